//! The smoothed natural residual of a contact and its derivatives, as a Newton iteration uses them.

use crate::{ContactLaw, normal_slack, slack};
use nalgebra::{Matrix4, Matrix4x3, Vector4};
use pliant_math::Real;

// Derivation. Let z = w − ρ s have the eigenvalues λ± = z₀ ± r, r = |z̄|, and write
//   D± = √(λ±² + 4ρκ),   φ± = (D± + λ±)/2,   ψ± = (D± − λ±)/2,   φ± ψ± = ρκ,   φ± − ψ± = λ±.
// P₊(z) has the eigenvalues φ±, so P₊(z) = ((φ₊ + φ₋)/2; (φ₊ − φ₋)/(2r) z̄). With T = D₊ + D₋, Π = D₊ D₋, Φ = φ₊ + φ₋ and
// Ψ = ψ₊ + ψ₋ (so Φ + Ψ = T, Φ − Ψ = 2 z₀), D₊² − D₋² = 4 z₀ r removes every division by r:
//   (φ₊ − φ₋)/(2r) = Φ/T =: k,
//   ∂P₀/∂z₀ = (φ₊/D₊ + φ₋/D₋)/2 =: p,        ∂P₀/∂z̄ = c z̄ᵀ,   ∂P̄/∂z₀ = c z̄,   c = Φ Ψ/(T Π),
//   ∂P̄/∂z̄ = k 1 + e z̄ z̄ᵀ,                   e = (p − k)/r² = −4 z₀ Φ Ψ/(Π T³),
//   ∂P₀/∂κ = ρ T/(2Π),                        ∂k/∂κ = −2ρ z₀/(T Π).
// The complement 1 − ∂P has the same form with φ and ψ exchanged: p → (ψ₊/D₊ + ψ₋/D₋)/2, k → Ψ/T, c → −c, e → −e.
// Its inverse again: p → (D₊/ψ₊ + D₋/ψ₋)/2 = (D₊φ₊ + D₋φ₋)/(2ρκ), k → T/Ψ, c → Φ²/(Tρκ), e → 2Φ²/(T²ρκ); no term cancels.
// T and Π are functions of z₀ and r² alone, which makes the generic form differentiable at r = 0:
//   Π² = (z₀² − r²)² + 8ρκ(z₀² + r²) + (4ρκ)²,   T² = 2(z₀² + r²) + 8ρκ + 2Π,   4ΦΨ = T² − 4z₀².
// F = w − P₊(z) = ρ s − P₊(−z): the first loses nothing where w is small, the second where s is.

/// The natural residual F(w, s) = w − P₊(w − ρ s) [N·s], written once for any scalar; zero exactly where s ∘ w = κ e with both
/// variables inside the cone.
///
/// P₊ is the projection on the second-order cone of R⁴ = R × R³, smoothed after Chen–Harker–Kanzow–Smale: the eigenvalues
/// λ± = z₀ ± |z̄| are mapped by λ ↦ (λ + √(λ² + 4ρκ))/2.
///
/// `slip` σ [-], s̄ = σ v_t; `kappa` > 0 \[J\]; `rho` > 0 \[kg\]: the scale between impulse and velocity, about 0.3 of the contact's effective mass;
/// `v_n` [m/s] normal velocity gap⁺/h; `v_t` [m/s] tangential world vector; `w` = (w₀; w̄) [N·s], w̄ a world vector.
///
/// Limits: smooth everywhere for Anitescu's law; for Coulomb's once continuously differentiable but for the kinks
/// at v_n ≤ 0, v_t = 0, see [`normal_slack`]. Regular at z̄ = 0 and at σ = 0. Nothing cancels, however far an eigenvalue is from zero.
///
/// Reference: Fukushima, Luo, Tseng (2002), section 5; Hayashi, Yamashita, Fukushima (2005).
pub fn residual<S: Real>(law: ContactLaw, slip: S, kappa: S, rho: f64, v_n: S, v_t: [S; 3], w: [S; 4]) -> [S; 4] {
    let s = slack(law, slip, v_n, v_t);
    let z: [S; 4] = std::array::from_fn(|a| w[a] - s[a] * rho);
    let z0 = z[0];
    let r2 = z[1] * z[1] + z[2] * z[2] + z[3] * z[3];
    let four_rk = kappa * (4.0 * rho);
    let (z02, sum) = (z0 * z0, z0 * z0 + r2);
    let tail = four_rk * (sum * 2.0 + four_rk);
    let pi = ((z02 - r2) * (z02 - r2) + tail).sqrt();
    let t = (sum * 2.0 + four_rk * 2.0 + pi * 2.0).sqrt();
    // Π + r² − z₀² without cancellation
    let excess = if r2.re() < z02.re() { tail / (pi + (z02 - r2)) } else { pi + (r2 - z02) };
    let four_phi_psi = (four_rk + excess) * 2.0;
    if z0.re() < 0.0 {
        let phi = four_phi_psi / ((t - z0 * 2.0) * 2.0);
        let k = phi / t;
        [w[0] - phi * 0.5, w[1] - k * z[1], w[2] - k * z[2], w[3] - k * z[3]]
    } else {
        let psi = four_phi_psi / ((t + z0 * 2.0) * 2.0);
        let k = psi / t;
        [s[0] * rho - psi * 0.5, s[1] * rho + k * z[1], s[2] * rho + k * z[2], s[3] * rho + k * z[3]]
    }
}

