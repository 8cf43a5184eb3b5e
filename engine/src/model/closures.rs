//! From a scene's closures to ties.

use super::Model;
use super::constants::MODEL;
use crate::constraints::{CONSTRAINTS, LoopClosure, pose};
use crate::geometry::collider::{Attachment, Pose};
use pliant_math::Vec3;
use pliant_math::params::{ANY, NON_NEGATIVE};
use pliant_scene::{Closure, ClosureKind, Mistake, Scene, SceneError};

impl Model {
    /// Adds what holds bodies together beside joints; their second points are where the first ones are as the scene begins.
    pub(super) fn add_closures(&mut self, scene: &Scene) -> Result<(), SceneError> {
        let weights = self.body_weights();
        let frames = self.tree.frames(&self.q0[self.n_node_dofs()..], &vec![0.0; self.tree.nv()]);
        for (k, closure) in scene.closure.iter().enumerate() {
            let attachment = |name: &Option<String>| {
                name.as_deref().and_then(|name| self.tree.body(name)).map_or(Attachment::World, Attachment::Body)
            };
            let attachments = [attachment(&Some(closure.body.clone())), attachment(&closure.to)];
            let poses = attachments.map(|c| pose(c, &self.q0, &frames));
            let second = second_point(closure, &poses, &format!("closure[{k}]"))?;
            let points = [("first", closure.point), ("second", second)].map(|(side, point)| {
                let first = self.params.len();
                for (a, x) in point.into_iter().enumerate() {
                    self.params.push(format!("{}.{side}[{a}]", closure.name), "m", ANY, x);
                }
                first
            });
            let compliance =
                closure.compliance.map(|c| self.params.push(format!("{}.compliance", closure.name), "m/N", NON_NEGATIVE, c));
            let weight = |c: Attachment| {
                if let Attachment::Body(b) = c { CONSTRAINTS.weight * weights[b].max(MODEL.lightest) } else { f64::INFINITY }
            };
            self.closures.push(LoopClosure {
                name: closure.name.clone(),
                attachments,
                points,
                relative: (closure.kind == ClosureKind::Weld).then(|| poses[1].rotation.transpose() * poses[0].rotation),
                compliance,
                weight: weight(attachments[0]).min(weight(attachments[1])),
            });
        }
        Ok(())
    }
}

/// The point of the second side, in its frame: as given, or where the first point is.
fn second_point(closure: &Closure, poses: &[Pose<f64>; 2], field: &str) -> Result<[f64; 3], SceneError> {
    let first = poses[0].position + poses[0].rotation * Vec3::from(closure.point);
    let Some(given) = closure.to_point else {
        return Ok(poses[1].rotation.tr_mul(&(first - poses[1].position)).into());
    };
    let second = poses[1].position + poses[1].rotation * Vec3::from(given);
    let distance = (first - second).norm();
    if distance > MODEL.open {
        return Err(SceneError::at(format!("{field}.to_point"), Mistake::Open { distance }));
    }
    Ok(given)
}
