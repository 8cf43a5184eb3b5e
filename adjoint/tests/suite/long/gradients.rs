//! Derivatives of rollouts and equilibria on the scenes of `tests/scenes`, against differences.

use crate::common::{Case, STEPS, scene, with};
use crate::judged::demand;
use pliant_adjoint::gradcheck::{GRADCHECK, Verdict};
use pliant_adjoint::{AdjointError, Seeds, equilibrium_jvp_columns, equilibrium_vjp, linearize, rollout_jvp, rollout_vjp};
use pliant_engine::equilibrium::equilibrium;
use pliant_engine::rollout::{Rollout, RolloutOptions, rollout};
use pliant_engine::step::{StepError, StepOptions};
use pliant_math::State;
use pliant_scene::{Integrator, Law, LinearSolver, resting_inputs};

const SMOOTH: [&str; 12] = [
    "free_swing",
    "clamped_ends",
    "edge_clamp",
    "uneven_edges",
    "velocity_gripper",
    "windy",
    "own_force",
    "twisting_rod",
    "arm_free",
    "arm_actuators",
    "arm_plastic",
    "arm_own",
];
/// The default rest gap, 1 nm: contacts of 4e7 N/m on ropes of 1 N/m.
const HARDEST: f64 = 1e-9;
const CONTACT: [&str; 4] = ["resting", "sliding", "sphere_drape", "capsule_drape"];

#[test]
fn smooth_rollouts_under_every_integrator() {
    for name in SMOOTH {
        for integrator in [Integrator::Midpoint, Integrator::Euler, Integrator::Sdirk2] {
            let case = Case::new(&with(name, integrator), STEPS);
            // nothing else damps this rope: bending damping changes its fastest waves beyond recognition from 5e-7 N·m·s on, and
            // differences of a hundredth of that carry a rounding of 3e-6
            let rounded = if (name, integrator) == ("free_swing", Integrator::Midpoint) { 1 } else { 0 };
            let kinks = if name.starts_with("arm") { 4 } else { 0 };
            let report = demand(&format!("{name} {integrator:?}"), &case, kinks + rounded);
            let entries: usize = report.blocks.iter().map(|b| b.size).sum();
            let all = case.model.ndx() + STEPS * case.model.nu() + case.model.n_params();
            assert_eq!(entries, all, "{name}: every input is in a block");
            // dry friction of size zero makes a joint that turns round stick: the only kink here
            let mut kinked = report.with(Verdict::Inconclusive);
            let expected = if rounded > 0 { &["cable.bend_damping"][..] } else { &[".friction", ".stiction"] };
            assert!(kinked.all(|b| expected.iter().any(|end| b.name.ends_with(end))), "{name}");
        }
    }
}

#[test]
fn rollouts_through_contact() {
    let gaps = [None, Some(HARDEST)];
    let cases = CONTACT.into_iter().flat_map(|name| [Integrator::Euler, Integrator::Sdirk2].map(|integrator| (name, integrator)));
    for (name, integrator) in cases {
        for gap in gaps {
            let mut scene = with(name, integrator);
            scene.contact.rest_gap = gap.unwrap_or(scene.contact.rest_gap);
            // rounding leaves differences of a rope at rest by two stages a floor above 1e-6
            let rounded = if gap.is_some() && name == "resting" && integrator == Integrator::Sdirk2 { 6 } else { 1 };
            demand(&format!("{name} {integrator:?} at {:e} m", scene.contact.rest_gap), &Case::new(&scene, STEPS), rounded);
        }
    }
}

