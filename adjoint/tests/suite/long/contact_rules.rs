//! Rules for pairs of a rope and a fixed shape: they stand for the shape's own friction, and let ignored pairs pass through each other.

use crate::common::{Case, scene};
use crate::judged::demand;
use pliant_adjoint::rollout_vjp;
use pliant_engine::rollout::Rollout;
use pliant_engine::step::StepOptions;
use pliant_scene::{ContactRule, Scene, Touching};

const STEPS: usize = 40;

/// Where a scene has the friction of a shape.
type Place = fn(&mut Scene) -> &mut f64;

/// Cables on a plane, a bar and a ball, and their names.
fn scenes() -> [(Scene, &'static str, Place); 3] {
    [
        (scene("sliding"), "floor", |scene: &mut Scene| &mut scene.plane[0].friction),
        (scene("capsule_drape"), "bar", |scene| &mut scene.capsule[0].friction),
        (scene("sphere_drape"), "ball", |scene| &mut scene.sphere[0].friction),
    ]
}

fn rule(scene: &Scene, shape: &str) -> ContactRule {
    ContactRule { between: [shape.to_owned(), scene.rope[0].name.clone()], ..ContactRule::default() }
}

fn run(scene: &Scene) -> (Case, Rollout) {
    let case = Case::new(scene, STEPS);
    let run = case.run(StepOptions::default());
    (case, run)
}

fn gradient(case: &Case, run: &Rollout, path: &str) -> f64 {
    rollout_vjp(run, &case.x_bar()).unwrap().theta[case.model.params().find(path).unwrap()]
}

#[test]
fn a_rule_stands_for_the_shapes_own_friction() {
    for contact in [Touching::Nodes, Touching::Edges] {
        for (mut own, shape, friction) in scenes() {
            own.rope[0].contact = contact;
            let mut ruled = own.clone();
            *friction(&mut own) = 0.12;
            ruled.contact.pair = vec![ContactRule { friction: Some(0.12), ..rule(&ruled, shape) }];
            let [(a, run_a), (b, run_b)] = [run(&own), run(&ruled)];
            let (x, y) = (&run_a.states[STEPS], &run_b.states[STEPS]);
            assert_eq!((&x.q, &x.v), (&y.q, &y.v), "{shape}, {contact:?}");
            let path = format!("{shape}.friction");
            let [by_own, by_rule] = [gradient(&a, &run_a, &path), gradient(&b, &run_b, "contact.pair[0].friction")];
            println!("{shape}, {contact:?}: {by_own:.6e} {by_rule:.6e}");
            assert!(by_own != 0.0 && (by_own - by_rule).abs() <= 1e-12 * by_own.abs(), "{by_own} {by_rule}");
            assert_eq!(gradient(&b, &run_b, &path), 0.0, "the shape's own says nothing any more");
        }
    }
}

#[test]
fn what_is_ignored_is_not_there() {
    for contact in [Touching::Nodes, Touching::Edges] {
        for (mut scene, shape, _) in scenes() {
            scene.rope[0].contact = contact;
            let mut without = scene.clone();
            without.plane.retain(|s| s.name != shape);
            without.sphere.retain(|s| s.name != shape);
            without.capsule.retain(|s| s.name != shape);
            let touched = run(&scene).1;
            scene.contact.pair = vec![ContactRule { ignore: true, ..rule(&scene, shape) }];
            let [a, b] = [run(&scene).1, run(&without).1];
            assert_eq!(
                (&a.states[STEPS].q, &a.states[STEPS].v),
                (&b.states[STEPS].q, &b.states[STEPS].v),
                "{shape}, {contact:?}"
            );
            assert_ne!(a.states[STEPS].q, touched.states[STEPS].q);
        }
    }
}

#[test]
fn gradients_with_rules() {
    for steps in [40, 100] {
        let case = Case::new(&scene("contact_rules"), steps);
        let report = demand(&format!("{steps} steps"), &case, 0);
        let rules = report.blocks.iter().find(|block| block.name == "contact.pair[*].friction").unwrap();
        assert!(rules.relative_error < 1e-7 && (rules.taylor_slope.unwrap() - 2.0).abs() < 0.1, "{rules:?}");
    }
}
