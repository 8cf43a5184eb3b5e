//! The state of a search between two rounds, and its result, as the journal keeps them.
//!
//! Fits have most of the numbers, and models share them: each distinct one is written once. Records are named, and taken from the plan; texts that
//! the library has are taken from it. A state is kept only if it is read back as it was.

use super::super::result::NumericsKind;
use super::hypothesis::{Bench, Hypothesis};
use super::round::Evidence;
use super::search::Found;
use crate::causes::{Cause, Situation, library};
use crate::fit::Fitted;
use crate::journal::{Words, words, written};
use crate::sensor::Sensor;
use crate::shooting::{OwnSize, Plan, RecordPlan};
use crate::stats::ar::ArModel;
use crate::unknown::{Coordinate, Probe, Target, Unknown, Values};
use pliant_math::State;

/// Notes on causes (title, outcome), and the causes that the simulation's own error imitates.
type Said<'a> = (&'a [(String, String)], &'a [(String, NumericsKind)]);

/// A search between two rounds.
pub(super) struct Between {
    pub beam: Vec<Hypothesis>,
    pub best: Hypothesis,
    pub tied: Vec<Hypothesis>,
    pub refitted: Vec<Vec<String>>,
    /// Of the last causes, when each was accepted.
    pub of_each: Vec<Evidence>,
    pub notes: Vec<(String, String)>,
    pub imitated: Vec<(String, NumericsKind)>,
    /// The last round has accepted none.
    pub over: bool,
}

impl Between {
    /// The state after the last round that was finished.
    pub fn reached(bench: &Bench) -> Option<Self> {
        let kept: Kept = bench.plan.journal.reached(&name(bench.plan, "round"))?;
        let mut models = kept.models(bench.plan)?.into_iter();
        let best = models.next()?;
        let beam = models.by_ref().take(kept.beam).collect();
        let imitated = kept.imitated()?;
        let (of_each, refitted) = (kept.evidence, kept.refitted);
        Some(Self { beam, best, tied: models.collect(), refitted, of_each, notes: kept.notes, imitated, over: kept.over })
    }

    /// Keeps the state: models that the next cause is tried on, and what was found on the way.
    pub fn keep(
        bench: &Bench,
        (best, beam, tied): (&Hypothesis, &[Hypothesis], &[Hypothesis]),
        refitted: &[Vec<String>],
        of_each: &[Evidence],
        said: Said,
        over: bool,
    ) {
        let models: Vec<&Hypothesis> = std::iter::once(best).chain(beam).chain(tied).collect();
        let rest = Kept { refitted: refitted.to_vec(), beam: beam.len(), evidence: of_each.to_vec(), over, ..Kept::default() };
        keep(bench, "round", rest, (&models, &[]), said);
    }
}

/// Accepted causes of which some are known to be needed.
pub(super) struct Pruned {
    pub best: Hypothesis,
    /// Evidence for the last ones.
    pub of_all: Vec<Evidence>,
    pub notes: Vec<(String, String)>,
    /// How many are still to be checked.
    pub left: usize,
}

impl Pruned {
    /// The state after the last check.
    pub fn reached(bench: &Bench) -> Option<Self> {
        let kept: Kept = bench.plan.journal.reached(&name(bench.plan, "check"))?;
        let best = kept.models(bench.plan)?.pop()?;
        Some(Self { best, of_all: kept.evidence, notes: kept.notes, left: kept.beam })
    }

    /// Keeps the state.
    pub fn keep(bench: &Bench, best: &Hypothesis, of_all: &[Evidence], notes: &[(String, String)], left: usize) {
        let rest = Kept { evidence: of_all.to_vec(), beam: left, ..Kept::default() };
        keep(bench, "check", rest, (&[best], &[]), (notes, &[]));
    }
}

