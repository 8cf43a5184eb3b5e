//! Derivatives of contact of edges and triangles.

use crate::common::Case;
use crate::common::shapes::{Random, dropped};
use crate::judged::demand;
use pliant_engine::step::StepOptions;
use pliant_scene::{Grid, Touching};

/// Two steps after a drop, on every shape.
#[test]
fn gradients_on_every_shape() {
    for sheet in [false, true] {
        for kind in 0..3 {
            let mut rng = Random(5);
            let mut scene = dropped(kind, sheet, Touching::Edges, 1.0 / 240.0, &mut rng);
            scene.cloth.iter_mut().for_each(|c| c.grid = Some(Grid { nodes: [4, 4], size: [0.3, 0.25], ..Grid::default() }));
            let case = Case::new(&scene, 80);
            let run = case.run(StepOptions { record: false, ..StepOptions::default() });
            let case = Case { x0: run.states[75].clone(), u: case.u[..5].to_vec(), ..case };
            demand(&format!("{} on {}", if sheet { "cloth" } else { "rope" }, ["ball", "bar", "brick"][kind]), &case, 1);
        }
    }
}

/// A hundred steps with grippers, from the scenes' beginnings.
#[test]
fn gradients_of_a_hundred_steps() {
    for name in ["rope_edges", "cloth_edges"] {
        let case = Case::new(&crate::common::scene(name), 100);
        let run = case.run(StepOptions::default());
        let touching = run.records.iter().filter(|r| {
            let modes = r.stages[0].1.contact_modes(&case.model, &case.theta);
            modes.iter().any(|m| *m != 0)
        });
        println!("{name}: {} of 100 steps list contacts, {} halvings", touching.count(), run.retries());
        demand(name, &case, if name == "rope_edges" { 3 } else { 1 });
    }
}

/// Contacts that begin deep aim at a gap that follows the one they began with, through positions, sizes and orientations.
#[test]
fn deep_starts() {
    let mut case = Case::new(&crate::common::scene("rope_edges"), 12);
    // 1.5 mm into the box, whose edge it is to lie on, and 5 mm into the bar
    (0..7).for_each(|node| case.x0.q[3 * node + 2] -= 0.0125);
    case.x0.v.fill(0.0);
    let run = case.run(StepOptions::default());
    let upward = |x: &pliant_math::State| (1..7).map(|node| x.v[3 * node + 2]).fold(0.0, f64::max);
    // no faster than a fall over that time, and what a push between two nodes gives them
    assert!(run.states.iter().all(|x| upward(x) < 0.3), "thrown");
    demand("deep starts of edges", &case, 3);
}