/// [`residual`] at a point, and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearization {
    /// F [N·s].
    pub f: Vector4<f64>,
    /// ∂F/∂w [-], symmetric.
    pub df_dw: Matrix4<f64>,
    /// (∂F/∂w)⁻¹ [-], by its own formula: nothing is lost where stick or slip makes ∂F/∂w nearly singular.
    pub df_dw_inverse: Matrix4<f64>,
    /// ∂F/∂v_n \[kg\].
    pub df_dvn: Vector4<f64>,
    /// ∂F/∂v_t \[kg\]; row a, column b: component a of F by world component b of v_t.
    pub df_dvt: Matrix4x3<f64>,
    /// ∂F/∂σ [N·s].
    pub df_dslip: Vector4<f64>,
    /// ∂F/∂κ [s/m].
    pub df_dkappa: Vector4<f64>,
}

/// Derivative of a (smoothed) projection: [[p, c z̄ᵀ], [c z̄, k 1 + e z̄ z̄ᵀ]].
struct Slope {
    p: f64,
    c: f64,
    k: f64,
    e: f64,
}

impl Slope {
    #[inline]
    fn matrix(&self, z: &[f64; 3]) -> Matrix4<f64> {
        let (c, k, e) = (self.c, self.k, self.e);
        let [x, y, z] = *z;
        let (cx, cy, cz) = (c * x, c * y, c * z);
        let (ex, ey, ez) = (e * x, e * y, e * z);
        #[rustfmt::skip]
        let m = Matrix4::new(
            self.p, cx, cy, cz,
            cx, k + ex * x, ex * y, ex * z,
            cy, ex * y, k + ey * y, ey * z,
            cz, ex * z, ey * z, k + ez * z,
        );
        m
    }

    /// The matrix times (a; b̄).
    #[inline]
    fn apply(&self, z: &[f64; 3], a: f64, b: &[f64; 3]) -> Vector4<f64> {
        let zb = z[0] * b[0] + z[1] * b[1] + z[2] * b[2];
        let along = self.c * a + self.e * zb;
        Vector4::new(
            self.p * a + self.c * zb,
            self.k * b[0] + along * z[0],
            self.k * b[1] + along * z[1],
            self.k * b[2] + along * z[2],
        )
    }
}

