#![allow(clippy::unwrap_used, clippy::panic)]
use super::*;
use crate::central;
use nalgebra::{SMatrix, SVector, Vector3};
use num_dual::{Derivative, DualSVec64};

const LAWS: [ContactLaw; 2] = [ContactLaw::Coulomb, ContactLaw::Anitescu];
const SLIPS: [f64; 5] = [0.0, 0.05, 0.4, 1.5, 50.0];
const KAPPAS: [f64; 6] = [1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2];
type Dual = DualSVec64<10>;

/// A generator that is the same everywhere; uniform in (−1, 1).
struct Lcg(u64);
impl Lcg {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    fn vector(&mut self, scale: f64) -> [f64; 3] {
        [scale * self.next(), scale * self.next(), scale * self.next()]
    }
}

/// F and its 10 derivatives by (v_n, v_t, w, σ, κ), in that order.
fn automatic(law: ContactLaw, slip: f64, kappa: f64, rho: f64, v_n: f64, v_t: [f64; 3], w: [f64; 4]) -> [Dual; 4] {
    let seed = |value: f64, k: usize| {
        let mut e = SVector::<f64, 10>::zeros();
        e[k] = 1.0;
        Dual::new(value, Derivative::some(e))
    };
    let v_t = std::array::from_fn(|a| seed(v_t[a], 1 + a));
    let w = std::array::from_fn(|a| seed(w[a], 4 + a));
    residual(law, seed(slip, 8), seed(kappa, 9), rho, seed(v_n, 0), v_t, w)
}

fn columns(l: &Linearization) -> [Vector4<f64>; 10] {
    std::array::from_fn(|k| match k {
        0 => l.df_dvn,
        1..4 => l.df_dvt.column(k - 1).into(),
        4..8 => l.df_dw.column(k - 4).into(),
        8 => l.df_dslip,
        _ => l.df_dkappa,
    })
}

/// Points on and around stick, slip and separation, inside and outside the cone, of very different scales.
fn for_points(mut check: impl FnMut(ContactLaw, f64, f64, f64, f64, [f64; 3], [f64; 4])) {
    let mut rng = Lcg(7);
    let rho = 0.3 * 0.01;
    for law in LAWS {
        for slip in SLIPS {
            for kappa in KAPPAS {
                for (v_n, speed, w0, w_bar) in [
                    (1e-7, 1e-9, 1e-3, 5e-4),  // stick
                    (1e-7, 0.3, 1e-3, 1e-3),   // slip
                    (1.0, 0.3, 1e-8, 1e-9),    // separate
                    (-0.5, 0.3, 1e-3, 1e-3),   // penetrate
                    (-1e-6, 1e-6, 1e-9, 1e-9), // near the apex
                    (0.02, 0.01, 3e-5, 3e-5),  // ρ s and w alike
                    (1e-6, 0.0, 1e-3, 0.0),    // nothing tangential
                    (1e-3, 0.4, -1e-3, 1e-3),  // w outside the cone
                ] {
                    for _ in 0..6 {
                        let (v_n, w0) = (v_n * (1.0 + 0.9 * rng.next()), w0 * (1.0 + 0.9 * rng.next()));
                        // the sharper friction, the smaller the speeds at which it turns
                        let (v_t, w_bar) = (rng.vector(speed / slip.max(1.0)), rng.vector(w_bar));
                        check(law, slip, kappa, rho, v_n, v_t, [w0, w_bar[0], w_bar[1], w_bar[2]]);
                    }
                }
            }
        }
    }
}

#[test]
fn kernel_equals_the_automatic_derivatives() {
    let mut worst = (0.0_f64, String::new());
    for_points(|law, slip, kappa, rho, v_n, v_t, w| {
        let l = linearize(law, slip, kappa, rho, v_n, v_t, w);
        let auto = automatic(law, slip, kappa, rho, v_n, v_t, w);
        let f: Vector4<f64> = Vector4::from_fn(|a, _| auto[a].re);
        let mut note = |error: f64, scale: f64, what: String| {
            let relative = if error == 0.0 { 0.0 } else { error / scale };
            if relative > worst.0 || relative.is_nan() {
                worst = (relative, format!("{what} {law} slip {slip} kappa {kappa:e} v_n {v_n:e} v_t {v_t:?} w {w:?}"));
            }
        };
        // F is a difference of terms of this size
        note((f - l.f).amax(), if w[0] > 0.0 { f.amax().max(1e-3 * w[0].abs()) } else { w[0].abs() }, "f".into());
        for (k, column) in columns(&l).iter().enumerate() {
            let expected = Vector4::from_fn(|a, _| auto[a].eps.0.map_or(0.0, |e| e[k]));
            note((expected - column).amax(), column.amax(), format!("column {k}"));
        }
    });
    assert!(worst.0 < 1e-12, "relative difference {:e} at {}", worst.0, worst.1);
}