impl Found {
    /// The result of a search that was finished.
    pub(super) fn reached(bench: &Bench) -> Option<Self> {
        let kept: Kept = bench.plan.journal.reached(&name(bench.plan, "search"))?;
        let mut models = kept.models(bench.plan)?.into_iter();
        let (base, best) = (models.next()?, models.next()?);
        let fitted = kept.fits.last()?.on(bench.plan)?;
        let known = known(bench.plan);
        let alike: Option<_> = kept.alike.iter().map(|of| of.iter().map(|cause| cause.of(&known)).collect()).collect();
        let (no_noise, imitated) = (bench.no_noise(&fitted), kept.imitated()?);
        let (tied, alike, evidence, notes) = (models.collect(), alike?, kept.evidence, kept.notes);
        Some(Self { base, best, fitted, evidence, tied, alike, no_noise, notes, imitated })
    }

    /// Keeps it.
    pub(super) fn keep(&self, bench: &Bench) {
        let models: Vec<&Hypothesis> = [&self.base, &self.best].into_iter().chain(&self.tied).collect();
        let known = known(bench.plan);
        if !self.alike.iter().flatten().all(|cause| KeptCause::new(cause).of(&known).as_ref() == Some(cause)) {
            return;
        }
        let alike = self.alike.iter().map(|of| of.iter().map(KeptCause::new).collect()).collect();
        let rest = Kept { alike, evidence: self.evidence.clone(), ..Kept::default() };
        keep(bench, "search", rest, (&models, &[&self.fitted]), (&self.notes, &self.imitated));
    }
}

/// Keeps models and fits with the rest of a state, if they are read back as they were.
fn keep(bench: &Bench, name: &str, mut kept: Kept, (models, fits): (&[&Hypothesis], &[&Fitted]), (notes, imitated): Said) {
    let plan = bench.plan;
    if !plan.journal.keeps() {
        return;
    }
    for model in models {
        let causes = model.causes.iter().map(KeptCause::new).collect();
        let fitted = kept.place(&model.fitted);
        let trail = model.trail.iter().map(|fitted| kept.place(fitted)).collect();
        kept.models.push(KeptModel { causes, fitted, trail });
    }
    // behind all others
    kept.fits.extend(fits.iter().map(|fitted| KeptFit::new(fitted)));
    kept.notes = notes.to_vec();
    kept.imitated = imitated.iter().map(|(title, kind)| (title.clone(), *kind as usize)).collect();
    let same = |(a, b): (&Hypothesis, &&Hypothesis)| {
        let trail = a.trail.iter().zip(&b.trail).all(|(a, b)| same(a, b));
        a.causes == b.causes && same(&a.fitted, &b.fitted) && a.trail.len() == b.trail.len() && trail
    };
    let last = kept.fits.iter().rev().zip(fits.iter().rev());
    let back = kept.models(plan).is_some_and(|back| back.iter().zip(models).all(same));
    if back && last.into_iter().all(|(kept, fitted)| kept.on(plan).is_some_and(|back| self::same(&back, fitted))) {
        plan.journal.reaches(&self::name(plan, name), &kept);
    }
}

/// The name of a state: a search over pieces goes before one over whole records.
fn name(plan: &Plan, name: &str) -> String {
    if plan.in_pieces() { format!("{name} in pieces") } else { name.to_owned() }
}

/// Whether two fits are the same to the last bit, their records included.
fn same(a: &Fitted, b: &Fitted) -> bool {
    let records = |(a, b): (&RecordPlan, &RecordPlan)| words_of(a) == words_of(b);
    let all = a.records.len() == b.records.len() && a.records.iter().zip(&b.records).all(records);
    all && written(&KeptFit::new(a)) == written(&KeptFit::new(b)) && a.noise == b.noise
}

