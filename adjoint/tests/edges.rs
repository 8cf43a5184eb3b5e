//! Contact of edges and triangles with fixed shapes: what may not be cut, friction, how hard steps are to solve, and derivatives.
#![allow(clippy::unwrap_used)]

mod common;

use common::Case;
use pliant_adjoint::gradcheck::{DOT_TEST, FLOOR_FACTOR, RELATIVE_ERROR, Report, gradcheck};
use pliant_engine::model::Model;
use pliant_engine::scene::{
    Block, Capsule, Cloth, Contact, Grid, Initial, Integrator, Plane, Rope, Scene, Sphere, Time, Touching,
};
use pliant_engine::step::{StepOptions, Stepper};

type V3 = nalgebra::Vector3<f64>;

// ---- Distances, by themselves --------------------------------------------------------------------------------------

/// Distance of a point from the nearest of the scene's spheres, capsules and boxes \[m\]; of boxes negative inside.
fn distance(scene: &Scene, p: &V3) -> f64 {
    let spheres = scene.sphere.iter().map(|s| (p - V3::from(s.center)).norm() - s.radius);
    let capsules = scene.capsule.iter().map(|s| {
        let (a, axis) = (V3::from(s.a), V3::from(s.b) - V3::from(s.a));
        let t = ((p - a).dot(&axis) / axis.norm_squared()).clamp(0.0, 1.0);
        (p - a - axis * t).norm() - s.radius
    });
    let blocks = scene.block.iter().map(|s| {
        let [w, x, y, z] = s.quaternion;
        let turn = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
        let y = turn.inverse() * (p - V3::from(s.position));
        let over = V3::from_fn(|k, _| y[k].abs() - s.half_extents[k]);
        over.map(|x| x.max(0.0)).norm() + over.max().min(0.0)
    });
    spheres.chain(capsules).chain(blocks).fold(f64::INFINITY, f64::min)
}

/// The least gap of all edges and triangles, sampled \[m\].
fn least_gap(scene: &Scene, model: &Model, q: &[f64]) -> f64 {
    let at = |node: usize| V3::new(q[3 * node], q[3 * node + 1], q[3 * node + 2]);
    let mut least = f64::INFINITY;
    for (rope, span) in scene.rope.iter().zip(model.ropes()) {
        for node in span.nodes.clone().skip(1) {
            for k in 0..=100 {
                let p = at(node - 1).lerp(&at(node), 0.01 * f64::from(k));
                least = least.min(distance(scene, &p) - rope.radius);
            }
        }
    }
    for (cloth, span) in scene.cloth.iter().zip(model.cloths()) {
        for t in &span.triangles {
            let [a, b, c] = t.map(|k| at(span.nodes.start + k));
            for i in 0..=24 {
                for j in 0..=24 - i {
                    let p = a + (b - a) * (f64::from(i) / 24.0) + (c - a) * (f64::from(j) / 24.0);
                    least = least.min(distance(scene, &p) - cloth.contact_radius());
                }
            }
        }
    }
    least
}

// ---- Random drops --------------------------------------------------------------------------------------------------

/// Numbers by a linear congruence (Knuth's MMIX).
struct Random(u64);

