//! From a scene's shapes to colliders, and which of them may touch.

use super::Model;
use super::constants::MODEL;
use super::rules::{Rule, rule_of};
use crate::constraints::{CONSTRAINTS, ColliderPair, Friction};
use crate::geometry::collider::{
    Attachment, Collider, ColliderShape, Place, Polyhedron, candidates, contact_geometry, drop_hidden, overlap,
};
use nalgebra::Matrix3;
use pliant_math::Vec3;
use pliant_math::params::{ANY, NON_NEGATIVE, POSITIVE};
use pliant_math::rotation::{matrix, normalized};
use pliant_scene::{Body, BodyShape, Mistake, Scene, SceneError, ShapeKind};
use std::collections::HashMap;
use std::sync::Arc;

/// A solid while pairs are listed.
struct Entry {
    /// Name of the object that has it, in the scene.
    object: String,
    /// Field of the scene, for errors.
    field: String,
}

impl Model {
    /// Adds colliders and pairs; of every rope the index of its radius in θ.
    pub(super) fn add_colliders(&mut self, scene: &Scene, radii: &[usize]) -> Result<(), SceneError> {
        let mut entries = self.body_colliders(scene)?;
        let of_bodies = self.colliders.len();
        self.fixed_colliders(scene, &mut entries);
        let fixed = self.colliders.len();
        if of_bodies > 0 || !scene.block.is_empty() || !scene.cylinder.is_empty() {
            self.node_colliders(radii, &mut entries);
        }
        let rules: Vec<Rule> = scene.contact.pair.iter().enumerate().map(|(k, rule)| self.push_rule(k, rule)).collect();
        self.apply_rules(&rules);
        let weights = self.body_weights();
        let joined = self.joined();
        for a in 0..self.colliders.len() {
            for b in a + 1..self.colliders.len() {
                if !self.may_touch(a, b, of_bodies..fixed, &joined) {
                    continue;
                }
                let rule = rule_of(&rules, &entries[a].object, &entries[b].object);
                if rule.is_some_and(|r| r.rule.ignore) {
                    continue;
                }
                let own = match (self.colliders[a].friction, self.colliders[b].friction) {
                    (Some(x), Some(y)) => Friction::Mean(x, y),
                    (Some(x), None) | (None, Some(x)) => Friction::Of(x),
                    (None, None) => Friction::Of(self.no_friction()),
                };
                let friction = rule.and_then(|r| r.friction).map_or(own, Friction::Of);
                let weight = self.weight(&weights, a).min(self.weight(&weights, b));
                self.collider_pairs.push(ColliderPair {
                    colliders: [a, b],
                    friction,
                    compliance: rule.and_then(|r| r.compliance),
                    weight,
                });
            }
        }
        self.refuse_overlaps(&entries)
    }

    fn body_colliders(&mut self, scene: &Scene) -> Result<Vec<Entry>, SceneError> {
        let mut entries = Vec::new();
        for (b, body) in scene.body.iter().enumerate() {
            let Some(index) = self.tree.body(&body.name) else { continue };
            for (k, shape) in body.shape.iter().enumerate() {
                let field = format!("body[{b}].shape[{k}]");
                let collider =
                    self.body_collider(body, k, shape, index).map_err(|mistake| SceneError::at(field.clone(), mistake))?;
                self.colliders.push(collider);
                entries.push(Entry { object: body.name.clone(), field });
            }
        }
        Ok(entries)
    }

    fn body_collider(&mut self, body: &Body, k: usize, shape: &BodyShape, index: usize) -> Result<Collider, Mistake> {
        let name = format!("{}.shape[{k}]", body.name);
        let place = Place::At(self.push_position(&name, shape.position));
        let turn = (shape.kind != ShapeKind::Sphere).then(|| self.push_rotation(&name)[0]);
        let (form, sizes) = match shape.kind {
            ShapeKind::Sphere => (ColliderShape::Ball, [shape.radius, None, None]),
            ShapeKind::Capsule => (ColliderShape::Capsule, [shape.radius, shape.half_length, None]),
            ShapeKind::Cylinder => (ColliderShape::Cylinder, [shape.radius, shape.half_length, None]),
            ShapeKind::Box => (ColliderShape::Block, [0, 1, 2].map(|a| shape.half_extents.map(|x| x[a]))),
            ShapeKind::Hull => (hull(shape)?, [None; 3]),
        };
        let sizes = self.push_sizes(&name, &form, sizes.map(|x| x.unwrap_or(0.0)));
        let friction = shape.friction.map(|mu| self.params.push(format!("{name}.friction"), "-", NON_NEGATIVE, mu));
        let rotation = matrix(&normalized(&shape.quaternion));
        let (attachment, point) = (Attachment::Body(index), Vec3::zeros());
        Ok(Collider { name, form, attachment, rotation, turn, point, place, sizes, friction })
    }