/// The parts of a record that are taken from the plan, as words.
fn words_of(rec: &RecordPlan) -> Vec<u64> {
    let (RecordPlan { record, inputs, past, others, start, correction, .. }, mut out) = (rec, Vec::new());
    [&record.joints, &record.inputs, inputs, past].into_iter().for_each(|rows| rows.put(&mut out));
    others.iter().for_each(|other| [&other.inputs, &other.past].into_iter().for_each(|rows| rows.put(&mut out)));
    (record.time.clone(), (record.markers.clone(), record.orientations.clone())).put(&mut out);
    (start.mean.clone(), (start.dofs.clone(), correction.to_vec())).put(&mut out);
    [&start.position, &start.velocity].into_iter().for_each(|matrix| matrix.as_slice().to_vec().put(&mut out));
    out
}

/// A state as it is written.
#[derive(Default)]
struct Kept {
    fits: Vec<KeptFit>,
    models: Vec<KeptModel>,
    /// How many of them are the beam; how many causes are still to be checked.
    beam: usize,
    refitted: Vec<Vec<String>>,
    evidence: Vec<Evidence>,
    alike: Vec<Vec<KeptCause>>,
    notes: Vec<(String, String)>,
    imitated: Vec<(String, usize)>,
    /// The search is over.
    over: bool,
}
words!(Kept { fits, models, beam, refitted, evidence, alike, notes, imitated, over });
words!(Evidence { statistic, foretold });

impl Kept {
    /// The number of a fit among those that are written.
    fn place(&mut self, fitted: &Fitted) -> usize {
        let new = KeptFit::new(fitted);
        let words = written(&new);
        self.fits.iter().position(|old| written(old) == words).unwrap_or_else(|| {
            self.fits.push(new);
            self.fits.len() - 1
        })
    }

    fn models(&self, plan: &Plan) -> Option<Vec<Hypothesis>> {
        let known = known(plan);
        let one = |model: &KeptModel| {
            let fit = |k: &usize| self.fits.get(*k)?.on(plan);
            let causes = model.causes.iter().map(|cause| cause.of(&known)).collect::<Option<_>>()?;
            let trail = model.trail.iter().map(fit).collect::<Option<_>>()?;
            Some(Hypothesis { causes, fitted: fit(&model.fitted)?, trail })
        };
        self.models.iter().map(one).collect()
    }

    fn imitated(&self) -> Option<Vec<(String, NumericsKind)>> {
        let kinds = [NumericsKind::Step, NumericsKind::Mesh, NumericsKind::Inputs];
        let kind = |number: usize| kinds.into_iter().find(|kind| *kind as usize == number);
        self.imitated.iter().map(|(title, number)| Some((title.clone(), kind(*number)?))).collect()
    }
}

struct KeptModel {
    causes: Vec<KeptCause>,
    fitted: usize,
    trail: Vec<usize>,
}
words!(KeptModel { causes, fitted, trail });

/// A cause by its name, with the numbers that were freed for it.
struct KeptCause {
    name: String,
    object: Option<String>,
    unknowns: Vec<Unknown>,
    nuisance_grid: Vec<Vec<(usize, f64)>>,
    companions: Vec<Unknown>,
    afterwards: Vec<Unknown>,
    starts: Vec<Vec<(usize, f64)>>,
}
words!(KeptCause { name, object, unknowns, nuisance_grid, companions, afterwards, starts });

impl KeptCause {
    fn new(cause: &Cause) -> Self {
        let Cause { name, object, unknowns, nuisance_grid, companions, afterwards, starts, .. } = cause.clone();
        Self { name: name.to_owned(), object, unknowns, nuisance_grid, companions, afterwards, starts }
    }

    fn of(&self, known: &[Cause]) -> Option<Cause> {
        let called = || known.iter().filter(|cause| cause.name == self.name);
        let texts = called().find(|cause| cause.object == self.object).or_else(|| called().next())?.clone();
        Some(Cause {
            object: self.object.clone(),
            unknowns: self.unknowns.clone(),
            nuisance_grid: self.nuisance_grid.clone(),
            companions: self.companions.clone(),
            afterwards: self.afterwards.clone(),
            starts: self.starts.clone(),
            ..texts
        })
    }
}

