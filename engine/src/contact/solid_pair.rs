//! Two solids that may touch, and their contact at one spot linearized.

use super::meeting::Changes;
use crate::bodies::spatial::{Force, Motion, hat, product};
use crate::geometry::solid::{Carrier, Feature, Meeting, Pose, Spot, carried};
use crate::terms::Vec3;
use nalgebra::{Matrix3, Matrix3x6, Matrix4, Matrix4x6, Matrix6, Matrix6x4, SMatrix, Vector4, Vector6};
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

/// Two solids that may touch.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidPair {
    /// Indices of the solids in the model; the normal of a contact points from the second to the first.
    pub solids: [usize; 2],
    /// Coefficient of friction.
    pub friction: Friction,
    /// Index in θ of the compliance [m/N], if it has any.
    pub compliance: Option<usize>,
    /// Weight of the lighter of the two that can move [N], as the scene begins: κ = rest gap × weight. It does not follow θ.
    pub weight: f64,
}

/// What a spot is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum SpotKey {
    /// Two features of a pair of solids.
    Contact {
        /// Index of the pair.
        pair: usize,
        /// Its features.
        spot: Spot,
        /// Whether the pair's second solid is the spot's first.
        swapped: bool,
    },
    /// A tie's points, or its axes.
    Tie {
        /// Index of the tie.
        tie: usize,
        /// Whether it is about the axes.
        turn: bool,
    },
    /// A facet and a feature of a fixed shape.
    Facet {
        /// Index of the group.
        group: usize,
        /// Index of the facet.
        facet: usize,
        /// What of the shape.
        feature: Feature,
    },
}

/// A contact of one step, or a part of a tie, with what the step's beginning says of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SpotState {
    pub key: SpotKey,
    /// What it pushes apart or holds together.
    pub carriers: [Carrier; 2],
    /// Solids of a contact in the spot's order; of a facet's, the fixed shape twice.
    pub solids: [usize; 2],
    /// Steps of the law \[kg\].
    pub rho_n: f64,
    pub rho_t: f64,
    /// Gap where the stage begins \[m\]; 0 of ties.
    pub gap: f64,
}

/// The numbers of the law at a spot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpotLaw {
    pub law: ContactLaw,
    pub at: SplitPoint,
}

impl SpotLaw {
    /// F [N·s].
    pub fn residual(&self, v_n: f64, v_t: &Vec3<f64>, w: &Vector4<f64>) -> Vector4<f64> {
        let at = &self.at;
        match self.law {
            ContactLaw::Coulomb => split_linearize(at, v_n, (*v_t).into(), (*w).into()).f,
            ContactLaw::Anitescu => {
                residual(self.law, at.mu, at.kappa, at.rho_n.min(at.rho_t), v_n, (*v_t).into(), (*w).into()).into()
            }
        }
    }

    /// F with its derivatives.
    pub fn linearize(&self, v_n: f64, v_t: &Vec3<f64>, w: &Vector4<f64>) -> Linearization {
        let at = &self.at;
        match self.law {
            ContactLaw::Coulomb => split_linearize(at, v_n, (*v_t).into(), (*w).into()),
            ContactLaw::Anitescu => linearize(self.law, at.mu, at.kappa, at.rho_n.min(at.rho_t), v_n, (*v_t).into(), (*w).into()),
        }
    }
}

/// Relative motion at a spot.
pub(crate) struct Sliding {
    /// V_A − V_B.
    pub relative: Motion<f64>,
    /// Relative velocity of the points that meet [m/s].
    pub velocity: Vec3<f64>,
    /// Its tangential part [m/s].
    pub v_t: Vec3<f64>,
}

impl Sliding {
    pub fn new(meeting: &Meeting<f64>, relative: Motion<f64>) -> Self {
        let velocity = relative.at(&meeting.point);
        Self { relative, velocity, v_t: velocity - meeting.normal * meeting.normal.dot(&velocity) }
    }
}

/// The wrench on the first solid of the impulse that goes with `w` [N·s about the origin].
pub(crate) fn spot_wrench(meeting: &Meeting<f64>, mu: f64, w: &Vector4<f64>) -> Force<f64> {
    Force::at(&meeting.point, meeting.normal * w[0] + Vec3::new(w[1], w[2], w[3]) * mu)
}

/// A spot linearized at an iterate, its cone variable eliminated. Displacements and velocities are six-vectors about the origin of
/// the evaluation, angular part first; side 0 is the first solid. The wrench is that on the first; on the second it is the opposite.
#[derive(Clone, Debug)]
pub(crate) struct SpotLinear {
    /// F at the iterate [N·s].
    pub f: Vector4<f64>,
    /// F_w and its inverse.
    pub f_w: Matrix4<f64>,
    pub inverse: Matrix4<f64>,
    /// ∂F/∂ξ of each side at fixed velocities, ∂F/∂V of the first side (that of the second is the opposite).
    pub f_xi: [Matrix4x6<f64>; 2],
    pub f_v: Matrix4x6<f64>,
    /// ∂W/∂w.
    pub w_w: Matrix6x4<f64>,
    /// ∂W/∂w F_w⁻¹.
    pub gain: Matrix6x4<f64>,
    /// ∂W/∂ξ of each side at fixed w.
    pub w_xi: [Matrix6<f64>; 2],
    /// ∂F/∂(v_n, μ).
    pub f_vn: Vector4<f64>,
    pub f_mu: Vector4<f64>,
    pub f_vt: SMatrix<f64, 4, 3>,
}

