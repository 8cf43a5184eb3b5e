//! Constraints: what a step solves for beside velocities. A kind of constraint is a
//! file here, its law beside it in [`crate::constraints`], and a line in [`Constraints`].
//!
//! Every constraint has multipliers λ (impulses, or a cone variable w ∈ R⁴) and as many residuals F(λ; q⁺, v⁺) = 0. One Newton step
//! eliminates them,
//! ```text
//! dλ = −F_λ⁻¹ (F + F_v dv),     F_v = ∂F/∂v⁺ with positions moving along
//! ```
//! and what is left acts on nodes, bodies or joints like a force p(λ − F_λ⁻¹ F)/h with derivatives by q⁺ and v⁺ ("condensed"), so that to
//! everything else a constraint is one more force. The derivatives of a step use the system in which λ are still unknowns
//! ([`crate::step`]'s record): condensed, a contact 1e7 times stiffer than the rope leaves its entries nine digits.
//!
//! | kind | multipliers | acts on | file |
//! |---|---|---|---|
//! | joint friction, limits, couplings | one impulse [N·m·s, N·s] | one or two joint coordinates | `joint`, laws in `joint_law`, `coupling` |
//! | contact of a node with a shape | w [N·s], the natural residual of the cone | the node | `node_contact` |
//! | contact of colliders | w, the split residual | two frames (bodies, nodes, world) | `body_contact` |
//! | loop closure | three impulses (w₀ is idle) | two frames | `closure` |
//! | contact of an edge or triangle with a shape | w, the split residual | two or three nodes | `edge_contact` |
//!
//! Grippers that grasp pull by springs that are explicit in the state ([`crate::grasp`]), which makes them forces.
//! Constraints between two frames share [`link`]: wrenches, their derivatives, and which degrees of freedom they reach.

mod body_contact;
mod closure;
mod edge_contact;
mod joint;
mod link;
mod node_contact;
mod record;
mod warm;

pub(crate) use body_contact::{BodyContact, BodyContacts, tangents};
pub(crate) use closure::Closures;
pub(crate) use edge_contact::EdgeContacts;
pub(crate) use joint::JointConstraints;
pub(crate) use link::{Link, Moved};
pub(crate) use node_contact::{NodeContacts, for_inputs as for_node_inputs};
pub(crate) use record::{Block, ConeRecord, ConstraintRecords, DofPartial, InputsAt, JointRecord, LinkDof, RecordAt};
pub(crate) use warm::WarmImpulses;

use crate::bodies::Frames;
use crate::geometry::collider::Feature;
use crate::step::blocks::UnconstrainedBlocks;
use crate::step::constants::STEP;
use crate::step::impact_check::Approach;
use crate::step::{Stage, StepError};
use nalgebra::{Matrix6, Vector4};
use pliant_linalg::{NodeMatrix, System};
use pliant_math::spatial::Force;

/// Where constraints are evaluated.
#[derive(Clone, Copy)]
pub(crate) struct Evaluation<'a> {
    /// Coordinates q̄, which are q⁺ in all schemes that allow constraints.
    pub q: &'a [f64],
    /// Velocities v⁺.
    pub v: &'a [f64],
    /// Frames of the bodies there.
    pub frames: &'a Frames<f64>,
    /// Blocks of the nodes' matrices at the last linearization, for [`Stage::resisting_mass`].
    pub blocks: &'a UnconstrainedBlocks,
    /// Whether it is the root, where residuals of constraints are rounding: a stiff law makes an impulse of that, which is not to count
    /// as a load.
    pub at_root: bool,
}

/// Forces of constraints, accumulated.
pub(crate) struct Loads<'a> {
    /// On rows of nodes and twists \[N\].
    pub nodes: &'a mut [f64],
    /// On bodies, about the origin of the frames; empty where no constraint reaches a body.
    pub bodies: &'a mut [Force<f64>],
    /// On degrees of freedom of joints, row by row [N·m, N].
    pub joints: &'a mut Vec<(usize, f64)>,
}

