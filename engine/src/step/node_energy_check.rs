//! Steps too long for what bends and buckles in them.
//!
//! The balance of the bodies' guard ([`super::guard`]) for nodes: inner forces, elastic and viscous, are those of where a stage evaluates
//! them, and what they do along the way is not what the elastic energy changes by, which is not convex. With q̄, v̄ and the inner
//! forces f of each stage, of length b h,
//! ```text
//! D = ΔT + ΔV − Σ_stages b h v̄·(m a − f(q̄, v̄)),   a = (v⁺ − v)/h of the stage        [J]
//! ```
//! is what the step creates beside the work of everything else, hands, wind, weight and contact, whatever it is; T counts free nodes, V is
//! elastic. Shapes that stand still do no work: where nothing but nodes moves, what they do all the same, pushing out what a long step has
//! put into them, counts as created. Stiff elements have roots far from the motion, of much more energy, and Newton's method may end at one of them: a step
//! by which the energy grows and that creates a noticeable part of what is at hand is refused, and two of half the length are taken. The
//! last halves are taken as they come; what they create is added up, and more than a tenth of what was at hand is an error: in a step, and,
//! less what others of them take, over all steps in a row that have such halves. It is no motion, whatever its cause.

use super::{SDIRK_GAMMA, StepError, Stepper};
use crate::rods::Remembered;
use crate::step::constants::STEP;
use crate::step::newton::Work;
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
    /// Of Newton's method, in all stages.
    pub work: Work,
}

/// Energy that a (sub)step creates, at most, and the energy at hand at its beginning, or its end if that is more \[J\].
#[derive(Clone, Copy)]
pub(super) struct Created {
    energy: f64,
    /// The part done by static obstacles.
    by_contact: f64,
    begin: f64,
    largest: f64,
}

/// Energy created by the substeps at the halving limit of a step, and the energy at hand as the first of them began \[J\]; and what those of the steps right
/// before it have left, and the most that was at hand since.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EnergyAccumulator {
    halves: usize,
    created: f64,
    by_contact: f64,
    at_hand: f64,
    /// The energy they have created, less the energy that some of them dissipated.
    net: f64,
    before: f64,
    most_at_hand: f64,
}

/// Steps in a row with last halves that have created something, up to a state.
#[derive(Clone, Debug)]
pub(super) struct Run {
    net: f64,
    most_at_hand: f64,
    end: State,
}

impl EnergyAccumulator {
    /// At the beginning of a step from a state.
    pub(super) fn after(run: Option<Run>, state: &State) -> Self {
        let before = run.filter(|run| run.end == *state);
        before.map_or_else(Self::default, |run| Self { before: run.net, most_at_hand: run.most_at_hand, ..Self::default() })
    }

    /// Counts a half that is taken as it comes.
    pub(super) fn add(&mut self, half: Created) {
        if self.halves == 0 {
            self.at_hand = half.begin;
        }
        self.halves += 1;
        self.most_at_hand = self.most_at_hand.max(half.begin);
        self.net += half.energy;
        self.created += half.energy.max(0.0);
        self.by_contact += half.by_contact.min(half.energy).max(0.0);
    }

    /// The excess, of the step or of all in a row, and the energy at hand.
    fn excess(&self) -> Option<(f64, f64)> {
        let sums = [(self.created, self.at_hand), (self.before + self.created, self.most_at_hand)];
        sums.into_iter().find(|(created, at_hand)| self.halves > 0 && *created > STEP.created_together * at_hand)
    }

    /// The accumulator of the next step.
    pub(super) fn run_to(&self, end: &State) -> Option<Run> {
        let net = self.before + self.net;
        (self.halves > 0 && net > 0.0).then(|| Run { net, most_at_hand: self.most_at_hand, end: end.clone() })
    }
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
    /// Energy of nodes that a step created, where it is checked: at most, or without the work of others, as it is for the last halves.
    pub(super) fn created_by_nodes(&mut self, step: &SubstepResult, last: bool) -> Option<Created> {
        let stages = if self.in_two_stages(step) { 2 } else { 1 };
        // halves of a step that did something of the kind may do it again
        let searched = if self.model.buckles() { STEP.searched_of_sheets } else { STEP.searched };
        let Work { iterations, evaluations, .. } = step.work;
        let suspect = iterations >= searched + stages - 1 || evaluations >= STEP.corrected * stages || step.h < self.model.h;
        // the second stage of a step goes on as the first has begun, which after a hit is up
        let hit = stages == 2 && !self.model.pairs.is_empty();
        if !(suspect || hit) || self.masses.nodes.is_empty() || self.model.integrator == Integrator::QuasiStatic {
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
            created.by_contact = if self.touches_what_stands_still() { contact.max(0.0) } else { 0.0 };
            created.energy = created.energy.min(grown + elastic[1] - elastic[0] - others + created.by_contact);
        }
        Some(created)
    }

    /// Whether that is too much for a (sub)step of length `h`.
    pub(super) fn is_too_much(&self, created: &Created, h: f64) -> bool {
        created.energy > STEP.created * h / self.model.h * created.largest
    }

