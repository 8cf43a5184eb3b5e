//! Coulomb's law at frozen geometry, on the central path: an interior-point method over all contacts at once.
//!
//! Relative velocities are affine in the impulses, u = b + G p. With P = diag(1, μ, μ), p = P w and the compliance C,
//! ```text
//! σ(s) = P (b + G P w) + (C w₀; 0),   σ(s) = (s₀ − |s̄|²/s₀; s̄),   s ∘ w = κ e,   s, w inside the cone
//! ```
//! is the law of [`pliant_smoothing`] with s as an unknown beside w. Where contacts share a load in more ways than one (a box on four
//! corners), only κ decides how: on the way down the central path the shares stay in the middle, where at a small κ Newton's method sees a
//! singular matrix. With the scaling W of Nesterov and Todd, W² w = s, one step solves
//! ```text
//! (L + T W²) dw = T (κ w⁻¹ − s) + σ(s) − (P b + L w),   ds = κ w⁻¹ − s − W² dw,   L = P G P + C,   T = ∂σ/∂s
//! ```
//! Reference: Y. E. Nesterov, M. J. Todd (1997), Math. Oper. Res. 22(1), for the scaling.

use crate::step::constants::STEP;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// A contact's numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CentralContact {
    /// Friction [-].
    pub mu: f64,
    /// Compliance over h² [1/kg].
    pub compliance_per_h2: f64,
    /// Smoothing κ \[J\].
    pub kappa: f64,
}

/// The cone variables w of all contacts, (w₀, w̄ along the two tangents); `None` if the path was lost. `b` are the relative velocities
/// without impulses [m/s], three per contact, `delassus` takes G by columns, of which `fill` writes the three of a contact.
///
/// Of many contacts listed few close. The path is followed for those that would close, and again with those that then would.
pub(crate) fn solve(
    contacts: &[CentralContact],
    b: &[f64],
    delassus: &mut [f64],
    mut fill: impl FnMut(usize, &mut [f64]),
) -> Option<Vec<Vector3<f64>>> {
    let n = b.len();
    let mut closing: Vec<bool> = b.chunks_exact(3).map(|b| b[0] <= 0.0).collect();
    let mut known = vec![false; contacts.len()];
    // no contact leaves the list, so this ends
    loop {
        for (i, columns) in delassus.chunks_exact_mut((3 * n).max(1)).enumerate() {
            if closing[i] && !std::mem::replace(&mut known[i], true) {
                fill(i, columns);
            }
        }
        let delassus = &*delassus;
        let listed: Vec<usize> = (0..contacts.len()).filter(|i| closing[*i]).collect();
        let rows: Vec<usize> = listed.iter().flat_map(|i| 3 * i..3 * i + 3).collect();
        let laws: Vec<CentralContact> = listed.iter().map(|i| contacts[*i]).collect();
        let g: Vec<f64> = rows.iter().flat_map(|c| rows.iter().map(move |r| delassus[c * n + r])).collect();
        let found = follow(&laws, &g, &rows.iter().map(|r| b[*r]).collect::<Vec<f64>>())?;
        let mut w = vec![Vector3::zeros(); contacts.len()];
        listed.iter().zip(found).for_each(|(i, found)| w[*i] = found);
        let mut more = false;
        for (i, contact) in contacts.iter().enumerate() {
            if closing[i] {
                continue;
            }
            let pushed = |j: &usize| {
                let p = [w[*j][0], contacts[*j].mu * w[*j][1], contacts[*j].mu * w[*j][2]];
                (0..3).map(|k| delassus[(3 * j + k) * n + 3 * i] * p[k]).sum::<f64>()
            };
            let opening = b[3 * i] + listed.iter().map(pushed).sum::<f64>();
            (closing[i], more) = (opening <= 0.0, more || opening <= 0.0);
            w[i][0] = contact.kappa / opening.abs().max(f64::MIN_POSITIVE);
        }
        if !more {
            return Some(w);
        }
    }
}

