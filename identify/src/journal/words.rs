//! Values as words of 64 bits, which give back every bit: JSON has no infinite numbers, and bounds are.

/// A value that can be written as words and read again.
pub trait Words: Sized {
    /// Writes it behind others.
    fn put(&self, out: &mut Vec<u64>);
    /// Reads it; none where the words are not those of one.
    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self>;
}

/// Implements [`Words`] for a struct by its fields, all of which have to be named.
macro_rules! words {
    ($name:ident { $($field:ident),+ $(,)? }) => {
        impl $crate::journal::Words for $name {
            fn put(&self, out: &mut Vec<u64>) {
                let Self { $($field),+ } = self;
                $($field.put(out);)+
            }

            fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
                $(let $field = $crate::journal::Words::take(from)?;)+
                Some(Self { $($field),+ })
            }
        }
    };
}
pub(crate) use words;

impl Words for u64 {
    fn put(&self, out: &mut Vec<u64>) {
        out.push(*self);
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        from.next()
    }
}

impl Words for usize {
    fn put(&self, out: &mut Vec<u64>) {
        out.push(*self as u64);
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        from.next().and_then(|word| word.try_into().ok())
    }
}

impl Words for f64 {
    fn put(&self, out: &mut Vec<u64>) {
        out.push(self.to_bits());
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        from.next().map(f64::from_bits)
    }
}

impl Words for bool {
    fn put(&self, out: &mut Vec<u64>) {
        out.push(u64::from(*self));
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        match from.next()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl Words for String {
    fn put(&self, out: &mut Vec<u64>) {
        self.len().put(out);
        for bytes in self.as_bytes().chunks(8) {
            let mut word = [0; 8];
            word[..bytes.len()].copy_from_slice(bytes);
            out.push(u64::from_le_bytes(word));
        }
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        let length = usize::take(from)?;
        let mut bytes = Vec::new();
        for _ in 0..length.div_ceil(8) {
            bytes.extend(from.next()?.to_le_bytes());
        }
        bytes.truncate(length);
        Self::from_utf8(bytes).ok()
    }
}

impl<T: Words> Words for Vec<T> {
    fn put(&self, out: &mut Vec<u64>) {
        self.len().put(out);
        self.iter().for_each(|one| one.put(out));
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        (0..usize::take(from)?).map(|_| T::take(from)).collect()
    }
}

impl<T: Words, const N: usize> Words for [T; N] {
    fn put(&self, out: &mut Vec<u64>) {
        self.iter().for_each(|one| one.put(out));
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        let all: Option<Vec<T>> = (0..N).map(|_| T::take(from)).collect();
        all?.try_into().ok()
    }
}

impl<T: Words> Words for Option<T> {
    fn put(&self, out: &mut Vec<u64>) {
        self.is_some().put(out);
        self.iter().for_each(|one| one.put(out));
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        Some(if bool::take(from)? { Some(T::take(from)?) } else { None })
    }
}

impl<A: Words, B: Words> Words for (A, B) {
    fn put(&self, out: &mut Vec<u64>) {
        self.0.put(out);
        self.1.put(out);
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        Some((A::take(from)?, B::take(from)?))
    }
}

/// The words of a value.
pub fn written(value: &impl Words) -> Vec<u64> {
    let mut out = Vec::new();
    value.put(&mut out);
    out
}

/// The value of words; none where they are not those of one.
pub fn read<T: Words>(words: Vec<u64>) -> Option<T> {
    let mut from = words.into_iter();
    T::take(&mut from).filter(|_| from.next().is_none())
}

/// Sixteen hexadecimal digits for each word.
pub(super) fn text(words: &[u64]) -> String {
    use std::fmt::Write;
    let mut out = String::with_capacity(16 * words.len());
    for word in words {
        let _ = write!(out, "{word:016x}");
    }
    out
}

/// The words of such a text; none where it is no such text.
pub(super) fn of_text(text: &str) -> Option<Vec<u64>> {
    let digits = text.as_bytes().chunks(16).map(|digits| std::str::from_utf8(digits).ok().filter(|d| d.len() == 16));
    digits.map(|digits| u64::from_str_radix(digits?, 16).ok()).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn every_bit_comes_back() {
        type All = (Vec<f64>, ((String, Option<[f64; 2]>), (bool, Option<usize>)));
        let all: All = (
            vec![0.1, -0.0, f64::INFINITY, f64::NAN, f64::MIN_POSITIVE / 4.0, 1.0 / 3.0],
            (("κ̄ [1/m], nine".to_owned(), Some([f64::NEG_INFINITY, 1.0])), (true, None)),
        );
        let words = written(&all);
        let back: All = read(of_text(&text(&words)).unwrap()).unwrap();
        assert_eq!((written(&back), &back.1), (words.clone(), &all.1));
        // words that are too few or too many are not those of one
        assert!(read::<All>(words[..words.len() - 1].to_vec()).is_none());
        assert!(read::<All>([words, vec![0]].concat()).is_none());
        assert_eq!((of_text("3ff"), of_text("zff0000000000000"), of_text("")), (None, None, Some(Vec::new())));
        assert!(read::<Vec<f64>>(vec![u64::MAX]).is_none() && read::<bool>(vec![2]).is_none());
    }
}
