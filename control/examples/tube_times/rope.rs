//! Sizes of a rope between grippers: nx = 66, nu = 6, N = 20.

use faer::Mat;
use pliant_control::observer::{JointResponses, Observer, OutputFeedbackTube, Responses, Sensing, Sharing};
use pliant_control::ocp::Ocp;
use pliant_control::tube::{
    Disturbance, EllipsoidalTube, ExactTube, RobustOptions, RowValues, Scaling, SharedGainTube, Tube, TubeProblem, TubeSynthesis,
    robust,
};

use super::problems::{box_rows, generator, identity, invariant, random, tube_cost};
use super::reference::Reference;
use super::{least, with_threads};

const NX: usize = 66;
const NU: usize = 6;
const N: usize = 20;

/// Damped, coupled dynamics; boxes of six states and of all inputs, some active at the last stage, so that no tail is shared.
fn problem(all_states: bool) -> Ocp {
    let mut rng = generator(66);
    let a = identity(NX, 0.98) + random(&mut rng, NX, NX, 0.01);
    let b = random(&mut rng, NX, NU, 0.2);
    let mut ocp = invariant(&a, &b, N, vec![0.5; NX], [1.0, 0.1, 1.0], 1.0);
    let rows = || {
        let mut rows = box_rows(NX, NU, 0.7, 100.0);
        if !all_states {
            let kept: Vec<usize> = (0..6).flat_map(|i| [i, NX + i]).collect();
            rows.gx = Mat::from_fn(12, NX, |r, c| rows.gx[(kept[r], c)]);
            rows.gu = Mat::zeros(12, NU);
            rows.limits.truncate(12);
            rows.weights.truncate(12);
        }
        rows
    };
    for stage in &mut ocp.stages {
        stage.rows = rows();
    }
    ocp.rows_final = rows();
    // the last stage's own rows are tight
    ocp.rows_final.limits.fill(0.05);
    ocp
}

pub fn run() {
    println!("nx = {NX}, nu = {NU}, N = {N}; least ms of 15 runs on 1 and 2 threads; 12 rows of states and 6 inputs a stage");
    let ocp = problem(false);
    let cost = tube_cost(NX, NU, 1.0, 0.1, 1.0);
    let dense = Disturbance::new((0..=N).map(|_| identity(NX, 1e-3)));
    let mut rng = generator(6);
    let low = Disturbance::new((0..=N).map(|_| random(&mut rng, NX, 6, 1e-3)));
    for (name, disturbance) in [("nw = 66", &dense), ("nw = 6", &low)] {
        let problem = TubeProblem::new(&ocp, disturbance, &cost).unwrap();
        for (kind, synthesis) in [
            ("exact, column by column", &ExactTube as &(dyn TubeSynthesis + Sync)),
            ("shared gain", &SharedGainTube),
            ("ellipsoid", &EllipsoidalTube { scaling: Scaling::Bound }),
        ] {
            let options = RobustOptions { iterations: 2, ..RobustOptions::default() };
            let found = robust(&ocp, disturbance, &cost, &mut Reference::default(), synthesis, &options).unwrap();
            let multipliers = RowValues::multipliers(&ocp, &found.nominal);
            let previous: Tube = found.tube;
            let time =
                |threads| with_threads(threads, || least(|| drop(synthesis.synthesize(&problem, &multipliers, Some(&previous)))));
            println!("{name:8} {kind:26} {:8.2} {:8.2}", time(1), time(2));
        }
    }
    let problem = TubeProblem::new(&ocp, &dense, &cost).unwrap();
    let sensing = Sensing { c: vec![identity(NX, 1.0); N], f: vec![identity(NX, 1e-3); N], delay: 1 };
    println!("{:35} {:8.2}", "Kalman, ny = 66", least(|| drop(Observer::new(&problem, &sensing))));
    for (name, sharing) in [("per column", Sharing::PerColumn), ("shared gain", Sharing::Shared)] {
        let synthesis = OutputFeedbackTube::new(&problem, sensing.clone(), sharing).unwrap();
        let options = RobustOptions { iterations: 2, ..RobustOptions::default() };
        let found = robust(&ocp, &dense, &cost, &mut Reference::default(), &synthesis, &options).unwrap();
        let gains = found.tube.gains;
        let time = |threads| with_threads(threads, || least(|| drop(synthesis.tightenings(&problem, &gains))));
        println!("output feedback by rows, {name:10} {:8.2} {:8.2}", time(1), time(2));
        if sharing == Sharing::Shared {
            let joint = |threads| {
                with_threads(threads, || least(|| drop(JointResponses::new(&problem, &sensing, &synthesis.observer, &gains))))
            };
            println!("{:35} {:8.2} {:8.2}", "output feedback, joint recursion", joint(1), joint(2));
        }
        let whole = least(|| drop(Responses::new(&problem, &sensing, &synthesis.observer, &gains)));
        println!("{:35} {whole:8.2}", "whole responses, all blocks");
    }
}
