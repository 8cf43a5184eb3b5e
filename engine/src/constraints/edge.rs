//! An edge or a triangle that may touch fixed shapes, and its contact at one point linearized.
//!
//! With p = Σ β_i x_i the point that touches, n the normal there and w the cone variable, the impulse P = w₀ n + μ w̄ acts on node i with
//! β_i P, and slides with u_t = (I − n nᵀ) Σ β_i v_i. Both n and β follow the nodes:
//! ```text
//! ∂(β_i P)/∂x_j = β_i w₀ ∂n/∂x_j + P ⊗ ∂β_i/∂x_j            (at fixed w; symmetric in the normal part: w₀ times the gap's Hessian)
//! ∂u_t/∂x_j = (I − n nᵀ) Σ v_i ⊗ ∂β_i/∂x_j − (n·u) ∂n/∂x_j − n (uᵀ ∂n/∂x_j),    ∂gap/∂x_j = β_j n
//! ```

use super::collider::{Friction, SplitLaw};
use super::impulse;
use crate::geometry::collider::{Feature, PlacedCollider};
use crate::geometry::element::{Nearest, nearest};
use nalgebra::{Matrix3, Matrix3x4, Matrix4, Matrix4x3, RowVector3, SMatrix, Vector4};
use num_dual::DualSVec64;
use pliant_math::Vec3;
use pliant_smoothing::{Linearization, SplitPoint};
use std::ops::Range;

/// An edge of a rope or a sheet, or a triangle of a sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactElement {
    /// Its nodes; of an edge the first two.
    pub nodes: [usize; 3],
    /// Two or three.
    pub count: usize,
    /// Index in θ of the radius \[m\].
    pub radius: usize,
    /// Third nodes of the triangles at an edge of a sheet.
    pub thirds: [Option<usize>; 2],
    /// Weight of its lightest node \[N\], as the scene begins: κ = rest gap × weight. It does not follow θ.
    pub weight: f64,
}

/// Facets of one rope or sheet, and a fixed shape that they may touch.
#[derive(Clone, Debug, PartialEq)]
pub struct ElementGroup {
    /// Indices of the contact elements.
    pub elements: Range<usize>,
    /// Index of the shape among the colliders.
    pub collider: usize,
    /// Coefficient of friction.
    pub friction: Friction,
}

/// The nearest point of a contact element, and how normal and weights change with each node.
pub(crate) struct ElementChanges {
    pub nearest: Nearest<f64>,
    /// ∂n/∂x_j [1/m].
    pub normal: [Matrix3<f64>; 3],
    /// ∂β_i/∂x_j [1/m], `weights[i][j]`.
    pub weights: [[RowVector3<f64>; 3]; 3],
}

/// [`ElementChanges`] of a contact element with `count` nodes, by dual numbers; the distance where there is no normal.
pub(crate) fn element_changes(
    x: &[Vec3<f64>; 3],
    count: usize,
    radius: f64,
    feature: Feature,
    shape: &PlacedCollider<f64>,
) -> Result<ElementChanges, f64> {
    if count == 2 { changes::<6>(x, radius, feature, shape) } else { changes::<9>(x, radius, feature, shape) }
}

/// With N numbers for N/3 nodes.
fn changes<const N: usize>(
    x: &[Vec3<f64>; 3],
    radius: f64,
    feature: Feature,
    shape: &PlacedCollider<f64>,
) -> Result<ElementChanges, f64> {
    let count = N / 3;
    let seeded = |i: usize| {
        Vec3::from_fn(|a, _| {
            let constant = DualSVec64::<N>::from_re(x[i][a]);
            if i < count { constant.derivative(3 * i + a) } else { constant }
        })
    };
    let nodes = [seeded(0), seeded(1), seeded(2)];
    let lifted = PlacedCollider {
        form: shape.form.clone(),
        rotation: shape.rotation.map(DualSVec64::from_re),
        position: shape.position.map(DualSVec64::from_re),
        sizes: shape.sizes.map(DualSVec64::from_re),
    };
    let found = nearest(&nodes[..count], DualSVec64::from_re(radius), feature, &lifted)?;
    let slope = |x: &DualSVec64<N>, j: usize| match x.eps.0 {
        Some(eps) if j < count => RowVector3::new(eps[3 * j], eps[3 * j + 1], eps[3 * j + 2]),
        _ => RowVector3::zeros(),
    };
    Ok(ElementChanges {
        nearest: Nearest {
            gap: found.gap.re,
            normal: found.normal.map(|x| x.re),
            weights: found.weights.map(|x| x.re),
            region: found.region,
        },
        normal: std::array::from_fn(|j| Matrix3::from_rows(&[0, 1, 2].map(|a| slope(&found.normal[a], j)))),
        weights: std::array::from_fn(|i| std::array::from_fn(|j| slope(&found.weights[i], j))),
    })
}

