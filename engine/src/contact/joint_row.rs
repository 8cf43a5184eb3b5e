//! Friction and stops at joints: one impulse each, condensed into the force on its degree of freedom.

use nalgebra::{SVector, Vector3};
use num_dual::{Derivative, DualSVec64};
use pliant_smoothing::{Real, friction_residual, stop_residual};

/// Part of its bound from which friction counts as slipping.
const SLIP: f64 = 0.999;
/// Numbers of θ that a row reads.
const PARAMS: usize = 3;

/// What a row is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointRowKind {
    /// Dry friction: Coulomb torque c, excess of stiction over it s, and speed v_s at which the excess has fallen by e (Stribeck):
    /// the bound is c + s exp(−(v/v_s)²). Indices in θ.
    Friction([usize; PARAMS]),
    /// A stop at the coordinate with this index in θ: below it (+1: coordinates are above) or above it (−1).
    Stop(usize, f64),
}

/// Friction or a stop at one degree of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointRow {
    /// Degree of freedom, counted from the first of the bodies'.
    pub dof: usize,
    /// Its coordinate, counted likewise.
    pub q: usize,
    /// What it is.
    pub kind: JointRowKind,
}

/// What a row's law is evaluated with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowPoint {
    /// Coordinate and velocity at the end of the step.
    pub q: f64,
    pub v: f64,
    /// Length of the stage [s].
    pub h: f64,
    /// Rest gap δ [m, rad].
    pub rest_gap: f64,
    /// Weight of the degree of freedom [kg·m²/s² or kg·m/s²]: its inertia times about gravity's acceleration over a metre.
    pub weight: f64,
    /// Step of the natural residual [kg·m² or kg].
    pub rho: f64,
}

/// A row linearized at an iterate.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RowLinear {
    /// F [N·m·s or N·s].
    pub f: f64,
    /// ∂F/∂(q, v, γ).
    pub f_q: f64,
    pub f_v: f64,
    pub f_gamma: f64,
    /// Rounding of γ: that of F through F_γ, which vanishes where a joint sticks or a stop is closed hard.
    pub rounding: f64,
}

impl JointRow {
    /// Indices in θ, with how many count.
    pub(crate) fn params(&self) -> ([usize; PARAMS], usize) {
        match self.kind {
            JointRowKind::Friction(params) => (params, PARAMS),
            JointRowKind::Stop(bound, _) => ([bound; PARAMS], 1),
        }
    }

    /// F for any scalar. κ = δ (c + weight/1000) for friction, δ weight for a stop.
    fn law<S: Real>(&self, at: &RowPoint, q: S, v: S, gamma: S, p: &[S]) -> S {
        match self.kind {
            JointRowKind::Friction(_) => {
                let fall = (-(v * v) / (p[2] * p[2])).exp();
                let bound = (p[0] + p[1] * fall) * at.h;
                let kappa = (p[0] + 1e-3 * at.weight) * at.rest_gap;
                friction_residual(kappa, at.rho, bound, bound, v, gamma)
            }
            JointRowKind::Stop(_, side) => {
                let v_n = (q - p[0]) * (side / at.h);
                stop_residual(S::from(at.rest_gap * at.weight), at.rho, v_n, gamma)
            }
        }
    }

    fn values(&self, theta: &[f64]) -> [f64; PARAMS] {
        self.params().0.map(|k| theta[k])
    }

    /// Whether it can act: a stop always, friction if it has a size.
    pub(crate) fn acts(&self, theta: &[f64]) -> bool {
        match self.kind {
            JointRowKind::Friction([coulomb, stiction, _]) => theta[coulomb] > 0.0 || theta[stiction] > 0.0,
            JointRowKind::Stop(..) => true,
        }
    }

    /// Generalized impulse per unit of γ.
    pub(crate) fn direction(&self) -> f64 {
        if let JointRowKind::Stop(_, side) = self.kind { side } else { 1.0 }
    }

    /// Friction: 1 stick, 2 and 3 slip; a stop: 0 open, 1 closed.
    pub(crate) fn mode(&self, at: &RowPoint, gamma: f64, theta: &[f64]) -> u8 {
        match self.kind {
            JointRowKind::Friction(_) if gamma.abs() <= SLIP * self.bound(at, theta) => 1,
            JointRowKind::Friction(_) => 2 + u8::from(gamma > 0.0),
            JointRowKind::Stop(..) => u8::from(gamma > (at.rest_gap * at.weight * at.rho).sqrt()),
        }
    }

    /// Largest impulse of friction [N·m·s or N·s]; 0 for a stop.
    fn bound(&self, at: &RowPoint, theta: &[f64]) -> f64 {
        match self.kind {
            JointRowKind::Friction([coulomb, stiction, speed]) => {
                (theta[coulomb] + theta[stiction] * (-(at.v / theta[speed]).powi(2)).exp()) * at.h
            }
            JointRowKind::Stop(..) => 0.0,
        }
    }

    /// F alone.
    pub(crate) fn residual(&self, at: &RowPoint, gamma: f64, theta: &[f64]) -> f64 {
        self.law(at, at.q, at.v, gamma, &self.values(theta))
    }

    /// F and its derivatives.
    pub(crate) fn linearize(&self, at: &RowPoint, gamma: f64, theta: &[f64]) -> RowLinear {
        type Dual = DualSVec64<3>;
        let seeded = |x: f64, k: usize| {
            let mut unit = Vector3::zeros();
            unit[k] = 1.0;
            Dual::new(x, Derivative::some(unit))
        };
        let p = self.values(theta).map(Dual::from_re);
        let f = self.law(at, seeded(at.q, 0), seeded(at.v, 1), seeded(gamma, 2), &p);
        let by = f.eps.0.unwrap_or_else(Vector3::zeros);
        let size = gamma.abs() + (at.rho * at.v).abs() + self.bound(at, theta);
        let rounding = 4.0 * f64::EPSILON * size / by[2].abs();
        RowLinear { f: f.re, f_q: by[0], f_v: by[1], f_gamma: by[2], rounding }
    }

    /// ∂F/∂θ of each number it reads.
    pub(crate) fn visit_theta(&self, at: &RowPoint, gamma: f64, theta: &[f64], visit: &mut dyn FnMut(usize, f64)) {
        type Dual = DualSVec64<PARAMS>;
        let (indices, count) = self.params();
        let p: [Dual; PARAMS] = std::array::from_fn(|k| {
            let mut unit = SVector::zeros();
            unit[k] = 1.0;
            Dual::new(theta[indices[k]], Derivative::some(unit))
        });
        let constant = |x: f64| Dual::from_re(x);
        let f = self.law(at, constant(at.q), constant(at.v), constant(gamma), &p);
        if let Some(by) = f.eps.0 {
            (0..count).for_each(|k| visit(indices[k], by[k]));
        }
    }
}
