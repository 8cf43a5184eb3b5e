//! Edges of ropes, and edges and triangles of sheets, that touch fixed shapes.

use super::Model;
use super::constants::MODEL;
use crate::constraints::{CONSTRAINTS, ContactElement, ElementGroup, Friction};
use crate::geometry::collider::{Attachment, ColliderShape, PlacedCollider, overlap};
use crate::geometry::element::{Candidates, candidates, nearest};
use nalgebra::Matrix3;
use pliant_math::Vec3;
use pliant_scene::{Mistake, Scene, SceneError, Touching};
use std::collections::BTreeMap;
use std::ops::Range;

impl Model {
    /// Adds the contact elements that a scene asks for, and refuses those that begin inside a shape; of every rope the index of its radius in θ.
    pub(super) fn add_elements(&mut self, scene: &Scene, radii: &[usize]) -> Result<(), SceneError> {
        for (r, rope) in scene.rope.iter().enumerate().filter(|(_, rope)| rope.contact == Touching::Edges) {
            let nodes = self.ropes[r].nodes.clone();
            let edges = nodes.clone().zip(nodes.clone().skip(1)).map(|(a, b)| ([a, b, b], 2, [None; 2])).collect();
            self.add_group(edges, nodes, radii[r], &format!("rope[{r}].initial"), &rope.name)?;
        }
        for (c, cloth) in scene.cloth.iter().enumerate().filter(|(_, cloth)| cloth.contact == Touching::Edges) {
            let span = self.cloths[c].clone();
            let triangles: Vec<[usize; 3]> = span.triangles.iter().map(|t| t.map(|k| span.nodes.start + k)).collect();
            let mut edges: BTreeMap<[usize; 2], [Option<usize>; 2]> = BTreeMap::new();
            for [a, b, c] in &triangles {
                for (i, j, third) in [(a, b, c), (b, c, a), (c, a, b)] {
                    let thirds = edges.entry([*i.min(j), *i.max(j)]).or_default();
                    let place = usize::from(thirds[0].is_some());
                    thirds[place] = Some(*third);
                }
            }
            let edges = edges.into_iter().map(|([a, b], thirds)| ([a, b, b], 2, thirds));
            let elements = edges.chain(triangles.iter().map(|t| (*t, 3, [None; 2]))).collect();
            self.add_group(elements, span.nodes, span.radius, &format!("cloth[{c}]"), &cloth.name)?;
        }
        Ok(())
    }

    /// Adds contact elements of one object, with every shape that they may touch.
    fn add_group(
        &mut self,
        elements: Vec<([usize; 3], usize, [Option<usize>; 2])>,
        nodes: Range<usize>,
        radius: usize,
        field: &str,
        name: &str,
    ) -> Result<(), SceneError> {
        let first = self.elements.len();
        for (corners, count, thirds) in elements {
            let free = || corners[..count].iter().filter(|node| !self.prescribed[**node]);
            if free().next().is_none() {
                continue;
            }
            let mass = |node: &usize| self.masses[*node].mass(self.params.values());
            let lightest = free().map(mass).fold(f64::INFINITY, f64::min);
            let weight = CONSTRAINTS.weight * lightest.max(MODEL.lightest);
            self.elements.push(ContactElement { nodes: corners, count, radius, thirds, weight });
        }
        let elements = first..self.elements.len();
        for collider in 0..self.colliders.len() {
            if self.colliders[collider].attachment != Attachment::World {
                continue;
            }
            let friction = match self.colliders[collider].form {
                ColliderShape::Ball | ColliderShape::Capsule => self.friction_of_shape(collider, &nodes),
                ColliderShape::Block => self.friction_of_nodes(collider, &nodes),
                ColliderShape::HalfSpace | ColliderShape::Cylinder | ColliderShape::Hull(_) => None,
            };
            let Some(friction) = friction else { continue };
            self.refuse_inside(&elements, collider, field, name)?;
            self.element_groups.push(ElementGroup { elements: elements.clone(), collider, friction });
        }
        Ok(())
    }

    /// Friction between a fixed ball or capsule and these nodes; `None` if they pass through each other.
    fn friction_of_shape(&self, collider: usize, nodes: &Range<usize>) -> Option<Friction> {
        let name = &self.colliders[collider].name;
        let pair = self.pairs.iter().find(|pair| nodes.contains(&pair.node) && self.shape_names[pair.shape] == *name);
        pair.map(|pair| Friction::Of(pair.friction))
    }

    /// Friction between a fixed solid and balls at these nodes; `None` if they pass through each other.
    fn friction_of_nodes(&self, collider: usize, nodes: &Range<usize>) -> Option<Friction> {
        let of_node = |s: usize| matches!(self.colliders[s].attachment, Attachment::Node(node) if nodes.contains(&node));
        let pair = self.collider_pairs.iter().find(|pair| {
            let [a, b] = pair.colliders;
            (a == collider && of_node(b)) || (b == collider && of_node(a))
        });
        pair.map(|pair| pair.friction)
    }

    /// No contact element may begin with its middle surface inside a shape: contact would throw it out.
    fn refuse_inside(&self, elements: &Range<usize>, collider: usize, field: &str, name: &str) -> Result<(), SceneError> {
        let theta = self.params.values();
        let world = crate::constraints::pose_of_world(&Vec3::zeros());
        let shape = self.colliders[collider].placed(&world, |k| theta[k]);
        let depth = |k: &usize| depth(&self.elements[*k], &self.q0, &shape);
        let Some(worst) = elements.clone().max_by(|a, b| depth(a).total_cmp(&depth(b))) else { return Ok(()) };
        if depth(&worst) <= MODEL.touching {
            return Ok(());
        }
        let nodes = self.elements[worst].nodes[..self.elements[worst].count].iter();
        let start = self.node_spans().find(|(span, _)| *span == name).map_or(0, |(_, nodes)| nodes.start);
        let nodes: Vec<String> = nodes.map(|node| (node - start).to_string()).collect();
        let first = format!("the inside of `{name}` between nodes {}", nodes.join(", "));
        let mistake = Mistake::Overlap { first, second: format!("`{}`", self.colliders[collider].name), depth: depth(&worst) };
        Err(SceneError::at(field.to_owned(), mistake))
    }
}

/// How deep the middle surface of a contact element certainly is in a shape \[m\].
fn depth(element: &ContactElement, q: &[f64], shape: &PlacedCollider<f64>) -> f64 {
    let x = element.nodes.map(|node| Vec3::new(q[3 * node], q[3 * node + 1], q[3 * node + 2]));
    let edge = x[1] - x[0];
    if let (2, Some(along)) = (element.count, edge.try_normalize(0.0)) {
        let zero = Vec3::zeros();
        let rotation = Matrix3::from_columns(&[zero, zero, along]);
        let sizes = [0.0, 0.5 * edge.norm(), 0.0];
        return overlap(&PlacedCollider { form: ColliderShape::Capsule, rotation, position: (x[0] + x[1]) * 0.5, sizes }, shape);
    }
    let now = Candidates { x: &x[..element.count], radius: 0.0, sheet: [None; 2], shape, margin: 0.0 };
    let mut found = Vec::new();
    candidates(&now, &now, &mut found);
    let gap = |feature| nearest(&x[..element.count], 0.0, feature, shape).map_or(0.0, |found| found.gap);
    found.into_iter().fold(0.0, |depth, feature| -gap(feature).min(-depth))
}