/// The law's numbers at the contact of an edge or triangle, of step ρ.
pub(crate) fn element_law(
    law: pliant_scene::Law,
    (group, element): (&ElementGroup, &ContactElement),
    rho: f64,
    theta: &[f64],
    [rest_gap, sharpness]: [f64; 2],
    regularization: f64,
) -> SplitLaw {
    let (mu, kappa) = (group.friction.value(theta), rest_gap * element.weight);
    SplitLaw::new(
        law,
        mu,
        sharpness,
        SplitPoint { slip: 0.0, kappa, rho_n: rho, rho_t: rho, compliance_per_h2: 0.0, regularization },
    )
}

/// Σ β_i x_i.
pub(crate) fn weighted(weights: &[f64; 3], x: &[Vec3<f64>; 3]) -> Vec3<f64> {
    x[0] * weights[0] + x[1] * weights[1] + x[2] * weights[2]
}

/// The part of `u` across the unit vector `n`.
pub(crate) fn tangential(n: &Vec3<f64>, u: &Vec3<f64>) -> Vec3<f64> {
    u - n * n.dot(u)
}

/// A contact of a contact element linearized at an iterate, its cone variable eliminated.
#[derive(Clone, Debug)]
pub(crate) struct ElementLinear {
    pub weights: [f64; 3],
    /// ∂P/∂w, and ∂P/∂w F_w⁻¹.
    pub by_w: Matrix3x4<f64>,
    pub gain: Matrix3x4<f64>,
    /// ∂F/∂x_j at fixed velocities, and ∂F/∂v_j.
    pub f_x: [Matrix4x3<f64>; 3],
    pub f_v: [Matrix4x3<f64>; 3],
    /// ∂(β_i P)/∂x_j at fixed w [N·s/m].
    pub fixed: [[Matrix3<f64>; 3]; 3],
}

impl ElementLinear {
    /// For the law linearized there, friction `mu`, nodes' velocities `v`, stage length `h` and cone variable `w`.
    pub fn new(law: &Linearization, changes: &ElementChanges, mu: f64, v: &[Vec3<f64>; 3], h: f64, w: &Vector4<f64>) -> Self {
        let Nearest { normal: n, weights, .. } = changes.nearest;
        let u = weighted(&weights, v);
        let impulse = impulse(n, mu, w);
        let projector = Matrix3::identity() - n * n.transpose();
        let mut by_w = Matrix3x4::zeros();
        by_w.set_column(0, &n);
        by_w.fixed_view_mut::<3, 3>(0, 1).fill_diagonal(mu);
        let f_x = std::array::from_fn(|j| {
            let dn = &changes.normal[j];
            let carried: Matrix3<f64> = (0..3).map(|i| v[i] * changes.weights[i][j]).sum();
            let du_t = projector * carried - dn * n.dot(&u) - n * (u.transpose() * dn);
            law.df_dvn * (n.transpose() * (weights[j] / h)) + law.df_dvt * du_t
        });
        let fixed = std::array::from_fn(|i| {
            std::array::from_fn(|j| changes.normal[j] * (weights[i] * w[0]) + impulse * changes.weights[i][j])
        });
        Self {
            weights,
            by_w,
            gain: by_w * law.df_dw_inverse,
            f_x,
            f_v: weights.map(|weight| law.df_dvt * projector * weight),
            fixed,
        }
    }

