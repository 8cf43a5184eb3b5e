//! Commands that are late as inputs are those that a scene's motor delays.

use crate::pendulum::Truth;
use pliant_identify::log::Setup;
use pliant_identify::shooting::{Plan, Shot, ShotWants, shoot};
use pliant_identify::unknown::{Unknown, Values};
use pliant_scene::Source;
use tempfile::TempDir;

/// A plan of the pendulum whose motor has this beside its name.
fn plan(motor: &str, folder: &TempDir) -> Plan {
    let text = crate::pendulum::SCENE.replace("name = \"motor\"", &format!("name = \"motor\"\n{motor}"));
    let source = Source { file: "scene.toml".to_owned(), text };
    let setup = Setup::from_source(source, folder.path().to_owned()).unwrap();
    Plan::new(&setup, &setup.read_logs(&[]).unwrap()).unwrap()
}

fn shot(plan: &Plan, values: &Values, unknown: Unknown) -> Shot {
    shoot(plan, &plan.fitted[0], values, ShotWants { unknowns: &[unknown], tangents: true, ..ShotWants::default() }).unwrap()
}

#[test]
fn they_move_the_readings_as_a_motor_with_a_delay_does() {
    let folder = TempDir::new().unwrap();
    Truth::default().logs(&folder).unwrap();
    // no whole number of steps, less than one, and none at all; with a lag behind it that begins where the commands before left it
    for (delay, lag) in [(0.0137, 0.0), (0.0137, 0.02), (0.0006, 0.01), (0.0, 0.0)] {
        let lagging = format!("lag = {lag:?}");
        let own = plan(&format!("{lagging}\ndelay = {delay:?}\nmax_delay = 0.05"), &folder);
        let late = plan(&lagging, &folder);
        let of_motor = Unknown { scale: 1e-3, ..Unknown::of_theta(&own.model, "motor.delay", 1e-3).unwrap() };
        let by_motor = shot(&own, &own.scene_values, of_motor);
        let mut values = late.scene_values.clone();
        values.late[0] = delay;
        let by_input = shot(&late, &values, Unknown::of_late("motor.delay".to_owned(), 0, 1e-3, (0.0, 0.05)));
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // a lag behind takes the mean over the step of a command that came in its parts
        let [readings, derivatives] = if lag > 0.0 { [1e-5, 1e-2] } else { [1e-14, 1e-12] };
        let error = apart(&by_motor.predicted, &by_input.predicted);
        assert!(error < readings, "{delay} {lag}: {error:e} rad");
        // ∂(reading)/∂(delay) of 1 ms, in rad
        let scale = by_motor.global.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let error = apart(&by_motor.global, &by_input.global);
        assert!(scale > 1e-4 && error < derivatives * scale, "{delay} {lag}: {error:e} of {scale:e}");
    }
}

#[test]
fn their_derivative_is_that_of_differences() {
    let folder = TempDir::new().unwrap();
    Truth::default().logs(&folder).unwrap();
    for (delay, lag) in [(0.0137, 0.0), (0.0137, 0.02), (0.0006, 0.01)] {
        let plan = plan(&format!("lag = {lag:?}"), &folder);
        let at = |delay: f64| {
            let mut values = plan.scene_values.clone();
            values.late[0] = delay;
            shot(&plan, &values, Unknown::of_late("motor.delay".to_owned(), 0, 1.0, (0.0, 0.05)))
        };
        let (step, middle) = (1e-6, at(delay));
        let (ahead, behind) = (at(delay + step).predicted, at(delay - step).predicted);
        let difference: Vec<f64> = ahead.iter().zip(&behind).map(|(a, b)| (a - b) / (2.0 * step)).collect();
        let scale = middle.global.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let error = middle.global.iter().zip(&difference).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(scale > 0.1 && error < 1e-7 * scale, "{delay} {lag}: {error:e} of {scale:e}");
    }
}
