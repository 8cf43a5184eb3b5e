//! From a scene's sheets to nodes, parameters and elements.

use super::{Model, NodeMass};
use crate::kinematics::{Drive, DriveKind};
use crate::terms::Element;
use crate::terms::sheet::{FaceDrag, Membrane, MembraneDamping, Plate, PlateDamping, bend_element, face_constants};
use pliant_math::Vec3;
use pliant_math::params::{ANY, NON_NEGATIVE, POSITIVE, Params};
use pliant_scene::{Clamp, Cloth, Gripper, Mesh, Mode, Scene, SceneError};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Bounds of Poisson's ratio: clear of −1 and 1, where a sheet's stiffness is infinite.
const POISSON: (f64, f64) = (-0.999, 0.5);

/// A sheet's place in the model.
#[derive(Clone, Debug, PartialEq)]
pub struct ClothSpan {
    /// Name in the scene.
    pub name: String,
    /// Node numbers in the model.
    pub nodes: std::ops::Range<usize>,
    /// Triangles, by nodes of the sheet counted from 0; all of a piece turned the same way.
    pub triangles: Vec<[usize; 3]>,
    /// Edges of the triangles, each once, by nodes of the sheet counted from 0, and their lengths at rest over the root of the area [-].
    pub edges: Vec<([usize; 2], f64)>,
    /// Index in θ of the sheet's area at rest \[m²\].
    pub area: usize,
    /// Index in θ of the distance at which its nodes touch \[m\].
    pub radius: usize,
}

/// Element lists of a sheet's forces; gravity is with the ropes'.
#[derive(Default)]
pub(super) struct SheetElements {
    membrane: Vec<Element>,
    membrane_damping: Vec<Element>,
    plate: Vec<Element>,
    plate_damping: Vec<Element>,
    drag: Vec<Element>,
}

/// Indices in θ.
struct SheetParams {
    area: usize,
    density: usize,
    thickness: usize,
    young: usize,
    poisson: usize,
    bend: usize,
    membrane_damping: usize,
    bend_damping: usize,
    drag_normal: usize,
    drag_quadratic: usize,
    radius: usize,
}

impl SheetParams {
    fn push(cloth: &Cloth, area: f64, params: &mut Params) -> Self {
        let mut entry = |name: &str, unit, bounds, value| params.push(format!("{}.{name}", cloth.name), unit, bounds, value);
        Self {
            area: entry("area", "m²", POSITIVE, area),
            density: entry("area_density", "kg/m²", POSITIVE, cloth.mass_per_area()),
            thickness: entry("thickness", "m", POSITIVE, cloth.thickness),
            young: entry("youngs_modulus", "Pa", NON_NEGATIVE, cloth.youngs_modulus),
            poisson: entry("poisson_ratio", "-", POISSON, cloth.poisson_ratio),
            bend: entry("bend_stiffness", "N·m", NON_NEGATIVE, cloth.plate_stiffness()),
            membrane_damping: entry("membrane_damping", "Pa·s", NON_NEGATIVE, cloth.membrane_damping),
            bend_damping: entry("bend_damping", "N·m·s", NON_NEGATIVE, cloth.bend_damping),
            drag_normal: entry("drag_normal", "kg/(m²·s)", NON_NEGATIVE, cloth.drag_normal),
            drag_quadratic: entry("drag_quadratic", "kg/m³", NON_NEGATIVE, cloth.drag_quadratic),
            radius: entry("radius", "m", NON_NEGATIVE, cloth.contact_radius()),
        }
    }
}

impl Model {
    /// Adds the nodes of all sheets after those there are, and lists their elements; weights join `gravity_elements`.
    pub(super) fn add_sheets(
        &mut self,
        scene: &Scene,
        [gravity, wind]: [usize; 2],
        gravity_elements: &mut Vec<Element>,
    ) -> Result<SheetElements, SceneError> {
        let mut out = SheetElements::default();
        for (c, cloth) in scene.cloth.iter().enumerate() {
            let mesh = cloth.rest(&format!("cloth[{c}]"))?;
            let p = SheetParams::push(cloth, mesh.total_area(), &mut self.params);
            let first = self.masses.len();
            for (i, fraction) in mesh.fractions().into_iter().enumerate() {
                let params = vec![gravity, gravity + 1, gravity + 2, p.area, p.density];
                gravity_elements.push(Element { nodes: vec![first + i], params, constants: vec![fraction] });
                let (length, density) = (p.area, p.density);
                self.masses.push(NodeMass { fraction, length, density, extras: Vec::new(), ghost: false });
            }
            out.list(&mesh, first, &p, wind);
            let (nodes, name, edges) = (first..self.masses.len(), cloth.name.clone(), edges(&mesh));
            self.cloths.push(ClothSpan { name, nodes, triangles: mesh.triangles, edges, area: p.area, radius: p.radius });
        }
        Ok(out)
    }