    fn push_position(&mut self, name: &str, position: [f64; 3]) -> usize {
        let first = self.params.len();
        for (a, x) in position.into_iter().enumerate() {
            self.params.push(format!("{name}.position[{a}]"), "m", ANY, x);
        }
        first
    }

    /// The rotation vector by which a shape or plane is turned from where the scene has it.
    pub(super) fn push_rotation(&mut self, name: &str) -> [usize; 3] {
        [0, 1, 2].map(|a| self.params.push(format!("{name}.rotation[{a}]"), "rad", ANY, 0.0))
    }

    fn push_sizes(&mut self, name: &str, form: &ColliderShape, sizes: [f64; 3]) -> [usize; 3] {
        let names: &[&str] = match form {
            ColliderShape::HalfSpace | ColliderShape::Hull(_) => &[],
            ColliderShape::Ball => &["radius"],
            ColliderShape::Capsule | ColliderShape::Cylinder => &["radius", "half_length"],
            ColliderShape::Block => &["half_extent[0]", "half_extent[1]", "half_extent[2]"],
        };
        let mut out = [0; 3];
        for (k, quantity) in names.iter().enumerate() {
            out[k] = self.params.push(format!("{name}.{quantity}"), "m", POSITIVE, sizes[k]);
        }
        out
    }

    /// Solids for the fixed shapes; planes, spheres and capsules share their parameters with the shapes that nodes touch.
    fn fixed_colliders(&mut self, scene: &Scene, entries: &mut Vec<Entry>) {
        let identity = Matrix3::identity();
        let mut push = |model: &mut Self, field: String, collider: Collider| {
            entries.push(Entry { object: collider.name.clone(), field });
            model.colliders.push(collider);
        };
        let fixed = |name: &str, form, rotation, place, sizes, friction| Collider {
            name: name.to_owned(),
            form,
            attachment: Attachment::World,
            rotation,
            turn: None,
            point: Vec3::zeros(),
            place,
            sizes,
            friction,
        };
        let find = |model: &Self, name: &str, quantity: &str| model.params.find(&format!("{name}.{quantity}"));
        for (i, s) in scene.plane.iter().enumerate() {
            let Some(height) = find(self, &s.name, "height") else { continue };
            let friction = find(self, &s.name, "friction");
            let collider =
                fixed(&s.name, ColliderShape::HalfSpace, along(&Vec3::from(s.normal)), Place::Height(height), [0; 3], friction);
            let turn = find(self, &s.name, "rotation[0]");
            push(self, format!("plane[{i}]"), Collider { turn, point: Vec3::from(s.point), ..collider });
        }
        for (i, s) in scene.sphere.iter().enumerate() {
            let (Some(center), Some(radius)) = (find(self, &s.name, "center[0]"), find(self, &s.name, "radius")) else {
                continue;
            };
            let friction = find(self, &s.name, "friction");
            push(
                self,
                format!("sphere[{i}]"),
                fixed(&s.name, ColliderShape::Ball, identity, Place::At(center), [radius, 0, 0], friction),
            );
        }
        for (i, s) in scene.capsule.iter().enumerate() {
            let ends = [find(self, &s.name, "a[0]"), find(self, &s.name, "b[0]"), find(self, &s.name, "radius")];
            let [Some(a), Some(b), Some(radius)] = ends else { continue };
            let place = Place::Between([a, a + 1, a + 2], [b, b + 1, b + 2]);
            let friction = find(self, &s.name, "friction");
            push(
                self,
                format!("capsule[{i}]"),
                fixed(&s.name, ColliderShape::Capsule, identity, place, [radius, 0, 0], friction),
            );
        }
        for (i, s) in scene.block.iter().enumerate() {
            let place = Place::At(self.push_position(&s.name, s.position));
            let turn = Some(self.push_rotation(&s.name)[0]);
            let sizes = self.push_sizes(&s.name, &ColliderShape::Block, s.half_extents);
            let friction = self.params.push(format!("{}.friction", s.name), "-", NON_NEGATIVE, s.friction);
            let rotation = matrix(&normalized(&s.quaternion));
            let collider = fixed(&s.name, ColliderShape::Block, rotation, place, sizes, Some(friction));
            push(self, format!("box[{i}]"), Collider { turn, ..collider });
        }
        for (i, s) in scene.cylinder.iter().enumerate() {
            let place = Place::At(self.push_position(&s.name, s.position));
            let turn = Some(self.push_rotation(&s.name)[0]);
            let sizes = self.push_sizes(&s.name, &ColliderShape::Cylinder, [s.radius, s.half_length, 0.0]);
            let friction = self.params.push(format!("{}.friction", s.name), "-", NON_NEGATIVE, s.friction);
            let rotation = matrix(&normalized(&s.quaternion));
            let collider = fixed(&s.name, ColliderShape::Cylinder, rotation, place, sizes, Some(friction));
            push(self, format!("cylinder[{i}]"), Collider { turn, ..collider });
        }
    }

