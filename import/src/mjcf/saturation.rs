//! Ranges of actuators and joints as saturation of motors, which limits the torque before the gear.

use super::Reader;
use crate::element::Element;
use pliant_scene::{Actuator, ActuatorKind};

impl<'a> Reader<'a> {
    /// Ranges of force, and of the control of a torque drive, as saturation.
    pub(super) fn saturate(&mut self, element: &Element, [control, force]: [Option<[f64; 2]>; 2], actuator: &mut Actuator) {
        let name = actuator.name.clone();
        if let Some([low, high]) = force {
            actuator.saturation = Some([low, high]);
            self.work.kept(element, &name, format!("forcerange {low} … {high}, as its saturation"));
        }
        let Some([low, high]) = control else { return };
        if actuator.kind != ActuatorKind::Torque || actuator.lag.is_some() || actuator.gain == 0.0 {
            let reason = "a scene does not cut commands: keep them within";
            self.work.ignored(element, &name, format!("ctrlrange {low} … {high}: {reason}"));
            return;
        }
        let torque = [low, high].map(|u| actuator.gain * u + actuator.offset);
        let torque = [torque[0].min(torque[1]), torque[0].max(torque[1])];
        if self.cut(element, actuator, torque) {
            self.work.kept(element, &name, format!("ctrlrange {low} … {high}, as saturation at the torques that it allows"));
        }
    }

    /// Narrows a saturation; if nothing were left of it, says so and leaves it.
    fn cut(&mut self, element: &Element, actuator: &mut Actuator, [low, high]: [f64; 2]) -> bool {
        let [least, largest] = actuator.saturation.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let both = [least.max(low), largest.min(high)];
        if both[0] < both[1] {
            actuator.saturation = Some(both);
            return true;
        }
        self.work.ignored(element, &actuator.name, format!("its torques {low} … {high} and {least} … {largest} do not meet"));
        false
    }

    /// Limits of the total torque of a joint's motors, where given.
    pub(super) fn joint_force_limits(&mut self) {
        for place in self.joints.clone() {
            let Some([low, high]) = place.force_range else { continue };
            let given = format!("actuatorfrcrange {low} … {high}");
            let motors: Vec<usize> =
                (0..self.work.scene.actuator.len()).filter(|k| self.work.scene.actuator[*k].joint == place.name).collect();
            let [one] = motors[..] else {
                let why = if motors.is_empty() { "no motor drives it" } else { "the sum of several motors is not limited" };
                self.work.ignored(place.element, &place.name, format!("{given}: {why}"));
                continue;
            };
            let mut actuator = self.work.scene.actuator[one].clone();
            let torque = [low / actuator.gear, high / actuator.gear];
            let torque = [torque[0].min(torque[1]), torque[0].max(torque[1])];
            if self.cut(place.element, &mut actuator, torque) {
                let reason = format!("{given}, as saturation of its motor \"{}\"", actuator.name);
                self.work.kept(place.element, &place.name, reason);
                self.work.scene.actuator[one] = actuator;
            }
        }
    }
}
