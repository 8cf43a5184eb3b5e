//! `<option>`: the step, gravity, and disabled features.

use super::words;
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::view::{View, check_attributes, check_children};
use crate::work::Work;
use pliant_scene::{Gravity, Time};

/// Forces that are switched on.
#[derive(Clone, Copy, Debug)]
pub struct Physics {
    pub gravity: bool,
    pub springs: bool,
    pub dampers: bool,
    pub constraints: bool,
    pub actuation: bool,
    pub limits: bool,
    pub friction: bool,
    pub contact: bool,
    /// Whether neighbours at a joint pass through each other.
    pub filter_parent: bool,
}

impl Physics {
    /// Reads all `<option>` elements into the scene's time and gravity; later ones override earlier ones.
    pub fn read(root: &Element, work: &mut Work) -> Result<Self, ImportError> {
        let mut physics = Self {
            gravity: true,
            springs: true,
            dampers: true,
            constraints: true,
            actuation: true,
            limits: true,
            friction: true,
            contact: true,
            filter_parent: true,
        };
        let (mut step, mut gravity) = (0.002, [0.0, 0.0, -9.81]);
        for element in root.children_of("option") {
            check_attributes(element, words::OPTION)?;
            check_children(element, &["flag"])?;
            let view = View::plain(element);
            if let Some(value) = view.number("timestep")? {
                if value <= 0.0 {
                    let mistake = ImportMistake::Sign { attribute: "timestep".to_owned(), value, must: "be positive" };
                    return Err(view.error("timestep", mistake));
                }
                step = value;
            }
            gravity = view.vector::<3>("gravity")?.unwrap_or(gravity);
            let air = &mut work.scene.air;
            air.density = view.not_negative("density", air.density)?;
            air.viscosity = view.not_negative("viscosity", air.viscosity)?;
            air.wind = view.vector::<3>("wind")?.unwrap_or(air.wind);
            for (name, value) in [("density", air.density), ("viscosity", air.viscosity)] {
                if value > 0.0 {
                    let instead = "its drag acts at the centres of mass and is the same to all sides, and turning is not damped";
                    work.approximate(element, &format!("`{name}` of the medium"), instead)?;
                }
            }
            if view.numbers("actuatorgroupdisable", 0..=31)?.is_some_and(|groups| !groups.is_empty()) {
                work.approximate(element, "`actuatorgroupdisable`", "groups of actuators cannot be disabled: all act")?;
            }
            work.leftovers(element, "", &words::OPTION_REASONS);
            work.kept(element, "", format!("step {step} s, gravity {gravity:?} m/s²"));
            for flags in &element.children {
                physics.flags(flags, work)?;
            }
        }
        work.scene.time = Time { step, ..Time::default() };
        work.scene.gravity = if physics.gravity { tilted(gravity) } else { tilted([0.0; 3]) };
        Ok(physics)
    }

    fn flags(&mut self, element: &Element, work: &mut Work) -> Result<(), ImportError> {
        let view = View::plain(element);
        let slots = [
            ("gravity", &mut self.gravity),
            ("spring", &mut self.springs),
            ("damper", &mut self.dampers),
            ("equality", &mut self.constraints),
            ("actuation", &mut self.actuation),
            ("limit", &mut self.limits),
            ("frictionloss", &mut self.friction),
            ("contact", &mut self.contact),
            ("filterparent", &mut self.filter_parent),
        ];
        for (name, slot) in slots {
            if let Some(word) = view.word(name, &["enable", "disable"])? {
                *slot = word == "enable";
            }
        }
        if view.word("constraint", &["enable", "disable"])? == Some("disable") {
            (self.constraints, self.limits, self.friction, self.contact) = (false, false, false, false);
        }
        if view.word("passive", &["enable", "disable"])? == Some("disable") {
            (self.springs, self.dampers) = (false, false);
        }
        let numerics = "of MuJoCo's numerics, or of forces that a scene does not have";
        let all = element.take_unused().join(", ");
        if !all.is_empty() {
            work.ignored(element, "", format!("{all}: {numerics}"));
        }
        work.kept(
            element,
            "",
            "gravity, springs, dampers, limits, dry friction, contact, constraints and actuators are switched as it says",
        );
        Ok(())
    }
}

/// Gravity of that vector [m/s²]. Every direction is Ry(tilt₁) Rx(tilt₀) (0, 0, −1) for some tilts.
fn tilted([x, y, z]: [f64; 3]) -> Gravity {
    let magnitude = x.hypot(y).hypot(z);
    if magnitude == 0.0 {
        return Gravity { magnitude, tilt: [0.0; 2] };
    }
    let about_y = if x == 0.0 && z == 0.0 { 0.0 } else { (-x).atan2(-z) };
    Gravity { magnitude, tilt: [y.atan2(x.hypot(z)) + 0.0, about_y + 0.0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_gravity_is_a_tilted_one() {
        for g in [[0.0, 0.0, -9.81], [1.0, -2.0, 3.0], [0.0, 5.0, 0.0], [-3.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0; 3]] {
            let tilted = tilted(g);
            let again = tilted.direction().map(|x| x * tilted.magnitude);
            assert!(again.iter().zip(g).all(|(a, b)| (a - b).abs() < 1e-14), "{g:?} {again:?}");
        }
        assert_eq!(tilted([0.0, 0.0, -9.81]), Gravity::default());
    }
}