/// Dry friction that slides and sticks, and a stop that is run into, from a soft to a hard rest gap.
#[test]
fn friction_and_stops_of_joints() {
    for (integrator, gap) in [(Integrator::Euler, 1e-4), (Integrator::Euler, 1e-8), (Integrator::Sdirk2, 1e-8)] {
        let mut scene = with("arm_stops", integrator);
        scene.contact.rest_gap = gap;
        let case = Case::new(&scene, 2 * STEPS);
        let run = case.run(StepOptions::default());
        let modes = |k: usize| run.records[k].stages[0].1.contact_modes(&case.model, &case.theta);
        let seen: Vec<Vec<u8>> = (0..run.records.len()).map(modes).collect();
        // shoulder friction, elbow friction, lower stop, upper stop
        let hard = gap < 1e-5; // a soft law slides a little below its bound, like one that sticks
        assert!(!hard || seen.iter().any(|m| m[0] == 1) && seen.iter().any(|m| m[0] == 2), "the shoulder slides, then sticks");
        assert!(seen.iter().any(|m| m[3] == 1), "the elbow runs into its stop");
        demand(&format!("arm_stops {integrator:?} at {gap:e}"), &case, 0);
    }
}

/// Friction that differs by direction and grows with the load, sliding both ways.
#[test]
fn friction_of_gears() {
    for (integrator, gap) in
        [(Integrator::Euler, 1e-4), (Integrator::Euler, 1e-8), (Integrator::Sdirk2, 1e-8), (Integrator::Midpoint, 1e-6)]
    {
        let mut scene = with("arm_gear", integrator);
        scene.contact.rest_gap = gap;
        let case = Case::new(&scene, STEPS);
        let run = case.run(StepOptions::default());
        let modes = |k: usize| run.records[k].stages[0].1.contact_modes(&case.model, &case.theta);
        let seen: Vec<Vec<u8>> = (0..run.records.len()).map(modes).collect();
        assert!(seen.iter().any(|m| m[2] % 4 == 2) && seen.iter().any(|m| m[2] % 4 == 3), "the elbow slides both ways");
        demand(&format!("arm_gear {integrator:?} at {gap:e}"), &case, 0);
    }
}

/// Friction that builds up along the way, of joints that go one way and of one that turns round. It begins with nothing built up, where loading
/// and unloading meet: that start is a kink, as dry friction of size zero is.
#[test]
fn presliding_of_joints() {
    for integrator in [Integrator::Midpoint, Integrator::Euler, Integrator::Sdirk2] {
        let case = Case::new(&with("arm_presliding", integrator), STEPS);
        let turned = |k: usize| case.run(StepOptions::default()).states.windows(2).any(|w| w[0].v[k] * w[1].v[k] < 0.0);
        assert!(turned(3), "the slide turns round");
        let report = demand(&format!("arm_presliding {integrator:?}"), &case, 3);
        let mut kinked = report.with(Verdict::Inconclusive);
        assert!(kinked.all(|b| ["x0.z", ".friction", ".stiction"].iter().any(|end| b.name.ends_with(end))));
    }
}

/// A delay of whole steps is a kink between shorter and longer ones; its derivative is that towards longer ones.
#[test]
fn a_delay_of_whole_steps_is_noticed() {
    let mut scene = with("arm_actuators", Integrator::Euler);
    (scene.actuator[0].delay, scene.actuator[0].lag) = (Some(0.01), None);
    let case = Case::new(&scene, 20);
    let report = demand("a delay of whole steps", &case, 3);
    let delay = report.blocks.iter().find(|b| b.name == "shoulder_servo.delay").unwrap();
    assert!(
        delay.verdict == Verdict::Inconclusive && delay.switches > 0 && report.verdict == Verdict::Inconclusive,
        "{delay:#?}"
    );
    let path = case.model.params().find("shoulder_servo.delay").unwrap();
    let end = |delay: f64| {
        let mut theta = case.theta.clone();
        theta[path] = delay;
        rollout(&case.model, &theta, &case.x0, &case.u, StepOptions::default()).unwrap().states[20].v[0]
    };
    let mut theta_dot = vec![0.0; case.theta.len()];
    theta_dot[path] = 1.0;
    let tangent = rollout_jvp(&case.run(StepOptions::default()), None, None, Some(&theta_dot)).unwrap()[20][case.model.nv()];
    let [longer, shorter] = [1e-6, -1e-6].map(|e| (end(0.01 + e) - end(0.01)) / e);
    let (right, left) = ((tangent - longer).abs(), (tangent - shorter).abs());
    assert!(right < 1e-3 * left && left > 1e-3 * tangent.abs(), "{tangent} is neither {longer} nor apart from {shorter}");
}