    fn node_colliders(&mut self, radii: &[usize], entries: &mut Vec<Entry>) {
        let ropes = self.ropes.iter().zip(radii).enumerate();
        let ropes = ropes.map(|(r, (rope, radius))| (&rope.name, rope.nodes.clone(), *radius, format!("rope[{r}].initial")));
        let cloths = self.cloths.iter().enumerate().map(|(c, s)| (&s.name, s.nodes.clone(), s.radius, format!("cloth[{c}]")));
        for (name, nodes, radius, field) in ropes.chain(cloths) {
            for (k, node) in nodes.enumerate().filter(|(_, node)| !self.prescribed[*node]) {
                self.colliders.push(Collider {
                    name: format!("{name}.node[{k}]"),
                    form: ColliderShape::Ball,
                    attachment: Attachment::Node(node),
                    rotation: Matrix3::identity(),
                    turn: None,
                    point: Vec3::zeros(),
                    place: Place::Origin,
                    sizes: [radius, 0, 0],
                    friction: None,
                });
                entries.push(Entry { object: name.clone(), field: field.clone() });
            }
        }
    }

    /// The entry of θ of two colliders that both have no friction of their own.
    fn no_friction(&mut self) -> usize {
        let path = "contact.friction";
        self.params.find(path).unwrap_or_else(|| self.params.push(path, "-", NON_NEGATIVE, 0.0))
    }

    /// Mass of every body as the scene begins \[kg\]; of one without, that of everything on it.
    pub(super) fn body_weights(&self) -> Vec<f64> {
        let inertias = self.inertias(self.params.values());
        let mut beyond: Vec<f64> = inertias.iter().map(|i| i.m).collect();
        for (b, body) in self.tree.bodies().iter().enumerate().rev() {
            if let Some(parent) = body.parent {
                beyond[parent] += beyond[b];
            }
        }
        inertias.iter().zip(beyond).map(|(i, all)| if i.m > 0.0 { i.m } else { all }).collect()
    }

    /// Weight of what carries a solid \[N\]; infinite for the world.
    fn weight(&self, bodies: &[f64], collider: usize) -> f64 {
        CONSTRAINTS.weight
            * match self.colliders[collider].attachment {
                Attachment::World => f64::INFINITY,
                Attachment::Body(body) => bodies[body].max(MODEL.lightest),
                Attachment::Node(node) => self.masses[node].mass(self.params.values()).max(MODEL.lightest),
            }
    }

    /// For every body the first one that it is fixed to without a joint; none if that is the world.
    fn joined(&self) -> Vec<Option<usize>> {
        let mut out: Vec<Option<usize>> = Vec::new();
        for (b, body) in self.tree.bodies().iter().enumerate() {
            out.push(if body.joints.is_empty() { body.parent.and_then(|p| out[p]) } else { Some(b) });
        }
        out
    }

