//! Coulomb's law at one contact as a *split* residual: the normal impulse by itself, the tangential one against it. It has the roots
//! of the natural residual ([`crate::residual`]), and suits contacts between bodies, where several contacts share directions of very
//! different inertia: the normal part does not see the sliding, and each part has a step of its own.

use crate::Linearization;
use crate::natural::smoothed_parts;
use nalgebra::{Matrix3, Matrix4, Matrix4x3, Vector3, Vector4};
use pliant_math::Real;

// Derivation. Coulomb's smoothed law has γ_n v_n = κ and w̄ = −(w₀/s₀) s̄ (see `law`). With τ = |w̄|, u = w̄ − ρ_t s̄ and s̄ = σ v_t,
// the second gives u ∥ w̄ and |u| − τ = ρ_t τ s₀/w₀, and s ∘ w = κ e gives s₀ (w₀² − τ²) = κ w₀. Together
//   (w₀² − τ²)(|u| − τ) = ρ_t κ τ,
// in which t = τ/|u| has no division by |u|: with X = |u|², G = w₀², c = ρ_t κ, s = 1 − t,
//   H = (G − t² X) s − c t = 0,   e = G − t² X ≥ 0,
//   ∂t/∂X = −t² s/D,   ∂t/∂G = s/D,   ∂t/∂c = −t/D,   D = 2 t X s + e + c > 0.
// Sticking, s is small and e is not; slipping, the other way round: the small one is taken from s e = c t, so neither cancels.

/// Arguments of one contact's law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitPoint {
    /// Slip factor σ [-]: the tangential velocity counts as s̄ = σ v_t.
    pub slip: f64,
    /// Smoothing κ \[J\].
    pub kappa: f64,
    /// Step of the normal part \[kg\], about 0.3 of the effective mass along the normal.
    pub rho_n: f64,
    /// Step of the tangential part \[kg\], about 0.3 of the smallest effective mass across it, over σ.
    pub rho_t: f64,
    /// Compliance over h² [1/kg]: the contact gives way by v_n += give · w₀.
    pub compliance_per_h2: f64,
    /// Added to ∂F/∂w [-] for an iteration: contacts that hold a body more often than it can move (four legs) then share its load
    /// instead of fighting over a linearization's error. 0 for derivatives.
    pub regularization: f64,
}

/// The root t of H in (0, 1), its complement s, e and D of the derivation, each to full relative precision.
#[derive(Clone, Copy, Debug)]
struct Ratio {
    t: f64,
    s: f64,
    d: f64,
}

/// Relative size of a Newton step after which its square is rounding [-].
const LAST: f64 = 1e-9;

impl Ratio {
    fn solve(x: f64, g: f64, c: f64) -> Self {
        if x > 4.0 * g { Self::slipping(x, g, c) } else { Self::sticking(x, g, c) }
    }

    /// The root as t < 1/2, near √(G/X): H falls from H(0) = G.
    fn slipping(x: f64, g: f64, c: f64) -> Self {
        let highest = (g / x).sqrt();
        let h = |t: f64| (g - t * t * x) * (1.0 - t) - c * t;
        let slope = |t: f64| -2.0 * t * x * (1.0 - t) - (g - t * t * x) - c;
        let t = root(|t| -h(t), |t| -slope(t), g / (c + (g * x).sqrt()), [0.0, highest]);
        let s = 1.0 - t;
        let direct = g - t * t * x;
        let e = if direct < 0.5 * g { c * t / s } else { direct };
        Self { t, s, d: 2.0 * t * x * s + e + c }
    }

    /// The root as s: s e − c (1 − s) rises from below 0 to G at s = 1.
    fn sticking(x: f64, g: f64, c: f64) -> Self {
        let low = if x > g { (x - g) / (x + (g * x).sqrt()) } else { 0.0 };
        let e_at = |s: f64| (g - x) + (2.0 - s) * s * x;
        let start = if x > g {
            let push = c / x;
            low + push / (low + (low * low + 2.0 * push).sqrt())
        } else {
            let b = g - x + c;
            2.0 * c / (b + (b * b + 8.0 * x * c).sqrt())
        };
        let s = root(|s| s * e_at(s) - c * (1.0 - s), |s| e_at(s) + 2.0 * s * (1.0 - s) * x + c, start, [low, 1.0]);
        let t = 1.0 - s;
        let e = e_at(s);
        // of s and e, the small one from the other
        let (s, e) = if x > g && e < 0.5 * g { (s, c * t / s) } else { (c * t / e, e) };
        Self { t, s, d: 2.0 * t * x * s + e + c }
    }
}