#[test]
fn softer_contact_is_judged_by_differences() {
    for name in CONTACT {
        let mut soft = with(name, Integrator::Euler);
        soft.contact.rest_gap = 1e-4;
        demand(&format!("{name} at 0.1 mm"), &Case::new(&soft, STEPS), 0);
    }
}

/// Many columns at once are refined only where a probe asks for it; one column always is. Both must be the same derivative.
#[test]
fn columns_of_the_jacobians_are_single_tangents() {
    for name in SMOOTH.into_iter().chain(CONTACT) {
        let case = Case::new(&scene(name), 10);
        let (run, nx) = (case.run(StepOptions::default()), case.model.ndx());
        let last = run.records.len() - 1;
        let own = linearize(&case.model, &case.theta, &run.records[last], false).a;
        let alone = Rollout { states: run.states[last..].to_vec(), controls: run.controls[last..].to_vec(), ..run.clone() };
        let alone = Rollout { records: run.records[last..].to_vec(), ..alone };
        let mut worst: f64 = 0.0;
        for k in 0..nx {
            let unit: Vec<f64> = (0..nx).map(|j| f64::from(u8::from(j == k))).collect();
            let tangent = &rollout_jvp(&alone, Some(&unit), None, None).unwrap()[1];
            let scale = tangent.iter().fold(f64::MIN_POSITIVE, |m, x| m.max(x.abs()));
            worst = (0..nx).fold(worst, |w, i| w.max((own[i * nx + k] - tangent[i]).abs() / scale));
        }
        println!("{name}: {worst:.1e}");
        assert!(worst < 1e-10, "{name}: {worst:e}");
    }
}

#[test]
fn checkpoints_give_the_same_bits() {
    for (name, integrator) in [
        ("free_swing", Integrator::Midpoint),
        ("sphere_drape", Integrator::Sdirk2),
        ("capsule_drape", Integrator::Euler),
        ("arm_gear", Integrator::Sdirk2),
        ("arm_actuators", Integrator::Midpoint),
    ] {
        let case = Case::new(&with(name, integrator), STEPS);
        let stored = rollout_vjp(&case.run(StepOptions::default()), &case.x_bar()).unwrap();
        for records in [1, 7, STEPS + 3] {
            let options = RolloutOptions { max_records: Some(records), ..RolloutOptions::default() };
            let run = rollout(&case.model, &case.theta, &case.x0, &case.u, options).unwrap();
            assert_eq!(run.checkpoints.is_some() && run.records.is_empty(), records < STEPS);
            assert_eq!(rollout_vjp(&run, &case.x_bar()).unwrap(), stored, "{name}, {records} records");
            assert!(records > STEPS || matches!(rollout_jvp(&run, None, None, None), Err(AdjointError::Checkpointed)));
        }
    }
}

/// Inputs of an equilibrium: u, then θ.
#[test]
fn equilibria_against_differences() {
    for name in ["free_swing", "clamped_ends", "edge_clamp", "windy"] {
        let scene = scene(name);
        let case = Case::new(&scene, 0);
        let u = resting_inputs(&scene).unwrap();
        let (nu, np) = (case.model.nu(), case.model.n_params());
        let eq = equilibrium(&case.model, &case.theta, &case.x0.q, &u).unwrap();
        let inputs = [u.as_slice(), case.theta.as_slice()].concat();
        let solve = |p: &[f64]| equilibrium(&case.model, &p[nu..], &eq.q, &p[..nu]).unwrap().q;
        let mut seeds = Seeds::none(nu + np, nu, np);
        (0..nu).for_each(|k| seeds.add_u(k, k, 1.0));
        (0..np).for_each(|k| seeds.add_theta(k, nu + k, 1.0));
        let jacobian = equilibrium_jvp_columns(&eq, &seeds);
        let q_bar: Vec<f64> = (0..eq.q.len()).map(|i| (1.3 * i as f64).cos()).collect();
        let (u_bar, theta_bar) = equilibrium_vjp(&eq, &q_bar).unwrap();
        let mut worst = (0.0, String::new());
        for (k, by_vjp) in u_bar.iter().chain(&theta_bar).enumerate() {
            let column: Vec<f64> = (0..eq.q.len()).map(|row| jacobian[row * (nu + np) + k]).collect();
            let parts: f64 = column.iter().zip(&q_bar).map(|(a, b)| (a * b).abs()).sum();
            assert!((dot(&column, &q_bar) - by_vjp).abs() <= GRADCHECK.dot_test * parts.max(1e-300), "{name}: column {k}");
            let error = column_error(&column, &inputs, k, &solve);
            if error > worst.0 {
                let label = if k < nu { format!("u[{k}]") } else { case.model.params().info(k - nu).path.clone() };
                worst = (error, label);
            }
        }
        println!("equilibrium {name}: worst column error {:.1e} ({})", worst.0, worst.1);
        assert!(worst.0 <= GRADCHECK.relative_error, "{name}: {worst:?}");
    }
}