impl Random {
    fn within(&mut self, a: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        a * ((self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
    }
}

fn ball() -> Sphere {
    Sphere { name: "ball".into(), center: [0.0; 3], radius: 0.06, friction: 0.4 }
}

fn bar() -> Capsule {
    Capsule { name: "bar".into(), a: [-0.07, 0.0, 0.0], b: [0.08, 0.02, 0.01], radius: 0.025, friction: 0.4 }
}

fn brick() -> Block {
    let quaternion = nalgebra::UnitQuaternion::from_euler_angles(0.5, 0.4, 0.2);
    let quaternion = [quaternion.w, quaternion.i, quaternion.j, quaternion.k];
    Block { name: "brick".into(), position: [0.0; 3], quaternion, half_extents: [0.06, 0.05, 0.04], friction: 0.4 }
}

/// Puts shape `kind` (0 ball, 1 bar, 2 brick) over a floor.
fn furnish(scene: &mut Scene, kind: usize) {
    scene.plane = vec![Plane { height: -0.12, friction: 0.4, ..Plane::default() }];
    match kind {
        0 => scene.sphere = vec![ball()],
        1 => scene.capsule = vec![bar()],
        _ => scene.block = vec![brick()],
    }
}

fn dropped(kind: usize, sheet: bool, contact: Touching, step: f64, rng: &mut Random) -> Scene {
    let mut scene = Scene { contact: Contact { rest_gap: 1e-6, ..Contact::default() }, ..Scene::default() };
    scene.time = Time { step, duration: 1.0, integrator: Integrator::Euler };
    let mut random = |a: f64| rng.within(a);
    let angle = random(3.0);
    let velocity = [random(0.3), random(0.3), random(0.5) - 0.5];
    let (x, y) = (random(0.05), random(0.05));
    let along = [angle.cos(), angle.sin(), 0.0];
    if sheet {
        let across = [-along[1], along[0], 0.0];
        let origin = [0, 1].map(|a| [x, y][a] - 0.15 * along[a] - 0.125 * across[a]);
        scene.cloth = vec![Cloth {
            grid: Some(Grid { nodes: [7, 6], size: [0.3, 0.25], ..Grid::default() }),
            origin: [origin[0], origin[1], 0.12],
            u_axis: Some(along),
            v_axis: Some(across),
            velocity,
            thickness: 2e-3,
            youngs_modulus: 2e4,
            bend_stiffness: Some(1e-5),
            membrane_damping: 20.0,
            bend_damping: 1e-7,
            contact,
            ..Cloth::default()
        }];
    } else {
        let from = [x - 0.25 * along[0], y - 0.25 * along[1], 0.12];
        scene.rope = vec![Rope {
            nodes: Some(10),
            length: 0.5,
            stretch_stiffness: 1e3,
            stretch_damping: 0.05,
            bend_stiffness: 3e-4,
            bend_damping: 1e-5,
            radius: 0.004,
            velocity,
            initial: Initial::Straight { from, direction: along },
            contact,
            ..Rope::default()
        }];
    }
    furnish(&mut scene, kind);
    scene
}

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

#[test]
fn random_drops_are_solved_and_nothing_is_cut() {
    for sheet in [false, true] {
        for step in [1.0 / 60.0, 1.0 / 240.0] {
            for kind in 0..3 {
                for contact in [Touching::Nodes, Touching::Edges] {
                    let steps = if step < 0.01 { [5, 200] } else { [20, 50] };
                    let c = count(kind, sheet, contact, step, steps);
                    println!(
                        "{} on {} h 1/{:.0} {contact:?}: {} steps, {:.2} iterations a step (most {}), {:.2} factorizations, {} halvings, {} failures, least gap {:.1e}, late {:.1e}",
                        if sheet { "cloth" } else { "rope" },
                        ["ball", "bar", "brick"][kind],
                        1.0 / step,
                        c.steps,
                        c.iterations as f64 / c.steps as f64,
                        c.most,
                        c.factorizations as f64 / c.steps as f64,
                        c.retries,
                        c.failures,
                        c.least_gap,
                        c.late_gap
                    );
                }
            }
        }
    }
}

// ---- Derivatives ---------------------------------------------------------------------------------------------------

fn demand(what: &str, case: &Case) -> Report {
    let report = gradcheck(&case.model, &case.theta, &case.x0, &case.u, 7).unwrap();
    let judged = || report.blocks.iter().filter(|b| b.contact_switches == 0);
    println!(
        "{what}: worst {:.1e}, slope {:?}, dot {:.1e}, judged {}/{}, switches {}, retries {}",
        report.worst_relative_error,
        report.taylor_slope,
        report.dot_test,
        judged().count(),
        report.blocks.len(),
        report.contact_switches,
        report.retries
    );
    let wrong: Vec<_> = judged().filter(|b| b.relative_error > RELATIVE_ERROR.max(FLOOR_FACTOR * b.floor)).collect();
    assert!(wrong.is_empty(), "{what}: {wrong:#?}");
    assert!(report.dot_test <= DOT_TEST, "{what}");
    assert!(judged().count() * 2 > report.blocks.len(), "{what}: differences must judge most blocks");
    report
}

/// Two steps after a drop, on every shape.
#[test]
fn gradients_on_every_shape() {
    for sheet in [false, true] {
        for kind in 0..3 {
            let mut rng = Random(5);
            let scene = dropped(kind, sheet, Touching::Edges, 1.0 / 240.0, &mut rng);
            let case = Case::new(&scene, 80);
            let run = case.run(StepOptions { record: false, ..StepOptions::default() });
            let case = Case { x0: run.states[75].clone(), u: case.u[..5].to_vec(), ..case };
            demand(&format!("{} on {}", if sheet { "cloth" } else { "rope" }, ["ball", "bar", "brick"][kind]), &case);
        }
    }
}

#[test]
fn explore() {
    let env = |k: &str, d: f64| std::env::var(k).ok().and_then(|x| x.parse::<f64>().ok()).unwrap_or(d);
    let (kind, sheet, step) = (env("KIND", 2.0) as usize, env("SHEET", 1.0) > 0.0, 1.0 / env("RATE", 60.0));
    let contact = if env("EDGES", 1.0) > 0.0 { Touching::Edges } else { Touching::Nodes };
    let mut rng = Random(3 + kind as u64);
    let (mut all, mut fails, mut halved, mut steps) = (0, 0, 0, 0);
    let clock = std::time::Instant::now();
    for drop in 0..env("DROPS", 20.0) as usize {
        let mut scene = dropped(kind, sheet, contact, step, &mut rng);
        scene.contact.rest_gap = env("GAP", 1e-6);
        if sheet {
            scene.cloth[0].bend_stiffness = Some(env("BEND", 1e-5));
            scene.cloth[0].youngs_modulus = env("YOUNG", 2e4);
            scene.cloth[0].drag_normal = env("DRAG", 0.0);
        }
        let case = Case::new(&scene, 1);
        let mut stepper =
            Stepper::new(&case.model, &case.theta, StepOptions { record: false, ..StepOptions::default() }).unwrap();
        let mut state = case.x0.clone();
        let verbose = env("VERBOSE", 0.0) > 0.0;
        for k in 0..env("STEPS", 50.0) as usize {
            let trace = match stepper.step(&mut state, &[]) {
                Ok((trace, _)) => trace,
                Err(error) => {
                    println!("drop {drop} step {k}: {error}");
                    fails += 1;
                    break;
                }
            };
            (all, halved, steps) = (all + trace.work.iterations, halved + trace.retries, steps + 1);
            let fastest = state.v.iter().fold(0.0f64, |a, v| a.max(v.abs()));
            if verbose {
                println!(
                    "drop {drop} step {k}: {} iterations, {} halvings, gap {:.1e}, fastest {fastest:.2}",
                    trace.work.iterations,
                    trace.retries,
                    least_gap(&scene, &case.model, &state.q)
                );
            }
        }
    }
    println!("{} iterations a step, {fails} failures, {halved} halvings, {:.1} s", all as f64 / steps as f64, clock.elapsed().as_secs_f64());
}
