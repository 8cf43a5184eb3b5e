//! Weight of a node.

use super::stencil::add_node;
use super::{Automatic, Element, Law, Point, Term};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

const MAGNITUDE: usize = 0;
const LENGTH: usize = 3;
const DENSITY: usize = 4;
const EXTRAS: usize = 5;

/// g = magnitude · R_y(tilt₁) R_x(tilt₀) (0, 0, −1)  [m/s²], tilts \[rad\], right-handed rotations about x and y.
#[inline]
pub fn gravity_vector<S: Real>(magnitude: S, tilt: [S; 2]) -> Vec3<S> {
    let ((sx, cx), (sy, cy)) = (tilt[0].sin_cos(), tilt[1].sin_cos());
    Vec3::new(-cx * sy, sx, -cx * cy) * magnitude
}

/// f = m g, E = −m g·q, m = fraction · length · linear_density + Σ extra masses.
///
/// Nodes: one. Parameters: gravity magnitude [m/s²], tilt₀, tilt₁ \[rad\], rope length \[m\], linear density [kg/m], then any
/// number (up to the limit of [`Automatic`]) of extra masses \[kg\]. Constant: the node's Voronoi fraction of the length [-].
#[derive(Clone, Copy, Debug, Default)]
pub struct GravityLaw;

fn mass<S: Real>(p: &[S], fraction: f64) -> S {
    p[EXTRAS..].iter().fold(p[LENGTH] * p[DENSITY] * fraction, |sum, &extra| sum + extra)
}

impl Law for GravityLaw {
    fn name(&self) -> &str {
        "gravity"
    }

    fn force<S: Real>(&self, _q: &[Vec3<S>], _v: &[Vec3<S>], p: &[S], constants: &[f64], f: &mut [Vec3<S>]) {
        f[0] += gravity_vector(p[MAGNITUDE], [p[1], p[2]]) * mass(p, constants[0]);
    }

    fn energy<S: Real>(&self, q: &[Vec3<S>], p: &[S], constants: &[f64]) -> S {
        -gravity_vector(p[MAGNITUDE], [p[1], p[2]]).dot(&q[0]) * mass(p, constants[0])
    }

    fn symmetric(&self, _p: &[f64]) -> bool {
        true
    }
}

/// [`GravityLaw`] on many nodes.
#[derive(Clone, Debug)]
pub struct Gravity {
    automatic: Automatic<GravityLaw>,
    weights: Vec<Weight>,
}

/// An [`Element`] without indirection, but for extra masses.
#[derive(Clone, Copy, Debug)]
struct Weight {
    node: usize,
    /// Magnitude and tilts.
    field: [usize; 3],
    length: usize,
    density: usize,
    fraction: f64,
    has_extras: bool,
}

/// g and ∂g/∂(magnitude, tilt₀, tilt₁).
#[derive(Clone, Copy)]
struct Field {
    g: Vec3<f64>,
    slopes: [Vec3<f64>; 3],
}

impl Field {
    fn new([magnitude, tilt0, tilt1]: [f64; 3]) -> Self {
        let ((sx, cx), (sy, cy)) = (tilt0.sin_cos(), tilt1.sin_cos());
        let down = Vec3::new(-cx * sy, sx, -cx * cy);
        let about = [Vec3::new(sx * sy, cx, sx * cy), Vec3::new(-cx * cy, 0.0, cx * sy)];
        Self { g: down * magnitude, slopes: [down, about[0] * magnitude, about[1] * magnitude] }
    }
}