/// The library where nothing is free, for the texts of causes.
fn known(plan: &Plan) -> Vec<Cause> {
    library(&Situation { plan, values: &plan.scene_values, free: &[], together: true })
}

struct KeptFit {
    unknowns: Vec<Unknown>,
    values: Values,
    records: Vec<KeptRecord>,
    residuals: Vec<Vec<f64>>,
    reflection: Vec<f64>,
    sigma: Vec<f64>,
    deviance: f64,
    rmse: f64,
    iterations: usize,
    converged: bool,
}
words!(KeptFit { unknowns, values, records, residuals, reflection, sigma, deviance, rmse, iterations, converged });

impl KeptFit {
    fn new(fitted: &Fitted) -> Self {
        let Fitted { unknowns, values, records, residuals, noise, deviance, rmse, iterations, converged } = fitted.clone();
        let (reflection, sigma) = (noise.reflection().to_vec(), noise.sigma().to_vec());
        let records = records.iter().map(KeptRecord::new).collect();
        Self { unknowns, values, records, residuals, reflection, sigma, deviance, rmse, iterations, converged }
    }

    fn on(&self, plan: &Plan) -> Option<Fitted> {
        Some(Fitted {
            unknowns: self.unknowns.clone(),
            values: self.values.clone(),
            records: self.records.iter().map(|rec| rec.on(plan)).collect::<Option<_>>()?,
            residuals: self.residuals.clone(),
            noise: ArModel::from_reflection(&self.reflection, self.sigma.clone()).ok()?,
            deviance: self.deviance,
            rmse: self.rmse,
            iterations: self.iterations,
            converged: self.converged,
        })
    }
}

/// The results of a fit in one record of the plan.
struct KeptRecord {
    name: String,
    parent: usize,
    z: Vec<f64>,
    sizes: Vec<OwnSize>,
    nodes: Vec<(usize, State)>,
    weight: f64,
}
words!(KeptRecord { name, parent, z, sizes, nodes, weight });

impl KeptRecord {
    fn new(rec: &RecordPlan) -> Self {
        let (name, parent, z) = (rec.record.name.clone(), rec.parent, rec.start.z.clone());
        Self { name, parent, z, sizes: rec.sizes.clone(), nodes: rec.nodes.clone(), weight: rec.weight }
    }

    fn on(&self, plan: &Plan) -> Option<RecordPlan> {
        let own = plan.fitted.iter().find(|rec| rec.parent == self.parent && rec.record.name == self.name)?;
        let mut out = RecordPlan { sizes: self.sizes.clone(), nodes: self.nodes.clone(), weight: self.weight, ..own.clone() };
        out.start.z.clone_from(&self.z);
        Some(out)
    }
}

words!(OwnSize { of, beyond, spread });
words!(State { q, v, z });
words!(Values { theta, sensor, joints, offsets, late });
words!(Unknown { path, unit, target, bounds, scale, coordinate, prior, probe });
words!(Probe { small, start });

impl Words for Sensor {
    fn put(&self, out: &mut Vec<u64>) {
        self.0.put(out);
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        Words::take(from).map(Self)
    }
}

impl Words for Coordinate {
    fn put(&self, out: &mut Vec<u64>) {
        (*self as usize).put(out);
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        let number = usize::take(from)?;
        [Self::Linear, Self::Log, Self::Inverse].into_iter().find(|one| *one as usize == number)
    }
}

/// A form that no law describes is no cause, and is not read back.
impl Words for Target {
    fn put(&self, out: &mut Vec<u64>) {
        let (kind, entries) = match self {
            Self::Theta(entries) => (0usize, entries.clone()),
            Self::Mirrored(low, high) => (1, vec![*low, *high]),
            Self::Sensor(entry) => (2, vec![*entry]),
            Self::Joint(sensor, entry) => (3, vec![*sensor, *entry]),
            Self::Beside(markers, axis) => (4, [&markers[..], &[*axis]].concat()),
            Self::Late(control) => (5, vec![*control]),
            Self::Form(_) => (6, Vec::new()),
        };
        (kind, entries).put(out);
    }

