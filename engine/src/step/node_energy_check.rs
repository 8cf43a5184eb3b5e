//! Steps too long for what bends and buckles in them.
//!
//! The balance of the bodies' guard ([`super::guard`]) for nodes: inner forces, elastic and viscous, are those of where a stage evaluates
//! them, and what they do along the way is not what the elastic energy changes by, which is not convex. With q̄, v̄ and the inner
//! forces f of each stage, of length b h,
//! ```text
//! D = ΔT + ΔV − Σ_stages b h v̄·(m a − f(q̄, v̄)),   a = (v⁺ − v)/h of the stage        [J]
//! ```
//! is what the step creates beside the work of everything else, hands, wind, weight and contact, whatever it is, and beside what rounding
//! may do; T counts free nodes, V is elastic. Shapes that stand still do no work: where nothing but nodes moves, what they do all the same, pushing out what a long step has
//! put into them, counts as created. Stiff elements have roots far from the motion, of much more energy, and Newton's method may end at one of them: a step
//! by which the energy grows and that creates a noticeable part of what is at hand is refused, and two of half the length are taken. Every
//! (sub)step is judged, whatever work it took, so that the outcome is a function of where it begins and of its inputs. The last halves are
//! taken as they come; what they create is added up, and more than a tenth of what was at hand is an error: in a step, and, less what
//! others of them take, over all steps of a rollout in a row that have such halves. It is no motion, whatever its cause.

use super::{SDIRK_GAMMA, StepError, Stepper};
use crate::constraints::weighed;
use crate::rods::{Remembered, RodPoint};
use crate::step::constants::STEP;
use crate::step::newton::rounding_energy;
use crate::terms::{Point, Term};
use pliant_math::State;
use pliant_scene::Integrator;

/// A (sub)step that has been taken.
#[derive(Clone, Copy)]
pub(super) struct SubstepResult<'a> {
    pub before: &'a State,
    pub after: &'a State,
    pub h: f64,
    /// Whether sdirk2 was left for Euler.
    pub by_euler: bool,
}

/// Energy that a (sub)step creates, at most, and the energy at hand at its beginning, or its end if that is more \[J\].
#[derive(Clone, Copy)]
pub(super) struct Created {
    pub energy: f64,
    /// The part done by static obstacles.
    by_contact: f64,
    begin: f64,
    largest: f64,
}

/// What the substeps at the halving limit of a step created: they are taken as they come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LastHalves {
    /// Their number.
    pub substeps: usize,
    /// Energy they created \[J\].
    pub created: f64,
    /// The part done by obstacles that stand still \[J\].
    pub by_contact: f64,
    /// The energy they created, less what others of them took \[J\].
    pub net: f64,
    /// Kinetic and elastic energy, and weight times extent, as the first of them began \[J\].
    pub at_hand: f64,
    /// The same of that with most.
    pub most_at_hand: f64,
}

impl LastHalves {
    /// Counts a half that is taken as it comes.
    pub(super) fn add(&mut self, half: Created) {
        if self.substeps == 0 {
            self.at_hand = half.begin;
        }
        self.substeps += 1;
        self.most_at_hand = self.most_at_hand.max(half.begin);
        self.net += half.energy;
        self.created += half.energy.max(0.0);
        self.by_contact += half.by_contact.min(half.energy).max(0.0);
    }
}

/// Steps of a rollout in a row with last halves: what they created together.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Run {
    net: f64,
    most_at_hand: f64,
}

impl Run {
    /// Takes a step, and returns what it created with those before it and what was at hand \[J\], if that is too much.
    pub fn add(&mut self, halves: &LastHalves) -> Option<(f64, f64)> {
        let most_at_hand = self.most_at_hand.max(halves.most_at_hand);
        let sums = [(halves.created, halves.at_hand), (self.net + halves.created, most_at_hand)];
        let net = self.net + halves.net;
        *self = if halves.substeps > 0 && net > 0.0 { Self { net, most_at_hand } } else { Self::default() };
        sums.into_iter().find(|(created, at_hand)| halves.substeps > 0 && *created > STEP.created_together * at_hand)
    }
}

