//! The state of a system of nodes and bodies.

/// Coordinates q (node positions \[m\], three each; then the joints' \[rad, m\], a unit quaternion w first for a ball), velocities v
/// (of nodes [m/s], then of joints [rad/s, m/s], three for a ball in its body's axes), and internal variables z (history
/// variables of joints, motors, rods and grippers; none in a scene without them). As one vector, x = (q, v, z).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Coordinates.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
    /// Internal variables.
    pub z: Vec<f64>,
}

impl State {
    /// Splits x = (q, v, z) after `nq` coordinates and `nv` velocities.
    pub fn from_flat(x: &[f64], nq: usize, nv: usize) -> Self {
        let (q, rest) = x.split_at(nq);
        let (v, z) = rest.split_at(nv);
        Self { q: q.to_vec(), v: v.to_vec(), z: z.to_vec() }
    }

    /// Joins x = (q, v, z).
    pub fn to_flat(&self) -> Vec<f64> {
        [self.q.as_slice(), self.v.as_slice(), self.z.as_slice()].concat()
    }
}
