//! Contacts of solids and ties of a stage: which there may be, how hard each is pushed back on, and where its cone variable starts.
//!
//! They are listed once per stage, from where it begins. What they do is in [`super::spot_forces`].

use super::facets::FacetSpot;
use super::{Stage, Workspace};
use crate::bodies::dynamics::WrenchPartial;
use crate::bodies::operational::{mobilities, yields};
use crate::bodies::spatial::{Force, Motion};
use crate::contact::{FacetLinear, SolidPair, SpotKey, SpotLaw, SpotLinear, SpotState, Tie, TieLaw, TieRows, pose_of_world};
use crate::geometry::solid::{Carrier, Feature, Form, Pose, Posed, candidates, meet};
use crate::terms::Vec3;
use nalgebra::{Matrix6, Vector4};
use pliant_smoothing::{ContactLaw, SplitPoint};

/// Safe fraction of the effective mass as the law's steps ρ.
pub(super) const RHO: f64 = 0.3;
/// Acceleration that makes a weight of a mass in the smoothing of contacts of solids [m/s²]: near gravity's, but no parameter.
pub(crate) const WEIGHT: f64 = 10.0;
/// Softening that leaves nothing of a contact.
const ABSENT: f64 = 1e12;
/// Relative change below which a cone variable has settled: derivatives of friction that almost slips feel its last digits.
const SETTLED: f64 = 1e-10;
/// Reach of a contact \[m\]: beyond it pushes with less than 1e-6 of the weight (hard contact) or 1e-3 (soft, where that would be
/// the whole scene), and is left out.
pub(super) fn reach(rest_gap: f64) -> f64 {
    (1e6 * rest_gap).min((1e3 * rest_gap).max(0.01))
}

/// What the contacts of solids keep through a stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct SpotWorkspace {
    /// Contacts of the stage, and each linearized.
    pub spots: Vec<SpotState>,
    pub linear: Vec<SpotLinear>,
    /// F of each at the last residual [N·s], and the rounding of its w.
    pub f: Vec<Vector4<f64>>,
    pub rounding: Vec<f64>,
    /// Corrections of the cone variables.
    pub dw: Vec<Vector4<f64>>,
    pub dw_next: Vec<Vector4<f64>>,
    /// Forces on bodies (wrench over stage length), and how they change with the own body.
    pub wrenches: Vec<Force<f64>>,
    /// The fastest approach of two solids with a contact, or a step's fall [m/s].
    pub fastest: f64,
    /// The fastest at which one would be pierced if nothing changed its motion [m/s].
    pub closing: f64,
    pub changes: Vec<WrenchPartial>,
    posed: Vec<Posed<f64>>,
    mobility: Vec<Matrix6<f64>>,
    stiffening: Vec<f64>,
    found: Vec<(crate::geometry::solid::Spot, bool)>,
    /// Contacts of facets linearized; they are the last of the spots.
    pub(super) facets: Vec<FacetLinear>,
    /// The shapes that groups of facets may touch, in the world.
    pub(super) fixed: Vec<Posed<f64>>,
    pub(super) features: Vec<Feature>,
}

impl SpotWorkspace {
    /// What |Δw|² of each contact counts by its parts: one over the effective mass along the normal and across [1/kg].
    pub(crate) fn weights(&self) -> impl Iterator<Item = Vector4<f64>> {
        self.spots.iter().map(|s| Vector4::new(RHO / s.rho_n, RHO / s.rho_t, RHO / s.rho_t, RHO / s.rho_t))
    }

    /// Whether solids are near enough to touch within the stage.
    pub(crate) fn touching(&self) -> bool {
        self.spots.iter().any(|s| matches!(s.key, SpotKey::Contact { .. }))
    }
}

