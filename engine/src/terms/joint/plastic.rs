//! Springs whose rest creeps: Maxwell elements at joints.

use super::{JointLaw, JointState};
use pliant_math::{Real, Vec3};

/// A spring in series with a viscous damper, so that under load the joint takes a set: with the elastic part e of the coordinate,
/// ```text
/// f = −(k + k₃ e²) e,      ė = q̇ − R(e)/τ,      R(e) = e, or with a yield e_y:  sign(e) max(|e| − e_y, 0)
/// ```
/// Parameters: k [N·m/rad or N/m], k₃ [N·m/rad³ or N/m³], τ \[s\] > 0, then e_y [rad or m] > 0 where `constants[0]` is 1, then the rest q₀
/// of a joint of one axis. Internal variable: the plastic part p of the coordinate, e = q − q₀ − p; it begins at `plastic_start` and the
/// joint is at rest at q₀ + p.
///
/// A step takes e from its beginning (e₀ = q − q₀ − p there) to where the force is evaluated at constant rate, exactly ([`relax`]): the
/// material does not depend on the step, whatever h/τ is. Without yield that is e = E e₀ + (t₁/t)(1 − E) Δq with E = e^{−t/τ}, t₁ = τ.
///
/// At a ball q, p and e are rotation vectors (q the logarithm of its turn, at most π), e_y and R act axis by axis, and the moment in the
/// body's axes is −Jᵀ (k + k₃ |e|²) e with q(δ) = q + J δ, so that ½ k |e|² + ¼ k₃ |e|⁴ is the energy at p held.
///
/// Limits: τ → ∞ is [`super::Spring`], τ → 0 a joint without elasticity, hence without force. The derivative is exact wherever e crosses
/// ±e_y at a rate; only at rest exactly at ±e_y it is that of one side.
#[derive(Clone, Copy, Debug)]
pub struct PlasticSpring;

impl JointLaw for PlasticSpring {
    fn name(&self) -> &str {
        "plastic joint stiffness"
    }

    fn vanishes(&self, p: &[f64]) -> bool {
        p[0] == 0.0 && p[1] == 0.0
    }

    fn force<S: Real>(&self, at: &JointState<S>, p: &[S], constants: &[f64], f: &mut [S]) {
        let e = elastic(at, p, constants);
        let e = &e[..at.q.len()];
        let stiffness = p[0] + p[1] * squared(e);
        if let [_, _, _] = e {
            let moment = pulled_back(&Vec3::new(at.q[0], at.q[1], at.q[2]), &Vec3::new(e[0], e[1], e[2]));
            (0..3).for_each(|k| f[k] -= stiffness * moment[k]);
        } else {
            f.iter_mut().zip(e).for_each(|(f, e)| *f -= stiffness * *e);
        }
    }

    fn advance<S: Real>(&self, at: &JointState<S>, p: &[S], constants: &[f64], z: &mut [S]) {
        let e = elastic(at, p, constants);
        for (k, z) in z.iter_mut().enumerate() {
            *z = at.q[k] - rest(p, constants) - e[k];
        }
    }

    fn energy<S: Real>(&self, at: &JointState<S>, p: &[S], constants: &[f64]) -> S {
        let e = elastic(at, p, constants);
        let size = squared(&e[..at.q.len()]);
        p[0] * size * 0.5 + p[1] * size * size * 0.25
    }
}

fn squared<S: Real>(e: &[S]) -> S {
    e.iter().fold(S::zero(), |sum, e| sum + *e * *e)
}

fn yields(constants: &[f64]) -> bool {
    constants.first() == Some(&1.0)
}

fn rest<S: Real>(p: &[S], constants: &[f64]) -> S {
    p.get(3 + usize::from(yields(constants))).copied().unwrap_or_else(S::zero)
}

/// Elastic parts where the force is evaluated.
fn elastic<S: Real>(at: &JointState<S>, p: &[S], constants: &[f64]) -> [S; 3] {
    let limit = yields(constants).then(|| p[3]);
    let rest = rest(p, constants);
    let one = |k: usize| relax(at.q_past[k] - rest - at.z[k], at.q[k] - at.q_past[k], at.elapsed, p[2], limit);
    std::array::from_fn(|k| if k < at.q.len() { one(k) } else { S::zero() })
}