/// Derivatives of condensed forces, accumulated; those on bodies follow from [`ConstraintSet::links`].
pub(crate) struct Slopes<'a> {
    /// ∂f/∂q̄ and ∂f/∂v̄ of nodes.
    pub dq: &'a mut NodeMatrix,
    pub dv: &'a mut NodeMatrix,
    /// Entries of K at degrees of freedom of joints: row, column, value.
    pub joints: &'a mut Vec<(usize, usize, f64)>,
}

/// The beginning of a stage, from which constraints are listed.
pub(crate) struct Beginning<'a> {
    pub frames: &'a Frames<f64>,
    /// Where the bodies would be at the end of the stage if nothing changed their motion, and those coordinates.
    pub ahead: &'a Frames<f64>,
    pub q_ahead: &'a [f64],
    /// Inverse inertia of every body with all joints yielding; empty before any set asks for it.
    pub mobility: &'a [Matrix6<f64>],
}

/// A change of velocities, and how it shows up at constraints.
pub(crate) struct Change<'a> {
    /// dv of all rows.
    pub d: &'a [f64],
    /// The displacement and change of velocity of every body that go with it; empty where no constraint reaches a body.
    pub bodies: &'a [Moved],
    pub frames: &'a Frames<f64>,
}

/// All constraints of one kind in a stage. Multipliers are numbered in the order of the set's constraints; `lambda`, residuals and
/// corrections are the set's own part of the whole.
pub(crate) trait ConstraintSet {
    /// Lists the constraints that may act within the stage, from where it begins.
    fn find(&mut self, _stage: &Stage, _at: &Beginning) {}

    /// Sets the steps ρ of the laws from the effective masses at the constraints.
    fn scale(&mut self, _stage: &Stage, _at: &Beginning) {}

    /// Constraints between two frames, in their order, with four multipliers each: a set of these needs no more than the defaults below.
    fn links(&self) -> &[Link] {
        &[]
    }

    /// Number of multipliers.
    fn dim(&self) -> usize {
        4 * self.links().len()
    }

    /// Residuals F into `out`, and the condensed forces for what was linearized before.
    fn residual(
        &mut self,
        stage: &Stage,
        at: &Evaluation,
        lambda: &[f64],
        out: &mut [f64],
        loads: &mut Loads,
    ) -> Result<(), StepError>;

    /// As [`ConstraintSet::residual`], linearizing.
    fn linearize(
        &mut self,
        stage: &Stage,
        at: &Evaluation,
        lambda: &[f64],
        out: &mut [f64],
        loads: &mut Loads,
        slopes: &mut Slopes,
    ) -> Result<(), StepError>;

    /// dλ that goes with a change of velocities, for the residuals at hand.
    fn correct(&self, stage: &Stage, change: &Change, residual: &[f64], d: &mut [f64]) {
        for (k, (link, d)) in self.links().iter().zip(d.chunks_exact_mut(4)).enumerate() {
            d.copy_from_slice(link.correct(stage, change, &cone(residual, k)).as_slice());
        }
    }

    /// Sets multipliers that push nothing to what the law makes of the others, at the root.
    fn settle(&self, _stage: &Stage, _at: &Evaluation, _lambda: &mut [f64]) -> Result<(), StepError> {
        Ok(())
    }

    /// Weights of |dλ|² in the norm of corrections: one over the effective mass [1/kg, 1/(kg·m²)].
    fn weights(&self, _stage: &Stage, out: &mut [f64]) {
        self.links().iter().zip(out.chunks_exact_mut(4)).for_each(|(link, out)| out.copy_from_slice(&link.weights()));
    }

    /// λ of the last stage, where there are any.
    fn start(&self, stage: &Stage, warm: Option<&WarmImpulses>, lambda: &mut [f64]);

    /// λ to start from without knowing the last stage's; features that were listed anew start as in [`ConstraintSet::start`].
    fn start_cold(&self, stage: &Stage, warm: Option<&WarmImpulses>, lambda: &mut [f64]) {
        self.start(stage, warm, lambda);
    }