/// The root of a rising function between two bounds, by Newton's method kept within them. For the functions here x f″/f′ is a few at most, so
/// that after a step of `LAST` the next would be rounding.
fn root(f: impl Fn(f64) -> f64, slope: impl Fn(f64) -> f64, start: f64, [mut below, mut above]: [f64; 2]) -> f64 {
    let inside = |x: f64, below: f64, above: f64| if x > below && x < above { x } else { 0.5 * (below + above) };
    let mut x = inside(start, below, above);
    for _ in 0..80 {
        let value = f(x);
        if value > 0.0 {
            above = x
        } else {
            below = x
        }
        let step = value / slope(x);
        if step.abs() <= LAST * x {
            return (x - step).clamp(below, above);
        }
        let next = inside(x - step, below, above);
        let done = (next - x).abs() <= 4.0 * f64::EPSILON * x;
        x = next;
        if done {
            break;
        }
    }
    x
}

/// The split residual F(w) [N·s] for any scalar: zero exactly where Coulomb's smoothed law holds. Arguments and units as those of
/// [`SplitPoint`] and [`crate::residual`]; `v_n` without the term of the contact's compliance.
#[allow(clippy::too_many_arguments)] // the numbers of a law, each with a derivative of its own
pub fn split_residual<S: Real>(
    slip: S,
    kappa: S,
    rho_n: f64,
    rho_t: f64,
    compliance_per_h2: S,
    v_n: S,
    v_t: [S; 3],
    w: [S; 4],
) -> [S; 4] {
    let v_n = v_n + compliance_per_h2 * w[0];
    let z = w[0] - v_n * rho_n;
    let rk = kappa * rho_n;
    let d = (z * z + rk * 4.0).sqrt();
    let phi = if z.re() < 0.0 { rk * 2.0 / (d - z) } else { (z + d) * 0.5 };
    let f0 = if z.re() < 0.0 { w[0] - phi } else { v_n * rho_n - rk / phi };
    let step: [S; 3] = std::array::from_fn(|a| v_t[a] * slip * rho_t);
    let u: [S; 3] = std::array::from_fn(|a| w[1 + a] - step[a]);
    let (x, g, c) = (u[0] * u[0] + u[1] * u[1] + u[2] * u[2], phi * phi, kappa * rho_t);
    let root = Ratio::solve(x.re(), g.re(), c.re());
    // a step of Newton's method from the root carries the derivatives
    let s0 = S::from(root.s);
    let t0 = S::from(root.t);
    let s = s0 - (((g - t0 * t0 * x) * s0 - c * t0) - ((g - t0 * t0 * x) * s0 - c * t0).re()) / S::from(root.d);
    let t = S::from(1.0) - s;
    [f0, w[1] * s + step[0] * t, w[2] * s + step[1] * t, w[3] * s + step[2] * t]
}