    fn take(from: &mut dyn Iterator<Item = u64>) -> Option<Self> {
        let (kind, entries): (usize, Vec<usize>) = Words::take(from)?;
        Some(match (kind, entries.as_slice()) {
            (0, entries) if !entries.is_empty() => Self::Theta(entries.to_vec()),
            (1, [low, high]) => Self::Mirrored(*low, *high),
            (2, [entry]) => Self::Sensor(*entry),
            (3, [sensor, entry]) => Self::Joint(*sensor, *entry),
            (4, [markers @ .., axis]) if !markers.is_empty() => Self::Beside(markers.to_vec(), *axis),
            (5, [control]) => Self::Late(*control),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::audit::starts::tests::{experiment, pendulum};
    use super::super::super::policy::POLICY;
    use super::*;
    use crate::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose, diagnose_kept};
    use crate::journal::{Journal, Partial, read};
    use crate::log::{Logs, Setup};
    use crate::shooting::{ShotWants, shoot};
    use crate::stats::testing::gaussians;
    use pliant_scene::Source;
    use std::path::PathBuf;
    use std::sync::{Arc, Mutex, OnceLock};

    /// A pendulum whose scene has no friction, with swings of one that may have: less than the long steps of the scene make up for, so that they have to be
    /// shortened before it is found.
    fn swings(friction: f64) -> (Setup, Logs) {
        let text = pendulum("measured").replace("midpoint", "euler");
        let fine = text.replace("step = 0.005", "step = 0.00005");
        let starts = [0.3f64, 0.5, 0.4, 0.6].map(|angle| vec![angle; 40]);
        let mut truth = experiment(&fine, &starts).0;
        let damping = truth.model.params().find("pivot.damping").unwrap();
        truth.scene_values.theta[damping] = friction;
        let records = truth.fitted.iter().chain(&truth.held_out).zip(&starts).enumerate();
        let readings: Vec<Vec<f64>> = records
            .map(|(k, (rec, _))| {
                let seen = shoot(&truth, rec, &truth.scene_values, ShotWants::default()).unwrap().predicted;
                seen.iter().zip(gaussians(40, k as u64)).map(|(x, e)| x + 1e-4 * e).collect()
            })
            .collect();
        let setup = Setup::from_source(Source::new("scene.toml", text.clone()), PathBuf::new()).unwrap();
        (setup, experiment(&text, &readings).1)
    }

    /// A diagnosis without its times.
    fn timeless(diagnosis: &Diagnosis) -> String {
        format!("{:?}", Diagnosis { wall_s: 0.0, parts: Vec::new(), ..diagnosis.clone() })
    }

    /// Words that are damaged are none, and the diagnosis does not go on from them.
    #[test]
    fn damaged_states_are_left_aside() {
        let plan = experiment(&pendulum("measured"), &[vec![0.3; 40], vec![0.5; 40]]).0;
        let white = ArModel::white(vec![1e-3]).unwrap();
        let options = crate::fit::FitOptions::default();
        let fitted = crate::fit::fit(&plan, &plan.fitted, &plan.scene_values, &[], Some(&white), &options).unwrap();
        let words = written(&KeptFit::new(&fitted));
        let back: KeptFit = read(words.clone()).unwrap();
        assert!(same(&back.on(&plan).unwrap(), &fitted));
        assert!(read::<KeptFit>(words[1..].to_vec()).is_none());
        // a model of two causes that are checked
        let causes: Vec<Cause> = known(&plan).into_iter().filter(|cause| !cause.unknowns.is_empty()).take(2).collect();
        let base = Hypothesis::baseline(fitted.clone());
        let best = causes.iter().fold(base, |model, cause| model.and(cause.clone(), fitted.clone()));
        let kept = Plan { journal: Journal::new(Partial::default(), Box::new(|_| ())), ..plan.clone() };
        let bench = Bench { plan: &kept, declared: Vec::new(), white };
        let notes = [(causes[0].title(), "why".to_owned())];
        Pruned::keep(&bench, &best, &[Evidence { statistic: 7.0, foretold: None }], &notes, 1);
        let back = Pruned::reached(&bench).unwrap();
        assert_eq!((back.best.causes, back.best.trail.len(), back.left, back.notes), (causes, 2, 1, notes.to_vec()));
        assert_eq!((back.of_all.len(), back.of_all[0].statistic), (1, 7.0));
        // records of another plan are none of its own
        let mut other = plan.clone();
        other.fitted[0].record.name = "another".to_owned();
        assert!(read::<KeptFit>(words).unwrap().on(&other).is_none());
    }

    mod long {
        use super::*;

        /// Where a finer step is still too coarse for the data a further pass has one that is not.
        #[test]
        fn passes_go_on_until_the_step_is_fine_enough() {
            let (setup, logs) = swings(0.0);
            let found = diagnose(&setup, &logs, &DiagnoseOptions::default(), &mut |_| ()).unwrap();
            let step = found.refined.unwrap().step;
            let passes = found.parts.iter().filter(|part| part.part == "audit").count();
            assert!(passes > 2 && step < 0.005 / 4.0, "{passes} {step} {}", found.reason);
            assert!(found.numerics.iter().all(|own| own.gain < POLICY.per_number), "{:?}", found.numerics);
            assert_eq!(found.verdict, Verdict::Numerics);
        }

        /// Wherever it is interrupted, in whichever of three passes, a diagnosis that goes on comes to the same end to the last bit; and the later it
        /// was, the less is computed again.
        #[test]
        fn it_goes_on_from_anywhere_to_the_same_end() {
            let (setup, logs) = swings(0.003);
            let options = DiagnoseOptions::default();
            let plain = diagnose(&setup, &logs, &options, &mut |_| ()).unwrap();
            assert!(plain.refined.is_some() && plain.stages.len() == 2, "{}", plain.reason);
            let whole: Arc<OnceLock<Arc<Journal>>> = Arc::default();
            let left_behind: Arc<Mutex<Vec<(String, Partial)>>> = Arc::default();
            let (at, seen) = (Arc::clone(&whole), Arc::clone(&left_behind));
            let tell = move |line: &str| seen.lock().unwrap().push((line.to_owned(), at.get().unwrap().so_far()));
            let journal = Journal::new(Partial::default(), Box::new(tell));
            whole.set(Arc::clone(&journal)).unwrap();
            let kept = diagnose_kept(&setup, &logs, &options, &journal).unwrap();
            assert_eq!(timeless(&kept), timeless(&plain));
            let all = journal.so_far();
            let names: Vec<&str> = all.states.keys().map(String::as_str).collect();
            let of = |name: &str| names.iter().filter(|n| n.starts_with(name)).count();
            assert_eq!((of("pass"), of("round"), of("search")), (2, 3, 3), "{names:?}");
            // once for each of what may lie there
            let mut stages: Vec<(String, Partial)> = Vec::new();
            for (line, partial) in left_behind.lock().unwrap().drain(..) {
                if stages.last().is_none_or(|(_, last)| last.states != partial.states) {
                    stages.push((line, partial));
                }
            }
            assert!(stages.len() >= 6, "{}", stages.len());
            let mut said = Vec::new();
            for (line, partial) in stages {
                let lines = Arc::new(Mutex::new(0));
                let count = Arc::clone(&lines);
                let journal = Journal::new(partial, Box::new(move |_| *count.lock().unwrap() += 1));
                let resumed = diagnose_kept(&setup, &logs, &options, &journal).unwrap();
                assert_eq!(timeless(&resumed), timeless(&plain), "interrupted at {line}");
                said.push(*lines.lock().unwrap());
            }
            assert!(said.is_sorted_by(|a, b| a > b), "{said:?}");
        }
    }
}
