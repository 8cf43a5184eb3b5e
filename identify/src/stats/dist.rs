//! Distribution functions under one roof, total on all of ℝ (no panics, tails by the survival function).

use rand::RngExt;
use statrs::distribution::{Beta, ChiSquared, ContinuousCDF, Normal, StudentsT};

/// One standard normal number (Box–Muller).
pub fn gaussian(rng: &mut impl RngExt) -> f64 {
    let (u, w): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * w).cos()
}

/// Φ(x), the standard normal distribution function.
pub fn normal_cdf(x: f64) -> f64 {
    Normal::standard().cdf(x)
}

/// 1 − Φ(x), accurate in the upper tail.
pub fn normal_sf(x: f64) -> f64 {
    Normal::standard().sf(x)
}

/// Φ⁻¹(p). Limits: −∞ at p ≤ 0, +∞ at p ≥ 1; NaN stays NaN.
pub fn normal_quantile(p: f64) -> f64 {
    if p.is_nan() {
        f64::NAN
    } else if p <= 0.0 {
        f64::NEG_INFINITY
    } else if p >= 1.0 {
        f64::INFINITY
    } else {
        Normal::standard().inverse_cdf(p)
    }
}

/// The |z| whose two-sided normal tail is p: z = −Φ⁻¹(p/2). Infinite when p has underflowed to zero.
pub fn z_of_two_sided(p: f64) -> f64 {
    -normal_quantile((0.5 * p).min(0.5))
}

/// P(χ²_dof > x). One at x ≤ 0; with dof = 0 the whole mass sits at zero.
pub fn chi2_sf(x: f64, dof: f64) -> f64 {
    if x.is_nan() {
        return f64::NAN;
    }
    if x <= 0.0 {
        return 1.0;
    }
    if x.is_infinite() {
        return 0.0;
    }
    ChiSquared::new(dof).map_or(0.0, |d| d.sf(x))
}

/// Quantile of χ²_dof at probability p in (0, 1); NaN outside or for dof ≤ 0.
pub fn chi2_quantile(p: f64, dof: f64) -> f64 {
    inside_unit(p).and_then(|p| ChiSquared::new(dof).ok().map(|d| d.inverse_cdf(p))).unwrap_or(f64::NAN)
}

/// P(|T_dof| > |x|), Student's t. Normal in the limit dof → ∞; NaN for dof ≤ 0.
pub fn t_two_sided(x: f64, dof: f64) -> f64 {
    if dof.is_infinite() {
        return 2.0 * normal_sf(x.abs());
    }
    StudentsT::new(0.0, 1.0, dof).map_or(f64::NAN, |d| 2.0 * d.sf(x.abs()))
}

/// Quantile of Student's t at probability p in (0, 1); NaN outside or for dof ≤ 0.
pub fn t_quantile(p: f64, dof: f64) -> f64 {
    inside_unit(p).and_then(|p| StudentsT::new(0.0, 1.0, dof).ok().map(|d| d.inverse_cdf(p))).unwrap_or(f64::NAN)
}

/// P(F_{a,b} > x) through the regularized incomplete beta function, also for fractional degrees of freedom.
pub fn f_sf(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    // P(F > x) = I_{b/(b+ax)}(b/2, a/2)
    Beta::new(0.5 * b, 0.5 * a).map_or(f64::NAN, |d| d.cdf(b / (b + a * x)))
}

/// Quantile of the Beta distribution; NaN outside (0, 1) or for a shape ≤ 0.
pub fn beta_quantile(p: f64, a: f64, b: f64) -> f64 {
    inside_unit(p).and_then(|p| Beta::new(a, b).ok().map(|d| d.inverse_cdf(p))).unwrap_or(f64::NAN)
}

fn inside_unit(p: f64) -> Option<f64> {
    (p > 0.0 && p < 1.0).then_some(p)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn known_values() {
        assert_relative_eq!(normal_quantile(0.975), 1.959_963_984_540_054, max_relative = 1e-12);
        assert_relative_eq!(normal_sf(10.0), 7.619_853_024_160_527e-24, max_relative = 1e-9);
        assert_relative_eq!(chi2_sf(3.841_458_820_694_124, 1.0), 0.05, max_relative = 1e-9);
        assert_relative_eq!(chi2_quantile(0.95, 4.0), 9.487_729_036_781_154, max_relative = 1e-8);
        assert_relative_eq!(t_quantile(0.95, 4.0), 2.131_846_786_326_649, max_relative = 1e-8);
        assert_relative_eq!(t_two_sided(2.131_846_786_326_649, 4.0), 0.1, max_relative = 1e-8);
        // F_{1,b} is t_b squared.
        assert_relative_eq!(f_sf(2.3 * 2.3, 1.0, 7.0), t_two_sided(2.3, 7.0), max_relative = 1e-9);
    }

    #[test]
    fn total_on_the_edges() {
        assert_eq!(normal_quantile(0.0), f64::NEG_INFINITY);
        assert_eq!(chi2_sf(-1.0, 2.0), 1.0);
        assert_eq!(chi2_sf(f64::INFINITY, 2.0), 0.0);
        assert!(t_quantile(1.0, 3.0).is_nan());
        assert!(z_of_two_sided(0.0).is_infinite());
        assert_relative_eq!(z_of_two_sided(1.0), 0.0, epsilon = 1e-12);
        assert!(chi2_sf(1e4, 3.0) >= 0.0);
    }
}