#[test]
fn closed_form_is_the_root() {
    let mut rng = Lcg(11);
    for law in LAWS {
        for slip in [1e-3, 0.3, 0.8, 1.5] {
            for kappa in KAPPAS {
                for (v_n, speed) in [(1e-7, 0.0), (1e-7, 1e-8), (1e-6, 0.5), (1.0, 0.2), (0.01, 2.0)] {
                    let v_t = rng.vector(speed);
                    let norm = v_t.iter().map(|v| v * v).sum::<f64>().sqrt();
                    let v_n = if law == ContactLaw::Anitescu { 1.01 * slip * norm + v_n } else { v_n };
                    let w = central(law, slip, kappa, v_n, v_t);
                    for rho in [1e-4, 0.03] {
                        let f = residual(law, slip, kappa, rho, v_n, v_t, w);
                        let scale = w[0] + rho * v_n + rho * slip * norm;
                        assert!(f.iter().all(|f| f.abs() < 1e-14 * scale), "{law} {slip} {kappa} {v_n} {v_t:?}: {f:?}");
                    }
                }
            }
        }
    }
}

/// Newton on w at fixed s must land on the closed form, whatever the scales.
#[test]
fn root_of_the_residual_is_complementary() {
    for law in LAWS {
        for slip in SLIPS {
            for kappa in [1e-12, 1e-9, 1e-4] {
                let v_t = [0.1, -0.2, 0.05].map(|v| v / slip.max(1.0));
                let (v_n, rho) = (3e-3 + if law == ContactLaw::Anitescu { 0.4 } else { 0.0 }, 0.003);
                let mut w = Vector4::new(1e-4, 0.0, 0.0, 0.0);
                for _ in 0..60 {
                    let l = linearize(law, slip, kappa, rho, v_n, v_t, w.into());
                    let step = l.df_dw.lu().solve(&l.f).unwrap();
                    // damped: stay where w₀ is positive
                    let shrink = if step[0] > 0.9 * w[0] { 0.9 * w[0] / step[0] } else { 1.0 };
                    w -= step * shrink;
                }
                let root: [f64; 4] = central(law, slip, kappa, v_n, v_t);
                for a in 0..4 {
                    assert!((w[a] - root[a]).abs() < 1e-9 * root[0], "{law} {slip} {kappa}: {w} {root:?}");
                }
                let (low, high) = eigenvalues(w.into());
                assert!(0.0 < low && low <= high);
            }
        }
    }
}

#[test]
fn regular_where_nothing_is_tangential() {
    for law in LAWS {
        for slip in [0.0, 0.5] {
            for (v_n, w0) in [(0.0, 1e-3), (1e-3, 0.0), (-1e-2, 0.0), (0.0, 0.0)] {
                let l = linearize(law, slip, 1e-9, 0.01, v_n, [0.0; 3], [w0, 0.0, 0.0, 0.0]);
                let finite = l.f.iter().chain(columns(&l).iter().flatten()).all(|x| x.is_finite());
                assert!(finite, "{law} {slip} {v_n} {w0}: {l:?}");
                let auto = automatic(law, slip, 1e-9, 0.01, v_n, [0.0; 3], [w0, 0.0, 0.0, 0.0]);
                for (k, column) in columns(&l).iter().enumerate() {
                    for a in 0..4 {
                        let expected = auto[a].eps.0.map_or(0.0, |e| e[k]);
                        assert!((expected - column[a]).abs() <= 1e-12 * column.amax(), "{law} {v_n} {w0}: column {k} row {a}");
                    }
                }
            }
        }
    }
}