impl Stage<'_> {
    /// Whether solids may touch, or are tied.
    pub(crate) fn has_spots(&self) -> bool {
        !(self.model.solid_pairs.is_empty() && self.model.ties.is_empty() && self.model.facet_groups.is_empty())
    }

    /// The law's numbers at a contact of `pair`.
    pub(super) fn spot_law(&self, pair: usize, spot: &SpotState) -> SpotLaw {
        let pair = &self.model.solid_pairs[pair];
        spot_law(
            self.model.contact.law,
            pair,
            spot,
            self.theta,
            [self.h, self.rest_gap],
            if self.absent { ABSENT } else { self.soften },
        )
    }

    /// The numbers of a tie's rows.
    pub(super) fn tie_law(&self, tie: usize, spot: &SpotState) -> TieLaw {
        tie_law(&self.model.ties[tie], spot, self.theta, [self.h, self.rest_gap], self.soften)
    }

    pub(super) fn tie_rows(&self, tie: usize, turn: bool, spot: &SpotState, q: &[f64], ws: &Workspace) -> TieRows {
        let poses = spot.carriers.map(|c| self.pose(c, q, ws));
        self.model.ties[tie].rows(turn, [&poses[0], &poses[1]], self.theta)
    }

    pub(super) fn pose(&self, carrier: Carrier, q: &[f64], ws: &Workspace) -> Pose<f64> {
        pose(carrier, q, &ws.bodies.frames)
    }

    /// Velocity of a carrier about the origin of the frames.
    pub(super) fn velocity(&self, carrier: Carrier, v: &[f64], ws: &Workspace) -> Motion<f64> {
        velocity(carrier, v, &ws.bodies.frames)
    }

    /// Lists the spots of this stage in `ws.spots`, and starts their cone variables: those of the last stage where there are any.
    pub(crate) fn find_spots(&self, ws: &mut Workspace) {
        if !self.has_spots() {
            return;
        }
        let n = self.model.n_node_dofs();
        self.frames_at_start(ws);
        let mut part = std::mem::take(&mut ws.spots);
        part.posed.clear();
        for solid in &self.model.solids {
            part.posed.push(solid.posed(&self.pose(solid.carrier, self.q_ref, ws), |k| self.theta[k]));
        }
        part.spots.clear();
        let g = self.theta[self.model.gravity].abs();
        part.fastest = g * self.h;
        for (k, pair) in self.model.solid_pairs.iter().enumerate() {
            let [a, b] = pair.solids;
            let (pa, pb) = (&part.posed[a], &part.posed[b]);
            let [va, vb] = [a, b].map(|s| self.velocity(self.model.solids[s].carrier, self.v_ref, ws));
            let speed = approach(pa, pb, &(va - vb));
            let margin = reach(self.rest_gap) + 1.5 * self.h * speed + 4.0 * g * self.h * self.h;
            if bound(pa, pb) > margin {
                continue;
            }
            part.found.clear();
            candidates(pa, pb, margin, &mut part.found);
            part.fastest = if part.found.is_empty() { part.fastest } else { part.fastest.max(speed) };
            for &(spot, swapped) in &part.found {
                let solids = if swapped { [b, a] } else { [a, b] };
                let carriers = solids.map(|s| self.model.solids[s].carrier);
                let key = SpotKey::Contact { pair: k, spot, swapped };
                part.spots.push(SpotState { key, carriers, solids, rho_n: 0.0, rho_t: 0.0, gap: 0.0 });
            }
        }
        for (tie, held) in self.model.ties.iter().enumerate() {
            for turn in [false, true].into_iter().take(1 + usize::from(held.relative.is_some())) {
                let key = SpotKey::Tie { tie, turn };
                part.spots.push(SpotState { key, carriers: held.carriers, solids: [0; 2], rho_n: 0.0, rho_t: 0.0, gap: 0.0 });
            }
        }
        part.closing = 0.0;
        let of_solids = part.spots.len();
        self.find_facets(&mut part, &mut ws.between);
        if of_solids > 0 {
            self.weigh_spots(&mut part, n, ws);
        }
        let count = part.spots.len();
        part.f.resize(count, Vector4::zeros());
        part.rounding.resize(count, 0.0);
        part.dw.resize(count, Vector4::zeros());
        part.dw_next.resize(count, Vector4::zeros());
        ws.spots = part;
        ws.it.p.resize(count, Vector4::zeros());
        ws.trial.p.resize(count, Vector4::zeros());
        self.start_spots(ws);
    }

    /// Steps ρ of the law at every spot, from the effective masses there.
    fn weigh_spots(&self, part: &mut SpotWorkspace, n: usize, ws: &mut Workspace) {
        let tree = &self.model.tree;
        part.stiffening.clear();
        part.stiffening.resize(tree.nv() * tree.nv(), 0.0);
        self.joint_stiffening(n, &mut part.stiffening);
        mobilities(tree, &ws.bodies.frames, self.inertias, &part.stiffening, &mut part.mobility);
        let mut closing = 0.0_f64;
        for spot in &mut part.spots {
            let of = |carrier: Carrier, wrench: &Force<f64>| match carrier {
                Carrier::World => 0.0,
                Carrier::Body(body) => yields(&part.mobility[body], wrench),
                Carrier::Node(node) => wrench.f.norm_squared() / self.mass[node].max(f64::MIN_POSITIVE),
            };
            let mobility = |wrench: Force<f64>| of(spot.carriers[0], &wrench) + of(spot.carriers[1], &wrench);
            match spot.key {
                SpotKey::Contact { spot: features, .. } => {
                    let [a, b] = spot.solids;
                    let Ok(meeting) = meet(&features, &part.posed[a], &part.posed[b]) else { continue };
                    let along = |x: Vec3<f64>| mobility(Force::at(&meeting.point, x));
                    let [s, t] = tangents(&meeting.normal);
                    // the largest mobility across the normal
                    let (ss, tt) = (along(s), along(t));
                    let st = 0.25 * (along(s + t) - along(s - t));
                    let across = 0.5 * (ss + tt) + (0.25 * (ss - tt) * (ss - tt) + st * st).sqrt();
                    (spot.rho_n, spot.rho_t) = (RHO / along(meeting.normal), RHO / across);
                    spot.gap = meeting.gap;
                    let [va, vb] = spot.carriers.map(|c| self.velocity(c, self.v_ref, ws));
                    closing = closing.max(-meeting.gap / self.h - (va - vb).at(&meeting.point).dot(&meeting.normal));
                }
                SpotKey::Tie { tie, turn } => {
                    let rows = self.tie_rows(tie, turn, spot, self.q_ref, ws);
                    let unit = |k: usize| rows.wrench(&Vector4::from_fn(|r, _| f64::from(u8::from(r == k + 1))));
                    let most: f64 = (0..3).map(|k| mobility(unit(k))).sum();
                    (spot.rho_n, spot.rho_t) = (RHO / most, RHO / most);
                }
                SpotKey::Facet { .. } => {}
            }
        }
        part.closing = closing;
    }

    /// Cone variables to start from: those of the last stage; of a new contact on the central path.
    pub(crate) fn start_spots(&self, ws: &mut Workspace) {
        for k in 0..ws.spots.spots.len() {
            let spot = ws.spots.spots[k];
            let known = ws.warm.as_ref().and_then(|warm| {
                let at = warm.spots.binary_search_by(|(key, _)| key.cmp(&spot.key)).ok()?;
                Some(warm.spots[at].1)
            });
            ws.it.p[k] = known.unwrap_or_else(|| self.central(&spot, ws));
        }
    }

    /// w on the central path for the gap at the beginning: w₀ v_n = κ, bounded by what closes it.
    fn central(&self, spot: &SpotState, ws: &Workspace) -> Vector4<f64> {
        let (law, gap) = match spot.key {
            SpotKey::Contact { pair, spot: features, .. } => {
                let [a, b] = spot.solids;
                let gap = meet(&features, &ws.spots.posed[a], &ws.spots.posed[b]).map_or(0.0, |m| m.gap);
                (self.spot_law(pair, spot), gap)
            }
            SpotKey::Tie { .. } => return Vector4::zeros(),
            SpotKey::Facet { group, facet, feature } => (self.facet_law(FacetSpot { group, facet, feature }, spot), spot.gap),
        };
        let z = -law.at.rho_n * gap.max(0.0) / self.h;
        let rk = law.at.rho_n * law.at.kappa;
        Vector4::new(2.0 * rk / ((z * z + 4.0 * rk).sqrt() - z), 0.0, 0.0, 0.0)
    }

    /// w in the middle of the central path: where a continuation from a soft contact begins.
    pub(crate) fn soften_spots(&self, ws: &mut Workspace) {
        for (spot, w) in ws.spots.spots.iter().zip(&mut ws.it.p) {
            let law = match spot.key {
                SpotKey::Contact { pair, .. } => self.spot_law(pair, spot),
                SpotKey::Tie { .. } => continue,
                SpotKey::Facet { group, facet, feature } => self.facet_law(FacetSpot { group, facet, feature }, spot),
            };
            *w = Vector4::new((law.at.kappa * law.at.rho_n / RHO).sqrt(), 0.0, 0.0, 0.0);
        }
    }

    /// Rounding noise of all w in the same measure.
    pub(crate) fn spots_rounding2(&self, part: &SpotWorkspace) -> f64 {
        part.spots.iter().zip(&part.rounding).map(|(s, r)| RHO * r * r / s.rho_n.min(s.rho_t)).sum()
    }

    /// Whether the pending changes leave the impulses where they are.
    pub(crate) fn spots_settled(&self, p: &[Vector4<f64>], part: &SpotWorkspace) -> bool {
        let still =
            |((w, dw), rounding): ((&Vector4<f64>, &Vector4<f64>), &f64)| dw.amax() <= (SETTLED * w.amax()).max(4.0 * rounding);
        p.iter().zip(&part.dw).zip(&part.rounding).all(still)
    }
}

