//! Friction and stops at joints, and joints that follow others: one impulse each, condensed into the force on its degrees of freedom.

use super::CONSTRAINTS;
use super::coupling::Coupling;
use nalgebra::{SVector, Vector3};
use num_dual::{Derivative, Dual64, DualSVec64};
use pliant_math::Real;
use pliant_smoothing::{friction_residual, stop_residual};

/// Numbers of θ that a row reads.
const PARAMS: usize = 5;

/// Dry friction of a joint: indices in θ, and where in z its load is. Against v > 0 the impulse is at most
/// ```text
/// h (c₊ + s exp(−(v/v_s)²) + μ |T|),      against v < 0 likewise with c₋
/// ```
/// with Coulomb's torque c± [N·m or N], the excess s of stiction over it, the speed v_s at which that has fallen by e (Stribeck), and the
/// part μ of the load T that springs and motors put on the joint *at the end of the last step*. A load of the same step would make the
/// bound depend on the motion it bounds, through servos as steep as 1/μ or more with two solutions or none; known beforehand, it
/// leaves the law well posed for every μ ≥ 0, at the price of first order in h where the load changes. The derivative by T is 0 at T = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointFriction {
    /// c₊, against positive velocities.
    pub coulomb: usize,
    /// c₋, against negative ones; the same index if there is no difference.
    pub backward: usize,
    /// s.
    pub stiction: usize,
    /// v_s.
    pub stribeck: usize,
    /// μ, and the place of T in z.
    pub load: Option<(usize, usize)>,
}

/// Kind of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointRowKind {
    /// Dry friction.
    Friction(JointFriction),
    /// A stop at the coordinate with this index in θ: below it (+1: coordinates are above) or above it (−1).
    Stop(usize, f64),
    /// It follows another one.
    Coupling(Coupling),
}

/// Friction or a stop at one degree of freedom, or what couples it to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointRow {
    /// Degree of freedom, counted from the first of the bodies'.
    pub dof: usize,
    /// Its coordinate, counted likewise.
    pub q: usize,
    /// Its kind.
    pub kind: JointRowKind,
}

/// Arguments of a row's law.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowPoint {
    /// Coordinate and velocity at the end of the step.
    pub q: f64,
    pub v: f64,
    /// Coordinate of the joint that leads, if one does.
    pub lead: f64,
    /// Length of the stage [s].
    pub h: f64,
    /// Rest gap δ [m, rad].
    pub rest_gap: f64,
    /// ε of [`super::sharpness`].
    pub sharpness: f64,
    /// Weight of the degree of freedom [kg·m²/s² or kg·m/s²]: its inertia times about gravity's acceleration over a metre.
    pub weight: f64,
    /// Step of the natural residual [kg·m² or kg].
    pub rho: f64,
    /// Load T of the joint [N·m or N].
    pub load: f64,
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
    /// Impulse on the leading degree of freedom per unit of γ, by which its motion counts in F too; and ∂/∂ of its coordinate.
    pub lever: f64,
    pub lever_bend: f64,
}

impl JointRow {
    /// Indices in θ, with how many count.
    pub(crate) fn params(&self) -> ([usize; PARAMS], usize) {
        match self.kind {
            JointRowKind::Friction(f) => {
                let part = f.load.map(|(part, _)| part);
                let params = [f.coulomb, f.backward, f.stiction, f.stribeck, part.unwrap_or(f.coulomb)];
                (params, if part.is_some() { PARAMS } else { PARAMS - 1 })
            }
            JointRowKind::Stop(bound, _) => ([bound; PARAMS], 1),
            // it has a law of its own
            JointRowKind::Coupling(c) => ([c.coefficients; PARAMS], 0),
        }
    }

    /// F for any scalar, of (q, v, γ, load). κ = ε δ (c + weight/1000) for friction with c the mean of c₊ and c₋, and ε of [`super::sharpness`], δ weight for a stop.
    fn law<S: Real>(&self, at: &RowPoint, [q, v, gamma, load]: [S; 4], p: &[S]) -> S {
        match self.kind {
            JointRowKind::Friction(friction) => {
                let fall = (-(v * v) / (p[3] * p[3])).exp();
                let mut more = p[2] * fall;
                if friction.load.is_some() {
                    more += p[4] * if load.re() == 0.0 { S::zero() } else { load.abs() };
                }
                let kappa = ((p[0] + p[1]) * 0.5 + 1e-3 * at.weight) * (at.rest_gap * at.sharpness);
                friction_residual(kappa, at.rho, (p[0] + more) * at.h, (p[1] + more) * at.h, v, gamma)
            }
            JointRowKind::Stop(_, side) => {
                let v_n = (q - p[0]) * (side / at.h);
                stop_residual(S::from(at.rest_gap * at.weight), at.rho, v_n, gamma)
            }
            JointRowKind::Coupling(_) => S::zero(),
        }
    }

    fn values(&self, theta: &[f64]) -> [f64; PARAMS] {
        self.params().0.map(|k| theta[k])
    }

    /// Whether it can act: stops and couplings always, friction if it has a size.
    pub(crate) fn acts(&self, theta: &[f64]) -> bool {
        match self.kind {
            JointRowKind::Friction(f) => {
                let part = f.load.map(|(part, _)| part);
                [Some(f.coulomb), Some(f.backward), Some(f.stiction), part].into_iter().flatten().any(|k| theta[k] > 0.0)
            }
            JointRowKind::Stop(..) | JointRowKind::Coupling(_) => true,
        }
    }

