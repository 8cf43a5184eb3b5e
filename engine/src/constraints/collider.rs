//! Colliders that may touch, and their contact linearized under the split law.

use super::distance_change::Changes;
use super::{CONSTRAINTS, LinkLinear, contact_law, slip};
use crate::geometry::collider::{ContactGeometry, carried};
use nalgebra::{Matrix3, SMatrix, Vector4};
use pliant_math::Vec3;
use pliant_math::spatial::{Force, Motion, hat, product};
use pliant_smoothing::{ContactLaw, Linearization, SplitPoint, linearize, residual, split_linearize};

/// Where a pair's coefficient of friction comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Friction {
    /// This entry of θ.
    Of(usize),
    /// The mean of two entries: each solid has one of its own.
    Mean(usize, usize),
}

impl Friction {
    /// The coefficient [-].
    pub fn value(self, theta: &[f64]) -> f64 {
        self.entries().into_iter().flatten().map(|(k, share)| share * theta[k]).sum()
    }

    /// Entries of θ and their shares.
    pub fn entries(self) -> [Option<(usize, f64)>; 2] {
        match self {
            Self::Of(k) => [Some((k, 1.0)), None],
            Self::Mean(a, b) => [Some((a, 0.5)), Some((b, 0.5))],
        }
    }
}

/// Two colliders that may touch.
#[derive(Clone, Debug, PartialEq)]
pub struct ColliderPair {
    /// Indices of the colliders in the model; the normal of a contact points from the second to the first.
    pub colliders: [usize; 2],
    /// Coefficient of friction.
    pub friction: Friction,
    /// Index in θ of the compliance [m/N], if it has any.
    pub compliance: Option<usize>,
    /// Weight of the lighter of the two that can move [N], as the scene begins: κ = rest gap × weight. It does not follow θ.
    pub weight: f64,
}

/// The numbers of the split law at a contact.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplitLaw {
    pub law: ContactLaw,
    /// Friction μ, and the slip factor's derivative by it [-].
    pub mu: f64,
    pub slip_by_mu: f64,
    pub at: SplitPoint,
    /// Whether the tangential part is left as it is: see [`SplitLaw::for_search`].
    pub idle: bool,
}

impl SplitLaw {
    /// F [N·s].
    pub fn residual(&self, v_n: f64, v_t: &Vec3<f64>, w: &Vector4<f64>) -> Vector4<f64> {
        let at = &self.at;
        if self.idle {
            return self.linearize(v_n, v_t, w).f;
        }
        match self.law {
            ContactLaw::Coulomb => split_linearize(at, v_n, (*v_t).into(), (*w).into()).f,
            ContactLaw::Anitescu => {
                residual(self.law, at.slip, at.kappa, at.rho_n.min(at.rho_t), v_n, (*v_t).into(), (*w).into()).into()
            }
        }
    }

    /// F with its derivatives.
    pub fn linearize(&self, v_n: f64, v_t: &Vec3<f64>, w: &Vector4<f64>) -> Linearization {
        let at = &self.at;
        match self.law {
            ContactLaw::Coulomb if self.idle => {
                let mut lin = split_linearize(at, v_n, (*v_t).into(), (*w).into());
                for x in [&mut lin.f, &mut lin.df_dvn] {
                    x.fixed_rows_mut::<3>(1).fill(0.0);
                }
                for m in [&mut lin.df_dw, &mut lin.df_dw_inverse] {
                    m.fixed_view_mut::<3, 1>(1, 0).fill(0.0);
                    m.fixed_view_mut::<3, 3>(1, 1).copy_from(&Matrix3::identity());
                }
                lin.df_dvt.fill(0.0);
                lin
            }
            ContactLaw::Coulomb => split_linearize(at, v_n, (*v_t).into(), (*w).into()),
            ContactLaw::Anitescu => {
                linearize(self.law, at.slip, at.kappa, at.rho_n.min(at.rho_t), v_n, (*v_t).into(), (*w).into())
            }
        }
    }
}

/// Relative motion at a contact.
pub(crate) struct Sliding {
    /// V_A − V_B.
    pub relative: Motion<f64>,
    /// Relative velocity of the points that meet [m/s].
    pub velocity: Vec3<f64>,
    /// Its tangential part [m/s].
    pub v_t: Vec3<f64>,
}

impl Sliding {
    pub fn new(geometry: &ContactGeometry<f64>, relative: Motion<f64>) -> Self {
        let velocity = relative.at(&geometry.point);
        Self { relative, velocity, v_t: velocity - geometry.normal * geometry.normal.dot(&velocity) }
    }
}

/// The wrench on the first solid of the impulse that goes with `w` [N·s about the origin].
pub(crate) fn contact_wrench(geometry: &ContactGeometry<f64>, mu: f64, w: &Vector4<f64>) -> Force<f64> {
    Force::at(&geometry.point, geometry.normal * w[0] + Vec3::new(w[1], w[2], w[3]) * mu)
}

