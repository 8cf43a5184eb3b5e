//! The torque beyond which a motor gives no more, ±L.
//!
//! A limit that no command reaches has no effect and no derivative, so the effect is looked at where a limit would cut so much of the
//! largest command; the best one counts, at a price. (The column is the derivative at that limit, along the motion it makes, not the
//! difference to no limit: it points the same way.) A fit begins at the limit that leaves least: from one that is far too low it is led beyond the
//! largest command, where nothing leads back.

use super::{Cause, Situation, unread};
use crate::shooting::SHOOTING;
use crate::unknown::{Coordinate, Target, Unknown};

/// Limits over the largest torque that was commanded.
const GRID: [f64; 4] = [0.97, 0.9, 0.7, 0.5];

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.actuators().into_iter().enumerate().filter_map(|(k, name)| cause(at, k, name)).collect()
}

fn cause(at: &Situation, actuator: usize, name: &str) -> Option<Cause> {
    let shape = Cause {
        object: Some(name.to_owned()),
        meaning: "a motor's largest torque is less than what was commanded",
        excitation: "command more and more torque: the joint's acceleration stops growing",
        ..Cause::default()
    };
    let find = |k: usize| at.plan.model.params().find(&format!("{name}.saturation[{k}]"));
    let (low, high) = (find(0)?, find(1)?);
    let limits = [low, high].map(|k| at.values.theta[k]);
    let refused = |why: &str| Some(Cause { untestable: Some(why.to_owned()), ..shape.clone() });
    if let Some(why) = unread(at) {
        return refused(&why);
    }
    if limits[0] != -limits[1] {
        return refused("its limits differ by direction in the scene: free them there");
    }
    let Some(peak) = peak(at, actuator, name) else { return refused("a servo's torque is not in the log") };
    if peak == 0.0 {
        return refused("nothing is commanded");
    }
    let grid = GRID.map(|part| part * peak).into_iter().filter(|limit| *limit < limits[1]);
    let nuisance_grid: Vec<_> = grid.map(|limit| vec![(low, -limit), (high, limit)]).collect();
    if nuisance_grid.is_empty() {
        return refused("the scene's limit is below most commands already: free it in the scene");
    }
    let unknown = Unknown {
        path: format!("{name}.saturation"),
        unit: at.plan.model.params().info(high).unit.to_owned(),
        target: Target::Mirrored(low, high),
        bounds: (0.0, SHOOTING.inactive_limit),
        scale: 0.1 * peak,
        coordinate: Coordinate::Linear,
        prior: None,
        probe: None,
    };
    Some(Cause { unknowns: vec![unknown], starts: nuisance_grid.clone(), nuisance_grid, ..shape })
}

/// Largest torque commanded in the fitted records [N·m or N]; none of a servo.
fn peak(at: &Situation, actuator: usize, name: &str) -> Option<f64> {
    let find = |key: &str| at.plan.model.params().find(&format!("{name}.{key}")).map(|k| at.values.theta[k]);
    let (gain, offset) = (find("gain")?, find("offset")?);
    let control = at.plan.model.nu() - at.actuators().len() + actuator;
    let commands = at.plan.fitted.iter().flat_map(|rec| &rec.inputs).map(|row| row[control]);
    Some(commands.map(|u| (gain * u + offset).abs()).fold(0.0, f64::max))
}
