//! Light–dark of VISION-SLS: a point whose position is measured well near x = 2 m only; times beside the published ones.
//!
//! The published method makes the noise's dependence on the nominal trajectory part of its sequential programs. Here the noise is frozen at
//! the last trajectory, the derivative of tube cost and tightenings by it enters the nominal cost as a linear term, and a line search on
//! nominal plus tube cost accepts. Gradients use that the tube is at its optimum (envelope).

use std::time::Instant;

use pliant_control::observer::{JointResponses, OutputFeedbackTube, Sensing, Sharing};
use pliant_control::ocp::{Ocp, OcpSolution, OcpSolver};
use pliant_control::tube::{Disturbance, RobustOptions, RobustSolution, RowValues, TubeCost, TubeProblem, TubeSynthesis, robust};

use super::chain::Timed;
use super::problems::{box_rows, identity, invariant, tube_cost};
use super::reference::cost_of;

/// (N, published s of the method, published s of its SDP by MOSEK).
const PUBLISHED: [(usize, f64, f64); 5] =
    [(20, 1.13, 52.0), (30, 4.33, 129.0), (40, 6.04, 247.0), (50, 7.22, 429.0), (60, 9.31, 727.0)];
/// Outer iterations at most, and the step \[m\] at which they end.
const OUTER: (usize, f64) = (40, 1e-3);

/// dt = 0.2 s, x⁺ = x + dt (u + 0.05 w), x in [−2, 5]², |u_i| ≤ 1, |x_N| ≤ 0.15, from (0, 2) to the origin; cost |x|² + |u|² + 50 |x_N|².
fn problem(horizon: usize) -> (Ocp, Disturbance, TubeCost) {
    let mut ocp = invariant(&identity(2, 1.0), &identity(2, 0.2), horizon, vec![0.0, 2.0], [2.0, 2.0, 100.0], 1.0);
    for stage in &mut ocp.stages[1..] {
        stage.rows = box_rows(2, 2, 5.0, 1e5);
        stage.rows.limits[2..].fill(2.0);
    }
    ocp.rows_final = box_rows(2, 2, 0.15, 1e5);
    let disturbance = Disturbance::new((0..=horizon).map(|j| identity(2, if j == 0 { 0.05 } else { 0.01 })));
    (ocp, disturbance, tube_cost(2, 2, 1e4, 1e4, 1e4))
}

/// F = 0.02 (2 − x)² · 1 along a trajectory.
fn sensing(x: &[Vec<f64>]) -> Sensing {
    let horizon = x.len() - 1;
    let f = x[..horizon].iter().map(|x| identity(2, 0.02 * (2.0 - x[0]).powi(2))).collect();
    Sensing { c: vec![identity(2, 1.0); horizon], f, delay: 1 }
}

/// Cost of the responses with the noise of a trajectory, gains without weights, and what its derivatives by the noises are made of.
fn responses(problem: &TubeProblem<'_>, x: &[Vec<f64>], ocp: &Ocp) -> Option<(f64, JointResponses)> {
    let synthesis = OutputFeedbackTube::new(problem, sensing(x), Sharing::Shared).ok()?;
    let gains = synthesis.synthesize(problem, &RowValues::zeros(ocp), None).ok()?.gains;
    let joint = JointResponses::new(problem, &synthesis.sensing, &synthesis.observer, &gains);
    let cost = joint.disturbances.iter().chain(&joint.noises).flat_map(|column| column.x.iter().chain(&column.u));
    Some((cost.map(|m| 1e4 * m.squared_norm_l2()).sum(), joint))
}

/// ∂(tube cost + μ·h)/∂x of each stage's first state, through the noise measured there.
fn gradient(joint: &JointResponses, x: &[Vec<f64>], multipliers: &RowValues) -> Vec<f64> {
    let of_stage = |(s, column): (usize, &pliant_control::tube::Column)| {
        let squares: f64 = column.x.iter().chain(&column.u).map(|m| 1e4 * m.squared_norm_l2()).sum();
        let rows = (s + 1..).zip(&column.x).map(|(k, response)| {
            let norm = |i: usize| (response[(i, 0)].powi(2) + response[(i, 1)].powi(2)).sqrt();
            multipliers.rows(k).iter().enumerate().map(|(i, mu)| mu * norm(i % 2)).sum::<f64>()
        });
        let noise = 0.02 * (2.0 - x[s][0]).powi(2);
        (2.0 * squares + rows.sum::<f64>()) / noise.max(1e-9) * -0.04 * (2.0 - x[s][0])
    };
    joint.noises.iter().enumerate().map(of_stage).collect()
}