/// Relative error of a column against the best of several fourth-order differences; forward ones at a bound of zero.
fn column_error(column: &[f64], at: &[f64], k: usize, solve: &dyn Fn(&[f64]) -> Vec<f64>) -> f64 {
    let moved = |d: f64| {
        let mut p = at.to_vec();
        p[k] += d;
        solve(&p)
    };
    let scale = if at[k] == 0.0 { 0.02 } else { at[k].abs() };
    let size = norm(column);
    let error = |eps: f64| {
        let samples: Vec<(f64, Vec<f64>)> = if at[k] == 0.0 {
            let weights = [-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -0.25];
            weights.iter().enumerate().map(|(j, w)| (w / eps, moved(j as f64 * eps))).collect()
        } else {
            [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)].map(|(j, w)| (w / (12.0 * eps), moved(j * eps))).into()
        };
        let off = |i: usize| samples.iter().map(|(w, q)| w * q[i]).sum::<f64>() - column[i];
        let defect = norm(&(0..column.len()).map(off).collect::<Vec<_>>());
        // a column below the rounding of the differences is zero
        if size.max(defect) * eps < 1e-12 { 0.0 } else { defect / size.max(defect) }
    };
    [1e-2, 1e-3, 1e-4].map(|e| error(e * scale)).into_iter().fold(f64::INFINITY, f64::min)
}

#[test]
fn every_factorization_gives_the_same_trajectory_and_gradient() {
    for (name, integrator) in
        [("clamped_ends", Integrator::Midpoint), ("windy", Integrator::Euler), ("sphere_drape", Integrator::Sdirk2)]
    {
        let mut results = Vec::new();
        for linear in [LinearSolver::Band, LinearSolver::Dense, LinearSolver::Sparse] {
            let mut scene = with(name, integrator);
            scene.solver.linear = linear;
            let case = Case::new(&scene, STEPS);
            let run = case.run(StepOptions::default());
            let gradient = rollout_vjp(&run, &case.x_bar()).unwrap();
            results.push((run.states.iter().flat_map(State::to_flat).collect::<Vec<_>>(), gradient.theta));
        }
        for other in &results[1..] {
            let (x, g) = (distance(&results[0].0, &other.0), distance(&results[0].1, &other.1));
            println!("{name}: band against another, states {x:.1e}, gradient {g:.1e}");
            assert!(x < 1e-10 && g < 1e-8, "{name}: {x:e} {g:e}");
        }
    }
}

/// Iterations and factorizations of 50 steps; a change for the worse beyond the slack shows here.
#[test]
fn work_per_step_stays_what_it_was() {
    for (name, integrator, most) in WORK {
        let case = Case::new(&with(name, integrator), STEPS);
        let run = case.run(StepOptions { record: false, ..StepOptions::default() });
        let work = run.work();
        let (iterations, factorizations) = (work.iterations as f64 / STEPS as f64, work.factorizations as f64 / STEPS as f64);
        println!("{name} {integrator:?}: {iterations:.2} iterations, {factorizations:.2} factorizations per step");
        assert!(iterations <= most, "{name} {integrator:?}: {iterations} iterations per step, {most} expected at most");
        assert!(factorizations <= most + 1.0);
    }
}