impl LinkLinear {
    /// Becomes that of a contact; false if its law has no finite derivative. `moves` says which sides can; derivatives by the others are
    /// left zero.
    #[allow(clippy::too_many_arguments)] // what a contact is linearized at
    pub fn set_contact(
        &mut self,
        moves: [bool; 2],
        law: &SplitLaw,
        geometry: &ContactGeometry<f64>,
        changes: &Changes,
        sliding: &Sliding,
        h: f64,
        w: &Vector4<f64>,
    ) -> bool {
        let lin = law.linearize(geometry.gap / h, &sliding.v_t, w);
        if !lin.df_dw_inverse.iter().all(|x| x.is_finite()) {
            return false;
        }
        let (n, c, mu) = (&geometry.normal, &geometry.point, law.mu);
        let projector = Matrix3::identity() - n * n.transpose();
        let turning = projector * hat(&sliding.relative.w);
        let along = n.dot(&sliding.velocity);
        let impulse = n * w[0] + Vec3::new(w[1], w[2], w[3]) * mu;
        for side in (0..2).filter(|side| moves[*side]) {
            let dn = &changes.normal[side];
            let dv_t = product(&turning, &changes.point[side]) - dn * along - n * (sliding.velocity.transpose() * dn);
            self.f_xi[side] = lin.df_dvn * (changes.gap[side] / h) + product(&lin.df_dvt, &dv_t);
            let dp = dn * w[0];
            let turn = product(&hat(c), &dp) - product(&hat(&impulse), &changes.point[side]);
            self.w_xi[side].fixed_view_mut::<3, 6>(0, 0).copy_from(&turn);
            self.w_xi[side].fixed_view_mut::<3, 6>(3, 0).copy_from(&dp);
        }
        let mut by_w = SMatrix::<f64, 3, 4>::zeros();
        by_w.set_column(0, n);
        by_w.fixed_view_mut::<3, 3>(0, 1).fill_diagonal(mu);
        self.w_w.fixed_view_mut::<3, 4>(0, 0).copy_from(&product(&hat(c), &by_w));
        self.w_w.fixed_view_mut::<3, 4>(3, 0).copy_from(&by_w);
        self.gain = product(&self.w_w, &lin.df_dw_inverse);
        self.f_v = product(&lin.df_dvt, &product(&projector, &carried(c, true)));
        (self.f, self.f_w, self.inverse) = (lin.f, lin.df_dw, lin.df_dw_inverse);
        (self.f_vn, self.f_mu, self.f_vt) = (lin.df_dvn, lin.df_dslip * law.slip_by_mu, lin.df_dvt);
        true
    }
}

/// The law's numbers at a contact of `pair` for a stage length and a rest gap.
pub(crate) fn body_contact_law(
    law: pliant_scene::Law,
    pair: &ColliderPair,
    [rho_n, rho_t]: [f64; 2],
    theta: &[f64],
    [h, rest_gap, sharpness]: [f64; 3],
    regularization: f64,
) -> SplitLaw {
    let at = SplitPoint {
        slip: 0.0,
        kappa: rest_gap * pair.weight,
        rho_n,
        rho_t,
        compliance_per_h2: pair.compliance.map_or(0.0, |k| theta[k] / (h * h)),
        regularization,
    };
    SplitLaw::new(law, pair.friction.value(theta), sharpness, at)
}

impl SplitLaw {
    /// With the slip factor of μ and ε, and ρ_t as sharp: `at` has that of ε = 1.
    pub fn new(law: pliant_scene::Law, mu: f64, sharpness: f64, at: SplitPoint) -> Self {
        let (slip, slip_by_mu) = slip(law, mu, sharpness);
        let rho_t = if law == pliant_scene::Law::Coulomb { at.rho_t * sharpness } else { at.rho_t };
        Self { law: contact_law(law), mu, slip_by_mu, at: SplitPoint { slip, rho_t, ..at }, idle: false }
    }

    /// As Newton's method sees it away from the root. Without friction the tangential part of w pushes nothing: it says only which way friction
    /// would act, for the derivative by μ. To look for it among the other unknowns cost most of the steps of bodies without friction
    /// that were not solved; it is left out, and follows from what the root slides ([`SplitLaw::settled`]).
    pub fn for_search(self, at_root: bool) -> Self {
        Self { idle: !at_root && self.is_idle(), ..self }
    }

    /// Whether the tangential part pushes nothing.
    pub fn is_idle(&self) -> bool {
        self.mu == 0.0 && self.law == ContactLaw::Coulomb
    }

    /// w with its tangential part from w₀ and the sliding velocity: with s̄ = σ v_t, w₀ v_n = κ and s₀ (w₀² − |w̄|²) = κ w₀,
    /// ```text
    /// w̄ = −2 w₀² s̄/(κ + √(κ² + 4 |s̄|² w₀²))
    /// ```
    pub fn settled(&self, v_t: &Vec3<f64>, w0: f64) -> Vector4<f64> {
        let (s, kappa) = (v_t * self.at.slip, self.at.kappa);
        let w_bar = s * (-2.0 * w0 * w0 / (kappa + kappa.hypot(2.0 * s.norm() * w0)));
        Vector4::new(w0, w_bar[0], w_bar[1], w_bar[2])
    }

    /// w on the central path for a signed distance: w₀ v_n = κ, bounded by what closes it.
    pub fn central(&self, gap: f64, h: f64) -> Vector4<f64> {
        let z = -self.at.rho_n * gap.max(0.0) / h;
        let rk = self.at.rho_n * self.at.kappa;
        Vector4::new(2.0 * rk / ((z * z + 4.0 * rk).sqrt() - z), 0.0, 0.0, 0.0)
    }

    /// w in the middle of the central path.
    pub fn middle(&self) -> Vector4<f64> {
        Vector4::new((self.at.kappa * self.at.rho_n / CONSTRAINTS.rho).sqrt(), 0.0, 0.0, 0.0)
    }
}