/// Componentwise, where a general inverse loses nine digits.
#[test]
fn inverse_is_the_inverse() {
    let mut worst = 0.0_f64;
    for_points(|law, slip, kappa, rho, v_n, v_t, w| {
        let l = linearize(law, slip, kappa, rho, v_n, v_t, w);
        let error = (l.df_dw * l.df_dw_inverse - Matrix4::identity()).abs();
        let rounding = l.df_dw.abs() * l.df_dw_inverse.abs();
        worst = worst.max(error.component_div(&rounding.add_scalar(f64::MIN_POSITIVE)).max());
    });
    assert!(worst < 1e-14, "{worst:e}");
}

/// A mass over a plane with normal z, for [`newton_lands_a_falling_mass`]; unknowns (v⁺, w).
struct FallingMass {
    law: ContactLaw,
    slip: f64,
    kappa: f64,
    mass: f64,
    h: f64,
    gap: f64,
    v: Vector3<f64>,
}

impl FallingMass {
    fn system(&self, y: &SVector<f64, 7>) -> (SVector<f64, 7>, SMatrix<f64, 7, 7>) {
        let Self { law, slip, kappa, mass, h, gap, v } = self;
        let (v_new, w) = (y.fixed_rows::<3>(0), y.fixed_rows::<4>(3));
        let v_t = [v_new[0], v_new[1], 0.0];
        let l = linearize(*law, *slip, *kappa, 0.3 * mass, gap / h + v_new[2], v_t, [w[0], w[1], w[2], w[3]]);
        let mut r = SVector::<f64, 7>::zeros();
        r.fixed_rows_mut::<3>(0).copy_from(&((v_new - v) * *mass - Vector3::new(slip * w[1], slip * w[2], w[0])));
        r.fixed_rows_mut::<4>(3).copy_from(&l.f);
        let mut k = SMatrix::<f64, 7, 7>::zeros();
        k.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(*mass);
        (k[(0, 4)], k[(1, 5)], k[(2, 3)]) = (-slip, -slip, -1.0);
        k.fixed_view_mut::<4, 2>(3, 0).copy_from(&l.df_dvt.fixed_columns::<2>(0));
        k.fixed_view_mut::<4, 1>(3, 2).copy_from(&l.df_dvn);
        k.fixed_view_mut::<4, 4>(3, 3).copy_from(&l.df_dw);
        (r, k)
    }

    /// Iterations of Newton's method with the natural monotonicity test, and the root.
    fn newton(&self) -> Option<(usize, SVector<f64, 7>)> {
        let norm = |d: &SVector<f64, 7>| (d.rows(0, 3).norm_squared() + d.rows(3, 4).norm_squared() / self.mass.powi(2)).sqrt();
        let mut y = SVector::<f64, 7>::zeros();
        y.fixed_rows_mut::<3>(0).copy_from(&self.v);
        y[3] = (self.kappa * self.mass).sqrt();
        for iteration in 1..30 {
            let (r, k) = self.system(&y);
            let factor = k.lu();
            let d = -factor.solve(&r)?;
            let mut alpha = 1.0;
            loop {
                let trial = y + d * alpha;
                let next = norm(&factor.solve(&self.system(&trial).0)?);
                if next <= (1.0 - alpha / 4.0) * norm(&d) || norm(&d) < 1e-10 {
                    y = trial;
                    if next < 1e-10 && alpha == 1.0 {
                        return Some((iteration, y));
                    }
                    break;
                }
                alpha *= 0.5;
                if alpha < 1e-3 {
                    return None;
                }
            }
        }
        None
    }
}

/// From a first guess that penetrates, with and without sliding: Newton's method must see the penetration.
#[test]
fn newton_lands_a_falling_mass() {
    for law in LAWS {
        for slip in [0.0, 0.3, 1.0] {
            for speed in [0.0, 1e-6, 0.5] {
                let (mass, h, gap, v) = (0.01, 0.005, 0.004, Vector3::new(speed, 0.0, -2.0));
                let falling = FallingMass { law, slip, kappa: 1e-9 * mass * 9.81, mass, h, gap, v };
                let (iterations, y) = falling.newton().unwrap_or_else(|| panic!("{law} slip {slip} speed {speed}: stuck"));
                assert!(iterations <= 8, "{law} slip {slip} speed {speed}: {iterations} iterations");
                assert!(gap + h * y[2] > 0.0 && y[3] > 0.0);
            }
        }
    }
}