struct Outcome {
    found: RobustSolution,
    tube_cost: f64,
    outer: usize,
    brightest: f64,
}

fn solve(horizon: usize, solver: &mut Timed) -> Option<Outcome> {
    let (ocp, disturbance, cost) = problem(horizon);
    let tube_problem = TubeProblem::new(&ocp, &disturbance, &cost).ok()?;
    let nominal: OcpSolution = solver.solve(&ocp).ok()?;
    let (mut x, mut u) = (nominal.x, nominal.u);
    let mut multipliers = RowValues::zeros(&ocp);
    let (mut tube, mut joint) = responses(&tube_problem, &x, &ocp)?;
    let mut prox = 1.0;
    let mut outer = 0;
    let mut found = None;
    while outer < OUTER.0 {
        outer += 1;
        let mut model = ocp.clone();
        for ((stage, x), slope) in model.stages.iter_mut().zip(&x).zip(gradient(&joint, &x, &multipliers)) {
            stage.q_linear[0] += slope;
            for (i, x) in x.iter().enumerate() {
                stage.q[(i, i)] += prox;
                stage.q_linear[i] -= prox * x;
            }
        }
        let synthesis = OutputFeedbackTube::new(&tube_problem, sensing(&x), Sharing::PerColumn).ok()?;
        let options = RobustOptions { iterations: 3, ..RobustOptions::default() };
        let candidate = robust(&model, &disturbance, &cost, solver, &synthesis, &options).ok()?;
        let before = cost_of(&ocp, &x, &u) + tube;
        let blend = |t: f64, from: &[Vec<f64>], to: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let of_vector = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a + t * (b - a)).collect();
            from.iter().zip(to).map(of_vector).collect()
        };
        let trial = [1.0, 0.5, 0.25, 0.125].into_iter().find_map(|t| {
            let (x, u) = (blend(t, &x, &candidate.nominal.x), blend(t, &u, &candidate.nominal.u));
            let (tube, joint) = responses(&tube_problem, &x, &ocp)?;
            (cost_of(&ocp, &x, &u) + tube < before || outer == 1).then_some((t, x, u, tube, joint))
        });
        let moved = x
            .iter()
            .zip(&candidate.nominal.x)
            .flat_map(|(a, b)| a.iter().zip(b))
            .fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()));
        multipliers = RowValues::multipliers(&ocp, &candidate.nominal);
        found = Some(candidate);
        match trial {
            Some((t, new_x, new_u, new_tube, new_joint)) => {
                (x, u, tube, joint) = (new_x, new_u, new_tube, new_joint);
                prox *= if t == 1.0 { 0.5 } else { 2.0 };
            }
            None => prox *= 8.0,
        }
        if moved < OUTER.1 {
            break;
        }
    }
    let brightest = x.iter().map(|x| x[0]).fold(f64::NEG_INFINITY, f64::max);
    Some(Outcome { found: found?, tube_cost: tube, outer, brightest })
}

pub fn run() {
    println!("light–dark, s; tubes of output feedback with gains per column, 3 inner iterations");
    println!("    N     tubes   nominal  outer  certified   tube cost  max x [m]   published   SDP");
    for (horizon, published, sdp) in PUBLISHED {
        let mut solver = Timed::default();
        let started = Instant::now();
        let Some(outcome) = solve(horizon, &mut solver) else {
            println!("{horizon:5} failed");
            continue;
        };
        let all = started.elapsed().as_secs_f64();
        println!(
            "{horizon:5} {:9.3} {:9.3} {:6} {:>10} {:11.1} {:10.2} {published:11.2} {sdp:5.0}",
            all - solver.seconds,
            solver.seconds,
            outcome.outer,
            outcome.found.is_certified(),
            outcome.tube_cost,
            outcome.brightest,
        );
    }
}