/// A state's part of the balance, kept from one (sub)step to the next.
#[derive(Clone, Debug, Default)]
pub(super) struct EnergyPoint {
    q: Vec<f64>,
    frames: Vec<f64>,
    /// The sections of rods.
    pub rods: RodPoint,
    /// Elastic and all energy of other terms \[J\].
    terms: [f64; 2],
}

/// A stage in the balance.
struct Part<'a> {
    /// b h \[s\].
    length: f64,
    /// Velocities that it begins and ends with, and over which time \[s\].
    from: &'a dyn Fn(usize) -> f64,
    to: &'a [f64],
    h: f64,
    q_bar: &'a [f64],
    v_bar: &'a [f64],
    /// Positions that it carries axes from, and these.
    axes: [&'a [f64]; 2],
}

/// Work in a (sub)step of everything but inner forces, and of contact on free rows, where nothing else acts \[J\].
struct Done {
    others: f64,
    contact: f64,
}

impl Done {
    fn and(self, other: Self) -> Self {
        Self { others: self.others + other.others, contact: self.contact + other.contact }
    }
}

impl Stepper<'_> {
    /// Energy of nodes that a step created: at most, or without the work of others, as it is for the last halves. `None` at rest and
    /// without nodes.
    pub(super) fn created_by_nodes(&mut self, step: &SubstepResult, last: bool) -> Option<Created> {
        if self.masses.nodes.is_empty() || self.model.integrator == Integrator::QuasiStatic {
            return None;
        }
        let kinetic = [step.before, step.after].map(|x| self.free_rows().map(|(k, m)| 0.5 * m * x.v[k] * x.v[k]).sum::<f64>());
        let [elastic, all] = self.energies(step);
        let (grown, resting) = (kinetic[1] - kinetic[0], elastic[0] + self.raised(&step.before.q));
        let mut created = Created {
            energy: grown + all[1] - all[0],
            by_contact: 0.0,
            begin: kinetic[0] + resting,
            largest: kinetic[0].max(kinetic[1]) + resting,
        };
        // what is little before the work of the others is seen to needs no look at it
        if last || self.is_too_much(&created, step.h) {
            let Done { others, contact } = self.work(step);
            created.by_contact =
                if self.touches_what_stands_still() { (contact - self.opening_work(step)).max(0.0) } else { 0.0 };
            created.energy = created.energy.min(grown + elastic[1] - elastic[0] - others + created.by_contact);
            created.energy -= rounding_energy(&self.model, &self.q_ref, step.h, &mut self.ws);
        }
        Some(created)
    }

    /// Whether that is too much for a (sub)step of length `h`.
    pub(super) fn is_too_much(&self, created: &Created, h: f64) -> bool {
        created.energy > STEP.created * h / self.model.h * created.largest
    }

    /// Adds a step to those of a rollout before it; an error if what they created together is no motion. Steps that may not be halved
    /// are wanted as they come.
    pub(crate) fn continue_run(
        &mut self,
        run: &mut Run,
        halves: &LastHalves,
        before: &State,
        after: &State,
    ) -> Result<(), StepError> {
        match run.add(halves).filter(|_| self.halves()) {
            Some(too_much) => Err(self.energy_error(halves, too_much, before, after)),
            None => Ok(()),
        }
    }

    /// The error of last halves that are no motion.
    pub(super) fn energy_error(
        &mut self,
        halves: &LastHalves,
        (created, at_hand): (f64, f64),
        before: &State,
        after: &State,
    ) -> StepError {
        let by_contact = halves.by_contact > 0.5 * halves.created;
        let term = if by_contact { "contact".to_owned() } else { self.grown_most(before, after) };
        StepError::EnergyCreated { step: 0, created, at_hand, term }
    }

    /// The inner force whose energy grows most from one state to another.
    fn grown_most(&mut self, before: &State, after: &State) -> String {
        let energy = |term: &dyn Term, x: &State| term.energy(&Point { q: &x.q, v: &self.still, theta: &self.theta });
        let inner = self.model.terms.iter().filter(|term| term.inner());
        let grown = inner.map(|term| (energy(term.as_ref(), after) - energy(term.as_ref(), before), term.name().to_owned()));
        let largest = grown.max_by(|a, b| a.0.total_cmp(&b.0));
        let otherwise = if self.model.rods.edges.is_empty() { "motion" } else { "bending and twist of rods" };
        largest.filter(|(by, _)| *by > 0.0).map_or_else(|| otherwise.to_owned(), |(_, name)| name)
    }

    fn in_two_stages(&self, step: &SubstepResult) -> bool {
        self.model.integrator == Integrator::Sdirk2 && !step.by_euler
    }

    /// Free rows of nodes and twists, and their mass.
    fn free_rows(&self) -> impl Iterator<Item = (usize, f64)> {
        self.masses.rows.iter().copied().enumerate().filter(|(k, _)| !self.model.prescribed_rows[*k])
    }

    /// Elastic energy, and all potential energy, of nodes before and after \[J\].
    fn energies(&mut self, step: &SubstepResult) -> [[f64; 2]; 2] {
        self.begin_at(step.before);
        let mut end = std::mem::take(&mut self.end);
        self.evaluate_energy(step.after, &mut end);
        let of = [&self.begin, &end].map(|point| {
            let sections = self.model.rods.energy(&point.rods, &self.theta, self.as_begun(step));
            point.terms.map(|energy| energy + sections)
        });
        self.end = end;
        [0, 1].map(|kind| [of[0][kind], of[1][kind]])
    }

    /// Brings `begin` to the state at which a (sub)step begins: as a rule the end of the one before.
    pub(super) fn begin_at(&mut self, x: &State) {
        if self.end.q == x.q && self.end.frames == self.frames_of(x) {
            std::mem::swap(&mut self.begin, &mut self.end);
        }
        let mut begin = std::mem::take(&mut self.begin);
        self.evaluate_energy(x, &mut begin);
        self.begin = begin;
    }

    pub(super) fn evaluate_energy(&self, x: &State, point: &mut EnergyPoint) {
        let frames = self.frames_of(x);
        if !point.q.is_empty() && point.q == x.q && point.frames == frames {
            return;
        }
        point.q.clone_from(&x.q);
        point.frames.clear();
        point.frames.extend_from_slice(frames);
        self.model.rods.evaluate(&x.q, frames, &x.q, &mut point.rods);
        point.terms = [0.0; 2];
        for term in &self.model.terms {
            let energy = term.energy(&Point { q: &x.q, v: &self.still, theta: &self.theta });
            point.terms[0] += if term.inner() { energy } else { 0.0 };
            point.terms[1] += energy;
        }
    }

    /// Whether nodes may touch shapes, all of which stand still, and nothing else acts on them but forces and hands.
    fn touches_what_stands_still(&self) -> bool {
        let shapes = !self.model.pairs.is_empty() || !self.model.element_groups.is_empty();
        shapes && self.model.tree.nv() == 0 && self.model.grasps.is_empty()
    }

    /// The most that the law of contact does by itself: w₀ v_n = κ, so that each stage opens each contact by no more than κ \[J\]. It is
    /// noticeable where nodes begin much nearer than the rest gap.
    fn opening_work(&self, step: &SubstepResult) -> f64 {
        let nodes: f64 = self.model.pairs.iter().map(|pair| self.masses.nodes[pair.node]).sum();
        let elements: f64 = self
            .model
            .element_groups
            .iter()
            .flat_map(|group| &self.model.elements[group.elements.clone()])
            .map(|element| element.weight)
            .sum();
        let stages = if self.in_two_stages(step) { 2.0 } else { 1.0 };
        stages * self.rest_gap * (nodes * weighed(self.theta[self.model.gravity]).0 + elements)
    }

    /// Σ b h v̄·(m a − f) of inner forces, and of all on free rows.
    fn work(&self, step: &SubstepResult) -> Done {
        let (n, h, gamma) = (self.model.n_node_dofs(), step.h, SDIRK_GAMMA);
        let ([q, v], [q_next, v_next]) = ([&step.before.q, &step.before.v], [&step.after.q, &step.after.v]);
        let from = |k: usize| v[k];
        let axes: [&[f64]; 2] = [q, self.frames_of(step.before)];
        if self.in_two_stages(step) {
            let first = &self.v_first;
            let q_first: Vec<f64> = (0..n).map(|k| q[k] + gamma * h * first[k]).collect();
            let reference = |k: usize| v[k] + (1.0 - gamma) / gamma * (first[k] - v[k]);
            let length = (1.0 - gamma) * h;
            let one = Part { length, from: &from, to: first, h: gamma * h, q_bar: &q_first, v_bar: first, axes };
            // the second stage's, by way of its reference: another way leaves another twist
            let axes: [&[f64]; 2] = [&self.q_ref, &self.frames];
            let two = Part { length: gamma * h, from: &reference, to: v_next, q_bar: q_next, v_bar: v_next, axes, ..one };
            return self.part_of_work(step, &one).and(self.part_of_work(step, &two));
        }
        let euler = Part { length: h, from: &from, to: v_next, h, q_bar: q_next, v_bar: v_next, axes };
        if self.model.integrator != Integrator::Midpoint {
            return self.part_of_work(step, &euler);
        }
        let q_bar: Vec<f64> = (0..n).map(|k| 0.5 * (q[k] + q_next[k])).collect();
        let of_prescribed = |k: usize| self.model.prescribed_rows[k];
        let v_bar: Vec<f64> = (0..n).map(|k| if of_prescribed(k) { v_next[k] } else { 0.5 * (v[k] + v_next[k]) }).collect();
        self.part_of_work(step, &Part { q_bar: &q_bar, v_bar: &v_bar, ..euler })
    }

    fn part_of_work(&self, step: &SubstepResult, part: &Part) -> Done {
        let mut f = vec![0.0; self.model.nv()];
        let at = Point { q: part.q_bar, v: part.v_bar, theta: &self.theta };
        let add = |inner: bool, f: &mut [f64]| {
            self.model.terms.iter().filter(|term| term.inner() == inner).for_each(|term| term.add_force(&at, f));
        };
        add(true, &mut f);
        let (rods, mut point) = (&self.model.rods, Default::default());
        rods.evaluate(part.axes[0], part.axes[1], part.q_bar, &mut point);
        rods.add_force(&point, part.v_bar, &self.theta, self.as_begun(step), &mut f);
        let inertia: f64 = self.free_rows().map(|(k, m)| m * part.v_bar[k] * (part.to[k] - (part.from)(k))).sum();
        let inner: f64 = (0..self.model.n_node_dofs()).map(|k| part.v_bar[k] * f[k]).sum();
        add(false, &mut f);
        let all: f64 = self.free_rows().map(|(k, _)| part.v_bar[k] * f[k]).sum();
        Done { others: part.length * (inertia / part.h - inner), contact: part.length * (inertia / part.h - all) }
    }

    fn frames_of<'a>(&self, x: &'a State) -> &'a [f64] {
        &x.z[self.model.ndz()..]
    }

    /// Sections as they were when the step began, with no time to forget.
    fn as_begun<'a>(&'a self, step: &'a SubstepResult) -> Remembered<'a> {
        Remembered { past: &self.rod_past, z: &step.before.z, elapsed: STEP.at_once * step.h }
    }

    /// The weight of all nodes times the diagonal of the box around them \[J\].
    fn raised(&self, q: &[f64]) -> f64 {
        let extent = |a: usize| {
            let along = |pick: fn(f64, f64) -> f64| (0..self.masses.nodes.len()).map(|i| q[3 * i + a]).fold(q[a], pick);
            along(f64::max) - along(f64::min)
        };
        let diagonal = extent(0).hypot(extent(1)).hypot(extent(2));
        self.masses.nodes.iter().sum::<f64>() * self.theta[self.model.gravity].abs() * diagonal
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(energies: &[f64]) -> LastHalves {
        let mut halves = LastHalves::default();
        energies.iter().for_each(|&energy| halves.add(Created { energy, by_contact: 0.0, begin: 1.0, largest: 1.0 }));
        halves
    }

    #[test]
    fn a_little_in_each_of_many_steps_is_too_much() {
        let mut run = Run::default();
        let refused: Vec<bool> = (0..4).map(|_| run.add(&step(&[0.04, -0.01])).is_some()).collect();
        assert_eq!(refused, [false, false, false, true]);
        // after a step without such halves it begins anew
        assert!(run.add(&step(&[])).is_none());
        assert!(run.add(&step(&[0.04])).is_none());
        // and one may do too much by itself, whatever was taken before and since
        assert!(Run::default().add(&step(&[0.11, -0.5])).is_some());
    }
}
