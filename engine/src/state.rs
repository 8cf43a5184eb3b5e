//! The state of a system of nodes and bodies.

/// Coordinates q (node positions \[m\], three each; then the joints' \[rad, m\], a unit quaternion w first for a ball) and velocities v
/// (of nodes [m/s], then of joints [rad/s, m/s], three for a ball in its body's axes). As one vector, x = (q, v).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Coordinates.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
}

impl State {
    /// Splits x = (q, v) after `nq` coordinates.
    pub fn from_flat(x: &[f64], nq: usize) -> Self {
        let (q, v) = x.split_at(nq);
        Self { q: q.to_vec(), v: v.to_vec() }
    }

    /// Joins x = (q, v).
    pub fn to_flat(&self) -> Vec<f64> {
        [self.q.as_slice(), self.v.as_slice()].concat()
    }
}
