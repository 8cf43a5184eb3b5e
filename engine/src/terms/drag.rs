//! Air drag on a node.

use super::stencil::{Block, Compact, add_node, add_outer, diagonal};
use super::{Automatic, Element, Law, Point, Term};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

/// f = −L (linear + quadratic |u|) u, u = v − wind, L = fraction · length; isotropic.
///
/// Nodes: one. Parameters: rope length \[m\], linear [kg/(m·s)], quadratic [kg/m²], wind₀, wind₁, wind₂ [m/s]. Constant: the node's
/// Voronoi fraction of the length [-]. |u| is given the slope 0 at u = 0, where the force is C¹.
#[derive(Clone, Copy, Debug, Default)]
pub struct DragLaw;

impl Law for DragLaw {
    fn name(&self) -> &str {
        "drag"
    }

    fn force<S: Real>(&self, _q: &[Vec3<S>], v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        let u = v[0] - Vec3::new(p[3], p[4], p[5]);
        let square = u.dot(&u);
        let speed = if square.re() > 0.0 { square.sqrt() } else { S::zero() };
        f[0] -= u * ((p[1] + p[2] * speed) * p[0] * constants[0]);
    }

    fn symmetric(&self, _p: &[f64]) -> bool {
        true
    }
}

/// [`DragLaw`] on many nodes, with hand-derived Jacobians.
#[derive(Clone, Debug)]
pub struct Drag {
    automatic: Automatic<DragLaw>,
    compact: Vec<Compact<1, 6>>,
}

#[inline]
fn relative(e: &Compact<1, 6>, p: &[f64; 6], at: &Point) -> (Vec3<f64>, f64) {
    let u = at.velocity(e.nodes[0]) - Vec3::new(p[3], p[4], p[5]);
    (u, u.norm())
}

/// ∂f/∂u = −L ((linear + quadratic |u|) I + quadratic u uᵀ/|u|).
#[inline]
fn slope(extent: f64, p: &[f64; 6], u: &Vec3<f64>, speed: f64) -> Block {
    let mut block = diagonal(-extent * (p[1] + p[2] * speed));
    if speed > 0.0 {
        add_outer(&mut block, &(u * (-extent * p[2] / speed)), u);
    }
    block
}

impl Drag {
    /// Drag on the elements' nodes; see [`DragLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let compact = Compact::all(DragLaw.name(), &elements);
        Self { automatic: Automatic::new(DragLaw, elements), compact }
    }

    /// Calls `each(element, parameters, u, |u|)` for every node with a coefficient.
    #[inline]
    fn for_each(&self, at: &Point, mut each: impl FnMut(&Compact<1, 6>, &[f64; 6], &Vec3<f64>, f64)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            if p[1] != 0.0 || p[2] != 0.0 {
                let (u, speed) = relative(e, &p, at);
                each(e, &p, &u, speed);
            }
        }
    }
}

impl Term for Drag {
    fn name(&self) -> &str {
        DragLaw.name()
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at, |e, p, u, speed| {
            add_node(f, e.nodes[0], &(u * (-(p[1] + p[2] * speed) * p[0] * e.constant)));
        });
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], _dq: &mut NodeMatrix, dv: &mut NodeMatrix) {
        self.for_each(at, |e, p, u, speed| {
            let extent = p[0] * e.constant;
            add_node(f, e.nodes[0], &(u * (-(p[1] + p[2] * speed) * extent)));
            dv.add_block(e.nodes[0], e.nodes[0], 1.0, &slope(extent, p, u, speed));
        });
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        for e in &self.compact {
            let p = e.values(at.theta);
            let (u, speed) = relative(e, &p, at);
            let extent = p[0] * e.constant;
            let block = slope(extent, &p, &u, speed);
            for (a, to_u) in block.iter().enumerate() {
                let row = 3 * e.nodes[0] + a;
                visit(row, e.params[0], -e.constant * (p[1] + p[2] * speed) * u[a]);
                visit(row, e.params[1], -extent * u[a]);
                visit(row, e.params[2], -extent * speed * u[a]);
                for (&wind, slope) in e.params[3..].iter().zip(to_u) {
                    visit(row, wind, -slope);
                }
            }
        }
    }

    fn symmetric(&self, _theta: &[f64]) -> bool {
        true
    }

    fn visit_stencils(&self, visit: &mut dyn FnMut(&[usize])) {
        self.automatic.visit_stencils(visit);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::terms::check;

    #[test]
    fn kernel_equals_law() {
        let elements = check::elements(1, 6);
        let (kernel, law) = (Drag::new(elements.clone()), Automatic::new(DragLaw, elements));
        check::same(&kernel, &law);
        check::jacobians_symmetric(&kernel);
    }

    #[test]
    fn calm_air_takes_power_and_a_node_at_wind_speed_feels_nothing() {
        let kernel = Drag::new(vec![Element { nodes: vec![0], params: (0..6).collect(), constants: vec![0.5] }]);
        let theta = [2.0, 0.1, 0.4, 0.0, 0.0, 0.0];
        let mut f = [0.0; 3];
        kernel.add_force(&Point { q: &[0.0; 3], v: &[3.0, 0.0, 4.0], theta: &theta }, &mut f);
        // −(0.1 + 0.4·5)·(3, 0, 4)
        assert!((f[0] + 6.3).abs() < 1e-14 && (f[2] + 8.4).abs() < 1e-14);

        let theta = [2.0, 0.1, 0.4, 3.0, 0.0, 4.0];
        let at = Point { q: &[0.0; 3], v: &[3.0, 0.0, 4.0], theta: &theta };
        for term in [&kernel as &dyn Term, &kernel.automatic] {
            let (mut f, mut dq, mut dv) = ([0.0; 3], NodeMatrix::band(1, 2), NodeMatrix::band(1, 2));
            term.add_jacobian(&at, &mut f, &mut dq, &mut dv);
            assert_eq!(f, [0.0; 3]);
            for a in 0..3 {
                for b in 0..3 {
                    assert_eq!(dv.get(a, b), if a == b { -0.1 } else { 0.0 });
                }
            }
        }
    }

    #[test]
    fn no_coefficient_no_force_but_a_slope() {
        check::zero_coefficients(&Drag::new(check::elements(1, 6)), &[1, 2]);
    }
}
