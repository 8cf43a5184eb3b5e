//! Moments in the bending of a rope that no law describes.
//!
//! With κ [-] and the rate D = P_T κ̇ [1/s] of [`BendLaw`] and [`BendDampingLaw`], whose forces at EI = 1 and c_b = 1 are
//! −(∂κ/∂q)ᵀ κ/l_v and −(∂κ/∂q)ᵀ D/l_v, a moment of the size m at every node has the forces
//! ```text
//! f = (∂κ/∂q)ᵀ m n/l_v,    n = κ/|κ|, or D/|D| where it turns over with the rate
//! ```
//! with m = x(|κ|), x(|D|) or x(t) in N·m²: −1 · n/l_v of the rate is dry friction in bending, −|κ|³ a rope that stiffens as it bends.

use super::Form;
use pliant_engine::model::RopeSpan;
use pliant_engine::terms::{BendDampingLaw, BendLaw, Law};
use pliant_math::Vec3;

/// Inner nodes of a rope, where it bends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bends {
    /// Number of the rope in the model.
    pub rope: usize,
    /// The first node, counted in the rope.
    pub first: usize,
    /// How many there are from there on.
    pub number: usize,
}

impl Bends {
    /// All of a rope.
    pub fn of(number: usize, rope: &RopeSpan) -> Self {
        let (first, ends) = if rope.is_closed() { (0, 0) } else { (1, 2) };
        Self { rope: number, first, number: rope.nodes.len().saturating_sub(ends) }
    }

    /// Each of its nodes alone.
    pub fn each(self) -> impl Iterator<Item = Self> {
        (self.first..self.first + self.number).map(move |first| Self { first, number: 1, ..self })
    }

    /// Calls `add(node, force)` for the forces of a form of size one. `length`: the rope's \[m\]; `at`: place and velocity of a node.
    pub fn forces(
        self,
        form: &Form,
        (rope, length): (&RopeSpan, f64),
        time: f64,
        at: impl Fn(usize) -> [Vec3<f64>; 2],
        mut add: impl FnMut(usize, Vec3<f64>),
    ) {
        let n = rope.nodes.len();
        for k in self.first..self.first + self.number {
            let nodes = [k + n - 1, k, k + 1].map(|i| rope.nodes.start + i % n);
            let (q, v) = (nodes.map(|node| at(node)[0]), nodes.map(|node| at(node)[1]));
            let fraction = 0.5 * (rope.fractions[(k + n - 1) % n] + rope.fractions[k]);
            let (p, constants, of_node) = ([length, 1.0], [fraction], length * fraction);
            let [mut bent, mut damped] = [[Vec3::<f64>::zeros(); 3]; 2];
            BendLaw.force(&q, &v, &p, &constants, &mut bent);
            BendDampingLaw.force(&q, &v, &p, &constants, &mut damped);
            let power: f64 = damped.iter().zip(&v).map(|(f, v)| f.dot(v)).sum();
            let curvature = (2.0 * of_node * BendLaw.energy(&q, &p, &constants)).sqrt();
            let rate = (-power * of_node).max(0.0).sqrt();
            let (unit, along) = if form.reversing { (damped, rate) } else { (bent, curvature) };
            if along > 0.0 {
                let size = -form.value(time, curvature, rate) / along;
                nodes.iter().zip(unit).for_each(|(node, f)| add(*node, f * size));
            }
        }
    }
}