    /// λ in the middle of the central path at the stage's rest gap: where a continuation from a soft contact begins.
    fn start_soft(&self, _stage: &Stage, _lambda: &mut [f64]) {}

    /// Keeps λ for the next stage.
    fn keep(&self, lambda: &[f64], warm: &mut WarmImpulses) {
        warm.listed.extend(self.links().iter().enumerate().map(|(k, link)| (link.id, cone(lambda, k))));
    }

    /// Adds the constraints, linearized at the root, to the record of the stage.
    fn record(&self, stage: &Stage, at: &mut RecordAt, lambda: &[f64], out: &mut ConstraintRecords) {
        self.links().iter().enumerate().for_each(|(k, link)| stage.record_link(link, cone(lambda, k), at, out));
    }

    /// Whether all residuals are rounding: `unit` of the multipliers and of what moves as fast as `speed` [m/s] in the laws' steps.
    fn at_rounding(&self, _stage: &Stage, lambda: &[f64], residuals: &[f64], unit: f64, speed: f64) -> bool {
        let steps = self.links().iter().map(|link| link.rho_n.max(link.rho_t));
        cones_at_rounding(lambda, residuals, steps, unit, speed)
    }

    /// Least signed distance among the constraints that this stage has listed, where it begins \[m\].
    fn least_gap(&self) -> f64 {
        f64::INFINITY
    }

    /// How constraints that may open have come nearer in this stage, `at` its root.
    fn visit_approaches(&self, _stage: &Stage, _at: &Evaluation, _lambda: &[f64], _visit: &mut dyn FnMut(Approach)) {}

    /// Pairs of different nodes that one constraint joins, of which the first is free.
    fn joined_nodes(&self, _stage: &Stage, _pairs: &mut Vec<[usize; 2]>) {}

    /// Calls `add(node, ∂p/∂q⁺/h at fixed λ)` for what constraints do to single nodes.
    fn visit_fixed_blocks(&self, stage: &Stage, add: &mut dyn FnMut(usize, [[f64; 3]; 3])) {
        self.links().iter().for_each(|link| link.visit_fixed_blocks(stage.h, add));
    }

    /// Adds what constraints do at fixed λ, beside [`ConstraintSet::visit_fixed_blocks`] and links, to ∂f/∂q̄ and A.
    fn add_fixed(&self, _stage: &Stage, _lambda: &[f64], _dq: &mut System, _a: &mut System) {}
}

/// The constraints of a stage, set by set.
#[derive(Clone, Debug, Default)]
pub(crate) struct Constraints {
    pub joints: JointConstraints,
    pub nodes: NodeContacts,
    pub bodies: BodyContacts,
    pub closures: Closures,
    pub edges: EdgeContacts,
}

impl Constraints {
    /// All sets, in the order of their multipliers: here a new kind is registered.
    pub fn sets(&self) -> [&dyn ConstraintSet; 5] {
        [&self.joints, &self.nodes, &self.bodies, &self.closures, &self.edges]
    }

    /// The same.
    pub fn sets_mut(&mut self) -> [&mut dyn ConstraintSet; 5] {
        [&mut self.joints, &mut self.nodes, &mut self.bodies, &mut self.closures, &mut self.edges]
    }

    /// Number of all multipliers.
    pub fn dim(&self) -> usize {
        self.sets().iter().map(|set| set.dim()).sum()
    }

    /// Constraints between two frames.
    pub fn links(&self) -> impl Iterator<Item = &Link> + Clone {
        self.bodies.links().iter().chain(self.closures.links())
    }

    /// Whether a constraint reaches a body or joins two frames.
    pub fn has_links(&self) -> bool {
        self.links().next().is_some()
    }

    /// Whether a constraint is listed that was looked for in this stage: a contact of colliders, edges or triangles, or a closure.
    pub fn any_listed(&self) -> bool {
        self.bodies.dim() + self.closures.dim() + self.edges.dim() > 0
    }