/// The same of contacts that all count.
fn follow(contacts: &[CentralContact], delassus: &[f64], b: &[f64]) -> Option<Vec<Vector3<f64>>> {
    if contacts.is_empty() {
        return Some(Vec::new());
    }
    let (m, n) = (contacts.len(), 3 * contacts.len());
    let scale = |k: usize| if k.is_multiple_of(3) { 1.0 } else { contacts[k / 3].mu };
    let mut l = DMatrix::from_fn(n, n, |r, c| scale(r) * delassus[c * n + r] * scale(c));
    contacts.iter().enumerate().for_each(|(i, contact)| l[(3 * i, 3 * i)] += contact.compliance_per_h2);
    let b = DVector::from_fn(n, |k, _| scale(k) * b[k]);
    let speed = b.amax().max(f64::MIN_POSITIVE);
    // what cannot move along a normal has no mobility there, and needs a size to start from
    let most = (0..m).map(|i| l[(3 * i, 3 * i)]).fold(0.0, f64::max);
    let least = (STEP.least_mobility * most).max(f64::MIN_POSITIVE);
    let alone = |i: usize| speed / l[(3 * i, 3 * i)].max(least);
    let mut s = vec![Vector3::new(speed, 0.0, 0.0); m];
    let mut w: Vec<_> = (0..m).map(|i| Vector3::new(alone(i), 0.0, 0.0)).collect();
    // the κ of this iteration over the law's
    let mut above = s.iter().zip(&w).zip(contacts).map(|((s, w), c)| s.dot(w) / c.kappa).fold(1.0, f64::max);
    for _ in 0..STEP.central_iterations {
        let reached = &b + &l * DVector::from_fn(n, |k, _| w[k / 3][k % 3]);
        let (mut matrix, mut right, mut open) = (l.clone(), DVector::zeros(n), 0.0_f64);
        let mut scalings = Vec::with_capacity(m);
        for (i, contact) in contacts.iter().enumerate() {
            let (sigma, t) = shifted(&s[i]);
            let scaling = scaling(&s[i], &w[i])?;
            let defect = sigma - reached.fixed_rows::<3>(3 * i);
            // none is led away from where it has got
            let kappa = (contact.kappa * above).min(s[i].dot(&w[i]).max(contact.kappa));
            let center = inverse(&w[i]) * kappa - s[i];
            open = open.max(defect.norm());
            right.fixed_rows_mut::<3>(3 * i).copy_from(&(t * center + defect));
            let own = matrix.fixed_view::<3, 3>(3 * i, 3 * i) + t * scaling;
            matrix.fixed_view_mut::<3, 3>(3 * i, 3 * i).copy_from(&own);
            scalings.push((scaling, center));
        }
        if above <= 1.0 && open <= STEP.central_precision * speed {
            return Some(w);
        }
        let step = matrix.lu().solve(&right)?;
        let dw: Vec<Vector3<f64>> = (0..m).map(|i| step.fixed_rows::<3>(3 * i).into_owned()).collect();
        let ds: Vec<Vector3<f64>> = scalings.iter().zip(&dw).map(|((scaling, center), dw)| center - scaling * dw).collect();
        let pairs = s.iter().zip(&ds).chain(w.iter().zip(&dw));
        let alpha = (STEP.central_boundary * pairs.map(|(x, d)| to_boundary(x, d)).fold(f64::INFINITY, f64::min)).min(1.0);
        if !alpha.is_finite() {
            return None;
        }
        s.iter_mut().zip(&ds).for_each(|(s, d)| *s += d * alpha);
        w.iter_mut().zip(&dw).for_each(|(w, d)| *w += d * alpha);
        // as much nearer to κ as the step went towards the path
        above = (above * (1.0 - 0.9 * alpha)).max(1.0);
    }
    None
}

