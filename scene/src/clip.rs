//! Clips that cables are laid in.

use super::Block;
use super::error::{Mistake, SceneError};

/// A U of three fixed boxes that a cable is pressed into from above.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// Its name; the boxes are `name_floor`, `name_left` and `name_right`.
    pub name: String,
    /// The middle of the floor that the cable lies on \[m\].
    pub position: [f64; 3],
    /// Turn of the slot about the vertical, from along x \[rad\].
    pub yaw: f64,
    /// Width between the walls \[m\].
    pub opening: f64,
    /// Thickness of walls and floor \[m\].
    pub wall: f64,
    /// Length of the slot \[m\].
    pub depth: f64,
    /// Height of the walls above the floor \[m\].
    pub height: f64,
    /// Friction coefficient [-].
    pub friction: f64,
}

impl Default for Clip {
    fn default() -> Self {
        Self {
            name: "clip".to_owned(),
            position: [0.0; 3],
            yaw: 0.0,
            opening: 0.008,
            wall: 0.003,
            depth: 0.01,
            height: 0.012,
            friction: 0.5,
        }
    }
}

impl Clip {
    /// Its boxes.
    ///
    /// # Errors
    /// Sizes that make no sense; `field` names the clip in them.
    pub fn boxes(&self, field: &str) -> Result<[Block; 3], SceneError> {
        let sizes =
            [("opening", self.opening, "m"), ("wall", self.wall, "m"), ("depth", self.depth, "m"), ("height", self.height, "m")];
        refuse_below(&|key| format!("{field}.{key}"), &sizes, &[("friction", self.friction, "-")])?;
        let (sin, cos) = self.yaw.sin_cos();
        let across = 0.5 * (self.opening + self.wall);
        let part = |suffix: &str, aside: f64, up: f64, half_extents: [f64; 3]| Block {
            name: format!("{}_{suffix}", self.name),
            position: [self.position[0] - sin * aside, self.position[1] + cos * aside, self.position[2] + up],
            quaternion: [(0.5 * self.yaw).cos(), 0.0, 0.0, (0.5 * self.yaw).sin()],
            half_extents,
            friction: self.friction,
        };
        let half = 0.5 * self.wall;
        let side = [0.5 * self.depth, half, 0.5 * self.height];
        Ok([
            part("floor", 0.0, -half, [0.5 * self.depth, 0.5 * self.opening + self.wall, half]),
            part("left", across, 0.5 * self.height, side),
            part("right", -across, 0.5 * self.height, side),
        ])
    }
}

/// The first number that is not positive, or that is negative; or not finite.
pub(super) fn refuse_below(
    at: &dyn Fn(&str) -> String,
    positive: &[(&str, f64, &'static str)],
    others: &[(&str, f64, &'static str)],
) -> Result<(), SceneError> {
    for (key, value, unit) in positive.iter().chain(others) {
        if !value.is_finite() {
            return Err(SceneError::at(at(key), Mistake::NotFinite { value: *value }));
        }
        let must_be_positive = positive.iter().any(|(k, ..)| k == key);
        if must_be_positive && *value <= 0.0 {
            return Err(SceneError::at(at(key), Mistake::NotPositive { value: *value, unit }));
        }
        if *value < 0.0 {
            return Err(SceneError::at(at(key), Mistake::Negative { value: *value, unit }));
        }
    }
    Ok(())
}