    /// Every set that has multipliers, with its part of `lambda`.
    pub fn parts<'a>(&'a self, lambda: &'a [f64]) -> impl Iterator<Item = (&'a dyn ConstraintSet, &'a [f64])> {
        let mut rest = lambda;
        let part = move |set: &'a dyn ConstraintSet| {
            let (own, others) = rest.split_at(set.dim());
            rest = others;
            (set, own)
        };
        let sets = (!lambda.is_empty()).then(|| self.sets());
        sets.into_iter().flatten().map(part).filter(|(_, own)| !own.is_empty())
    }

    /// Calls `each` with every set that has multipliers, and its part of `lambda`.
    pub fn for_parts(&self, lambda: &mut [f64], mut each: impl FnMut(&dyn ConstraintSet, &mut [f64])) {
        let mut rest = lambda;
        for set in self.sets() {
            if rest.is_empty() {
                break;
            }
            let (own, others) = std::mem::take(&mut rest).split_at_mut(set.dim());
            if !own.is_empty() {
                each(set, own);
            }
            rest = others;
        }
    }

    /// First multiplier of the node contacts, of contacts of colliders, of closures, and of edges and triangles.
    pub fn starts(&self) -> [usize; 4] {
        let mut at = self.joints.dim();
        [self.nodes.dim(), self.bodies.dim(), self.closures.dim(), 0].map(|dim| {
            at += dim;
            at - dim
        })
    }
}

/// Which constraint an impulse belongs to, from one stage to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum ConstraintId {
    /// A pair of node and shape, by its index.
    Node(usize),
    /// Two features of a pair of colliders.
    Bodies {
        /// Index of the pair.
        pair: usize,
        /// Its features.
        features: crate::geometry::collider::FeaturePair,
        /// Whether the pair's second collider is the first of the features.
        swapped: bool,
    },
    /// A loop closure's points, or its axes.
    Closure {
        /// Index of the closure.
        closure: usize,
        /// Whether it is about the axes.
        turn: bool,
    },
    /// An edge or triangle and a feature of a fixed shape.
    Edge(EdgeId),
}

/// An edge or triangle and a feature of a fixed shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct EdgeId {
    /// Index of the group.
    pub group: usize,
    /// Index of the edge or triangle.
    pub element: usize,
    /// Feature of the shape.
    pub feature: Feature,
}

impl ConstraintId {
    /// A number that tells constraints apart, for comparing which of them act.
    pub fn fold(&self) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        self.hash(&mut hasher);
        hasher.finish()
    }
}

/// The cone variable of constraint `k`.
pub(crate) fn cone(lambda: &[f64], k: usize) -> Vector4<f64> {
    Vector4::from_column_slice(&lambda[4 * k..4 * k + 4])
}

/// [`ConstraintSet::at_rounding`] of cone variables, by the laws' steps ρ \[kg\].
fn cones_at_rounding(lambda: &[f64], residuals: &[f64], steps: impl Iterator<Item = f64>, unit: f64, speed: f64) -> bool {
    let largest = |x: &[f64]| x.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    let cones = lambda.chunks_exact(4).zip(residuals.chunks_exact(4)).zip(steps);
    cones.into_iter().all(|((w, f), rho)| largest(f) <= unit * (largest(w) + rho * speed))
}

impl Stage<'_> {
    /// Signed distance \[m\] that a contact must have where the stage ends, for that where it begins. A contact that begins deeper than it could
    /// have got within a step is one that was not listed before, or that the scene begins with. To demand that it be open at the end of the
    /// stage would throw things apart with depth/h, the faster the shorter the step; it has to open by `recovery`·h² only.
    pub(crate) fn target(&self, gap: f64) -> f64 {
        (gap + STEP.recovery * self.h * self.h).min(0.0)
    }
}

/// Reach of a contact \[m\]: beyond it pushes with less than 1e-6 of the weight (hard contact) or 1e-3 (soft, where that would be
/// the whole scene), and is left out.
pub(crate) fn reach(rest_gap: f64) -> f64 {
    (1e6 * rest_gap).min((1e3 * rest_gap).max(0.01))
}
