//! The laws: which velocities s the impulse w is complementary to, and the impulse on the central path in closed form.

use pliant_math::Real;
use std::fmt;
use std::str::FromStr;

/// Term ς by which the sliding velocity enters the normal direction of the cone, s₀ = v_n + ς.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ContactLaw {
    /// Coulomb's law after de Saxcé: ς = |s̄|²/s₀, which tends to |s̄| where the contact slides and is smooth at v_t = 0.
    /// The contact plane stays at v_n ≥ 0 whatever the sliding velocity.
    #[default]
    Coulomb,
    /// The convex relaxation: ς = 0. A steadily sliding contact rides on a gap of μ h |v_t| (h the step), and at large μ or small
    /// h lifts off and loses its friction.
    Anitescu,
}

/// The name of a law could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown contact law `{name}`: expected `coulomb` or `anitescu`")]
pub struct UnknownLaw {
    /// The given value.
    pub name: String,
}

impl FromStr for ContactLaw {
    type Err = UnknownLaw;

    fn from_str(name: &str) -> Result<Self, UnknownLaw> {
        match name {
            "coulomb" => Ok(Self::Coulomb),
            "anitescu" => Ok(Self::Anitescu),
            _ => Err(UnknownLaw { name: name.to_owned() }),
        }
    }
}

impl fmt::Display for ContactLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Coulomb => "coulomb",
            Self::Anitescu => "anitescu",
        })
    }
}

/// The normal component s₀ [m/s] of the cone variable.
///
/// Coulomb: s₀ = (v_n + √(v_n² + 4|s̄|²))/2 for v_n ≥ 0, the positive root of s₀ = v_n + |s̄|²/s₀; and s₀ = |s̄| + v_n/2, its
/// continuation with the same slope, for v_n < 0. Anitescu: s₀ = v_n.
///
/// `v_n` [m/s]: normal velocity gap⁺/h, negative where it penetrates. `s_bar_norm2` [m²/s²]: |s̄|² = σ²|v_t|².
///
/// Limits: for Coulomb s is inside the cone exactly where v_n > 0, since there s₀² − |s̄|² = v_n s₀, and below s₀ < |s̄|. All
/// roots have v_n > 0, so the continuation moves none; it only decides how an iteration sees penetration. (The same square root
/// for v_n < 0 would send s to the apex as v_t → 0 and hide from Newton's method that there is penetration at all.) At
/// v_n ≤ 0, s̄ = 0 there is a kink; the derivatives returned there are ∂s₀/∂s̄ = 0 and, at v_n = 0, that of the separating side,
/// ∂s₀/∂v_n = 1.
pub fn normal_slack<S: Real>(law: ContactLaw, v_n: S, s_bar_norm2: S) -> S {
    match law {
        ContactLaw::Anitescu => v_n,
        ContactLaw::Coulomb if v_n.re() >= 0.0 => {
            let discriminant = v_n * v_n + s_bar_norm2 * 4.0;
            if discriminant.re() == 0.0 { v_n } else { (v_n + discriminant.sqrt()) * 0.5 }
        }
        ContactLaw::Coulomb if s_bar_norm2.re() > 0.0 => s_bar_norm2.sqrt() + v_n * 0.5,
        ContactLaw::Coulomb => v_n * 0.5,
    }
}

/// The cone variable s = (s₀; σ v_t) [m/s] of a contact; `v_t` is a world vector in the tangent plane, `slip` σ [-] weighs it.
pub fn slack<S: Real>(law: ContactLaw, slip: S, v_n: S, v_t: [S; 3]) -> [S; 4] {
    let s_bar = v_t.map(|v| slip * v);
    let norm2 = s_bar[0] * s_bar[0] + s_bar[1] * s_bar[1] + s_bar[2] * s_bar[2];
    [normal_slack(law, v_n, norm2), s_bar[0], s_bar[1], s_bar[2]]
}

/// Whether s lies strictly inside the cone, which is where [`central`] is on the central path: v_n > 0 (Coulomb),
/// v_n > σ|v_t| (Anitescu).
pub fn admissible(law: ContactLaw, slip: f64, v_n: f64, v_t: [f64; 3]) -> bool {
    let speed = v_t.iter().map(|v| v * v).sum::<f64>().sqrt();
    match law {
        ContactLaw::Coulomb => v_n > 0.0,
        ContactLaw::Anitescu => v_n > slip * speed,
    }
}