    fn may_touch(&self, a: usize, b: usize, fixed: std::ops::Range<usize>, joined: &[Option<usize>]) -> bool {
        let new_to_nodes =
            |collider: usize| matches!(self.colliders[collider].form, ColliderShape::Block | ColliderShape::Cylinder);
        match (self.colliders[a].attachment, self.colliders[b].attachment) {
            (Attachment::World, Attachment::World) | (Attachment::Node(_), Attachment::Node(_)) => false,
            // nodes touch fixed planes, spheres and capsules by a way of their own
            (Attachment::World, Attachment::Node(_)) => fixed.contains(&a) && new_to_nodes(a),
            (Attachment::Node(_), Attachment::World) => fixed.contains(&b) && new_to_nodes(b),
            (Attachment::Body(x), Attachment::Body(y)) => {
                let (x, y) = (joined[x], joined[y]);
                let above = |x: Option<usize>| x.and_then(|x| self.tree.bodies()[x].parent).and_then(|p| joined[p]);
                // neighbours at a joint overlap there, and two that are fixed to the world do not move
                x != y && (x.is_none() || above(x) != y || y.is_none()) && (y.is_none() || above(y) != x || x.is_none())
            }
            (Attachment::Body(x), Attachment::World) | (Attachment::World, Attachment::Body(x)) => joined[x].is_some(),
            (Attachment::Body(_), Attachment::Node(_)) | (Attachment::Node(_), Attachment::Body(_)) => true,
        }
    }

    /// No pair may overlap as the scene begins: contact would throw them apart.
    fn refuse_overlaps(&self, entries: &[Entry]) -> Result<(), SceneError> {
        let theta = self.params.values();
        let frames = self.tree.frames(&self.q0[self.n_node_dofs()..], &vec![0.0; self.tree.nv()]);
        let pose = |s: &Collider| crate::constraints::pose(s.attachment, &self.q0, &frames);
        let placed: Vec<_> = self.colliders.iter().map(|s| s.placed(&pose(s), |k| theta[k])).collect();
        let mut deepest: HashMap<(usize, usize), f64> = HashMap::new();
        let mut found = Vec::new();
        for pair in &self.collider_pairs {
            let [a, b] = pair.colliders;
            found.clear();
            candidates(&placed[a], &placed[b], 0.0, &mut found);
            drop_hidden(&placed[a], &placed[b], MODEL.overlap, &mut found);
            for (feature_pair, swapped) in &found {
                let (a, b) = if *swapped { (b, a) } else { (a, b) };
                // only points that lie in the other solid tell how deep it is
                let Ok(geometry) = contact_geometry(feature_pair, &placed[a], &placed[b]) else { continue };
                let depth = deepest.entry((pair.colliders[0], pair.colliders[1])).or_insert(0.0);
                *depth = depth.max(-geometry.gap);
            }
            // where no features meet
            let depth = deepest.entry((a, b)).or_insert(0.0);
            *depth = depth.max(overlap(&placed[a], &placed[b]));
        }
        let worst = deepest
            .into_iter()
            .filter(|(_, depth)| *depth > MODEL.overlap)
            .max_by(|x, y| x.1.total_cmp(&y.1).then(y.0.cmp(&x.0)));
        let Some(((a, b), depth)) = worst else { return Ok(()) };
        let name = |k: usize| format!("`{}`", self.colliders[k].name);
        Err(SceneError::at(entries[a].field.clone(), Mistake::Overlap { first: name(a), second: name(b), depth }))
    }
}

/// The hull of a shape's points.
fn hull(shape: &BodyShape) -> Result<ColliderShape, Mistake> {
    let points: Vec<Vec3<f64>> = shape.points.iter().flatten().map(|p| Vec3::from(*p)).collect();
    let hull = Polyhedron::new(&points).ok_or(Mistake::FlatHull { points: points.len() })?;
    Ok(ColliderShape::Hull(Arc::new(hull)))
}

/// Axes with z along `normal`.
fn along(normal: &Vec3<f64>) -> Matrix3<f64> {
    let z = normal.normalize();
    let mut e = Vec3::zeros();
    e[z.iamin()] = 1.0;
    let x = e.cross(&z).normalize();
    Matrix3::from_columns(&[x, z.cross(&x), z])
}