/// The numbers of a tie's rows for a stage length and a rest gap.
pub(super) fn tie_law(tie: &Tie, spot: &SpotState, theta: &[f64], [h, rest_gap]: [f64; 2], soften: f64) -> TieLaw {
    let compliance = tie.compliance.map_or(0.0, |k| theta[k]) + rest_gap / tie.weight;
    TieLaw { rho: spot.rho_t, give: compliance / (h * h), soften }
}

/// The law's numbers at a spot for a stage length and a rest gap.
pub(super) fn spot_law(
    law: crate::scene::Law,
    pair: &SolidPair,
    spot: &SpotState,
    theta: &[f64],
    [h, rest_gap]: [f64; 2],
    soften: f64,
) -> SpotLaw {
    SpotLaw {
        law: match law {
            crate::scene::Law::Coulomb => ContactLaw::Coulomb,
            crate::scene::Law::Anitescu => ContactLaw::Anitescu,
        },
        at: SplitPoint {
            mu: pair.friction.value(theta),
            kappa: rest_gap * pair.weight,
            rho_n: spot.rho_n,
            rho_t: spot.rho_t,
            give: pair.compliance.map_or(0.0, |k| theta[k] / (h * h)),
            soften,
        },
    }
}

/// Pose of a carrier seen from the origin of the frames.
pub(crate) fn pose(carrier: Carrier, q: &[f64], frames: &crate::bodies::Frames<f64>) -> Pose<f64> {
    match carrier {
        Carrier::World => pose_of_world(&frames.origin),
        Carrier::Body(body) => {
            let frame = &frames.bodies[body];
            Pose { rotation: frame.rotation, position: frame.position }
        }
        Carrier::Node(node) => {
            let x = Vec3::new(q[3 * node], q[3 * node + 1], q[3 * node + 2]);
            Pose { position: x - frames.origin, ..pose_of_world(&frames.origin) }
        }
    }
}

