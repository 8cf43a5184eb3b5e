//! A constraint between two frames (bodies, nodes, the world) linearized: a wrench W(λ)/h on the first and its opposite on the second.

use nalgebra::{Matrix4, Matrix4x6, Matrix6, Matrix6x4, SMatrix, Vector4, Vector6};
use pliant_math::spatial::product;

/// A constraint between two frames linearized at an iterate, its multipliers eliminated. Displacements and velocities are six-vectors about the origin of
/// the evaluation, angular part first; side 0 is the first frame. The wrench is that on the first; on the second it is the opposite.
#[derive(Clone, Debug)]
pub(crate) struct LinkLinear {
    /// F at the iterate [N·s].
    pub f: Vector4<f64>,
    /// F_w and its inverse.
    pub f_w: Matrix4<f64>,
    pub inverse: Matrix4<f64>,
    /// ∂F/∂ξ of each side at fixed velocities, ∂F/∂V of the first side (that of the second is the opposite).
    pub f_xi: [Matrix4x6<f64>; 2],
    pub f_v: Matrix4x6<f64>,
    /// ∂W/∂w.
    pub w_w: Matrix6x4<f64>,
    /// ∂W/∂w F_w⁻¹.
    pub gain: Matrix6x4<f64>,
    /// ∂W/∂ξ of each side at fixed w.
    pub w_xi: [Matrix6<f64>; 2],
    /// ∂F/∂(v_n, μ).
    pub f_vn: Vector4<f64>,
    pub f_mu: Vector4<f64>,
    pub f_vt: SMatrix<f64, 4, 3>,
}

impl LinkLinear {
    /// Before the first linearization.
    pub fn zero() -> Self {
        Self {
            f: Vector4::zeros(),
            f_w: Matrix4::zeros(),
            inverse: Matrix4::zeros(),
            f_xi: [Matrix4x6::zeros(); 2],
            f_v: Matrix4x6::zeros(),
            w_w: Matrix6x4::zeros(),
            gain: Matrix6x4::zeros(),
            w_xi: [Matrix6::zeros(); 2],
            f_vn: Vector4::zeros(),
            f_mu: Vector4::zeros(),
            f_vt: SMatrix::zeros(),
        }
    }

    /// ∂W/∂ξ of a side, with w following (`condensed`) or fixed.
    pub fn by_displacement(&self, side: usize, condensed: bool) -> Matrix6<f64> {
        if condensed { self.w_xi[side] - product(&self.gain, &self.f_xi[side]) } else { self.w_xi[side] }
    }

    /// ∂W/∂V of a side.
    pub fn by_velocity(&self, side: usize, condensed: bool) -> Matrix6<f64> {
        if !condensed {
            return Matrix6::zeros();
        }
        let of_first = -product(&self.gain, &self.f_v);
        if side == 0 { of_first } else { -of_first }
    }

    /// The change of F that goes with a change (δξ, δV) of one side.
    pub fn df(&self, side: usize, (xi, v): &(Vector6<f64>, Vector6<f64>)) -> Vector4<f64> {
        let moving = product(&self.f_v, v);
        product(&self.f_xi[side], xi) + if side == 0 { moving } else { -moving }
    }
}