/// [`split_residual`] at a point, with its derivatives by hand; ∂F/∂(1/kg of `compliance_per_h2`) is ∂F/∂v_n · w₀.
pub fn split_linearize(at: &SplitPoint, v_n: f64, v_t: [f64; 3], w: [f64; 4]) -> Linearization {
    let SplitPoint { slip, kappa, rho_n, rho_t, compliance_per_h2, regularization } = *at;
    let v_n = v_n + compliance_per_h2 * w[0];
    let z = w[0] - rho_n * v_n;
    let (root, phi, psi) = smoothed_parts(z, rho_n * kappa);
    let (up, down) = (phi / root, psi / root);
    let f0 = if z < 0.0 { w[0] - phi } else { rho_n * v_n - psi };

    let v_t = Vector3::from(v_t);
    let w_bar = Vector3::new(w[1], w[2], w[3]);
    let u = w_bar - v_t * (rho_t * slip);
    let (x, g, c) = (u.norm_squared(), phi * phi, rho_t * kappa);
    let Ratio { t, s, d } = Ratio::solve(x, g, c);
    let (t_x, t_g, t_c) = (-t * t * s / d, s / d, -t / d);
    let f_bar = w_bar * s + v_t * (t * rho_t * slip);

    let outer = u * u.transpose();
    // −∂F̄/∂u = t 1 + 2 t_X u uᵀ
    let by_u = Matrix3::identity() * t + outer * (2.0 * t_x);
    let by_phi = u * (-t_g * 2.0 * phi);
    let dz = 1.0 - rho_n * compliance_per_h2;
    let mut df_dw = Matrix4::zeros();
    // 1 − φ′ dz, without cancellation where the contact is closed
    let diagonal = down + up * rho_n * compliance_per_h2 + regularization;
    df_dw[(0, 0)] = diagonal;
    df_dw.fixed_view_mut::<3, 1>(1, 0).copy_from(&(by_phi * (up * dz)));
    df_dw.fixed_view_mut::<3, 3>(1, 1).copy_from(&(Matrix3::identity() * (s + regularization) - outer * (2.0 * t_x)));

    // −2 t_X over the part that all directions share
    let k = 2.0 * t * t * (s / (s + regularization)) / d;
    let inverse_bar = (Matrix3::identity() - outer * (k / (1.0 + k * x))) / (s + regularization);
    let mut inverse = Matrix4::zeros();
    inverse[(0, 0)] = 1.0 / diagonal;
    inverse.fixed_view_mut::<3, 1>(1, 0).copy_from(&(inverse_bar * by_phi * (-up * dz / diagonal)));
    inverse.fixed_view_mut::<3, 3>(1, 1).copy_from(&inverse_bar);

    let stack = |top: f64, bottom: Vector3<f64>| Vector4::new(top, bottom[0], bottom[1], bottom[2]);
    let mut df_dvt = Matrix4x3::zeros();
    df_dvt.fixed_view_mut::<3, 3>(1, 0).copy_from(&(by_u * (rho_t * slip)));
    let phi_kappa = rho_n / root;
    Linearization {
        f: stack(f0, f_bar),
        df_dw,
        df_dw_inverse: inverse,
        df_dvn: stack(up * rho_n, by_phi * (-up * rho_n)),
        df_dvt,
        df_dslip: stack(0.0, by_u * v_t * rho_t),
        df_dkappa: stack(-phi_kappa, by_phi * phi_kappa - u * (t_c * rho_t)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ContactLaw, central};
    use approx::assert_relative_eq;
    use num_dual::Dual64;

    const CASES: [(f64, f64, [f64; 3]); 7] = [
        (0.5, 1e-6, [0.2, 0.0, 0.0]),
        (0.5, 1e-9, [1e-9, 2e-9, 0.0]),
        (0.8, 1e-7, [0.0, -3e-7, 1e-7]),
        (0.0, 1e-5, [0.3, 0.1, 0.0]),
        (0.3, 0.5, [0.1, 0.0, 0.2]),
        (1.2, 1e-8, [1e-3, 0.0, 1e-3]),
        (0.5, 1e-8, [0.0, 0.0, 0.0]),
    ];

    #[test]
    fn its_roots_are_those_of_the_closed_law() {
        for kappa in [1e-4, 1e-9, 1e-12] {
            for (slip, v_n, v_t) in CASES {
                let w: [f64; 4] = central(ContactLaw::Coulomb, slip, kappa, v_n, v_t);
                let f: [f64; 4] = split_residual(slip, kappa, 0.1, 0.05, 0.0, v_n, v_t, w);
                let size = w[0] + 0.1 * v_n + 0.05 * slip * v_t.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
                assert!(f.iter().all(|f| f.abs() <= 1e-15 * size), "{slip} {kappa:e} {v_n:e} {v_t:?}: {f:?} of {size:e}");
            }
        }
    }

    #[test]
    fn derivatives_by_hand_are_those_of_dual_numbers() {
        let at = SplitPoint { slip: 0.6, kappa: 1e-5, rho_n: 0.2, rho_t: 0.07, compliance_per_h2: 0.3, regularization: 0.0 };
        for (w, v_n, v_t) in [
            ([0.05, 0.02, -0.03, 0.001], 1e-3, [0.1, -0.2, 0.05]),
            ([0.2, 0.02, 0.01, 0.0], -1e-2, [1e-3, 0.0, 2e-3]),
            ([1e-4, 0.0, 0.0, 0.0], 0.3, [0.0, 0.0, 0.0]),
            ([0.1, 0.3, 0.2, -0.1], 0.01, [0.4, 0.0, -0.3]),
        ] {
            let lin = split_linearize(&at, v_n, v_t, w);
            let dual = |k: usize| {
                let seed = |i: usize, x: f64| Dual64::new(x, f64::from(u8::from(i == k)));
                let w: [Dual64; 4] = std::array::from_fn(|a| seed(a, w[a]));
                let v_t: [Dual64; 3] = std::array::from_fn(|a| seed(5 + a, v_t[a]));
                split_residual(
                    seed(8, at.slip),
                    seed(9, at.kappa),
                    at.rho_n,
                    at.rho_t,
                    seed(10, at.compliance_per_h2),
                    seed(4, v_n),
                    v_t,
                    w,
                )
            };
            let hand: Vec<Vector4<f64>> = (0..4)
                .map(|a| lin.df_dw.column(a).into_owned())
                .chain([lin.df_dvn])
                .chain((0..3).map(|a| lin.df_dvt.column(a).into_owned()))
                .chain([lin.df_dslip, lin.df_dkappa, lin.df_dvn * w[0]])
                .collect();
            for (k, column) in hand.iter().enumerate() {
                let f = dual(k);
                for a in 0..4 {
                    assert_relative_eq!(f[a].re, lin.f[a], epsilon = 1e-14);
                    assert_relative_eq!(f[a].eps, column[a], epsilon = 1e-9 * column.norm().max(1e-3), max_relative = 1e-9);
                }
            }
            let unit = lin.df_dw * lin.df_dw_inverse;
            assert_relative_eq!(unit, Matrix4::identity(), epsilon = 1e-9);
            let soft = split_linearize(&SplitPoint { regularization: 0.01, ..at }, v_n, v_t, w);
            assert_relative_eq!(soft.df_dw * soft.df_dw_inverse, Matrix4::identity(), epsilon = 1e-9);
            assert_relative_eq!(soft.df_dw - lin.df_dw, Matrix4::identity() * 0.01, epsilon = 1e-12);
        }
    }
}
