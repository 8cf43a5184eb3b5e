//! Contact of edges and triangles with fixed shapes: what may not be cut, friction, how hard steps are to solve, and derivatives.
#![allow(clippy::unwrap_used)]

mod common;

use common::Case;
use pliant_adjoint::gradcheck::{DOT_TEST, FLOOR_FACTOR, RELATIVE_ERROR, Report, gradcheck};
use pliant_engine::model::Model;
use pliant_engine::scene::{
    Block, Capsule, Clamp, Cloth, Contact, Grid, Gripper, Initial, Integrator, Plane, Rope, Scene, Sphere, Time, Touching,
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

/// The least gap along an edge between two points: sampled, and refined where it is least \[m\].
fn edge_gap(scene: &Scene, [a, b]: [V3; 2]) -> f64 {
    let at = |s: f64| distance(scene, &a.lerp(&b, s));
    let samples = 40;
    let best = (0..=samples).min_by(|i, j| at(f64::from(*i) / 40.0).total_cmp(&at(f64::from(*j) / 40.0))).unwrap();
    let [mut low, mut high] = [-1.0, 1.0].map(|d| ((f64::from(best) + d) / 40.0).clamp(0.0, 1.0));
    for _ in 0..40 {
        let (s, t) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if at(s) < at(t) { high = t } else { low = s }
    }
    at(0.5 * (low + high)).min(at(f64::from(best) / 40.0))
}

/// The least gap of a triangle's inside: sampled, and that of boxes' corners under it \[m\].
fn inside_gap(scene: &Scene, [a, b, c]: [V3; 3]) -> f64 {
    let mut least = f64::INFINITY;
    for i in 1..16 {
        for j in 1..16 - i {
            let p = a + (b - a) * (f64::from(i) / 16.0) + (c - a) * (f64::from(j) / 16.0);
            least = least.min(distance(scene, &p));
        }
    }
    for block in &scene.block {
        let [w, x, y, z] = block.quaternion;
        let turn = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
        for k in 0..8 {
            let out = V3::from_fn(|a, _| if k >> a & 1 == 0 { 1.0 } else { -1.0 });
            let corner = V3::from(block.position) + turn * out.component_mul(&V3::from(block.half_extents));
            let n = (b - a).cross(&(c - a)).normalize();
            let foot = corner - n * n.dot(&(corner - a));
            let inside = [(a, b), (b, c), (c, a)].iter().all(|(p, q)| n.dot(&(q - p).cross(&(foot - p))) >= 0.0);
            // a corner far inside is none that the sheet lies on
            let gap = n.dot(&(a - corner)) * n.dot(&(turn * out)).signum();
            if inside && gap > -0.01 && n.dot(&(turn * out)).abs() > 1.0 {
                least = least.min(gap);
            }
        }
    }
    least
}

/// The least gap of all edges and triangles \[m\].
fn least_gap(scene: &Scene, model: &Model, q: &[f64]) -> f64 {
    let at = |node: usize| V3::new(q[3 * node], q[3 * node + 1], q[3 * node + 2]);
    let mut least = f64::INFINITY;
    for (rope, span) in scene.rope.iter().zip(model.ropes()) {
        for node in span.nodes.clone().skip(1) {
            least = least.min(edge_gap(scene, [at(node - 1), at(node)]) - rope.radius);
        }
    }
    for (cloth, span) in scene.cloth.iter().zip(model.cloths()) {
        for t in &span.triangles {
            let [a, b, c] = t.map(|k| at(span.nodes.start + k));
            let of_edges = [[a, b], [b, c], [c, a]].map(|e| edge_gap(scene, e)).into_iter().fold(f64::INFINITY, f64::min);
            least = least.min(of_edges.min(inside_gap(scene, [a, b, c])) - cloth.contact_radius());
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

// ---- Statics and friction ------------------------------------------------------------------------------------------

fn last(scene: &Scene, steps: usize) -> (Case, Vec<f64>, Vec<f64>) {
    let case = Case::new(scene, steps);
    let state = case.run(StepOptions { record: false, ..StepOptions::default() }).states.pop().unwrap();
    (case, state.q, state.v)
}

/// Four nodes hung over each shape come to rest on it with edges at the rest gap, held by friction.
#[test]
fn a_rope_of_four_nodes_rests_on_its_edges() {
    for kind in 0..3 {
        let rope = Rope {
            nodes: Some(4),
            length: 0.4,
            stretch_stiffness: 1e3,
            stretch_damping: 2.0,
            bend_stiffness: 1e-2,
            bend_damping: 1e-3,
            drag_linear: 0.5,
            radius: 0.004,
            initial: Initial::Straight { from: [-0.2, 0.002, 0.08], direction: [1.0, 0.02, 0.0] },
            contact: Touching::Edges,
            ..Rope::default()
        };
        let mut scene = Scene { rope: vec![rope], ..Scene::default() };
        scene.time = Time { step: 0.005, duration: 1.0, integrator: Integrator::Euler };
        scene.contact.rest_gap = 1e-7;
        match kind {
            0 => scene.sphere = vec![Sphere { friction: 1.0, ..ball() }],
            1 => scene.capsule = vec![Capsule { a: [0.0, -0.1, 0.0], b: [0.0, 0.1, 0.0], radius: 0.05, friction: 1.0, ..bar() }],
            _ => {
                // an edge along y on top
                let half = std::f64::consts::FRAC_PI_8;
                let quaternion = [half.cos(), 0.0, half.sin(), 0.0];
                scene.block = vec![Block { quaternion, half_extents: [0.04, 0.1, 0.04], friction: 1.0, ..brick() }];
            }
        }
        let (case, q, v) = last(&scene, 400);
        let gap = least_gap(&scene, &case.model, &q);
        let fastest = v.iter().fold(0.0f64, |a, v| a.max(v.abs()));
        println!("shape {kind}: least gap {gap:.2e} m, fastest {fastest:.1e} m/s");
        assert!(gap > 0.0 && gap < 1e-5, "{kind}: {gap}");
        assert!(fastest < 1e-3);
    }
}

/// A coarse sheet rests on a box's corner, and on a ball smaller than its triangles, without being cut.
#[test]
fn a_coarse_sheet_rests_on_a_corner_and_on_a_small_ball() {
    for kind in 0..2 {
        let sheet = Cloth {
            grid: Some(Grid { nodes: [4, 4], size: [0.3, 0.3], ..Grid::default() }),
            // the point under load lies within a triangle
            origin: [-0.17, -0.14, 0.09],
            thickness: 2e-3,
            youngs_modulus: 2e4,
            bend_stiffness: Some(5e-4),
            membrane_damping: 100.0,
            bend_damping: 1e-5,
            drag_normal: 1.0,
            contact: Touching::Edges,
            ..Cloth::default()
        };
        let corners = Clamp::Nodes(vec![0, 3, 12, 15]);
        let hand = Gripper { rope: None, cloth: Some("sheet".into()), clamp: corners, ..Gripper::default() };
        let mut scene = Scene { cloth: vec![sheet], gripper: vec![hand], ..Scene::default() };
        scene.time = Time { step: 0.005, duration: 1.0, integrator: Integrator::Euler };
        scene.contact.rest_gap = 1e-7;
        if kind == 0 {
            // a space diagonal upright
            let axis = V3::new(1.0, 1.0, 1.0).cross(&V3::z()).normalize();
            let angle = (1.0 / 3f64.sqrt()).acos();
            let turn = nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_unchecked(axis), angle);
            let quaternion = [turn.w, turn.i, turn.j, turn.k];
            let half = 0.0879 / 3f64.sqrt();
            scene.block = vec![Block { quaternion, half_extents: [half; 3], friction: 0.5, ..brick() }];
        } else {
            scene.sphere = vec![Sphere { radius: 0.02, center: [0.0, 0.0, 0.068], ..ball() }];
        }
        let (case, q, _) = last(&scene, 200);
        let gap = least_gap(&scene, &case.model, &q);
        println!("shape {kind}: least gap {gap:.2e} m");
        // a ball is sampled at every sixteenth of a triangle's side
        assert!(gap > -1e-9 && gap < if kind == 0 { 1e-5 } else { 2e-3 }, "{kind}: {gap}");
        let mut cut = scene.clone();
        cut.cloth[0].contact = Touching::Nodes;
        let (case, q, _) = last(&cut, 200);
        assert!(least_gap(&cut, &case.model, &q) < -1e-3, "nodes alone let it through");
    }
}

/// A straight edge across two bars that run downhill: friction as on an incline.
#[test]
fn an_edge_on_rails_sticks_and_slides_as_a_block_on_an_incline() {
    const MU: f64 = 0.5;
    let on_rails = |slope: f64, rest_gap: f64| {
        let bars = [-0.05, 0.05].map(|y| Capsule {
            name: if y < 0.0 { "left".into() } else { "right".into() },
            a: [-2.0, y, -0.01],
            b: [0.5, y, -0.01],
            radius: 0.01,
            friction: MU,
        });
        let rope = Rope {
            nodes: Some(2),
            length: 0.2,
            bend_stiffness: 0.0,
            radius: 0.005,
            initial: Initial::Straight { from: [0.0, -0.1, 0.005 + rest_gap], direction: [0.0, 1.0, 0.0] },
            contact: Touching::Edges,
            ..Rope::default()
        };
        let mut scene = Scene { rope: vec![rope], capsule: bars.to_vec(), ..Scene::default() };
        scene.gravity.tilt = [0.0, slope];
        scene.contact.rest_gap = rest_gap;
        scene.time = Time { step: 0.01, duration: 1.0, integrator: Integrator::Euler };
        scene
    };
    for part in [0.3, 0.8, 0.95] {
        let (_, q, v) = last(&on_rails((part * MU).atan(), 1e-9), 100);
        // smoothing lets it creep: δ/h ρ/(μ (1 − ρ²))
        let creep = 1e-9 / 0.01 * part / (MU * (1.0 - part * part));
        println!("at {part} of the friction angle: {:.1e} m/s (formula {creep:.1e}), {:.1e} m", v[0], q[0]);
        assert!(-v[0] < 3.0 * creep && -q[0] < 3.0 * creep, "{part}: {v:?}");
    }
    for excess in [1.05, 1.5, 2.0] {
        let slope = excess * MU.atan();
        let case = Case::new(&on_rails(slope, 1e-9), 60);
        let states = case.run(StepOptions { record: false, ..StepOptions::default() }).states;
        let acceleration = (states[20].v[0] - states[60].v[0]) / 0.4;
        let expected = 9.81 * (slope.sin() - MU * slope.cos());
        println!("at {excess} of it: {acceleration:.6} m/s², {expected:.6}");
        assert!((acceleration / expected - 1.0).abs() < 1e-3, "{excess}: {acceleration}, {expected}");
    }
}

/// Planes are touched by nodes either way: nothing differs.
#[test]
fn on_a_plane_edges_change_nothing() {
    let mut scene = common::scene("resting");
    let (_, q, v) = last(&scene, 40);
    scene.rope[0].contact = Touching::Edges;
    assert_eq!((q, v), {
        let (_, q, v) = last(&scene, 40);
        (q, v)
    });
}

/// A light rope over a bar, a weight at one end, pulled slowly down at the other: T₂/T₁ = e^{μφ} over half a turn.
fn capstan(nodes: usize, mu: f64, contact: Touching) -> f64 {
    const R: f64 = 0.05;
    let (radius, length, edges) = (0.002, 0.6, nodes - 1);
    let lift = R + radius;
    // up on one side, round, and down on the other
    let half = std::f64::consts::PI * lift;
    let leg = 0.5 * (length - half);
    let pitch = length / edges as f64;
    // nodes so that edges touch at their middles
    let outer = lift / (0.5 * pitch / lift).cos() + 1e-4;
    let points = (0..nodes).map(|k| {
        let s = k as f64 * pitch;
        let along = (s - leg) / half;
        match along {
            a if a <= 0.0 => [-outer, 0.0, s - leg],
            a if a >= 1.0 => [outer, 0.0, leg + half - s],
            a => {
                let (sin, cos) = (a * std::f64::consts::PI).sin_cos();
                [-outer * cos, 0.0, outer * sin]
            }
        }
    });
    let weight = 0.2;
    let rope = Rope {
        nodes: Some(nodes),
        length,
        linear_density: 1e-3,
        stretch_stiffness: 2e3,
        stretch_damping: 2.0,
        bend_stiffness: 0.0,
        radius,
        tip_mass: weight,
        initial: Initial::Points { points: points.collect() },
        contact,
        ..Rope::default()
    };
    let motion = pliant_engine::scene::Motion::Line { velocity: [0.0, 0.0, -0.02] };
    let hand = Gripper { clamp: Clamp::Nodes(vec![0]), motion, ..Gripper::default() };
    let bar = Capsule { a: [0.0, -0.2, 0.0], b: [0.0, 0.2, 0.0], radius: R, friction: mu, ..bar() };
    let mut scene = Scene { rope: vec![rope], gripper: vec![hand], capsule: vec![bar], ..Scene::default() };
    scene.time = Time { step: 0.004, duration: 3.0, integrator: Integrator::Euler };
    scene.contact.rest_gap = 1e-7;
    let case = Case::new(&scene, 500);
    let states = case.run(StepOptions { record: false, ..StepOptions::default() }).states;
    // means over the way of some edges
    let tension = |q: &[f64], e: usize| {
        let d: f64 = (0..3).map(|a| (q[3 * e + 3 + a] - q[3 * e + a]).powi(2)).sum::<f64>().sqrt();
        2e3 * (d / pitch - 1.0)
    };
    let late = &states[200..];
    let mean = |e: usize| late.iter().map(|s| tension(&s.q, e)).sum::<f64>() / late.len() as f64;
    mean(0) / mean(edges - 1)
}

#[test]
fn a_rope_over_a_bar_obeys_the_capstan_equation() {
    for mu in [0.2, 0.4] {
        let exact = (mu * std::f64::consts::PI).exp();
        let error = |nodes: usize, contact| {
            let found = capstan(nodes, mu, contact);
            println!("capstan μ = {mu}, {nodes} nodes, {contact:?}: {found:.4}, e^μπ = {exact:.4}");
            (found / exact - 1.0).abs()
        };
        // second order in the edges' length
        let [coarse, fine] = [31, 61].map(|nodes| error(nodes, Touching::Edges));
        assert!(fine < 0.01 && coarse < 0.04 && coarse > 3.0 * fine, "{coarse} {fine}");
        assert!(error(61, Touching::Nodes) < 0.01);
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
            let mut scene = dropped(kind, sheet, Touching::Edges, 1.0 / 240.0, &mut rng);
            scene.cloth.iter_mut().for_each(|c| c.grid = Some(Grid { nodes: [4, 4], size: [0.3, 0.25], ..Grid::default() }));
            let case = Case::new(&scene, 80);
            let run = case.run(StepOptions { record: false, ..StepOptions::default() });
            let case = Case { x0: run.states[75].clone(), u: case.u[..5].to_vec(), ..case };
            demand(&format!("{} on {}", if sheet { "cloth" } else { "rope" }, ["ball", "bar", "brick"][kind]), &case);
        }
    }
}

/// A hundred steps with grippers, from the scenes' beginnings.
#[test]
fn gradients_of_a_hundred_steps() {
    for name in ["rope_edges", "cloth_edges"] {
        let case = Case::new(&common::scene(name), 100);
        let run = case.run(StepOptions::default());
        let touching = run.records.iter().filter(|r| {
            let modes = r.stages[0].1.contact_modes(&case.model, &case.theta);
            modes.iter().any(|m| *m != 0)
        });
        println!("{name}: {} of 100 steps list contacts, {} halvings", touching.count(), run.retries());
        let report = demand(name, &case);
        // the sheet's quadratic regime is narrower: its slope is lost in rounding
        let slope = report.taylor_slope.unwrap();
        assert!(name == "cloth_edges" || (1.9..2.1).contains(&slope), "{name}: {slope}");
    }
}
