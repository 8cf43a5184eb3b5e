//! The state of a nodal system.

/// Positions q \[m\] and velocities v [m/s] of all nodes, three numbers per node. As one vector, x = (q, v).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Positions \[m\].
    pub q: Vec<f64>,
    /// Velocities [m/s].
    pub v: Vec<f64>,
}

impl State {
    /// Splits x = (q, v).
    pub fn from_flat(x: &[f64]) -> Self {
        let (q, v) = x.split_at(x.len() / 2);
        Self { q: q.to_vec(), v: v.to_vec() }
    }

    /// Joins x = (q, v).
    pub fn to_flat(&self) -> Vec<f64> {
        [self.q.as_slice(), self.v.as_slice()].concat()
    }
}
