//! Numbers as people read them.

const SUPERSCRIPTS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];

/// Significant digits of most numbers.
const FEW: usize = 3;

/// Three significant digits: `0.0123`, `1.23×10⁻⁵`.
pub(crate) fn number(x: f64) -> String {
    number_with(x, FEW)
}

/// So many significant digits.
fn number_with(x: f64, significant: usize) -> String {
    let Some((mantissa, exponent)) = digits(x, significant) else { return special(x) };
    if (-3..5).contains(&exponent) {
        return plain(x, significant, exponent);
    }
    let sign = if exponent < 0 { "⁻" } else { "" };
    let exponent: String =
        exponent.unsigned_abs().to_string().chars().filter_map(|c| SUPERSCRIPTS.get(c.to_digit(10)? as usize)).collect();
    format!("{}×10{sign}{exponent}", mantissa.replace('-', "−"))
}

/// The same for terminals: `1.23e-5`.
pub(crate) fn number_plain(x: f64) -> String {
    number_plain_with(x, FEW)
}

fn number_plain_with(x: f64, significant: usize) -> String {
    match digits(x, significant) {
        Some((_, exponent)) if (-3..5).contains(&exponent) => plain(x, significant, exponent).replace('−', "-"),
        Some((mantissa, exponent)) => format!("{mantissa}e{exponent}"),
        None => special(x),
    }
}

/// Four significant digits, for terminals.
pub(crate) fn four_digits(x: f64) -> String {
    number_plain_with(x, 4)
}

/// An estimate and the ends of its interval, with as many digits as show two of its half width.
pub(crate) fn estimate_of(x: f64, interval: Option<[f64; 2]>) -> (String, Option<[String; 2]>) {
    let significant = resolving(x, interval);
    (number_with(x, significant), interval.map(|ends| ends.map(|x| number_with(x, significant))))
}

/// The same for terminals.
pub(crate) fn estimate_plain(x: f64, interval: Option<[f64; 2]>) -> (String, Option<[String; 2]>) {
    let significant = resolving(x, interval);
    (number_plain_with(x, significant), interval.map(|ends| ends.map(|x| number_plain_with(x, significant))))
}

fn resolving(x: f64, interval: Option<[f64; 2]>) -> usize {
    let Some([low, high]) = interval else { return FEW };
    let digits = x.abs().log10().floor() - (0.5 * (high - low)).log10().floor() + 2.0;
    // NaN and infinite where there is no interval, or no width
    if digits.is_finite() { digits.clamp(FEW as f64, 9.0) as usize } else { FEW }
}

/// So many decimals, unless the number is too large for them.
pub(crate) fn fixed(x: f64, decimals: usize) -> String {
    if x.abs() < 1e9 { format!("{x:.decimals$}") } else { format!("{x:.3e}") }
}

/// Unit in which errors are reported, a thousandth of theirs: mm, mrad, mN·m; of no unit at all that of lengths.
pub(crate) fn thousandths(unit: &str) -> String {
    match unit {
        "" => "mm".to_owned(),
        "-" => "10⁻³".to_owned(),
        _ => unit.strip_prefix('k').filter(|rest| rest.starts_with('g')).map_or_else(|| format!("m{unit}"), str::to_owned),
    }
}

/// A size [unit] in [`thousandths`].
pub(crate) fn quantity(x: f64, unit: &str) -> String {
    format!("{} {}", number(1e3 * x), thousandths(unit))
}

/// The same for terminals.
pub(crate) fn quantity_plain(x: f64, unit: &str) -> String {
    format!("{} {}", number_plain(1e3 * x), thousandths(unit))
}

/// A fraction of something that may have been taken, in words: `93 %`, or `nothing` where it has grown instead.
pub(crate) fn share(x: f64) -> String {
    if x >= 0.005 { format!("{:.0} %", 100.0 * x) } else { "nothing".to_owned() }
}