/// The elastic part after the time `t` \[s\] in which the coordinate changed by `change` at a constant rate, from `e`; relaxation time `tau`
/// \[s\], and the yield beyond which alone it relaxes, if any. Exact.
///
/// From within the yield, e moves with the coordinate; beyond, its excess d = |e| − e_y decays towards that of steady creep, rate · tau.
/// At constant rate e crosses the yield at most twice, at times known in closed form.
pub fn relax<S: Real>(e: S, change: S, t: f64, tau: S, limit: Option<S>) -> S {
    if t <= 0.0 {
        return e + change;
    }
    let rate = change / t;
    let steady = rate * tau;
    let decayed = |excess: S, t: S| excess + (steady - excess) * -(-(t / tau)).exp_m1();
    let Some(limit) = limit else { return decayed(e, S::from(t)) };
    let (mut e, mut left) = (e, S::from(t));
    // beyond, within, and beyond on the other side at most
    for _ in 0..3 {
        let beyond = e.re().abs() > limit.re() || (e.re().abs() == limit.re() && e.re() * rate.re() > 0.0);
        if beyond {
            let yielded = limit * e.re().signum();
            let excess = e - yielded;
            let end = decayed(excess, left);
            if end.re() * e.re() >= 0.0 {
                return yielded + end;
            }
            left -= tau * (-excess / steady).ln_1p();
            e = yielded;
        } else {
            let end = e + rate * left;
            if end.re().abs() <= limit.re() {
                return end;
            }
            let yielded = limit * rate.re().signum();
            left -= (yielded - e) / rate;
            e = yielded;
        }
    }
    e
}

/// Jᵀ x with J of [`pliant_math::rotation::logarithm_jacobian`] at the rotation vector `c`.
fn pulled_back<S: Real>(c: &Vec3<S>, x: &Vec3<S>) -> Vec3<S> {
    let s2 = c.dot(c);
    let along = if s2.re() < 1e-4 {
        s2 * (s2 * (1.0 / 30240.0) + 1.0 / 720.0) + 1.0 / 12.0
    } else {
        let half = s2.sqrt() * 0.5;
        (-half / half.tan() + 1.0) / s2
    };
    // J = 1 + ½ [c] + along [c]²
    let once = c.cross(x);
    x - once * S::from(0.5) + c.cross(&once) * along
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use approx::assert_relative_eq;
    use num_dual::Dual64;
    use pliant_math::rotation::logarithm_jacobian;

    /// ė = rate − R(e)/τ in a million steps.
    fn by_steps(mut e: f64, rate: f64, t: f64, tau: f64, limit: f64) -> f64 {
        let n = 1_000_000;
        let h = t / f64::from(n);
        for _ in 0..n {
            let slope = |e: f64| rate - e.signum() * (e.abs() - limit).max(0.0) / tau;
            let middle = e + 0.5 * h * slope(e);
            e += h * slope(middle);
        }
        e
    }

    #[test]
    fn relaxation_is_that_of_its_differential_equation() {
        for (e, rate, limit) in [
            (0.0, 2.0, 0.1),
            (0.05, -3.0, 0.1),
            (0.6, -4.0, 0.1),
            (-0.6, 0.3, 0.1),
            (0.6, 0.0, 0.1),
            (0.3, 1.0, 0.0),
            (-0.3, 8.0, 0.2),
        ] {
            let (t, tau): (f64, f64) = (0.2, 0.07);
            let limit_given = (limit > 0.0).then_some(limit);
            assert_relative_eq!(relax(e, rate * t, t, tau, limit_given), by_steps(e, rate, t, tau, limit), epsilon = 1e-9);
        }
    }

    /// The whole in one step or in many: the material does not know the step.
    #[test]
    fn parts_of_a_step_make_the_step() {
        let (e, rate, t, tau) = (0.6, -4.0, 0.3, 0.07);
        for limit in [None, Some(0.1)] {
            let once = relax(e, rate * t, t, tau, limit);
            let thrice = (0..3).fold(e, |e, _| relax(e, rate * t / 3.0, t / 3.0, tau, limit));
            assert_relative_eq!(once, thrice, max_relative = 1e-13);
        }
    }

    #[test]
    fn derivatives_through_both_yields() {
        let (x, h): ([f64; 4], f64) = ([0.6, -1.2, 0.07, 0.1], 1e-6);
        let at = |x: [f64; 4]| relax(x[0], x[1], 0.3, x[2], Some(x[3]));
        for k in 0..4 {
            let seeded: [Dual64; 4] = std::array::from_fn(|j| Dual64::new(x[j], f64::from(u8::from(j == k))));
            let exact = relax(seeded[0], seeded[1], 0.3, seeded[2], Some(seeded[3])).eps;
            let moved = |by: f64| at(std::array::from_fn(|j| x[j] + if j == k { by } else { 0.0 }));
            assert_relative_eq!(exact, (moved(h) - moved(-h)) / (2.0 * h), epsilon = 1e-8);
        }
    }

    #[test]
    fn moments_are_pulled_back_by_the_jacobian() {
        for c in [Vec3::new(0.4, -1.1, 0.7), Vec3::new(1e-3, 2e-3, -1e-3), Vec3::zeros()] {
            let x = Vec3::new(0.3, 0.8, -0.5);
            assert_relative_eq!(pulled_back(&c, &x), logarithm_jacobian(&c).transpose() * x, epsilon = 1e-13);
        }
    }
}
