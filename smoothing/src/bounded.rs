//! Laws of one impulse γ and one velocity: Coulomb friction at a joint, and a one-sided stop. The one-dimensional members of the
//! family of contact laws.
//!
//! ```text
//! friction:  −b₊ ≤ γ ≤ b₋,  γ = −b₊ where v > 0, b₋ where v < 0, anything between where v = 0
//! stop:       γ ≥ 0, v_n ≥ 0, γ v_n = κ
//! ```
//! Both are roots of a natural residual with the smoothed positive part φ(x) = (x + √(x² + 4ρκ))/2:
//! ```text
//! friction:  F = γ + b₊ − φ(γ − ρv + b₊) + φ(γ − ρv − b₋)
//! stop:      F = γ − φ(γ − ρ v_n)
//! ```
//! A sticking joint creeps at v = κ (1/(b₊ + γ) − 1/(b₋ − γ)), to first order in κ: proportional to κ, not to the load.

use pliant_math::Real;

/// The residual of friction [N·m·s or N·s]; bounds `b_plus` (against v > 0) and `b_minus`, both ≥ 0; `rho` > 0 [kg·m² or kg].
pub fn friction_residual<S: Real>(kappa: S, rho: f64, b_plus: S, b_minus: S, v: S, gamma: S) -> S {
    let z = gamma - v * rho;
    gamma + b_plus - positive_part(z + b_plus, kappa * rho) + positive_part(z - b_minus, kappa * rho)
}

/// The residual of a stop [N·m·s or N·s]: `v_n` is the distance to it at the end of the step over the step's length, negative beyond.
pub fn stop_residual<S: Real>(kappa: S, rho: f64, v_n: S, gamma: S) -> S {
    gamma - positive_part(gamma - v_n * rho, kappa * rho)
}

/// φ(x), to full relative precision on both sides.
fn positive_part<S: Real>(x: S, rho_kappa: S) -> S {
    let d = (x * x + rho_kappa * 4.0).sqrt();
    if x.re() < 0.0 { rho_kappa * 2.0 / (d - x) } else { (x + d) * 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// γ by bisection: F rises with γ.
    fn solve(f: impl Fn(f64) -> f64) -> f64 {
        let (mut low, mut high) = (-10.0, 10.0);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if f(middle) < 0.0 { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    #[test]
    fn friction_opposes_sliding_at_its_bounds_and_sticks_between_them() {
        let (kappa, rho) = (1e-9, 0.1);
        let gamma = |v: f64| solve(|g| friction_residual(kappa, rho, 0.3, 0.2, v, g));
        assert_relative_eq!(gamma(0.5), -0.3, epsilon = 1e-7);
        assert_relative_eq!(gamma(-0.5), 0.2, epsilon = 1e-7);
        for load in [-0.1, 0.0, 0.15] {
            let creep = kappa * (1.0 / (0.3 + load) - 1.0 / (0.2 - load));
            assert_relative_eq!(gamma(creep), load, epsilon = 1e-6);
        }
    }

    #[test]
    fn a_stop_is_on_the_central_path() {
        for v_n in [1e-9, 1e-6, 0.1] {
            let kappa = 1e-9;
            let gamma: f64 = kappa / v_n;
            assert!(stop_residual::<f64>(kappa, 0.1, v_n, gamma).abs() < 1e-13 * gamma.max(1.0));
        }
    }

    #[test]
    fn no_friction_is_no_impulse() {
        assert!(friction_residual::<f64>(1e-12, 0.1, 0.0, 0.0, 0.7, 0.0).abs() < 1e-300);
    }
}
