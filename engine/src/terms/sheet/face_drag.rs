//! Air drag on a triangle, along its normal.

use crate::terms::stencil::{Block, add_node, add_outer};
use crate::terms::{Automatic, Element, Law, Point, Term, contraction};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

/// f = −⅓ A (c + d |u_n|) u_n n on each node, u_n = n·(mean velocity − wind), A n the area vector of the triangle as it is now.
///
/// Nodes: three. Parameters: c [kg/(m²·s)], d [kg/m³], wind₀, wind₁, wind₂ [m/s]. No constants. Sliding through the air along the
/// sheet costs nothing. |u_n| is given the slope 0 at u_n = 0, where the force is C¹. Not finite where the triangle has no area.
#[derive(Clone, Copy, Debug, Default)]
pub struct FaceDragLaw;

impl Law for FaceDragLaw {
    fn name(&self) -> &str {
        "face_drag"
    }

    fn force<S: Real>(&self, q: &[Vec3<S>], v: &[Vec3<S>], p: &[S], _constants: &[f64], f: &mut [Vec3<S>]) {
        let area = (q[1] - q[0]).cross(&(q[2] - q[0])) * S::from(0.5);
        let u = (v[0] + v[1] + v[2]) * S::from(1.0 / 3.0) - Vec3::new(p[2], p[3], p[4]);
        let u_n = area.dot(&u) / area.dot(&area).sqrt();
        let speed = if u_n.re() < 0.0 { -u_n } else { u_n };
        let third = area * ((p[0] + p[1] * speed) * u_n * (-1.0 / 3.0));
        f.iter_mut().for_each(|f| *f += third);
    }

    fn symmetric(&self, p: &[f64]) -> bool {
        p[0] == 0.0 && p[1] == 0.0
    }
}

/// [`FaceDragLaw`] on many triangles, with hand-derived Jacobians.
#[derive(Clone, Debug)]
pub struct FaceDrag {
    automatic: Automatic<FaceDragLaw>,
    faces: Vec<([usize; 3], [usize; 5])>,
}

/// A triangle in the wind.
struct Wind {
    /// A n \[m²\].
    area: Vec3<f64>,
    size: f64,
    /// Velocity against the air [m/s], and its part along n.
    u: Vec3<f64>,
    u_n: f64,
    p: [f64; 5],
}

impl Wind {
    #[inline]
    fn new(nodes: &[usize; 3], params: &[usize; 5], at: &Point) -> Self {
        let ([x0, x1, x2], [v0, v1, v2]) = (nodes.map(|i| at.position(i)), nodes.map(|i| at.velocity(i)));
        let p = params.map(|k| at.theta[k]);
        let area = (x1 - x0).cross(&(x2 - x0)) * 0.5;
        let (size, u) = (area.norm(), (v0 + v1 + v2) / 3.0 - Vec3::new(p[2], p[3], p[4]));
        Self { area, size, u, u_n: area.dot(&u) / size, p }
    }

    /// Pressure (c + d |u_n|) u_n and its slope by u_n.
    #[inline]
    fn pressure(&self) -> (f64, f64) {
        let linear = self.p[0] + self.p[1] * self.u_n.abs();
        (linear * self.u_n, linear + self.p[1] * self.u_n.abs())
    }
}

impl FaceDrag {
    /// Drag on the elements' triangles; see [`FaceDragLaw`] for what an element holds.
    ///
    /// # Panics
    /// If an element is not of the law's shape: a mistake where elements are built.
    pub fn new(elements: Vec<Element>) -> Self {
        let copied = |e: &Element| {
            assert!(
                e.nodes.len() == 3 && e.params.len() == 5,
                "face_drag: an element has the wrong number of nodes or parameters"
            );
            (std::array::from_fn(|k| e.nodes[k]), std::array::from_fn(|k| e.params[k]))
        };
        Self { faces: elements.iter().map(copied).collect(), automatic: Automatic::new(FaceDragLaw, elements) }
    }

    /// Calls `each(nodes, wind)` for every triangle with a coefficient.
    #[inline]
    fn for_each(&self, at: &Point, mut each: impl FnMut(&[usize; 3], &Wind)) {
        for (nodes, params) in &self.faces {
            if at.theta[params[0]] != 0.0 || at.theta[params[1]] != 0.0 {
                each(nodes, &Wind::new(nodes, params, at));
            }
        }
    }
}

/// `[e]ₓ`, so that e × x = [e]ₓ x.
fn cross_matrix(e: &Vec3<f64>) -> Block {
    [[0.0, -e[2], e[1]], [e[2], 0.0, -e[0]], [-e[1], e[0], 0.0]]
}

/// ∂(force on a node)/∂(area vector): −⅓ (p I + p′ n (u − u_n n)ᵀ), p the pressure.
fn to_area(wind: &Wind) -> Block {
    let (pressure, slope) = wind.pressure();
    let n = wind.area / wind.size;
    let mut out = [[0.0; 3]; 3];
    add_outer(&mut out, &(n * (-slope / 3.0)), &(wind.u - n * wind.u_n));
    (0..3).for_each(|a| out[a][a] -= pressure / 3.0);
    out
}