impl Gravity {
    /// Weight of the elements' nodes; see [`GravityLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let fits = |e: &Element| e.nodes.len() == 1 && e.params.len() >= EXTRAS && e.constants.len() == 1;
        assert!(elements.iter().all(fits), "gravity: an element has the wrong number of nodes, parameters or constants");
        let weight = |e: &Element| Weight {
            node: e.nodes[0],
            field: [e.params[MAGNITUDE], e.params[1], e.params[2]],
            length: e.params[LENGTH],
            density: e.params[DENSITY],
            fraction: e.constants[0],
            has_extras: e.params.len() > EXTRAS,
        };
        let weights = elements.iter().map(weight).collect();
        Self { automatic: Automatic::new(GravityLaw, elements), weights }
    }

    /// Calls `each(number of the element, field)`, with the trigonometry done once for all elements that read the same gravity.
    fn for_each(&self, theta: &[f64], mut each: impl FnMut(usize, &Field)) {
        let mut known: Option<([usize; 3], Field)> = None;
        for (k, weight) in self.weights.iter().enumerate() {
            let indices = weight.field;
            if known.as_ref().is_none_or(|(same, _)| *same != indices) {
                known = Some((indices, Field::new(indices.map(|k| theta[k]))));
            }
            if let Some((_, field)) = &known {
                each(k, field);
            }
        }
    }

    /// Mass of element `k`.
    #[inline]
    fn mass(&self, k: usize, theta: &[f64]) -> f64 {
        let weight = &self.weights[k];
        let continuous = theta[weight.length] * theta[weight.density] * weight.fraction;
        if !weight.has_extras {
            return continuous;
        }
        self.automatic.elements()[k].params[EXTRAS..].iter().fold(continuous, |sum, &k| sum + theta[k])
    }
}

impl Term for Gravity {
    fn name(&self) -> &str {
        self.automatic.law().name()
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at.theta, |k, field| add_node(f, self.weights[k].node, &(field.g * self.mass(k, at.theta))));
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], _dq: &mut NodeMatrix, _dv: &mut NodeMatrix) {
        self.add_force(at, f);
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        self.for_each(at.theta, |k, field| {
            let e = &self.automatic.elements()[k];
            let (length, density, fraction) = (at.theta[e.params[LENGTH]], at.theta[e.params[DENSITY]], e.constants[0]);
            let m = self.mass(k, at.theta);
            for a in 0..3 {
                let row = 3 * e.nodes[0] + a;
                for (&param, slope) in e.params.iter().zip(&field.slopes) {
                    visit(row, param, slope[a] * m);
                }
                visit(row, e.params[LENGTH], field.g[a] * density * fraction);
                visit(row, e.params[DENSITY], field.g[a] * length * fraction);
                for &param in &e.params[EXTRAS..] {
                    visit(row, param, field.g[a]);
                }
            }
        });
    }

    fn energy(&self, at: &Point) -> f64 {
        let mut sum = 0.0;
        self.for_each(at.theta, |k, field| sum -= field.g.dot(&at.position(self.weights[k].node)) * self.mass(k, at.theta));
        sum
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

    fn pair(extras: usize) -> (Gravity, Automatic<GravityLaw>) {
        let elements = check::elements(1, EXTRAS + extras);
        (Gravity::new(elements.clone()), Automatic::new(GravityLaw, elements))
    }

    #[test]
    fn kernel_equals_law() {
        for extras in 0..3 {
            let (kernel, law) = pair(extras);
            check::same(&kernel, &law);
            check::force_is_energy_slope(&GravityLaw, &law);
        }
    }

    #[test]
    fn untilted_gravity_points_down_and_tilts_turn_right_handed() {
        let at_rest = gravity_vector(9.81, [0.0, 0.0]);
        assert!((at_rest - Vec3::new(0.0, 0.0, -9.81)).norm() < 1e-15);
        // R_x(π/2) turns −z into +y; R_y(π/2) turns −z into −x.
        let quarter = std::f64::consts::FRAC_PI_2;
        assert!((gravity_vector(1.0, [quarter, 0.0]) - Vec3::y()).norm() < 1e-15);
        assert!((gravity_vector(1.0, [0.0, quarter]) + Vec3::x()).norm() < 1e-15);
    }

    #[test]
    fn weight_is_mass_times_magnitude() {
        let elements = vec![Element { nodes: vec![0], params: vec![0, 1, 2, 3, 4, 5], constants: vec![0.25] }];
        let theta = [9.81, 0.0, 0.0, 2.0, 0.1, 0.3];
        let mut f = [0.0; 3];
        Gravity::new(elements).add_force(&Point { q: &[0.0; 3], v: &[0.0; 3], theta: &theta }, &mut f);
        assert!((f[2] + 9.81 * 0.35).abs() < 1e-14 && f[0] == 0.0 && f[1] == 0.0);
    }
}
