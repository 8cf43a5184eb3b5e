//! θ: every number a physical law uses, as one flat vector with named entries.
//!
//! Path grammar `object.quantity`, `object.quantity[k]` or `object.node[i].quantity`; SI units. The order is fixed when the
//! model is built.

use std::collections::HashMap;

/// Description of one entry of θ.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamInfo {
    /// Path, for example `cable.bend_stiffness`.
    pub path: String,
    /// SI unit, for example `N·m²`; `-` if dimensionless.
    pub unit: &'static str,
    /// Smallest physically admissible value.
    pub lower: f64,
    /// Largest physically admissible value.
    pub upper: f64,
}

/// Names, units and bounds of all entries of θ, and their values in the scene.
#[derive(Clone, Debug, Default)]
pub struct Params {
    infos: Vec<ParamInfo>,
    values: Vec<f64>,
    index: HashMap<String, usize>,
}

impl Params {
    /// Appends an entry and returns its index in θ. A path that exists already is kept and its index returned.
    pub fn push(&mut self, path: impl Into<String>, unit: &'static str, bounds: (f64, f64), value: f64) -> usize {
        let path = path.into();
        if let Some(&k) = self.index.get(&path) {
            return k;
        }
        let k = self.infos.len();
        self.index.insert(path.clone(), k);
        self.infos.push(ParamInfo { path, unit, lower: bounds.0, upper: bounds.1 });
        self.values.push(value);
        k
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.infos.len()
    }

    /// Whether there is no entry.
    pub fn is_empty(&self) -> bool {
        self.infos.is_empty()
    }

    /// Index of a path.
    pub fn find(&self, path: &str) -> Option<usize> {
        self.index.get(path).copied()
    }

    /// Description of entry `k`.
    pub fn info(&self, k: usize) -> &ParamInfo {
        &self.infos[k]
    }

    /// Descriptions in the order of θ.
    pub fn infos(&self) -> &[ParamInfo] {
        &self.infos
    }

    /// The values given by the scene.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The path closest to `wanted` by edit distance, for error messages.
    pub fn nearest(&self, wanted: &str) -> Option<&str> {
        self.infos.iter().map(|i| i.path.as_str()).min_by_key(|p| edit_distance(p, wanted))
    }
}

/// Fewest insertions, deletions and replacements of letters that turn `a` into `b` (Levenshtein 1966); capitals count as other letters.
pub fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

/// Bounds of a quantity that may be zero but not negative.
pub const NON_NEGATIVE: (f64, f64) = (0.0, f64::INFINITY);
/// Bounds of a quantity of either sign.
pub const ANY: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
/// Bounds of an edge's rest strain: twice as long as its share, or half.
pub const REST_STRAIN: (f64, f64) = (-0.5, 1.0);
/// Bounds of a quantity that must be positive.
pub const POSITIVE: (f64, f64) = (f64::MIN_POSITIVE, f64::INFINITY);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("N", "n"), 1);
    }
}
