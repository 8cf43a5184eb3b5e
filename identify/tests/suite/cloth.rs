//! Fits of sheets of cloth: starts as the data have them, derivatives of readings, any parameter free.

use crate::cloth_logs::{GRID, Logged, SIDES, setup};
use pliant_identify::fit_scene;
use pliant_identify::shooting::{Plan, RecordPlan, ShotWants, shoot};
use pliant_identify::unknown::{Unknown, Values};
use tempfile::TempDir;

const NODES: usize = GRID[0] * GRID[1];

fn plan(logged: &Logged) -> Plan {
    let folder = TempDir::new().unwrap();
    let setup = setup(&folder, logged, "");
    Plan::new(&setup, &setup.read_logs(&[]).unwrap()).unwrap()
}

/// Of a sheet that is marked in some places and begins in motion: by the initial state, and by parameters of the sheet, the gripper, the
/// scene and the sensor.
#[test]
fn derivatives_are_those_of_the_readings() {
    let plan = plan(&Logged { initial: "measured", samples: 12, before: 40, records: [1, 0], ..Logged::default() });
    let mut rec = plan.fitted[0].clone();
    rec.start.z.iter_mut().enumerate().for_each(|(k, z)| *z = 0.05 * (1.7 * k as f64).cos());
    let of_sheet = ["area", "area_density", "thickness", "youngs_modulus", "poisson_ratio", "bend_stiffness"];
    let more = ["membrane_damping", "bend_damping", "drag_normal", "drag_quadratic"];
    let sheet = of_sheet.iter().chain(&more).map(|name| format!("sheet.{name}"));
    let others = ["hand.offset[0]", "gravity.tilt[1]", "gravity.magnitude", "air.wind[0]"].map(str::to_owned);
    let theta = sheet.chain(others).map(|path| Unknown::of_theta(&plan.model, &path, 1e-2).unwrap());
    let unknowns: Vec<Unknown> = theta.chain([0, 3, 5, 7].map(|k| Unknown::of_sensor(k, 1e-2, (-1.0, 2.0)))).collect();
    let values = plan.scene_values.clone();
    let wants = ShotWants { unknowns: &unknowns, tangents: true, ..ShotWants::default() };
    let shot = shoot(&plan, &rec, &values, wants).unwrap();
    let residual = |rec: &RecordPlan, values: &Values| shoot(&plan, rec, values, ShotWants::default()).unwrap().residual;
    let (k, m) = (unknowns.len(), shot.own_columns);
    assert_eq!(m, 2 * 3 * (NODES - GRID[1]));
    // measured − simulated falls as the simulated reading rises; central differences, extrapolated from a change and half of it
    let check = |name: &str, at: &dyn Fn(f64) -> Vec<f64>, (change, within): (f64, f64), column: &dyn Fn(usize) -> f64| {
        let slope = |e: f64| -> Vec<f64> { at(-e).iter().zip(at(e)).map(|(down, up)| (down - up) / (2.0 * e)).collect() };
        let (whole, half) = (slope(change), slope(0.5 * change));
        let size = (0..whole.len()).map(|r| column(r).abs()).fold(0.0, f64::max);
        assert!(size > 0.0, "{name} moves nothing");
        for r in 0..whole.len() {
            let difference = (4.0 * half[r] - whole[r]) / 3.0;
            assert!((difference - column(r)).abs() < within * size, "{name}, row {r}: {difference} {} of {size}", column(r));
        }
    };
    for (j, unknown) in unknowns.iter().enumerate() {
        let at = |change: f64| {
            let mut moved = values.clone();
            unknown.set(&mut moved, unknown.moved(unknown.value(&values), change));
            residual(&rec, &moved)
        };
        // a delay moves readings past the ends of steps, where their curvature jumps
        let how = if unknown.path == "sensor.time_offset" { (1e-3, 1e-3) } else { (1e-2, 1e-5) };
        check(&unknown.path, &at, how, &|r| shot.global[r * k + j]);
    }
    for j in (0..m).step_by(7) {
        let at = |change: f64| {
            let mut moved = rec.clone();
            moved.start.z[j] += change;
            residual(&moved, &values)
        };
        check(&format!("z[{j}]"), &at, (1e-3, 1e-5), &|r| shot.own[r * m + j]);
    }
}

/// A start in motion is found where all free nodes are marked, and where few are; and it may be taken as it is where all are.
#[test]
fn records_may_begin_in_motion() {
    let free: Vec<usize> = (GRID[1]..NODES).collect();
    let logged = Logged { samples: 40, records: [1, 0], ..Logged::default() };
    // as they are, starts are as good as a quadratic through nine samples: here of a sheet that has hardly begun to move
    for (initial, marked, before, noise) in
        [("measured", free.as_slice(), 40, 3e-4), ("measured", &SIDES, 40, 3e-4), ("given", free.as_slice(), 0, 1e-5)]
    {
        let folder = TempDir::new().unwrap();
        let setup = setup(&folder, &Logged { initial, marked, before, noise, ..logged }, "");
        let report = fit_scene(&setup, &setup.read_logs(&[]).unwrap(), &mut |_| {}).unwrap();
        let stiffness = report.parameters[0].estimate;
        assert!(report.converged && (stiffness / 2e-4 - 1.0).abs() < 0.1, "{initial}, {} markers: {report}", marked.len());
    }
}

/// All that a motion determines of a sheet is found at once, from wrong values.
#[test]
fn any_parameter_may_be_free() {
    let truth = [("youngs_modulus", 1.6e4), ("bend_damping", 8e-6), ("drag_normal", 0.1), ("membrane_damping", 150.0)];
    let free: String = truth
        .iter()
        .map(|(name, x)| format!("{{ path = \"sheet.{name}\", lower = {:e}, upper = {:e} }}, ", 0.01 * x, 100.0 * x))
        .collect();
    let folder = TempDir::new().unwrap();
    let setup = setup(&folder, &Logged { sheet: &truth, records: [2, 0], samples: 60, noise: 1e-5, ..Logged::default() }, "");
    let text = setup.source.text.replace("free = [", &format!("free = [{free}"));
    let setup =
        pliant_identify::log::Setup::from_source(pliant_scene::Source::new("scene.toml", &text), folder.path().to_owned())
            .unwrap();
    let report = fit_scene(&setup, &setup.read_logs(&[]).unwrap(), &mut |_| {}).unwrap();
    for (parameter, (name, value)) in report.parameters.iter().zip(truth) {
        assert!((parameter.estimate / value - 1.0).abs() < 0.1, "{name}: {report}");
    }
}
