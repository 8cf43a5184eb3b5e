//! The object that a gripper holds: a rope or a sheet of cloth.

use super::cloth::Cloth;
use super::cloth_initial::cloth_points;
use super::error::SceneError;
use super::file::Scene;
use super::gripper::Gripper;
use super::initial::rope_points;
use super::rope::Rope;
use super::vector::V3;

/// A rope or a sheet, and its number in the scene.
#[derive(Clone, Copy, Debug)]
pub enum Held<'a> {
    /// A rope.
    Rope(&'a Rope, usize),
    /// A sheet.
    Cloth(&'a Cloth, usize),
}

impl Scene {
    /// The object that a gripper holds; `None` if the scene does not have it.
    pub fn held(&self, gripper: &Gripper) -> Option<Held<'_>> {
        if let Some(name) = &gripper.rope {
            let index = self.rope.iter().position(|rope| rope.name == *name)?;
            return Some(Held::Rope(&self.rope[index], index));
        }
        let name = gripper.cloth.as_ref()?;
        let index = self.cloth.iter().position(|cloth| cloth.name == *name)?;
        Some(Held::Cloth(&self.cloth[index], index))
    }
}

impl<'a> Held<'a> {
    /// Its name.
    pub fn name(self) -> &'a str {
        match self {
            Self::Rope(rope, _) => &rope.name,
            Self::Cloth(cloth, _) => &cloth.name,
        }
    }

    /// Whether it is a closed rope.
    pub(super) fn is_closed(self) -> bool {
        matches!(self, Self::Rope(rope, _) if rope.closed)
    }

    /// The node of that number, negative ones counted from the end; `None` if there is no such node.
    pub fn node(self, number: i64) -> Option<usize> {
        match self {
            Self::Rope(rope, _) => rope.node(number),
            Self::Cloth(cloth, _) => cloth.node(number),
        }
    }

    /// Where its nodes begin [m], without ghosts.
    pub(super) fn points(self, scene: &Scene) -> Result<Vec<V3>, SceneError> {
        match self {
            Self::Rope(_, index) => rope_points(scene, index),
            Self::Cloth(cloth, index) => cloth_points(cloth, index),
        }
    }
}
