//! `gravcomp`: bodies whose weight is carried.
//!
//! MuJoCo lifts each body by a part of its weight; a scene has joints whose motors carry a part of the weight beyond them. They are the
//! same where everything beyond a joint is lifted by the same part.

use super::Reader;
use crate::element::Element;
use pliant_scene::{Body, JointKind};

/// A body with `gravcomp`.
#[derive(Clone, Debug)]
pub struct Carried<'a> {
    pub element: &'a Element,
    /// Name in the scene.
    pub body: String,
    /// Part of its weight.
    pub part: f64,
}

impl<'a> Reader<'a> {
    /// Gives joints the part of the weight that they carry, tree by tree where that is exact.
    pub(super) fn carry_weights(&mut self) {
        let carried = std::mem::take(&mut self.carried);
        for lifted in &carried {
            let given = format!("gravcomp {}", lifted.part);
            let Some(root) = self.tree_of(&lifted.body) else {
                self.work.ignored(lifted.element, &lifted.body, format!("{given}: it cannot move"));
                continue;
            };
            let applied = self.physics.springs || self.physics.dampers;
            match self.parts(&root, &carried).filter(|_| applied) {
                Some(parts) => {
                    for (body, part) in parts {
                        let joints = self.work.scene.body.iter_mut().filter(|b| b.name == body).flat_map(|b| &mut b.joint);
                        joints.for_each(|j| j.gravity_compensation = Some(part));
                    }
                    self.work.kept(
                        lifted.element,
                        &lifted.body,
                        format!("{given}, as gravity_compensation of the joints below it"),
                    );
                }
                None if !applied => self.work.ignored(lifted.element, &lifted.body, format!("{given}: switched off by flags")),
                None => {
                    let why = "its joints carry others of another part too, or it flies, which a scene's motors do not: it feels its \
                        whole weight";
                    self.work.ignored(lifted.element, &lifted.body, format!("{given}: {why}"));
                }
            }
        }
    }

    /// The lowest body with joints that carries a body.
    fn tree_of(&self, body: &str) -> Option<String> {
        let mut lowest = self.carrier(body)?.to_owned();
        while let Some(next) = self.parent_of(&lowest).and_then(|p| self.carrier(p)) {
            lowest = next.to_owned();
        }
        Some(lowest)
    }

    fn parent_of(&self, body: &str) -> Option<&str> {
        self.work.scene.body.iter().find(|b| b.name == body).and_then(|b| b.parent.as_deref())
    }

    /// Whether `body` is `above` or hangs on it.
    fn hangs_on(&self, body: &str, above: &str) -> bool {
        body == above || self.parent_of(body).is_some_and(|p| self.hangs_on(p, above))
    }

    /// The part that each body's joints carry, in the tree of `root`; none if that cannot be said.
    fn parts(&self, root: &str, carried: &[Carried]) -> Option<Vec<(String, f64)>> {
        let bodies = &self.work.scene.body;
        let part = |body: &Body| carried.iter().find(|c| c.body == body.name).map_or(0.0, |c| c.part);
        let mut out = Vec::new();
        for body in bodies.iter().filter(|b| !b.joint.is_empty() && self.hangs_on(&b.name, root)) {
            let mut beyond = bodies.iter().filter(|b| b.mass > 0.0 && self.hangs_on(&b.name, &body.name)).map(part);
            let first = beyond.next().unwrap_or(0.0);
            if beyond.any(|other| other != first) || body.joint.iter().any(|j| j.kind == JointKind::Free) {
                return None;
            }
            if first != 0.0 {
                out.push((body.name.clone(), first));
            }
        }
        Some(out)
    }
}
