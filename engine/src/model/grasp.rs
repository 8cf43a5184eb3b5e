//! Grippers that grasp by proximity: their points, parameters and memory.

use super::Model;
use crate::grasp::Grasp;
use crate::kinematics::{Drive, DriveKind};
use pliant_math::params::{ANY, NON_NEGATIVE, POSITIVE};
use pliant_scene::{Gripper, Mode};

/// Bounds of a part of a whole.
const PART: (f64, f64) = (0.0, 1.0);

impl Model {
    /// Adds a gripper whose point is `node`.
    pub(super) fn add_grasp(&mut self, gripper: &Gripper, grasp: &pliant_scene::Grasp, node: usize) {
        let (elements, corners) = self.graspable(gripper);
        let first_u = self.nu();
        let name = &gripper.name;
        let offset = self.params.len();
        for (a, value) in gripper.offset.iter().enumerate() {
            self.params.push(format!("{name}.offset[{a}]"), "m", ANY, *value);
        }
        let mut entry = |key: &str, unit, bounds, value| self.params.push(format!("{name}.{key}"), unit, bounds, value);
        let mut own = Grasp {
            name: name.clone(),
            node,
            closing: first_u + 3,
            stiffness: entry("stiffness", "N/m", NON_NEGATIVE, grasp.stiffness),
            radius: entry("radius", "m", NON_NEGATIVE, grasp.radius),
            steepness: entry("steepness", "-", POSITIVE, grasp.steepness),
            closing_time: entry("closing_time", "s", NON_NEGATIVE, grasp.closing_time),
            smoothing: entry("smoothing", "m", POSITIVE, grasp.smoothing),
            tail: entry("tail", "-", PART, grasp.tail),
            tail_reach: entry("tail_reach", "m", POSITIVE, grasp.far()),
            memory: 0,
            elements,
            corners,
        };
        let places: Vec<usize> = Grasp::memory_names(name, corners).into_iter().map(|name| self.memory.push(name, 0.0)).collect();
        own.memory = places[0];
        let kind = match gripper.mode {
            Mode::Prescribed => DriveKind::PrescribedNodes(vec![node]),
            Mode::Velocity => DriveKind::VelocityNodes(vec![node]),
        };
        self.drives.push(Drive { name: name.clone(), kind, first_u, offset, held: Vec::new(), closes: true });
        self.prescribed[node] = true;
        self.grasps.push(own);
    }

    /// Objects that a gripper may seize, and the number of nodes of their elements.
    fn graspable(&self, gripper: &Gripper) -> (Vec<[usize; 3]>, usize) {
        if let Some(rope) = gripper.rope.as_ref().and_then(|name| self.rope(name)) {
            let nodes = rope.nodes.clone();
            return (nodes.clone().zip(nodes.skip(1)).map(|(i, j)| [i, j, j]).collect(), 2);
        }
        let sheet = gripper.cloth.as_ref().and_then(|name| self.cloth(name));
        let triangles = |cloth: &super::ClothSpan| {
            let first = cloth.nodes.start;
            cloth.triangles.iter().map(|t| t.map(|i| first + i)).collect()
        };
        (sheet.map_or_else(Vec::new, triangles), 3)
    }
}
