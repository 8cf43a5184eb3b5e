//! Times in turns.

use std::any::Any;
use std::time::Instant;

/// A measured operation.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Op {
    Refactor,
    Solve,
    SolveTranspose,
    SolveMany,
    Inverse,
}

const OPS: [Op; 5] = [Op::Refactor, Op::Solve, Op::SolveTranspose, Op::SolveMany, Op::Inverse];

/// A factored matrix.
pub trait Solver {
    fn name(&self) -> String;
    fn dim(&self) -> usize;
    fn run(&mut self, op: Op);
    /// Largest of b − K x, relative to that of b, for one right-hand side.
    fn residual(&mut self) -> f64;
    /// The factor's numbers, as a record would keep them.
    fn copy(&self) -> Box<dyn Any>;
}

/// Seconds that a solver's repetitions take at least in a round.
const ROUND: f64 = 2e-4;
/// Rounds at least and at most, and seconds after which there are no more.
const ROUNDS: [usize; 2] = [7, 400];
const BUDGET: f64 = 0.06;

/// Our shortest times \[s\] by [`Op`], and faer's beside them.
pub struct Comparison {
    pub times: [Option<f64>; 5],
    pub kilobytes: f64,
    pub residual: f64,
    pub others: Vec<Other>,
}

/// One of faer's ways: the medians of its times over ours.
pub struct Other {
    pub name: String,
    pub ratios: [Option<f64>; 5],
    pub kilobytes: f64,
    pub residual: f64,
}

impl Comparison {
    /// Of all operations that are `wanted`; the first of the solvers is ours.
    pub fn measure(mut solvers: Vec<Box<dyn Solver + '_>>, wanted: impl Fn(Op) -> bool) -> Self {
        let alone = |s: &mut Box<dyn Solver + '_>| Other {
            name: s.name(),
            ratios: [None; 5],
            kilobytes: kilobytes(s.as_ref()),
            residual: s.residual(),
        };
        let mut found: Vec<Other> = solvers.iter_mut().map(alone).collect();
        let mut times = [None; 5];
        for (k, op) in OPS.into_iter().enumerate().filter(|(_, op)| wanted(*op)) {
            let rounds = in_turns(&mut solvers, op);
            times[k] = rounds.iter().map(|round| round[0]).min_by(f64::total_cmp);
            for (i, other) in found.iter_mut().enumerate() {
                other.ratios[k] = median(rounds.iter().map(|round| round[i] / round[0]).collect());
            }
        }
        let ours = found.remove(0);
        Self { times, kilobytes: ours.kilobytes, residual: ours.residual, others: found }
    }
}

/// Seconds of every solver, round by round.
fn in_turns(solvers: &mut [Box<dyn Solver + '_>], op: Op) -> Vec<Vec<f64>> {
    let repetitions: Vec<usize> = solvers
        .iter_mut()
        .map(|solver| {
            solver.run(op);
            (ROUND / seconds(solver.as_mut(), op, 1)).ceil().clamp(1.0, 1e5) as usize
        })
        .collect();
    let (mut spent, mut rounds) = (0.0, Vec::new());
    while rounds.len() < ROUNDS[0] || (rounds.len() < ROUNDS[1] && spent < BUDGET * solvers.len() as f64) {
        let round: Vec<f64> = solvers.iter_mut().zip(&repetitions).map(|(s, count)| seconds(s.as_mut(), op, *count)).collect();
        spent += round.iter().zip(&repetitions).map(|(seconds, count)| seconds * *count as f64).sum::<f64>();
        rounds.push(round);
    }
    rounds
}

/// Seconds of a repetition, without those in which the processor was given to others.
fn seconds(solver: &mut dyn Solver, op: Op, repetitions: usize) -> f64 {
    let (outer, waited, inner) = (Instant::now(), waiting(), Instant::now());
    (0..repetitions).for_each(|_| solver.run(op));
    let (elapsed, waited) = (inner.elapsed().as_secs_f64(), waiting() - waited);
    // (what it waited may lie beside the repetitions)
    let all = outer.elapsed().as_secs_f64();
    (if waited > 0.0 { all - waited } else { elapsed }) / repetitions as f64
}

/// Seconds that this thread has waited for a processor since it began (Linux).
fn waiting() -> f64 {
    let schedstat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    1e-9 * schedstat.split_whitespace().nth(1).and_then(|word| word.parse::<f64>().ok()).unwrap_or(0.0)
}

fn median(mut numbers: Vec<f64>) -> Option<f64> {
    numbers.sort_unstable_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied()
}

/// Memory of a copy of the factor, from the growth of the process with many of them.
fn kilobytes(solver: &dyn Solver) -> f64 {
    const ENOUGH: f64 = 32e6;
    let mut copies = Vec::new();
    let mut grow_to = |bytes: f64| {
        while resident() < bytes {
            copies.push(solver.copy());
        }
        (resident(), copies.len())
    };
    // the first ones take what is free
    let (before, first) = grow_to(resident() + ENOUGH);
    let (after, last) = grow_to(before + ENOUGH);
    1e-3 * (after - before) / (last - first) as f64
}

/// Bytes of memory that the process occupies (Linux).
fn resident() -> f64 {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = statm.split_whitespace().nth(1).and_then(|word| word.parse::<f64>().ok());
    4096.0 * pages.unwrap_or(f64::INFINITY)
}