    /// The coupling that it is, if any.
    pub(crate) fn coupling(&self) -> Option<&Coupling> {
        if let JointRowKind::Coupling(coupling) = &self.kind { Some(coupling) } else { None }
    }

    /// Degree of freedom that leads, if it is a coupling to one.
    pub(crate) fn lead(&self) -> Option<usize> {
        self.coupling().and_then(|c| c.lead).map(|joint| joint.dof)
    }

    /// Impulse on the leading degree of freedom per unit of γ.
    pub(crate) fn lever(&self, at: &RowPoint, theta: &[f64]) -> f64 {
        self.coupling().map_or(0.0, |c| c.lever(at, theta))
    }

    /// Generalized impulse per unit of γ.
    pub(crate) fn direction(&self) -> f64 {
        if let JointRowKind::Stop(_, side) = self.kind { side } else { 1.0 }
    }

    /// Friction: 1 stick, 2 and 3 slip, plus 4 under a negative load; a stop: 0 open, 1 closed; a coupling: 0.
    pub(crate) fn mode(&self, at: &RowPoint, gamma: f64, theta: &[f64]) -> u8 {
        match self.kind {
            JointRowKind::Friction(_) => {
                let [against_forward, against_backward] = self.bounds(at, theta);
                let sticks = -CONSTRAINTS.slip * against_forward <= gamma && gamma <= CONSTRAINTS.slip * against_backward;
                let motion = if sticks { 1 } else { 2 + u8::from(gamma > 0.0) };
                motion + 4 * u8::from(at.load < 0.0)
            }
            JointRowKind::Coupling(_) => 0,
            JointRowKind::Stop(..) => u8::from(gamma > (at.rest_gap * at.weight * at.rho).sqrt()),
        }
    }

    /// Place in z of the load that it depends on.
    pub(crate) fn load(&self) -> Option<usize> {
        match self.kind {
            JointRowKind::Friction(f) => f.load.map(|(_, place)| place),
            JointRowKind::Stop(..) | JointRowKind::Coupling(_) => None,
        }
    }

    /// Largest impulses of friction against positive and negative velocities [N·m·s or N·s]; 0 for the others.
    fn bounds(&self, at: &RowPoint, theta: &[f64]) -> [f64; 2] {
        match self.kind {
            JointRowKind::Friction(f) => {
                let part = f.load.map_or(0.0, |(part, _)| theta[part]);
                let more = theta[f.stiction] * (-(at.v / theta[f.stribeck]).powi(2)).exp() + part * at.load.abs();
                [f.coulomb, f.backward].map(|c| (theta[c] + more) * at.h)
            }
            JointRowKind::Stop(..) | JointRowKind::Coupling(_) => [0.0; 2],
        }
    }

    /// F alone.
    pub(crate) fn residual(&self, at: &RowPoint, gamma: f64, theta: &[f64]) -> f64 {
        if let Some(coupling) = self.coupling() {
            return coupling.residual(at, gamma, theta);
        }
        self.law(at, [at.q, at.v, gamma, at.load], &self.values(theta))
    }

    /// F and its derivatives.
    pub(crate) fn linearize(&self, at: &RowPoint, gamma: f64, theta: &[f64]) -> RowLinear {
        if let Some(coupling) = self.coupling() {
            return coupling.linearize(at, gamma, theta);
        }
        type Dual = DualSVec64<3>;
        let seeded = |x: f64, k: usize| {
            let mut unit = Vector3::zeros();
            unit[k] = 1.0;
            Dual::new(x, Derivative::some(unit))
        };
        let p = self.values(theta).map(Dual::from_re);
        let f = self.law(at, [seeded(at.q, 0), seeded(at.v, 1), seeded(gamma, 2), Dual::from_re(at.load)], &p);
        let by = f.eps.0.unwrap_or_else(Vector3::zeros);
        RowLinear { f: f.re, f_q: by[0], f_v: by[1], f_gamma: by[2], ..RowLinear::default() }
    }

    /// ∂F/∂θ of each number it reads.
    pub(crate) fn visit_theta(&self, at: &RowPoint, gamma: f64, theta: &[f64], visit: &mut dyn FnMut(usize, f64)) {
        if let Some(coupling) = self.coupling() {
            return coupling.visit_theta(at, gamma, theta, &mut |param, [by_f, _]| visit(param, by_f));
        }
        type Dual = DualSVec64<PARAMS>;
        let (indices, count) = self.params();
        let p: [Dual; PARAMS] = std::array::from_fn(|k| {
            let mut unit = SVector::zeros();
            unit[k] = 1.0;
            Dual::new(theta[indices[k]], Derivative::some(unit))
        });
        let constant = |x: f64| Dual::from_re(x);
        let f = self.law(at, [at.q, at.v, gamma, at.load].map(constant), &p);
        if let Some(by) = f.eps.0 {
            (0..count).for_each(|k| visit(indices[k], by[k]));
        }
    }

    /// ∂F/∂load.
    pub(crate) fn by_load(&self, at: &RowPoint, gamma: f64, theta: &[f64]) -> f64 {
        let p = self.values(theta).map(Dual64::from_re);
        let [q, v, gamma] = [at.q, at.v, gamma].map(Dual64::from_re);
        self.law(at, [q, v, gamma, Dual64::new(at.load, 1.0)], &p).eps
    }
}
