//! Two bodies held together: a point of one at a point of the other, and for a weld their axes too. What closes a kinematic loop.
//!
//! ```text
//! x_A − x_B = −C f,      e(R_A, R_B) = −C_r t
//! ```
//! with the force f on the first body at their middle, and the moment t; e is half the vector of the skew part of R_A R_relᵀ R_Bᵀ,
//! the angle of a small turn. The compliance C is that of the scene or, without one, what gives way by the rest gap under the weight of
//! the lighter body: as hard as contact. Both hold at the end of a step, so they do not drift.

use super::LinkLinear;
use crate::geometry::collider::{Attachment, Pose, carried};
use nalgebra::{Matrix3, Matrix4, Matrix4x6, Matrix6, Matrix6x4, SMatrix, Vector4};
use pliant_math::Vec3;
use pliant_math::spatial::{Force, hat};

/// Two carriers that are held together.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopClosure {
    /// Name in the scene.
    pub name: String,
    /// The constrained directions.
    pub attachments: [Attachment; 2],
    /// First of three entries of θ each: the point in either carrier's frame \[m\].
    pub points: [usize; 2],
    /// R_relᵀ = R_Bᵀ R_A as the scene begins, if the axes are held too.
    pub relative: Option<Matrix3<f64>>,
    /// Index in θ of the compliance [m/N] and [rad/(N·m)], if it has one.
    pub compliance: Option<usize>,
    /// Weight of the lighter body [N], as the scene begins.
    pub weight: f64,
}

/// Numbers of a tie's rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ClosureLaw {
    /// Scale of the residual \[kg or kg·m²\].
    pub rho: f64,
    /// Compliance over h² [1/kg].
    pub compliance_per_h2: f64,
    /// As for contacts.
    pub regularization: f64,
}

/// The rows of one part of a tie at poses of both sides.
pub(crate) struct TieRows {
    /// Constraint error \[m or rad\].
    pub error: Vec3<f64>,
    /// Its change with displacements of both sides.
    pub by_displacement: [nalgebra::Matrix3x6<f64>; 2],
    /// Where the force acts \[m\]; of a moment none.
    pub point: Option<Vec3<f64>>,
    point_changes: [nalgebra::Matrix3x6<f64>; 2],
}

impl LoopClosure {
    /// The point of a side in the world, seen from the origin of the evaluation.
    pub(crate) fn point(&self, side: usize, pose: &Pose<f64>, theta: &[f64]) -> Vec3<f64> {
        let k = self.points[side];
        pose.position + pose.rotation * Vec3::new(theta[k], theta[k + 1], theta[k + 2])
    }

    /// Rows that hold the points (`turn` false) or the axes together.
    pub(crate) fn rows(&self, turn: bool, poses: [&Pose<f64>; 2], theta: &[f64]) -> TieRows {
        let zero = nalgebra::Matrix3x6::zeros();
        if !turn {
            let [a, b] = [0, 1].map(|side| self.point(side, poses[side], theta));
            let (by_a, by_b) = (carried(&a, true), carried(&b, true));
            let half = [by_a * 0.5, by_b * 0.5];
            return TieRows { error: a - b, by_displacement: [by_a, -by_b], point: Some((a + b) * 0.5), point_changes: half };
        }
        let relative = self.relative.unwrap_or_else(Matrix3::identity);
        // E = R_A R_relᵀ R_Bᵀ is the identity where the axes are held
        let e = poses[0].rotation * relative.transpose() * poses[1].rotation.transpose();
        let error = Vec3::new(e[(2, 1)] - e[(1, 2)], e[(0, 2)] - e[(2, 0)], e[(1, 0)] - e[(0, 1)]) * 0.5;
        let spread = Matrix3::from_diagonal_element(e.trace());
        let mut by = [zero; 2];
        by[0].fixed_view_mut::<3, 3>(0, 0).copy_from(&((spread - e) * 0.5));
        by[1].fixed_view_mut::<3, 3>(0, 0).copy_from(&((e.transpose() - spread) * 0.5));
        TieRows { error, by_displacement: by, point: None, point_changes: [zero; 2] }
    }
}

impl TieRows {
    /// F = (w₀; ρ (error/h + give w̄)).
    pub(crate) fn residual(&self, law: &ClosureLaw, h: f64, w: &Vector4<f64>) -> Vector4<f64> {
        let f = (self.error / h + Vec3::new(w[1], w[2], w[3]) * law.compliance_per_h2) * law.rho;
        Vector4::new(w[0], f[0], f[1], f[2])
    }

