//! Random scenes that a gradient check once found fault with; what was wrong stands beside each.

use crate::common::Case;
use crate::judged::demand;
use pliant_adjoint::linearize;
use pliant_engine::step::StepOptions;
use pliant_scene::{Nothing, Scene, read_scene};

fn scene(name: &str) -> Scene {
    read_scene::<Nothing>(format!("{}/tests/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn whole(scene: &Scene) -> Case {
    Case::new(scene, (scene.time.duration / scene.time.step).round() as usize)
}

/// The load of a contact in the derivatives took the rounding of its gap for an impulse: derivatives were off by 1e-7 to 1e-6.
#[test]
fn balls_that_fall_at_a_tight_rest_gap() {
    for name in ["s25", "s97", "s131"] {
        demand(name, &whole(&scene(name)), 0);
    }
}

/// Disagreements below the floor of the difference were failures. Unjudged are blocks whose differences are too coarse.
#[test]
fn disagreements_below_the_floor_are_none() {
    for (name, inconclusive) in [("s28", 1), ("s41", 2), ("s45", 0), ("s118", 0), ("s148", 1)] {
        demand(name, &whole(&scene(name)), inconclusive);
    }
}

/// Over a level floor nothing depends on where a ball is across: these columns of A are zero but for the ball's own place, however large
/// the impulse and however tight the rest gap.
#[test]
fn nothing_depends_on_where_over_a_floor_a_body_falls() {
    let mut scene = scene("s131");
    scene.rope.clear();
    scene.plane[0].height = 0.0;
    scene.body[0].position[2] += 0.155;
    let case = Case::new(&scene, 30);
    let run = case.run(StepOptions::default());
    let mut impulse = 0.0_f64;
    for step in &run.records {
        let a = linearize(&case.model, &case.theta, step, false).a;
        impulse = impulse.max(a[8 * 12 + 2].abs());
        for column in [0, 1] {
            for row in (0..12).filter(|row| *row != column) {
                assert!(a[12 * row + column].abs() < 1e-12, "A[{row}, {column}] = {:e}", a[12 * row + column]);
            }
        }
    }
    assert!(impulse > 100.0, "the ball touches down: {impulse}");
}