/// A fraction in per cent.
pub(crate) fn percent(x: f64) -> String {
    if x.is_finite() { format!("{:.0} %", 100.0 * x).replace('-', "−") } else { special(x) }
}

/// A unit, unless there is none.
pub(crate) fn unit(unit: &str) -> &str {
    if unit == "-" { "" } else { unit }
}

/// A p-value.
pub(crate) fn p_value(p: f64) -> String {
    if p < 1e-12 { "< 10⁻¹²".to_owned() } else { number(p) }
}

/// Mantissa with so many digits, and exponent; `None` if there are none.
fn digits(x: f64, significant: usize) -> Option<(String, i32)> {
    if x == 0.0 || !x.is_finite() {
        return None;
    }
    let text = format!("{x:.*e}", significant - 1);
    let (mantissa, exponent) = text.split_once('e')?;
    let mantissa = if mantissa.contains('.') { mantissa.trim_end_matches('0').trim_end_matches('.') } else { mantissa };
    Some((mantissa.to_owned(), exponent.parse().ok()?))
}

fn plain(x: f64, significant: usize, exponent: i32) -> String {
    let decimals = usize::try_from(significant as i32 - 1 - exponent).unwrap_or(0);
    let text = format!("{x:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.replace('-', "−")
}

fn special(x: f64) -> String {
    match x {
        0.0 => "0".to_owned(),
        _ if x.is_nan() => "–".to_owned(),
        _ if x > 0.0 => "∞".to_owned(),
        _ => "−∞".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits() {
        assert_eq!(number(0.012345), "0.0123");
        assert_eq!(number(-1.0), "−1");
        assert_eq!(number(1234.5), "1234");
        assert_eq!(number(1.2345e-5), "1.23×10⁻⁵");
        assert_eq!(number(-2.0e12), "−2×10¹²");
        assert_eq!((number(0.0), number(f64::NAN), number(f64::INFINITY)), ("0".into(), "–".into(), "∞".into()));
        assert_eq!(number_plain(-1.2345e-5), "-1.23e-5");
        assert_eq!((fixed(0.5, 4), fixed(1e300, 4)), ("0.5000".into(), "1.000e300".into()));
        assert_eq!((share(0.934), share(-0.15)), ("93 %".into(), "nothing".into()));
        assert_eq!((percent(0.934), quantity(0.00123, "m")), ("93 %".into(), "1.23 mm".into()));
        assert_eq!(quantity_plain(0.0123, "rad"), "12.3 mrad");
        assert_eq!([thousandths("kg·m²"), thousandths("m/s"), thousandths("-")], ["g·m²", "mm/s", "10⁻³"]);
        assert_eq!((p_value(1e-20), p_value(0.04)), ("< 10⁻¹²".into(), "0.04".into()));
    }

    #[test]
    fn intervals_show_their_width() {
        let plain = |x, interval| {
            let (value, ends) = estimate_plain(x, Some(interval));
            let [low, high] = ends.unwrap_or_default();
            [value, low, high]
        };
        assert_eq!(plain(0.80005, [0.79982, 0.80018]), ["0.80005", "0.79982", "0.80018"]);
        assert_eq!(plain(1.5e-4, [1.2e-4, 1.8e-4]), ["1.5e-4", "1.2e-4", "1.8e-4"]);
        assert_eq!(plain(0.3, [0.3, 0.3]), ["0.3", "0.3", "0.3"]);
        assert_eq!(plain(2.0, [f64::NEG_INFINITY, f64::INFINITY]), ["2", "−∞", "∞"]);
        let ends = Some(["−7.341×10⁵".to_owned(), "−7.323×10⁵".to_owned()]);
        assert_eq!(estimate_of(-7.33214e5, Some([-7.341e5, -7.323e5])), ("−7.3321×10⁵".to_owned(), ends));
        assert_eq!(estimate_of(0.3, None), ("0.3".to_owned(), None));
    }
}