/// Velocity of a carrier about the origin of the frames.
pub(super) fn velocity(carrier: Carrier, v: &[f64], frames: &crate::bodies::Frames<f64>) -> Motion<f64> {
    match carrier {
        Carrier::World => Motion::zero(),
        Carrier::Body(body) => frames.bodies[body].velocity,
        Carrier::Node(node) => Motion { w: Vec3::zeros(), v: Vec3::new(v[3 * node], v[3 * node + 1], v[3 * node + 2]) },
    }
}

/// A bound of how fast two solids approach anywhere, for the motion of the first relative to the second [m/s].
fn approach(a: &Posed<f64>, b: &Posed<f64>, relative: &Motion<f64>) -> f64 {
    let toward = |solid: &Posed<f64>, down: f64| down.max(0.0) + relative.w.norm() * solid.reach();
    match (a.form, b.form) {
        (Form::HalfSpace, _) => toward(b, relative.at(&b.position).dot(&a.rotation.column(2))),
        (_, Form::HalfSpace) => toward(a, -relative.at(&a.position).dot(&b.rotation.column(2))),
        _ if a.reach() < b.reach() => toward(a, relative.at(&a.position).norm()),
        _ => toward(b, relative.at(&b.position).norm()),
    }
}

/// A lower bound of the distance between two solids \[m\].
fn bound(a: &Posed<f64>, b: &Posed<f64>) -> f64 {
    match (a.form, b.form) {
        (Form::HalfSpace, Form::HalfSpace) => f64::INFINITY,
        (Form::HalfSpace, _) => (b.position - a.position).dot(&a.rotation.column(2)) - b.reach(),
        (_, Form::HalfSpace) => (a.position - b.position).dot(&b.rotation.column(2)) - a.reach(),
        _ => (a.position - b.position).norm() - a.reach() - b.reach(),
    }
}

/// Two unit vectors across a unit vector and each other.
pub(super) fn tangents(n: &Vec3<f64>) -> [Vec3<f64>; 2] {
    let k = n.iamin();
    let mut e = Vec3::zeros();
    e[k] = 1.0;
    let s = n.cross(&e).normalize();
    [s, n.cross(&s)]
}