    /// The impulse on the first side as a wrench about the origin [N·s].
    pub(crate) fn wrench(&self, w: &Vector4<f64>) -> Force<f64> {
        let impulse = Vec3::new(w[1], w[2], w[3]);
        match &self.point {
            Some(point) => Force::at(point, impulse),
            None => Force { n: impulse, f: Vec3::zeros() },
        }
    }

    /// As a linearized constraint between two frames.
    pub(crate) fn linearize(&self, law: &ClosureLaw, h: f64, w: &Vector4<f64>) -> LinkLinear {
        let diagonal = law.rho * law.compliance_per_h2 + law.regularization;
        let mut f_w = Matrix4::from_diagonal_element(diagonal);
        f_w[(0, 0)] = 1.0;
        let mut inverse = Matrix4::from_diagonal_element(1.0 / diagonal);
        inverse[(0, 0)] = 1.0;
        let impulse = Vec3::new(w[1], w[2], w[3]);
        let f_xi = self.by_displacement.map(|by| {
            let mut f = Matrix4x6::zeros();
            f.fixed_view_mut::<3, 6>(1, 0).copy_from(&(by * (law.rho / h)));
            f
        });
        let w_xi = self.point_changes.map(|by| {
            let mut m = Matrix6::zeros();
            m.fixed_view_mut::<3, 6>(0, 0).copy_from(&(-hat(&impulse) * by));
            m
        });
        let mut w_w = Matrix6x4::zeros();
        match &self.point {
            Some(point) => {
                w_w.fixed_view_mut::<3, 3>(0, 1).copy_from(&hat(point));
                w_w.fixed_view_mut::<3, 3>(3, 1).fill_with_identity();
            }
            None => w_w.fixed_view_mut::<3, 3>(0, 1).fill_with_identity(),
        }
        LinkLinear {
            f: self.residual(law, h, w),
            f_w,
            inverse,
            f_xi,
            f_v: Matrix4x6::zeros(),
            w_w,
            gain: w_w * inverse,
            w_xi,
            f_vn: Vector4::zeros(),
            f_mu: Vector4::zeros(),
            f_vt: SMatrix::zeros(),
        }
    }
}

/// The numbers of a closure's rows for a stage length and a rest gap.
pub(crate) fn closure_law(
    closure: &LoopClosure,
    rho: f64,
    theta: &[f64],
    [h, rest_gap]: [f64; 2],
    regularization: f64,
) -> ClosureLaw {
    let compliance = closure.compliance.map_or(0.0, |k| theta[k]) + rest_gap / closure.weight;
    ClosureLaw { rho, compliance_per_h2: compliance / (h * h), regularization }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pliant_math::rotation::about;

    #[test]
    fn rows_change_as_differences_say() {
        let axis = |x: f64, y: f64, z: f64| Vec3::new(x, y, z).normalize();
        let poses = [
            Pose { rotation: about(&axis(1.0, 2.0, -0.5), 0.8), position: Vec3::new(0.2, -0.1, 0.4) },
            Pose { rotation: about(&axis(0.3, -1.0, 0.7), 1.1), position: Vec3::new(-0.3, 0.2, 0.1) },
        ];
        let theta = [0.1, 0.2, -0.3, 0.05, -0.15, 0.25];
        let closure = LoopClosure {
            name: String::new(),
            attachments: [Attachment::World; 2],
            points: [0, 3],
            relative: Some(about(&axis(0.2, 0.1, 1.0), 0.4)),
            compliance: None,
            weight: 1.0,
        };
        for turn in [false, true] {
            let rows = closure.rows(turn, [&poses[0], &poses[1]], &theta);
            for side in 0..2 {
                for k in 0..6 {
                    let moved = |step: f64| {
                        let mut xi = [0.0; 6];
                        xi[k] = step;
                        let mut both = poses;
                        // to first order, as the poses' change is
                        both[side] = poses[side].displaced(&xi);
                        closure.rows(turn, [&both[0], &both[1]], &theta).error
                    };
                    let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                    assert!((difference - rows.by_displacement[side].column(k)).amax() < 1e-9, "{turn} {side} {k}");
                }
            }
        }
    }
}