    /// Refuses a step whose last halves are no motion.
    pub(super) fn refuse(&mut self, before: &State, after: &State) -> Result<(), StepError> {
        let Some((created, at_hand)) = self.unsound.excess() else { return Ok(()) };
        let by_contact = self.unsound.by_contact > 0.5 * self.unsound.created;
        let term = if by_contact { "contact".to_owned() } else { self.grown_most(before, after) };
        Err(StepError::EnergyCreated { step: 0, created, at_hand, term })
    }

    /// The inner force whose energy grows most from one state to another.
    fn grown_most(&mut self, before: &State, after: &State) -> String {
        let energy = |term: &dyn Term, x: &State| term.energy(&Point { q: &x.q, v: &self.still, theta: self.theta });
        let inner = self.model.terms.iter().filter(|term| term.inner());
        let grown = inner.map(|term| (energy(term.as_ref(), after) - energy(term.as_ref(), before), term.name().to_owned()));
        let largest = grown.max_by(|a, b| a.0.total_cmp(&b.0));
        largest.filter(|(by, _)| *by > 0.0).map_or_else(|| "bending and twist of rods".to_owned(), |(_, name)| name)
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
        let mut point = std::mem::take(&mut self.rod_point);
        let rods = &self.model.rods;
        let of = [step.before, step.after].map(|x| {
            rods.evaluate(&x.q, self.frames_of(x), &x.q, &mut point);
            let sections = rods.energy(&point, self.theta, self.as_begun(step));
            let (mut elastic, mut all) = (sections, sections);
            for term in &self.model.terms {
                let energy = term.energy(&Point { q: &x.q, v: &self.still, theta: self.theta });
                elastic += if term.inner() { energy } else { 0.0 };
                all += energy;
            }
            [elastic, all]
        });
        self.rod_point = point;
        [0, 1].map(|kind| [of[0][kind], of[1][kind]])
    }

    /// Whether nodes may touch shapes, all of which stand still, and nothing else acts on them but forces and hands.
    fn touches_what_stands_still(&self) -> bool {
        let shapes = !self.model.pairs.is_empty() || !self.model.element_groups.is_empty();
        shapes && self.model.tree.nv() == 0 && self.model.grasps.is_empty()
    }

    /// Σ b h v̄·(m a − f) of inner forces, and of all on free rows.
    fn work(&self, step: &SubstepResult) -> Done {
        let (n, h, gamma) = (self.model.n_node_dofs(), step.h, SDIRK_GAMMA);
        let ([q, v], [q_next, v_next]) = ([&step.before.q, &step.before.v], [&step.after.q, &step.after.v]);
        let from = |k: usize| v[k];
        if self.in_two_stages(step) {
            let first = &self.v_first;
            let q_first: Vec<f64> = (0..n).map(|k| q[k] + gamma * h * first[k]).collect();
            let reference = |k: usize| v[k] + (1.0 - gamma) / gamma * (first[k] - v[k]);
            let one = Part { length: (1.0 - gamma) * h, from: &from, to: first, h: gamma * h, q_bar: &q_first, v_bar: first };
            let two = Part { length: gamma * h, from: &reference, to: v_next, q_bar: q_next, v_bar: v_next, ..one };
            return self.part_of_work(step, &one).and(self.part_of_work(step, &two));
        }
        let euler = Part { length: h, from: &from, to: v_next, h, q_bar: q_next, v_bar: v_next };
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
        let at = Point { q: part.q_bar, v: part.v_bar, theta: self.theta };
        let add = |inner: bool, f: &mut [f64]| {
            self.model.terms.iter().filter(|term| term.inner() == inner).for_each(|term| term.add_force(&at, f));
        };
        add(true, &mut f);
        let (rods, mut point) = (&self.model.rods, Default::default());
        rods.evaluate(&step.before.q, self.frames_of(step.before), part.q_bar, &mut point);
        rods.add_force(&point, part.v_bar, self.theta, self.as_begun(step), &mut f);
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

    fn half(energy: f64) -> Created {
        Created { energy, by_contact: 0.0, begin: 1.0, largest: 1.0 }
    }

    #[test]
    fn a_little_in_each_of_many_steps_is_too_much() {
        let (end, elsewhere) = (State::default(), State { q: vec![1.0], ..State::default() });
        let step = |run: Option<Run>, from: &State, energies: &[f64]| {
            let mut unsound = EnergyAccumulator::after(run, from);
            energies.iter().for_each(|e| unsound.add(half(*e)));
            (unsound.excess().is_some(), unsound.run_to(&end))
        };
        let mut run = None;
        let refused: Vec<bool> = (0..4)
            .map(|_| {
                let (refused, next) = step(run.take(), &end, &[0.04, -0.01]);
                run = next;
                refused
            })
            .collect();
        assert_eq!(refused, [false, false, false, true]);
        // a step from another state, or after one without such halves, begins anew
        assert!(!step(run.clone(), &elsewhere, &[0.04]).0);
        let (refused, none) = step(run, &end, &[]);
        assert!(!refused && none.is_none());
        // and one may do too much by itself, whatever was taken before and since
        assert!(step(None, &end, &[0.11, -0.5]).0);
    }
}