/// The cone variable w = κ s⁻¹ (in the Jordan algebra) on the central path [N·s]; the impulse is w₀ n + μ w̄:
///
/// ```text
/// Coulomb:   w₀ = κ/v_n,                       w̄ = −w₀ σ v_t/s₀
/// Anitescu:  w₀ = κ v_n/(v_n² − σ²|v_t|²),     w̄ = −κ σ v_t/(v_n² − σ²|v_t|²)
/// ```
///
/// `slip` σ [-], s̄ = σ v_t; `kappa` \[J\] smoothing; `v_n`, `v_t` [m/s] normal velocity and tangential world vector.
///
/// Sign: w₀ > 0 pushes apart; w̄ opposes v_t and stays in the tangent plane, |w̄| < w₀.
/// Limits: only where [`admissible`]; elsewhere the formula is not on the path and its value means nothing. μ enters by σ alone.
/// Reference: Fukushima, Luo, Tseng (2002), Smoothing functions for second-order-cone complementarity problems; de Saxcé and
/// Feng (1998) for s₀.
pub fn central<S: Real>(law: ContactLaw, slip: S, kappa: S, v_n: S, v_t: [S; 3]) -> [S; 4] {
    let s = slack(law, slip, v_n, v_t);
    let w0 = match law {
        ContactLaw::Coulomb => kappa / v_n,
        ContactLaw::Anitescu => {
            let determinant = v_n * v_n - (s[1] * s[1] + s[2] * s[2] + s[3] * s[3]);
            kappa * v_n / determinant
        }
    };
    let factor = -(w0 / s[0]);
    [w0, factor * s[1], factor * s[2], factor * s[3]]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use approx::assert_relative_eq;
    use num_dual::first_derivative;

    #[test]
    fn names_are_read_and_written() {
        for law in [ContactLaw::Coulomb, ContactLaw::Anitescu] {
            assert_eq!(law.to_string().parse::<ContactLaw>().unwrap(), law);
        }
        let error = "Coulomb".parse::<ContactLaw>().unwrap_err();
        assert_eq!(error.to_string(), "unknown contact law `Coulomb`: expected `coulomb` or `anitescu`");
    }

    #[test]
    fn slack_solves_its_equation_and_continues_with_the_same_slope() {
        for s_bar in [1e-12, 1e-6, 1e-3, 1.0_f64] {
            for v_n in [1e-9, 1e-3, 3.0_f64] {
                let s0: f64 = normal_slack(ContactLaw::Coulomb, v_n, s_bar * s_bar);
                assert_relative_eq!(s0, v_n + s_bar * s_bar / s0, max_relative = 4e-16);
            }
            let slope = |v_n: f64| first_derivative(|v| normal_slack(ContactLaw::Coulomb, v, v * 0.0 + s_bar * s_bar), v_n);
            let (above, below) = (slope(0.0), slope(-1e-300));
            assert_relative_eq!(above.0, below.0, max_relative = 1e-15);
            assert_relative_eq!(above.1, below.1, max_relative = 1e-15);
            // below, s is outside the cone and penetration is felt
            let (s0, slope) = slope(-0.1);
            assert!(s0 < s_bar && slope == 0.5);
        }
    }

    #[test]
    fn slack_has_the_derivative_of_the_separating_side_at_the_apex() {
        let (value, slope) = first_derivative(|v| normal_slack(ContactLaw::Coulomb, v, v * 0.0), 0.0);
        assert_eq!((value, slope), (0.0, 1.0));
    }

    #[test]
    fn the_central_path_is_complementary_to_the_slack() {
        for law in [ContactLaw::Coulomb, ContactLaw::Anitescu] {
            for slip in [0.1, 0.7, 30.0] {
                for v_t in [[0.0, 0.0, 0.0], [1e-8, 0.0, 2e-8], [0.3, -0.2, 0.1]] {
                    let kappa = 1e-9;
                    let speed: f64 = v_t.iter().map(|v: &f64| v * v).sum::<f64>().sqrt();
                    let v_n = 1e-6 + if law == ContactLaw::Anitescu { 1.001 * slip * speed } else { 0.0 };
                    assert!(admissible(law, slip, v_n, v_t));
                    let w = central(law, slip, kappa, v_n, v_t);
                    let s = slack(law, slip, v_n, v_t);
                    let inner: f64 = s.iter().zip(w).map(|(s, w)| s * w).sum();
                    // s·w is a difference of two products that can be 1e5 times larger
                    assert!((inner - kappa).abs() < 1e-14 * s[0] * w[0] + 1e-13 * kappa, "{law} {slip} {v_t:?}: {inner}");
                    for a in 1..4 {
                        assert!((s[0] * w[a] + w[0] * s[a]).abs() <= 1e-15 * s[0] * w[0]);
                    }
                    let w_bar = (w[1] * w[1] + w[2] * w[2] + w[3] * w[3]).sqrt();
                    assert!(w_bar < w[0], "inside the friction cone");
                }
            }
        }
    }

    #[test]
    fn without_friction_both_laws_are_a_normal_barrier() {
        for law in [ContactLaw::Coulomb, ContactLaw::Anitescu] {
            let w: [f64; 4] = central(law, 0.0, 1e-8, 1e-4, [2.0, 0.0, 0.0]);
            assert_relative_eq!(w[0], 1e-4, max_relative = 1e-15);
            assert_eq!([w[1], w[2], w[3]].map(f64::abs), [0.0; 3]);
        }
    }

    /// A weight that slides steadily at |v_t| needs w₀ = m g h: Coulomb hovers at κ/(m g) whatever the speed, Anitescu lifts off
    /// by σ h |v_t|.
    #[test]
    fn steady_sliding_lifts_off_under_anitescu_only() {
        let (mass, gravity, h, slip, speed) = (0.02, 9.81, 1e-2, 0.6, 0.5);
        let kappa = 1e-9 * mass * gravity;
        let gap = |law| {
            // w₀ falls monotonically with v_n: bisect w₀(v_n) = m g h
            let (mut low, mut high): (f64, f64) = (if law == ContactLaw::Anitescu { slip * speed } else { 0.0 }, 10.0);
            for _ in 0..200 {
                let middle = 0.5 * (low + high);
                let [w0, ..] = central(law, slip, kappa, middle, [speed, 0.0, 0.0]);
                if w0 > mass * gravity * h { low = middle } else { high = middle }
            }
            h * high
        };
        assert_relative_eq!(gap(ContactLaw::Coulomb), 1e-9, max_relative = 1e-6);
        assert_relative_eq!(gap(ContactLaw::Anitescu), slip * h * speed, max_relative = 1e-5);
    }
}