/// [`residual`] in `f64` with all its derivatives by hand, without allocation; arguments and limits as there.
///
/// At the kinks of Coulomb's law (v_n ≤ 0, v_t = 0) the derivatives are those of [`normal_slack`].
pub fn linearize(law: ContactLaw, slip: f64, kappa: f64, rho: f64, v_n: f64, v_t: [f64; 3], w: [f64; 4]) -> Linearization {
    let s_bar = v_t.map(|v| slip * v);
    let s_bar2 = s_bar[0] * s_bar[0] + s_bar[1] * s_bar[1] + s_bar[2] * s_bar[2];
    let s0: f64 = normal_slack(law, v_n, s_bar2);
    let (ds0_dvn, ds0_ds_bar) = slack_slope(law, v_n, s0, s_bar, s_bar2);

    let z0 = w[0] - rho * s0;
    let z = [w[1] - rho * s_bar[0], w[2] - rho * s_bar[1], w[3] - rho * s_bar[2]];
    let r = (z[0] * z[0] + z[1] * z[1] + z[2] * z[2]).sqrt();
    let rk = rho * kappa;
    let (d_plus, phi_plus, psi_plus) = smoothed_parts(z0 + r, rk);
    let (d_minus, phi_minus, psi_minus) = smoothed_parts(z0 - r, rk);
    let (t, pi, phi, psi) = (d_plus + d_minus, d_plus * d_minus, phi_plus + phi_minus, psi_plus + psi_minus);
    let (r_plus, r_minus) = (0.5 / d_plus, 0.5 / d_minus);
    let c = phi * psi / (t * pi);
    let e = -4.0 * z0 * c / (t * t);
    let (k, k_complement) = (phi / t, psi / t);
    let by_z = Slope { p: phi_plus * r_plus + phi_minus * r_minus, c, k, e };
    let complement = Slope { p: psi_plus * r_plus + psi_minus * r_minus, c: -c, k: k_complement, e: -e };

    let along = phi * phi / (t * rk);
    let p_inverse = (d_plus * phi_plus + d_minus * phi_minus) / (2.0 * rk);
    let inverse = Slope { p: p_inverse, c: along, k: t / psi, e: 2.0 * along / t };

    let f = if z0 < 0.0 {
        Vector4::new(w[0] - 0.5 * phi, w[1] - k * z[0], w[2] - k * z[1], w[3] - k * z[2])
    } else {
        let by = |a: usize| rho * s_bar[a] + k_complement * z[a];
        Vector4::new(rho * s0 - 0.5 * psi, by(0), by(1), by(2))
    };
    let by_s = |ds0: f64, ds_bar: &[f64; 3]| by_z.apply(&z, rho * ds0, &ds_bar.map(|s| rho * s));
    let axis = |a: usize| {
        let mut ds_bar = [0.0; 3];
        ds_bar[a] = slip;
        by_s(slip * ds0_ds_bar[a], &ds_bar)
    };
    let ds0_dslip = ds0_ds_bar[0] * v_t[0] + ds0_ds_bar[1] * v_t[1] + ds0_ds_bar[2] * v_t[2];
    let dk_dkappa = -2.0 * rho * z0 / (t * pi);
    Linearization {
        f,
        df_dw: complement.matrix(&z),
        df_dw_inverse: inverse.matrix(&z),
        df_dvn: by_s(ds0_dvn, &[0.0; 3]),
        df_dvt: Matrix4x3::from_columns(&[axis(0), axis(1), axis(2)]),
        df_dslip: by_s(ds0_dslip, &v_t),
        df_dkappa: -Vector4::new(0.5 * rho * t / pi, dk_dkappa * z[0], dk_dkappa * z[1], dk_dkappa * z[2]),
    }
}

/// (D, φ, ψ) of an eigenvalue, each to full relative precision.
#[inline]
pub(crate) fn smoothed_parts(lambda: f64, rho_kappa: f64) -> (f64, f64, f64) {
    let d = (lambda * lambda + 4.0 * rho_kappa).sqrt();
    let large = 0.5 * (d + lambda.abs());
    let small = rho_kappa / large;
    if lambda < 0.0 { (d, small, large) } else { (d, large, small) }
}

/// (∂s₀/∂v_n, ∂s₀/∂s̄).
#[inline]
fn slack_slope(law: ContactLaw, v_n: f64, s0: f64, s_bar: [f64; 3], s_bar2: f64) -> (f64, [f64; 3]) {
    if law == ContactLaw::Anitescu {
        return (1.0, [0.0; 3]);
    }
    if v_n < 0.0 {
        let size = s_bar2.sqrt();
        return (0.5, if size > 0.0 { s_bar.map(|s| s / size) } else { [0.0; 3] });
    }
    let root = (v_n * v_n + 4.0 * s_bar2).sqrt();
    if root == 0.0 { (1.0, [0.0; 3]) } else { (s0 / root, s_bar.map(|s| 2.0 * s / root)) }
}

/// Eigenvalues (x₀ − |x̄|, x₀ + |x̄|) of a cone variable, s [m/s] or w [N·s]; both positive inside the cone. An iteration has
/// settled when those of s and of w change by less than 1e-6 of themselves.
pub fn eigenvalues(x: [f64; 4]) -> (f64, f64) {
    let r = (x[1] * x[1] + x[2] * x[2] + x[3] * x[3]).sqrt();
    (x[0] - r, x[0] + r)
}

#[cfg(test)]
mod tests;
