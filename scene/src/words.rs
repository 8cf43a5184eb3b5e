//! Guesses for messages: the nearest known word, the number in a text with a unit.

use pliant_math::params::edit_distance;

/// The known word nearest to `word`, if it is near enough to be a typing error; capitals do not count.
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let letters = word.chars().count();
    // a word with every letter replaced is another word
    let limit = ((letters / 3).max(1) + 1).min(letters.saturating_sub(1));
    let lower = word.to_lowercase();
    let near = known.into_iter().map(|candidate| (edit_distance(&lower, &candidate.to_lowercase()), candidate));
    let prefix = |candidate: &str| candidate.chars().zip(word.chars()).take_while(|(a, b)| a == b).count();
    // Among equally near words the one with the longer common beginning.
    let best = near.filter(|(d, _)| *d <= limit).min_by_key(|(d, candidate)| (*d, usize::MAX - prefix(candidate)));
    best.map(|(_, candidate)| candidate)
}

/// `` `a`, `b`, `c` ``
pub fn list<'a>(words: impl IntoIterator<Item = &'a str>) -> String {
    words.into_iter().map(|word| format!("`{word}`")).collect::<Vec<_>>().join(", ")
}

/// A number for messages: plain where it is short, `1e-300` instead of three hundred digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Num(pub f64);

impl std::fmt::Display for Num {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let size = self.0.abs();
        if size == 0.0 {
            write!(f, "0") // not −0
        } else if (1e-5..1e9).contains(&size) || !size.is_finite() {
            write!(f, "{}", self.0)
        } else {
            write!(f, "{:e}", self.0)
        }
    }
}

/// (unit of a key, suffix somebody wrote, factor)
const FACTORS: [(&str, &str, f64); 18] = [
    ("m", "mm", 1e-3),
    ("m", "cm", 1e-2),
    ("m", "km", 1e3),
    ("m", "um", 1e-6),
    ("m", "in", 0.0254),
    ("s", "ms", 1e-3),
    ("s", "us", 1e-6),
    ("s", "min", 60.0),
    ("kg", "g", 1e-3),
    ("kg", "mg", 1e-6),
    ("rad", "deg", std::f64::consts::PI / 180.0),
    ("rad", "°", std::f64::consts::PI / 180.0),
    ("N", "kN", 1e3),
    ("N", "mN", 1e-3),
    ("kg/m", "g/m", 1e-3),
    ("m/s", "mm/s", 1e-3),
    ("m/s", "km/h", 1.0 / 3.6),
    ("Hz", "kHz", 1e3),
];

/// The number in a text such as "5 mm", in the unit the key asks for.
pub(super) fn number_in(text: &str, unit: Option<&str>) -> Option<f64> {
    let text = text.trim();
    let end = text.find(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c))).unwrap_or(text.len());
    let (number, suffix) = text.split_at(end);
    let (number, suffix) = (number.parse::<f64>().ok()?, suffix.trim());
    if suffix.is_empty() || Some(suffix) == unit {
        return Some(number);
    }
    let factor = FACTORS.iter().find(|(u, s, _)| Some(*u) == unit && *s == suffix)?.2;
    // Rounded to the digits somebody would write.
    format!("{:.12e}", number * factor).parse().ok()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn finds_the_nearest_word() {
        assert_eq!(nearest("bend_stifness", ["stretch_stiffness", "bend_stiffness", "length"]), Some("bend_stiffness"));
        assert_eq!(nearest("Length", ["length", "radius"]), Some("length"));
        assert_eq!(nearest("m_y", ["a_y", "m_yy", "m_zz"]), Some("m_yy"));
        assert_eq!(nearest("color", ["length", "radius"]), None);
        assert_eq!((nearest("kg", ["m", "cm", "mm"]), nearest("MM", ["m", "cm", "mm"])), (None, Some("mm")));
    }

    #[test]
    fn numbers_stay_short() {
        let text = |x: f64| Num(x).to_string();
        assert_eq!((text(1e-300), text(-2.5e300), text(-0.0)), ("1e-300".into(), "-2.5e300".into(), "0".into()));
        assert_eq!((text(1500.0), text(0.003), text(f64::INFINITY)), ("1500".into(), "0.003".into(), "inf".into()));
    }

    #[test]
    fn reads_numbers_with_units() {
        assert_eq!(number_in("5 mm", Some("m")), Some(0.005));
        assert_eq!(number_in("5mm", Some("m")), Some(0.005));
        assert_eq!(number_in("0.5", Some("m")), Some(0.5));
        assert_eq!(number_in("50 g/m", Some("kg/m")), Some(0.05));
        assert_eq!(number_in("5 furlongs", Some("m")), None);
        assert_eq!(number_in("soft", None), None);
    }
}