    /// ∂F/∂v_j, with positions moving along by `way`.
    pub fn slope(&self, j: usize, way: f64) -> Matrix4x3<f64> {
        self.f_x[j] * way + self.f_v[j]
    }

    /// ∂(β_i P)/∂x_j and ∂(β_i P)/∂v_j with w following.
    pub fn condensed(&self, i: usize, j: usize) -> [Matrix3<f64>; 2] {
        let gain = self.gain * self.weights[i];
        [self.fixed[i][j] - gain * self.f_x[j], -(gain * self.f_v[j])]
    }
}

/// A split law linearized at an iterate.
#[derive(Clone, Debug)]
pub(crate) struct ConeLinear {
    /// F_w and its inverse.
    pub f_w: Matrix4<f64>,
    pub inverse: Matrix4<f64>,
    /// ∂F/∂(v_n, μ, v_t).
    pub f_vn: Vector4<f64>,
    pub f_mu: Vector4<f64>,
    pub f_vt: SMatrix<f64, 4, 3>,
}

impl ConeLinear {
    pub fn new(lin: &Linearization, slip_by_mu: f64) -> Self {
        let (f_w, inverse) = (lin.df_dw, lin.df_dw_inverse);
        Self { f_w, inverse, f_vn: lin.df_dvn, f_mu: lin.df_dslip * slip_by_mu, f_vt: lin.df_dvt }
    }

    pub fn zero() -> Self {
        let (f, m) = (Vector4::zeros(), Matrix4::zeros());
        Self { f_w: m, inverse: m, f_vn: f, f_mu: f, f_vt: SMatrix::zeros() }
    }
}

/// Three numbers each of the nodes of an edge or triangle.
pub(crate) fn of_nodes(element: &ContactElement, x: &[f64]) -> [Vec3<f64>; 3] {
    element.nodes.map(|node| Vec3::new(x[3 * node], x[3 * node + 1], x[3 * node + 2]))
}

impl ContactElement {
    /// Its nodes.
    pub(crate) fn corners(&self) -> &[usize] {
        &self.nodes[..self.count]
    }

