//! Contact of nodes with fixed shapes, linearized. With w the cone variable, the impulse is p = w₀ n + μ w̄ and F(w, v̂) = 0 is the
//! smoothed natural residual of the cone.

use super::CONSTRAINTS;
use super::Touch;
use nalgebra::{Matrix3, Matrix3x4, Matrix4, Matrix4x3, Vector4};
use pliant_math::Vec3;
use pliant_smoothing::ContactLaw;

/// The acceleration [m/s²] by which the sharpness of a node's contact follows from its mass, and its derivative by gravity.
pub(crate) fn weighed(gravity: f64) -> (f64, f64) {
    if gravity > 0.0 { (gravity, 1.0) } else { (CONSTRAINTS.weight, 0.0) }
}

/// The numbers a contact's law takes at one node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LawPoint {
    pub law: ContactLaw,
    /// Friction μ [-].
    pub mu: f64,
    /// Slip factor σ and its derivative by μ [-].
    pub slip: (f64, f64),
    /// Smoothing κ [J].
    pub kappa: f64,
    /// Step of the natural residual ρ [kg].
    pub rho: f64,
}

/// The linearization of one contact and its elimination.
#[derive(Clone, Debug)]
pub(crate) struct Condensed {
    /// Impulse p [N·s] at the iterate, world frame.
    pub impulse: Vec3<f64>,
    /// F at the iterate [N·s].
    pub residual: Vector4<f64>,
    /// ∂p/∂q⁺ [N·s/m] and ∂p/∂v⁺ [kg] with w eliminated; the first holds the dependence through gap and normal.
    pub dp_dq: Matrix3<f64>,
    pub dp_dv: Matrix3<f64>,
    /// ∂p/∂q⁺ at fixed w [N·s/m].
    pub dp_dq_fixed: Matrix3<f64>,
    /// ∂p/∂w.
    pub dp_dw: Matrix3x4<f64>,
    /// ∂p/∂w F_w⁻¹.
    pub gain: Matrix3x4<f64>,
    /// F_w and F_w⁻¹.
    pub df_dw: Matrix4<f64>,
    pub inverse: Matrix4<f64>,
    /// ∂F/∂q⁺ and ∂F/∂v⁺.
    pub df_dq: Matrix4x3<f64>,
    pub df_dv: Matrix4x3<f64>,
    /// ∂F/∂v_n, ∂F/∂v_t, ∂F/∂μ (through σ), ∂F/∂κ for parameter derivatives.
    pub df_dvn: Vector4<f64>,
    pub df_dvt: Matrix4x3<f64>,
    pub df_dmu: Vector4<f64>,
    pub df_dkappa: Vector4<f64>,
}

/// p = w₀ n + μ w̄.
pub(crate) fn impulse(normal: Vec3<f64>, mu: f64, w: &Vector4<f64>) -> Vec3<f64> {
    normal * w[0] + Vec3::new(w[1], w[2], w[3]) * mu
}

impl Condensed {
    /// Linearizes at cone variable `w` and node velocity `v`; `h` is the stage length. False if the iterate is not finite.
    pub(crate) fn linearize(&mut self, at: LawPoint, touch: &Touch, v: Vec3<f64>, h: f64, w: &Vector4<f64>) -> bool {
        let lin = pliant_smoothing::linearize(at.law, at.slip.0, at.kappa, at.rho, touch.v_n, touch.v_t.into(), (*w).into());
        if !lin.df_dw_inverse.iter().all(|x| x.is_finite()) {
            return false;
        }
        // in place: what a contact holds is a kilobyte
        self.df_dq = lin.df_dvn * (touch.normal / h).transpose() + lin.df_dvt * touch.dv_t_dq(v);
        self.df_dv = lin.df_dvt * touch.projector();
        self.dp_dw.set_column(0, &touch.normal);
        self.dp_dw.fixed_view_mut::<3, 3>(0, 1).copy_from(&Matrix3::from_diagonal_element(at.mu));
        self.gain = self.dp_dw * lin.df_dw_inverse;
        self.impulse = impulse(touch.normal, at.mu, w);
        self.dp_dq_fixed = touch.hessian * w[0];
        self.dp_dq = self.dp_dq_fixed - self.gain * self.df_dq;
        self.dp_dv = -self.gain * self.df_dv;
        (self.residual, self.df_dw, self.inverse) = (lin.f, lin.df_dw, lin.df_dw_inverse);
        (self.df_dvn, self.df_dvt, self.df_dmu, self.df_dkappa) =
            (lin.df_dvn, lin.df_dvt, lin.df_dslip * at.slip.1, lin.df_dkappa);
        true
    }

    /// The change of w that goes with the change `dv` of the node's velocity, for the residual `f` at the current iterate;
    /// `dq = h dv`.
    pub(crate) fn dw(&self, f: &Vector4<f64>, dv: Vec3<f64>, h: f64) -> Vector4<f64> {
        -(self.inverse * (f + (self.df_dq * h + self.df_dv) * dv))
    }
}

impl Condensed {
    /// A placeholder before the first linearization: no impulse, no gain.
    pub(crate) fn zero() -> Self {
        Self {
            impulse: Vec3::zeros(),
            residual: Vector4::zeros(),
            dp_dq: Matrix3::zeros(),
            dp_dv: Matrix3::zeros(),
            dp_dq_fixed: Matrix3::zeros(),
            dp_dw: Matrix3x4::zeros(),
            df_dw: Matrix4::zeros(),
            gain: Matrix3x4::zeros(),
            inverse: Matrix4::zeros(),
            df_dq: Matrix4x3::zeros(),
            df_dv: Matrix4x3::zeros(),
            df_dvn: Vector4::zeros(),
            df_dvt: Matrix4x3::zeros(),
            df_dmu: Vector4::zeros(),
            df_dkappa: Vector4::zeros(),
        }
    }
}