    /// The forces of all sheets; none if there is no sheet.
    pub(super) fn add_sheet_terms(&mut self, e: SheetElements) {
        if self.cloths.is_empty() {
            return;
        }
        self.terms.push(Arc::new(Membrane::new(e.membrane)));
        self.terms.push(Arc::new(MembraneDamping::new(e.membrane_damping)));
        self.terms.push(Arc::new(Plate::new(e.plate)));
        self.terms.push(Arc::new(PlateDamping::new(e.plate_damping)));
        self.terms.push(Arc::new(FaceDrag::new(e.drag)));
    }

    /// Adds a gripper that holds nodes of a sheet.
    pub(super) fn add_sheet_gripper(&mut self, gripper: &Gripper, scene_cloths: &[Cloth]) {
        let named = |name: &str| gripper.cloth.as_deref() == Some(name);
        let Some((span, cloth)) = self.cloths.iter().zip(scene_cloths).find(|(span, _)| named(&span.name)) else { return };
        let Clamp::Nodes(numbers) = &gripper.clamp else { return };
        let nodes: Vec<usize> = numbers.iter().filter_map(|&k| Some(span.nodes.start + cloth.node(k)?)).collect();
        let kind = match gripper.mode {
            Mode::Prescribed => DriveKind::PrescribedNodes(nodes),
            Mode::Velocity => DriveKind::VelocityNodes(nodes),
        };
        let (first_u, offset) = (self.nu(), self.params.len());
        for (a, value) in gripper.offset.iter().enumerate() {
            self.params.push(format!("{}.offset[{a}]", gripper.name), "m", ANY, *value);
        }
        let drive = Drive { name: gripper.name.clone(), kind, first_u, offset, held: Vec::new(), closes: false };
        for node in drive.nodes() {
            self.prescribed[node] = true;
        }
        self.drives.push(drive);
    }

    /// Name and nodes of every rope, then of every sheet, without ghosts.
    pub fn node_spans(&self) -> impl Iterator<Item = (&str, std::ops::Range<usize>)> {
        let ropes = self.ropes.iter().map(|r| (r.name.as_str(), r.nodes.clone()));
        ropes.chain(self.cloths.iter().map(|c| (c.name.as_str(), c.nodes.clone())))
    }

    /// The sheets.
    pub fn cloths(&self) -> &[ClothSpan] {
        &self.cloths
    }

    /// The sheet of that name.
    pub fn cloth(&self, name: &str) -> Option<&ClothSpan> {
        self.cloths.iter().find(|c| c.name == name)
    }
}

/// Edges of a mesh and their relative lengths, as [`ClothSpan::edges`].
fn edges(mesh: &Mesh) -> Vec<([usize; 2], f64)> {
    let sides = |&[a, b, c]: &[usize; 3]| [[a, b], [b, c], [c, a]].map(|[i, j]| [i.min(j), i.max(j)]);
    let pairs: BTreeSet<[usize; 2]> = mesh.triangles.iter().flat_map(sides).collect();
    let (x, root) = (|i: usize| Vec3::from(mesh.vertices[i]), mesh.total_area().sqrt());
    pairs.into_iter().map(|[i, j]| ([i, j], (x(j) - x(i)).norm() / root)).collect()
}

impl SheetElements {
    fn list(&mut self, mesh: &Mesh, first: usize, p: &SheetParams, wind: usize) {
        let area = mesh.total_area();
        let rest = |node: usize| Vec3::from(mesh.vertices[node - first]);
        for (triangle, beyond) in mesh.triangles.iter().zip(&mesh.beyond) {
            let nodes = triangle.map(|i| first + i);
            let constants = face_constants(&triangle.map(|i| mesh.vertices[i]), area);
            let face = |params: Vec<usize>, constants| Element { nodes: nodes.to_vec(), params, constants };
            self.membrane.push(face(vec![p.area, p.young, p.poisson, p.thickness], constants.clone()));
            self.membrane_damping.push(face(vec![p.area, p.membrane_damping, p.thickness], constants));
            self.drag.push(face(vec![p.drag_normal, p.drag_quadratic, wind, wind + 1, wind + 2], Vec::new()));
            if let Some(bend) = bend_element(nodes, beyond.map(|node| node.map(|i| first + i)), &rest) {
                self.plate.push(Element { params: vec![p.bend, p.poisson], ..bend.clone() });
                self.plate_damping.push(Element { params: vec![p.bend_damping, p.poisson], ..bend });
            }
        }
    }
}