    /// Adds the impulse at the nearest point as forces on the nodes.
    pub(crate) fn push(&self, found: &Nearest<f64>, impulse: Vec3<f64>, h: f64, f: &mut [f64]) {
        for (&node, weight) in self.corners().iter().zip(found.weights) {
            (0..3).for_each(|a| f[3 * node + a] += weight * impulse[a] / h);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::collider::ColliderShape;
    use nalgebra::SVector;
    use pliant_math::rotation::about;
    use pliant_smoothing::{split_linearize, split_residual};

    type Dual = DualSVec64<9>;

    const H: f64 = 0.01;
    const MU: f64 = 0.7;
    const LAW: SplitPoint =
        SplitPoint { slip: 0.6, kappa: 1e-5, rho_n: 0.02, rho_t: 0.02, compliance_per_h2: 0.0, regularization: 0.0 };

    /// Impulses on the nodes and F for nodes and velocities of any scalar.
    fn generic(
        x: &[Vec3<Dual>],
        v: &[Vec3<Dual>; 3],
        w: &Vector4<f64>,
        feature: Feature,
        shape: &PlacedCollider<f64>,
    ) -> ([Vec3<Dual>; 3], [Dual; 4]) {
        let lifted = PlacedCollider {
            form: shape.form.clone(),
            rotation: shape.rotation.map(Dual::from_re),
            position: shape.position.map(Dual::from_re),
            sizes: shape.sizes.map(Dual::from_re),
        };
        let found = nearest(x, Dual::from_re(0.01), feature, &lifted).unwrap();
        let n = found.normal;
        let u = v[0] * found.weights[0] + v[1] * found.weights[1] + v[2] * found.weights[2];
        let u_t = u - n * n.dot(&u);
        let w = w.map(Dual::from_re);
        let impulse = n * w[0] + Vec3::new(w[1], w[2], w[3]) * Dual::from_re(MU);
        let [slip, kappa, compliance_per_h2] = [LAW.slip, LAW.kappa, LAW.compliance_per_h2].map(Dual::from_re);
        let f = split_residual(slip, kappa, LAW.rho_n, LAW.rho_t, compliance_per_h2, found.gap / H, u_t.into(), w.into());
        (found.weights.map(|weight| impulse * weight), f)
    }

    #[test]
    fn the_condensed_contact_is_that_of_dual_numbers() {
        let rotation = about(&Vec3::new(0.6, 0.0, 0.8), 0.4);
        let shape = |form, sizes| PlacedCollider { form, rotation, position: Vec3::new(0.01, 0.02, -0.1), sizes };
        let cases = [
            (2, Feature::Whole, shape(ColliderShape::Ball, [0.09, 0.0, 0.0])),
            (3, Feature::Whole, shape(ColliderShape::Ball, [0.09, 0.0, 0.0])),
            (2, Feature::Whole, shape(ColliderShape::Capsule, [0.08, 0.2, 0.0])),
            (2, Feature::Whole, shape(ColliderShape::Capsule, [0.08, 0.01, 0.0])),
            (3, Feature::End(1), shape(ColliderShape::Capsule, [0.08, 0.02, 0.0])),
            (2, Feature::edge(1, [1, 1]), shape(ColliderShape::Block, [0.06, 0.2, 0.07])),
            (2, Feature::corner([1, 1, 1]), shape(ColliderShape::Block, [0.06, 0.05, 0.07])),
            (3, Feature::corner([1, 1, 1]), shape(ColliderShape::Block, [0.06, 0.05, 0.07])),
        ];
        let nodes = [Vec3::new(-0.1, -0.12, 0.01), Vec3::new(0.12, 0.1, 0.0), Vec3::new(-0.09, 0.16, -0.01)];
        // inside, and beyond an end
        for shift in [Vec3::zeros(), Vec3::new(0.25, 0.2, 0.02)] {
            for (count, feature, shape) in &cases {
                let x = nodes.map(|x| x + shift);
                let v = [Vec3::new(0.3, -0.2, -0.1), Vec3::new(0.1, 0.4, 0.2), Vec3::new(-0.2, 0.1, -0.3)];
                let w = Vector4::new(0.02, 0.004, -0.006, 0.003);
                let changes = element_changes(&x, *count, 0.01, *feature, shape).unwrap();
                let found = changes.nearest;
                let u_t = tangential(&found.normal, &weighted(&found.weights, &v));
                let lin = split_linearize(&LAW, found.gap / H, u_t.into(), w.into());
                let by_hand = ElementLinear::new(&lin, &changes, MU, &v, H, &w);
                let seeded = |i: usize, x: &Vec3<f64>, on: bool| {
                    Vec3::from_fn(|a, _| if on { Dual::from_re(x[a]).derivative(3 * i + a) } else { Dual::from_re(x[a]) })
                };
                for moving in [false, true] {
                    let at = [0, 1, 2].map(|i| seeded(i, &x[i], !moving));
                    let speeds = [0, 1, 2].map(|i| seeded(i, &v[i], moving));
                    let (impulses, f) = generic(&at[..*count], &speeds, &w, *feature, shape);
                    let slope = |x: &Dual| x.eps.0.unwrap_or_else(SVector::zeros);
                    for j in 0..*count {
                        for a in 0..3 {
                            let column = if moving { by_hand.f_v[j].column(a) } else { by_hand.f_x[j].column(a) };
                            for r in 0..4 {
                                let (hand, dual) = (column[r], slope(&f[r])[3 * j + a]);
                                assert!(
                                    (hand - dual).abs() < 1e-12 * (1.0 + column.norm()),
                                    "{feature:?} {count}: {hand} {dual}"
                                );
                            }
                            for (i, impulse) in impulses.iter().enumerate().take(*count) {
                                for (b, impulse) in impulse.iter().enumerate() {
                                    let hand = if moving { 0.0 } else { by_hand.fixed[i][j][(b, a)] };
                                    let dual = slope(impulse)[3 * j + a];
                                    assert!(
                                        (hand - dual).abs() < 1e-12 * (1.0 + by_hand.fixed[i][j].norm()),
                                        "{feature:?} {count}"
                                    );
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}
