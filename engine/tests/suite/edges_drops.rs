//! Random drops of ropes and sheets whose edges and triangles touch: nothing is cut, and how hard steps are to solve.

use crate::common::Case;
use crate::common::shapes::{Random, dropped, least_gap};
use pliant_engine::step::{StepOptions, Stepper};
use pliant_scene::Touching;

#[derive(Default, Debug)]
struct Count {
    steps: usize,
    iterations: usize,
    most: usize,
    factorizations: usize,
    retries: usize,
    failures: usize,
    least_gap: f64,
    late_gap: f64,
}

/// `drops` drops of `steps` steps each.
fn count(kind: usize, sheet: bool, contact: Touching, step: f64, [drops, steps]: [usize; 2]) -> Count {
    let mut out = Count { late_gap: f64::INFINITY, ..Count::default() };
    let mut rng = Random(3 + kind as u64);
    for _ in 0..drops {
        let scene = dropped(kind, sheet, contact, step, &mut rng);
        let case = Case::new(&scene, 1);
        let mut stepper =
            Stepper::new(&case.model, &case.theta, StepOptions { record: false, ..StepOptions::default() }).unwrap();
        let mut state = case.x0.clone();
        for k in 0..steps {
            match stepper.step(&mut state, &[]) {
                Ok((trace, _)) => {
                    out.steps += 1;
                    out.iterations += trace.work.iterations;
                    out.most = out.most.max(trace.work.iterations);
                    out.factorizations += trace.work.factorizations;
                    out.retries += trace.retries;
                }
                Err(error) => {
                    println!("{error}");
                    out.failures += 1;
                    break;
                }
            }
            let gap = least_gap(&scene, &case.model, &state.q);
            out.least_gap = out.least_gap.min(gap);
            if 2 * k > steps {
                out.late_gap = out.late_gap.min(gap);
            }
        }
    }
    out
}

/// Coarse sheets and ropes on all shapes. What falls moves by half an edge in 1/60 s, and what it hits beside the features that were listed
/// is pushed out in the next step; at rest nothing is cut.
#[test]
fn random_drops_are_solved_and_nothing_is_cut() {
    let many = std::env::var("PLIANT_MANY_DROPS").is_ok();
    for (sheet, step) in [(false, 1.0 / 60.0), (false, 1.0 / 240.0), (true, 1.0 / 60.0), (true, 1.0 / 240.0)] {
        for kind in 0..3 {
            for contact in [Touching::Nodes, Touching::Edges] {
                let size = match (many, step < 0.01) {
                    (true, true) => [5, 200],
                    (true, false) => [20, 50],
                    (false, true) => [1, 120],
                    (false, false) => [2, 30],
                };
                let c = count(kind, sheet, contact, step, size);
                println!(
                    "{} on {}, 1/{:.0} s, {contact:?}: {} steps, {:.2} iterations a step (most {}), {} halvings, {} failures, \
                     least gap {:.1e} m, of the later half {:.1e} m",
                    if sheet { "sheet" } else { "rope" },
                    ["ball", "bar", "brick"][kind],
                    1.0 / step,
                    c.steps,
                    c.iterations as f64 / c.steps as f64,
                    c.most,
                    c.retries,
                    c.failures,
                    c.least_gap,
                    c.late_gap
                );
                assert_eq!(c.failures, 0);
                if contact == Touching::Edges {
                    // in a step of 1/240 s what falls on a brick moves by 8 mm, so (8 mm)²/2 over the size of an edge is the depth of what was not
                    // listed when the step began
                    assert!(c.least_gap > if step < 0.01 { -6e-4 } else { -0.01 }, "{c:?}");
                    assert!(step > 0.01 || c.late_gap > -1e-9, "{c:?}");
                } else {
                    assert!(c.least_gap < -5e-3, "between nodes, shapes are cut: {c:?}");
                }
            }
        }
    }
}

/// A rope whose edges begin in a box, though no node does, is pushed out at a step's fall a step, not with depth/h, whatever the step.
#[test]
fn an_edge_that_begins_deep_is_pushed_out_slowly() {
    let text = r#"
schema_version = 1
[time]
step = 0.004
duration = 1.0
integrator = "euler"
[contact]
rest_gap = 1e-6
[[rope]]
name = "cable"
nodes = 3
length = 0.4
linear_density = 0.05
stretch_stiffness = 400.0
bend_stiffness = 5e-4
radius = 0.004
contact = "edges"
initial = { shape = "straight", from = [-0.2, 0.0, 0.0524], direction = [1.0, 0.0, 0.0] }
[[box]]
name = "table"
position = [0.1, 0.0, 0.0]
half_extents = [0.05, 0.1, 0.05]
friction = 0.4
"#;
    let scene = pliant_scene::parse_scene(text, "inside.toml").unwrap();
    for step in [1.0 / 240.0, 0.001] {
        let mut scene = scene.clone();
        scene.time.step = step;
        let case = Case::new(&scene, 40);
        let begun = least_gap(&scene, &case.model, &case.x0.q);
        assert!(begun < -1.5e-3, "{begun} m");
        let run = case.run(StepOptions { record: false, ..StepOptions::default() });
        assert_eq!(run.retries(), 0);
        let gaps: Vec<f64> = run.states.iter().map(|x| least_gap(&scene, &case.model, &x.q)).collect();
        // by no more than 10 h² a step, until it is out
        let slowly = |g: &[f64]| g[0] >= 0.0 || (0.0..10.0 * step * step + 1e-6).contains(&(g[1] - g[0]));
        assert!(gaps.windows(2).all(slowly), "h = {step}: {gaps:?}");
        assert!(gaps[40] > (begun + 40.0 * 10.0 * step * step).min(0.0) - 1e-6, "h = {step}: {} m", gaps[40]);
    }
}
