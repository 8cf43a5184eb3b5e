//! One node against one shape: gap, relative velocity and their derivatives.

use crate::geometry::{GeometryError, Shape};
use nalgebra::Matrix3;
use pliant_math::Vec3;

/// A possible contact. Pairs are listed once, when the model is built; every pair is a row of every step.
#[derive(Clone, Debug)]
pub struct ContactPair {
    /// The node, a sphere of the rope's radius.
    pub node: usize,
    /// Index of the shape in the model.
    pub shape: usize,
    /// Index in θ of the rope's radius \[m\].
    pub radius: usize,
    /// Index in θ of the coefficient of friction [-].
    pub friction: usize,
}

/// Geometry of a pair at q⁺ and the velocity seen there.
#[derive(Clone, Debug)]
pub(crate) struct Touch {
    /// Gap over the stage length, gap(q⁺)/h [m/s].
    pub v_n: f64,
    /// Tangential velocity (I − n nᵀ) v⁺ [m/s], world frame.
    pub v_t: Vec3<f64>,
    /// Outward normal n of the shape.
    pub normal: Vec3<f64>,
    /// ∂n/∂q [1/m].
    pub hessian: Matrix3<f64>,
}

impl Touch {
    pub(crate) fn new(
        shape: &Shape,
        x: Vec3<f64>,
        v: Vec3<f64>,
        h: f64,
        radius: f64,
        theta: &[f64],
    ) -> Result<Self, GeometryError> {
        let gap = shape.eval(&x, radius, theta)?;
        let v_t = v - gap.normal * gap.normal.dot(&v);
        Ok(Self { v_n: gap.gap / h, v_t, normal: gap.normal, hessian: gap.hessian })
    }

    /// ∂v_t/∂v at fixed position: the tangential projector.
    pub(crate) fn projector(&self) -> Matrix3<f64> {
        Matrix3::identity() - self.normal * self.normal.transpose()
    }

    /// ∂v_t/∂q = −(n·v) H − n (H v)ᵀ.
    pub(crate) fn dv_t_dq(&self, v: Vec3<f64>) -> Matrix3<f64> {
        -self.hessian * self.normal.dot(&v) - self.normal * (self.hessian * v).transpose()
    }
}