const WORK: [(&str, Integrator, f64); 4] = [
    ("free_swing", Integrator::Midpoint, 2.0),
    ("clamped_ends", Integrator::Midpoint, 2.0),
    ("sliding", Integrator::Euler, 2.5),
    // two stages a step
    ("sphere_drape", Integrator::Sdirk2, 5.0),
];

#[test]
fn wrong_inputs_are_refused_with_their_names() {
    let case = Case::new(&scene("free_swing"), 3);
    let (model, record) = (&case.model, StepOptions::default());
    let mut bad = case.x0.clone();
    bad.q[7] = f64::NAN;
    let error = rollout(model, &case.theta, &bad, &case.u, record).unwrap_err();
    assert!(matches!(error, StepError::NotFinite { step: 0, .. }), "{error}");
    println!("{error}");

    let short = State { q: case.x0.q[1..].to_vec(), ..case.x0.clone() };
    let error = rollout(model, &case.theta, &short, &case.u, record).unwrap_err();
    assert!(matches!(error, StepError::Size { what: "position vector", .. }), "{error}");
    let error = rollout(model, &case.theta, &case.x0, &[vec![0.0; 2]], record).unwrap_err();
    assert!(matches!(error, StepError::Size { what: "control", got: 2, expected: 3 }), "{error}");
    let error = rollout(model, &case.theta[1..], &case.x0, &case.u, record).unwrap_err();
    assert!(matches!(error, StepError::Size { what: "parameter vector", .. }), "{error}");

    let mut theta = case.theta.clone();
    theta[model.params().find("cable.bend_stiffness").unwrap()] = -1e-3;
    let error = rollout(model, &theta, &case.x0, &case.u, record).unwrap_err().to_string();
    assert!(error.contains("cable.bend_stiffness") && error.contains("-0.001 N·m²"), "{error}");
}

#[test]
fn wrong_cotangents_are_refused() {
    let case = Case::new(&scene("free_swing"), 3);
    let run = case.run(StepOptions::default());
    let x_bar = case.x_bar();
    assert!(matches!(rollout_vjp(&run, &x_bar[1..]), Err(AdjointError::Size { what: "x_bar", got: 3, expected: 4 })));
    let mut ragged = x_bar.clone();
    ragged[2].pop();
    assert!(matches!(rollout_vjp(&run, &ragged), Err(AdjointError::Size { what: "x_bar row", .. })));
    assert!(matches!(rollout_jvp(&run, None, None, Some(&[1.0])), Err(AdjointError::Size { what: "theta_dot", .. })));
    let unrecorded = case.run(StepOptions { record: false, ..StepOptions::default() });
    assert!(matches!(rollout_vjp(&unrecorded, &x_bar), Err(AdjointError::NoRecords)));
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    norm(&a.iter().zip(b).map(|(x, y)| x - y).collect::<Vec<_>>()) / norm(a)
}

/// A plane is without friction unless it says so. Coulomb's law begins linearly, which a one-sided difference sees; the convex relaxation
/// holds the square of the coefficient, so nothing is wrong with a gradient of 0 there, whatever slope a difference to larger ones finds.
#[test]
fn the_gradient_by_no_friction() {
    for (law, rest_gap) in [(Law::Coulomb, 1e-9), (Law::Coulomb, 1e-6), (Law::Anitescu, 1e-9)] {
        let mut scene = scene("sliding");
        scene.plane[0].friction = 0.0;
        (scene.contact.rest_gap, scene.contact.law) = (rest_gap, law);
        let report = demand(&format!("without friction, {law:?} at {rest_gap:e} m"), &Case::new(&scene, 10), 0);
        let friction = report.blocks.iter().find(|b| b.name == "floor.friction").unwrap();
        let expected = (friction.derivative.abs() > 1e-3) == (law == Law::Coulomb);
        assert!(friction.verdict == Verdict::Pass && friction.one_sided && expected, "{friction:#?}");
    }
}