/// σ(s) and its derivative T.
fn shifted(s: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let across2 = s[1] * s[1] + s[2] * s[2];
    let ratio = across2 / (s[0] * s[0]);
    let t = Matrix3::new(1.0 + ratio, -2.0 * s[1] / s[0], -2.0 * s[2] / s[0], 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    (Vector3::new(s[0] - across2 / s[0], s[1], s[2]), t)
}

/// s₀² − |s̄|².
fn determinant(x: &Vector3<f64>) -> f64 {
    let across = x[1].hypot(x[2]);
    (x[0] - across) * (x[0] + across)
}

/// The inverse in the algebra of the cone: x ∘ x⁻¹ = e.
fn inverse(x: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(x[0], -x[1], -x[2]) / determinant(x)
}

/// W², with W² w = s.
fn scaling(s: &Vector3<f64>, w: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let (ds, dw) = (determinant(s), determinant(w));
    if !(ds > 0.0 && dw > 0.0) {
        return None;
    }
    let (s, w) = (s / ds.sqrt(), w / dw.sqrt());
    let gamma = (0.5 * (1.0 + s.dot(&w))).sqrt();
    let point = (s + Vector3::new(w[0], -w[1], -w[2])) / (2.0 * gamma);
    let reflected = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    Some((point * point.transpose() * 2.0 - reflected) * (ds / dw).sqrt())
}

/// The largest step from x along d that stays in the cone.
fn to_boundary(x: &Vector3<f64>, d: &Vector3<f64>) -> f64 {
    let a = d[0] * d[0] - d[1] * d[1] - d[2] * d[2];
    let b = x[0] * d[0] - x[1] * d[1] - x[2] * d[2];
    let c = determinant(x);
    // c + 2 b α + a α² = 0, the smallest positive root; and the apex
    let apex = if d[0] < 0.0 { -x[0] / d[0] } else { f64::INFINITY };
    let discriminant = b * b - a * c;
    if discriminant < 0.0 {
        return apex;
    }
    let q = -(b + discriminant.sqrt().copysign(b));
    let roots = [if a != 0.0 { q / a } else { f64::INFINITY }, if q != 0.0 { c / q } else { f64::INFINITY }];
    roots.into_iter().filter(|x| *x > 0.0).fold(apex, f64::min)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use approx::assert_relative_eq;

    const KAPPA: f64 = 1e-12;

    fn contact(mu: f64) -> CentralContact {
        CentralContact { mu, compliance_per_h2: 0.0, kappa: KAPPA }
    }

    fn solve_with(contacts: &[CentralContact], g: &[f64], b: &[f64]) -> Vec<Vector3<f64>> {
        let size = 3 * b.len();
        solve(contacts, b, &mut vec![f64::NAN; g.len()], |i, columns| columns.copy_from_slice(&g[i * size..][..size])).unwrap()
    }

    /// G of contacts that all push the same free mass: `G = J Jᵀ/m`, the columns of J being (n, s, t).
    fn one_mass(m: f64, contacts: usize) -> Vec<f64> {
        let n = 3 * contacts;
        (0..n * n).map(|k| if k / n % 3 == k % n % 3 { 1.0 / m } else { 0.0 }).collect()
    }

    #[test]
    fn a_mass_is_stopped_and_sticks_or_slides() {
        for (mu, slides) in [(0.9, false), (0.3, true)] {
            let w = solve_with(&[contact(mu)], &one_mass(2.0, 1), &[-1.0, 0.6, 0.0]);
            assert_relative_eq!(w[0][0], 2.0, max_relative = 1e-6);
            let tangential = if slides { -mu * 2.0 } else { -1.2 };
            assert_relative_eq!(mu * w[0][1], tangential, max_relative = 1e-6);
        }
    }

    #[test]
    fn contacts_that_one_would_do_for_share_evenly() {
        let contacts = [contact(0.5); 4];
        let b: Vec<f64> = (0..4).flat_map(|_| [-1.0, 0.1, 0.0]).collect();
        let w = solve_with(&contacts, &one_mass(2.0, 4), &b);
        w.iter().for_each(|w| assert_relative_eq!(w[0], 0.5, max_relative = 1e-4));
    }

    #[test]
    fn what_leaves_is_not_held() {
        let w = solve_with(&[contact(0.5)], &one_mass(1.0, 1), &[0.5, 0.1, 0.0]);
        assert!(w[0][0] > 0.0 && w[0][0] < 1e-6, "{}", w[0][0]);
    }

    /// A mass guided along its floor hits a wall.
    #[test]
    fn a_contact_without_mobility_is_left_alone() {
        let mut g = vec![0.0; 36];
        (0..3).for_each(|k| g[7 * (3 + k)] = 0.5);
        let w = solve_with(&[contact(0.0), contact(0.0)], &g, &[0.2, 0.0, 0.0, -1.0, 0.0, 0.0]);
        assert_relative_eq!(w[1][0], 2.0, max_relative = 1e-6);
        assert!(w[0][0] < 1e-6, "{}", w[0][0]);
    }

    #[test]
    fn the_scaling_takes_w_to_s() {
        let (s, w) = (Vector3::new(2.0, 0.5, -1.0), Vector3::new(0.3, -0.1, 0.2));
        assert_relative_eq!(scaling(&s, &w).unwrap() * w, s, max_relative = 1e-12);
        assert_relative_eq!(to_boundary(&w, &(-w)), 1.0, max_relative = 1e-12);
    }
}