impl SpotLinear {
    /// `moves` says which sides can; derivatives by the others are left zero.
    pub fn new(
        moves: [bool; 2],
        law: &SpotLaw,
        meeting: &Meeting<f64>,
        changes: &Changes,
        sliding: &Sliding,
        h: f64,
        w: &Vector4<f64>,
    ) -> Option<Self> {
        let lin = law.linearize(meeting.gap / h, &sliding.v_t, w);
        if !lin.df_dw_inverse.iter().all(|x| x.is_finite()) {
            return None;
        }
        let (n, c, mu) = (&meeting.normal, &meeting.point, law.at.mu);
        let projector = Matrix3::identity() - n * n.transpose();
        let turning = projector * hat(&sliding.relative.w);
        let along = n.dot(&sliding.velocity);
        let impulse = n * w[0] + Vec3::new(w[1], w[2], w[3]) * mu;
        let f_xi = [0, 1].map(|side| {
            if !moves[side] {
                return Matrix4x6::zeros();
            }
            let dn = &changes.normal[side];
            let dv_t = product(&turning, &changes.point[side]) - dn * along - n * (sliding.velocity.transpose() * dn);
            lin.df_dvn * (changes.gap[side] / h) + product(&lin.df_dvt, &dv_t)
        });
        let w_xi = [0, 1].map(|side| {
            if !moves[side] {
                return Matrix6::zeros();
            }
            let dp = changes.normal[side] * w[0];
            stack(&(product(&hat(c), &dp) - product(&hat(&impulse), &changes.point[side])), &dp)
        });
        let mut by_w = SMatrix::<f64, 3, 4>::zeros();
        by_w.set_column(0, n);
        by_w.fixed_view_mut::<3, 3>(0, 1).fill_diagonal(mu);
        let mut w_w = Matrix6x4::zeros();
        w_w.fixed_view_mut::<3, 4>(0, 0).copy_from(&(hat(c) * by_w));
        w_w.fixed_view_mut::<3, 4>(3, 0).copy_from(&by_w);
        Some(Self {
            f: lin.f,
            f_w: lin.df_dw,
            inverse: lin.df_dw_inverse,
            f_xi,
            f_v: product(&lin.df_dvt, &product(&projector, &carried(c, true))),
            w_w,
            gain: product(&w_w, &lin.df_dw_inverse),
            w_xi,
            f_vn: lin.df_dvn,
            f_mu: lin.df_dmu,
            f_vt: lin.df_dvt,
        })
    }

    /// Of a facet's contact, which moves no body: the law alone.
    pub fn of_law(lin: &Linearization) -> Self {
        Self {
            f: lin.f,
            f_w: lin.df_dw,
            inverse: lin.df_dw_inverse,
            f_xi: [Matrix4x6::zeros(); 2],
            f_v: Matrix4x6::zeros(),
            w_w: Matrix6x4::zeros(),
            gain: Matrix6x4::zeros(),
            w_xi: [Matrix6::zeros(); 2],
            f_vn: lin.df_dvn,
            f_mu: lin.df_dmu,
            f_vt: lin.df_dvt,
        }
    }

    /// ∂W/∂ξ of a side, with w following (`condensed`) or fixed.
    pub fn by_displacement(&self, side: usize, condensed: bool) -> Matrix6<f64> {
        if condensed { self.w_xi[side] - product(&self.gain, &self.f_xi[side]) } else { self.w_xi[side] }
    }

    /// ∂W/∂V of a side.
    pub fn by_velocity(&self, side: usize, condensed: bool) -> Matrix6<f64> {
        if !condensed {
            return Matrix6::zeros();
        }
        let of_first = -product(&self.gain, &self.f_v);
        if side == 0 { of_first } else { -of_first }
    }

    /// The change of w that goes with changes (δξ, δV) of both sides, for the residual `f`.
    pub fn dw(&self, f: &Vector4<f64>, change: &[[Vector6<f64>; 2]; 2]) -> Vector4<f64> {
        let [[xi_a, v_a], [xi_b, v_b]] = change;
        -(self.inverse * (f + self.f_xi[0] * xi_a + self.f_xi[1] * xi_b + self.f_v * (v_a - v_b)))
    }

    /// Rounding of w: that of F through F_w⁻¹.
    pub fn rounding(&self, w: &Vector4<f64>, law: &SpotLaw, v_t: &Vec3<f64>) -> f64 {
        let size = w.norm() + law.at.rho_t * law.at.mu * v_t.norm();
        4.0 * f64::EPSILON * size * self.inverse.norm()
    }
}

fn stack(top: &Matrix3x6<f64>, bottom: &Matrix3x6<f64>) -> Matrix6<f64> {
    let mut m = Matrix6::zeros();
    m.fixed_view_mut::<3, 6>(0, 0).copy_from(top);
    m.fixed_view_mut::<3, 6>(3, 0).copy_from(bottom);
    m
}

/// Pose of a carrier that does not move.
pub(crate) fn pose_of_world(origin: &Vec3<f64>) -> Pose<f64> {
    Pose { rotation: Matrix3::identity(), position: -origin }
}

/// The node that a carrier is, if any.
pub(crate) fn node_of(carrier: Carrier) -> Option<usize> {
    if let Carrier::Node(node) = carrier { Some(node) } else { None }
}

impl SpotKey {
    /// A number that tells spots apart, for comparing which of them touch.
    pub fn fold(&self) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        self.hash(&mut hasher);
        hasher.finish()
    }
}