impl FaceDrag {
    /// [`Term::visit_theta`] by a visitor whose type is known, which is inlined.
    fn each_slope(&self, at: &Point, visit: &mut (impl FnMut(usize, usize, f64) + ?Sized)) {
        for (nodes, params) in &self.faces {
            let wind = Wind::new(nodes, params, at);
            let slope = wind.pressure().1;
            for row in nodes.iter().flat_map(|&i| (0..3).map(move |a| 3 * i + a)) {
                let third = wind.area[row % 3] / -3.0;
                visit(row, params[0], third * wind.u_n);
                visit(row, params[1], third * wind.u_n * wind.u_n.abs());
                for (b, &param) in params[2..].iter().enumerate() {
                    visit(row, param, -third * slope * wind.area[b] / wind.size);
                }
            }
        }
    }
}

impl Term for FaceDrag {
    fn name(&self) -> &str {
        FaceDragLaw.name()
    }

    fn add_force(&self, at: &Point, f: &mut [f64]) {
        self.for_each(at, |nodes, wind| {
            let third = wind.area * (-wind.pressure().0 / 3.0);
            nodes.iter().for_each(|&i| add_node(f, i, &third));
        });
    }

    fn add_jacobian(&self, at: &Point, f: &mut [f64], dq: &mut NodeMatrix, dv: &mut NodeMatrix) {
        self.for_each(at, |nodes, wind| {
            let (pressure, slope) = wind.pressure();
            let third = wind.area * (-pressure / 3.0);
            let mut to_v = [[0.0; 3]; 3];
            add_outer(&mut to_v, &(wind.area * (-slope / 9.0)), &(wind.area / wind.size));
            let to_area = to_area(wind);
            let x = nodes.map(|i| at.position(i));
            // ∂(A n)/∂x_j = ½ [e]ₓ with e the opposite edge
            let to_q: [Block; 3] = std::array::from_fn(|j| {
                let turn = cross_matrix(&((x[(j + 2) % 3] - x[(j + 1) % 3]) * 0.5));
                std::array::from_fn(|a| std::array::from_fn(|b| (0..3).map(|c| to_area[a][c] * turn[c][b]).sum()))
            });
            for &i in nodes {
                add_node(f, i, &third);
                for (&j, to_q) in nodes.iter().zip(&to_q) {
                    dv.add_block(i, j, 1.0, &to_v);
                    dq.add_block(i, j, 1.0, to_q);
                }
            }
        });
    }

    fn visit_theta(&self, at: &Point, visit: &mut dyn FnMut(usize, usize, f64)) {
        self.each_slope(at, visit);
    }

    fn pull_theta(&self, at: &Point, weights: &[f64], sums: &mut [f64]) {
        self.each_slope(at, &mut contraction(weights, sums));
    }

    fn symmetric(&self, theta: &[f64]) -> bool {
        self.faces.iter().all(|(_, params)| theta[params[0]] == 0.0 && theta[params[1]] == 0.0)
    }

    fn visit_stencils(&self, visit: &mut dyn FnMut(&[usize])) {
        self.automatic.visit_stencils(visit);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::terms::check::{self, Sample};
    use crate::terms::sheet::element::tests::faces;

    fn elements() -> Vec<Element> {
        faces(5).into_iter().map(|e| Element { constants: Vec::new(), ..e }).collect()
    }

    #[test]
    fn kernel_equals_law() {
        let (kernel, law) = (FaceDrag::new(elements()), Automatic::new(FaceDragLaw, elements()));
        check::same_on(Sample::sheet, &kernel, &law);
        check::zero_coefficients_on(Sample::sheet, &kernel, &[0, 1]);
    }

    /// A square metre that falls flat at 2 m/s through air rising at 1 m/s; edgewise it feels nothing.
    #[test]
    fn drag_is_pressure_times_area_along_the_normal() {
        let kernel = FaceDrag::new(vec![Element { nodes: vec![0, 1, 2], params: (0..5).collect(), constants: vec![] }]);
        let q = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let force = |v: [f64; 3], theta: &[f64; 5]| {
            let v = [v, v, v].concat();
            let f = check::force(&kernel, &Point { q: &q, v: &v, theta });
            [0, 1, 2].map(|a| f[a] + f[3 + a] + f[6 + a])
        };
        let f = force([5.0, 0.0, -2.0], &[0.3, 0.2, 0.0, 0.0, 1.0]);
        assert!(f[0] == 0.0 && f[1] == 0.0 && (f[2] - (0.3 + 0.2 * 3.0) * 3.0).abs() < 1e-14, "{f:?}");
        assert_eq!(force([5.0, 1.0, 0.0], &[0.3, 0.2, 0.0, 0.0, 0.0]), [0.0; 3]);
    }
}
