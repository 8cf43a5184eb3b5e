//! The numbers of a page: one array of single precision, in base64.

use serde::Serialize;

/// All numbers of a page, one array after the other.
#[derive(Debug, Default)]
pub(super) struct Numbers(Vec<f32>);

/// Where an array stands among them.
#[derive(Clone, Copy, Debug, Serialize, PartialEq, Eq)]
pub(super) struct Slice {
    /// First number.
    offset: usize,
    /// Its length.
    length: usize,
}

impl Numbers {
    /// Appends an array.
    pub(super) fn push(&mut self, values: impl IntoIterator<Item = f64>) -> Slice {
        let offset = self.0.len();
        self.0.extend(values.into_iter().map(|x| x as f32));
        Slice { offset, length: self.0.len() - offset }
    }

    /// Little-endian bytes in base64 (RFC 4648, with padding).
    pub(super) fn to_base64(&self) -> String {
        let bytes: Vec<u8> = self.0.iter().flat_map(|x| x.to_le_bytes()).collect();
        base64(&bytes)
    }
}

const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

fn base64(bytes: &[u8]) -> String {
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |k: usize| u32::from(group.get(k).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for k in 0..4 {
            let letter = ALPHABET[(bits >> (18 - 6 * k) & 63) as usize];
            out.push(if k <= group.len() { char::from(letter) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_as_the_standard_has_it() {
        let pairs = [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("foobar", "Zm9vYmFy")];
        for (plain, coded) in pairs {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        assert_eq!(base64(&[0xfb, 0xff, 0xfe]), "+//+");
    }

    #[test]
    fn arrays_follow_each_other() {
        let mut numbers = Numbers::default();
        assert_eq!(numbers.push([1.0, 2.0]), Slice { offset: 0, length: 2 });
        assert_eq!(numbers.push([0.5]), Slice { offset: 2, length: 1 });
        assert_eq!(numbers.to_base64(), "AACAPwAAAEAAAAA/");
    }
}
