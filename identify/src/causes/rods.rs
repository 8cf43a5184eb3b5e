//! What causes of rods are made of: the rods of a scene, the grippers that hold their axes, and typical sizes.

use super::{Cause, Situation};
use crate::unknown::Unknown;
use nalgebra::Vector3;

impl Situation<'_> {
    /// Whether a rope twists.
    pub(super) fn is_rod(&self, rope: &str) -> bool {
        self.plan.model.params().find(&format!("{rope}.twist_stiffness")).is_some()
    }

    /// A cause for every rope that twists; it names the rope where there are several.
    pub(super) fn per_rod(&self, one: impl Fn(&str) -> Cause) -> Vec<Cause> {
        let rods: Vec<&str> = self.ropes().into_iter().filter(|rope| self.is_rod(rope)).collect();
        let several = rods.len() > 1;
        rods.into_iter().map(|rod| Cause { object: several.then(|| rod.to_owned()), ..one(rod) }).collect()
    }

    /// A cause for every gripper that holds the axes of a rod, with three unknowns of this name, each from −`most` to `most`.
    pub(super) fn per_rod_gripper(&self, quantity: &str, scale: f64, most: f64, meaning: &'static str) -> Vec<Cause> {
        let unknown = |gripper: &str, a: usize| {
            let of_model = self.theta(&format!("{gripper}.{quantity}[{a}]"), scale)?;
            Some(Unknown { bounds: (-most, most), ..of_model })
        };
        let one = |(gripper, _): (String, bool)| Cause {
            meaning,
            unknowns: (0..3).filter_map(|a| unknown(&gripper, a)).collect(),
            object: Some(gripper),
            excitation: "measure the turn: a second marker beside the rod, on the gripper",
            ..Cause::default()
        };
        self.rod_grippers().into_iter().map(one).collect()
    }

    /// Prescribed grippers that hold the axes of a rod, and whether they are the first to hold that one.
    pub(super) fn rod_grippers(&self) -> Vec<(String, bool)> {
        let holds = self.holds();
        let first = |k: usize| holds[..k].iter().all(|(_, rope)| *rope != holds[k].1);
        holds.iter().enumerate().map(|(k, (gripper, _))| (gripper.clone(), first(k))).collect()
    }

    /// Those that hold the axes of this rod, without the first.
    pub(super) fn later_grippers(&self, rod: &str) -> Vec<String> {
        let holds = self.holds().into_iter();
        let of_rod = |(_, rope): &(String, Option<usize>)| rope.is_some_and(|rope| self.plan.model.ropes()[rope].name == rod);
        holds.filter(of_rod).map(|(gripper, _)| gripper).skip(1).collect()
    }

    /// Prescribed grippers that hold the axes of rods, with the rod's number.
    pub(super) fn holds(&self) -> Vec<(String, Option<usize>)> {
        let model = &self.plan.model;
        let with_roll = model.drives().iter().filter(|drive| drive.held.iter().any(|held| held.roll.is_some()));
        let rope = |nodes: &[usize]| model.ropes().iter().position(|rope| nodes.iter().any(|node| rope.nodes.contains(node)));
        with_roll.map(|drive| (drive.name.clone(), rope(&drive.nodes()))).collect()
    }

    /// Paths of a quantity that every joint of a rod has.
    pub(super) fn joints_of(&self, rod: &str, quantity: &str) -> Vec<String> {
        let (begin, end) = (format!("{rod}.node["), format!("].{quantity}"));
        let paths = self.plan.model.params().infos().iter().map(|info| &info.path);
        paths.filter(|path| path.starts_with(&begin) && path.ends_with(&end)).cloned().collect()
    }

    /// Markers on a rod.
    pub(super) fn markers_on(&self, rod: &str) -> Vec<usize> {
        let nodes = self.plan.model.rope(rod).map(|rope| rope.nodes.clone()).unwrap_or_default();
        let on = |k: &usize| self.plan.markers[*k].nodes().is_some_and(|pair| nodes.contains(&pair.node));
        (0..self.plan.markers.len()).filter(on).collect()
    }

    /// The curvature of a rod bent to an arc of one radian [1/m]: a typical size.
    pub(super) fn typical_curvature(&self, rod: &str) -> f64 {
        1.0 / self.value(&format!("{rod}.length")).max(f64::MIN_POSITIVE)
    }

    /// The largest curvature at the nodes of a rod as records begin [1/m].
    pub(super) fn largest_curvature(&self, rod: &str) -> f64 {
        let Some(span) = self.plan.model.rope(rod) else { return 1.0 };
        let mut largest = 0.0_f64;
        for rec in &self.plan.fitted {
            let x = |node: usize| Vector3::from_column_slice(&rec.start.mean.q[3 * node..3 * node + 3]);
            for node in span.nodes.start + 1..span.nodes.end - 1 {
                let (a, b) = (x(node) - x(node - 1), x(node + 1) - x(node));
                largest = largest.max(2.0 * a.angle(&b) / (a.norm() + b.norm()));
            }
        }
        if largest.is_finite() && largest > 0.0 { largest } else { self.typical_curvature(rod) }
    }

    /// Unmeasured parameters that decide where a rod with intrinsic curvature lies: the turns of later grippers about it, and its
    /// stiffness in twist.
    pub(super) fn unmeasured_of(&self, rod: &str) -> Vec<Unknown> {
        let rolls = self.later_grippers(rod).into_iter().filter_map(|gripper| self.theta(&format!("{gripper}.roll"), 0.1));
        let stiffness = self.theta(&format!("{rod}.twist_stiffness"), 0.1 * self.value(&format!("{rod}.bend_stiffness")));
        rolls.chain(stiffness.map(Unknown::logarithmic)).collect()
    }
}
