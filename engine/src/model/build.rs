//! From a scene to a model.

use super::{DofWeights, Model, NodeMass, RopeSpan};
use crate::bodies::Tree;
use crate::constraints::ContactPair;
use crate::geometry::Shape;
use crate::kinematics::{Drive, DriveKind, EdgeClamp};
use crate::memory::Layout;
use crate::rods::Rods;
use crate::terms::{Automatic, Bend, BendDamping, Drag, Element, Gravity, Law, RestStrain, Stretch, StretchDamping, Term};
use pliant_linalg::NodeLayout;
use pliant_math::Vec3;
use pliant_math::params::{ANY, NON_NEGATIVE, POSITIVE, Params, REST_STRAIN};
use pliant_scene::{Clamp, End, Gripper, Mode, Rope, Scene, SceneError, Source, Start};
use std::sync::Arc;

/// A model that cannot be built.
#[derive(Clone, Debug, thiserror::Error)]
pub enum BuildError {
    /// The scene contradicts itself.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A custom term acts on a node that does not exist.
    #[error("term `{term}`: element {element} acts on node {node}, but the model has nodes 0 to {last}")]
    Node {
        /// Term.
        term: String,
        /// Element number.
        element: usize,
        /// Node asked for.
        node: usize,
        /// Last node there is.
        last: usize,
    },
}

impl BuildError {
    /// The same error with file and line found in the scene's text.
    pub fn located(self, source: &Source) -> Self {
        match self {
            Self::Scene(error) => Self::Scene(error.located(source)),
            other => other,
        }
    }
}

/// Builds a [`Model`] from a scene, and lets one add forces of one's own before it is finished.
#[derive(Debug)]
pub struct ModelBuilder {
    model: Model,
}

/// Nodes of one rope while its elements are listed: real nodes, and the ghosts at clamped end edges.
pub(super) struct RopeNodes<'a> {
    pub rope: &'a Rope,
    span: RopeSpan,
    ghost_first: Option<usize>,
    ghost_last: Option<usize>,
    pub params: RopeParams,
}

pub(super) struct RopeParams {
    pub length: usize,
    density: usize,
    stretch: usize,
    stretch_damping: usize,
    pub bend: usize,
    pub bend_damping: usize,
    drag_linear: usize,
    drag_quadratic: usize,
    tip: usize,
    radius: usize,
    first_node_mass: usize,
    first_rest_strain: Option<usize>,
}

/// Element lists of all terms, filled rope by rope.
#[derive(Default)]
struct Elements {
    gravity: Vec<Element>,
    stretch: Vec<Element>,
    stretch_damping: Vec<Element>,
    rest_strain: Vec<Element>,
    bend: Vec<Element>,
    bend_damping: Vec<Element>,
    drag: Vec<Element>,
}

impl ModelBuilder {
    /// Checks the scene and builds everything it describes.
    pub fn new(scene: &Scene) -> Result<Self, BuildError> {
        pliant_scene::check(scene)?;
        let mut params = Params::default();
        let gravity = params.push("gravity.magnitude", "m/s²", NON_NEGATIVE, scene.gravity.magnitude);
        for (a, tilt) in scene.gravity.tilt.iter().enumerate() {
            params.push(format!("gravity.tilt[{a}]"), "rad", ANY, *tilt);
        }
        let wind = params.len();
        for (a, wind) in scene.air.wind.iter().enumerate() {
            params.push(format!("air.wind[{a}]"), "m/s", ANY, *wind);
        }
        if scene.body.iter().any(|body| body.mass > 0.0) {
            params.push("air.density", "kg/m³", NON_NEGATIVE, scene.air.density);
            params.push("air.viscosity", "Pa·s", NON_NEGATIVE, scene.air.viscosity);
        }
        let (q0, v0) = pliant_scene::initial_state(scene)?;
        let mut model = Model {
            params,
            ropes: Vec::new(),
            cloths: Vec::new(),
            masses: Vec::new(),
            prescribed: Vec::new(),
            prescribed_rows: Vec::new(),
            rods: Rods::default(),
            drives: Vec::new(),
            grasps: Vec::new(),
            terms: Vec::new(),
            tree: Tree::default(),
            joint_terms: Vec::new(),
            body_drags: Vec::new(),
            joint_rows: Vec::new(),
            weights: DofWeights::default(),
            n_actuators: 0,
            memory: Layout::default(),
            shapes: Vec::new(),
            shape_names: Vec::new(),
            pairs: Vec::new(),
            elements: Vec::new(),
            element_groups: Vec::new(),
            colliders: Vec::new(),
            collider_pairs: Vec::new(),
            closures: Vec::new(),
            own_forces: Vec::new(),
            layout: Arc::new(NodeLayout::band(0, 0)),
            gravity,
            h: scene.time.step,
            integrator: scene.time.integrator,
            contact: scene.contact.clone(),
            solver: scene.solver.clone(),
            start: {
                let mut starts = scene.rope.iter().map(|r| r.start).chain(scene.cloth.iter().map(|c| c.start));
                if starts.any(|s| s == Start::Equilibrium) { Start::Equilibrium } else { Start::AsGiven }
            },
            q0,
            v0,
            frames0: Vec::new(),
        };
        let mut elements = Elements::default();
        let mut ropes = Vec::new();
        for rope in &scene.rope {
            let nodes = RopeNodes::place(rope, &scene.gripper, &mut model);
            nodes.list_elements(gravity, wind, &mut elements);
            ropes.push(nodes);
        }
        let sheets = model.add_sheets(scene, [gravity, wind], &mut elements.gravity)?;
        let first_point = model.masses.len();
        let grasping = scene.gripper.iter().filter(|g| matches!(g.clamp, Clamp::Grasp(_)));
        model.masses.extend(grasping.map(|_| NodeMass { ghost: true, ..NodeMass::default() }));
        model.add_terms(elements);
        model.add_sheet_terms(sheets);
        model.prescribed = vec![false; model.n_nodes()];
        model.add_rods(scene, &ropes)?;
        for gripper in &scene.gripper {
            match &gripper.clamp {
                Clamp::Grasp(grasp) => model.add_grasp(gripper, grasp, first_point + model.grasps.len()),
                Clamp::Nodes(_) | Clamp::End(_) => {
                    model.add_gripper(gripper, &ropes);
                    model.add_sheet_gripper(gripper, &scene.cloth);
                }
            }
        }
        model.drive_rows();
        model.add_bodies(scene);
        model.weights = model.dof_weights();
        model.add_couplings(scene)?;
        model.add_shapes(scene);
        model.add_pairs(&ropes);
        let radii: Vec<usize> = ropes.iter().map(|r| r.params.radius).collect();
        model.add_colliders(scene, &radii)?;
        model.add_elements(scene, &radii)?;
        model.add_closures(scene)?;
        model.add_forces(scene)?;
        Ok(Self { model })
    }

    /// Adds an entry to θ, for a law of one's own, and returns its index.
    pub fn add_param(&mut self, path: &str, unit: &'static str, bounds: (f64, f64), value: f64) -> usize {
        self.model.params.push(path, unit, bounds, value)
    }

    /// The model so far, to look up nodes and parameters.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Adds a law and the elements it acts on; its derivatives are automatic.
    pub fn add_law<L: Law + 'static>(&mut self, law: L, elements: Vec<Element>) -> Result<(), BuildError> {
        self.add_term(Arc::new(Automatic::new(law, elements)))
    }

    /// Adds a force with derivatives of its own.
    pub fn add_term(&mut self, term: Arc<dyn Term>) -> Result<(), BuildError> {
        let (last, mut element, mut beyond) = (self.model.n_nodes() - 1, 0, None);
        term.visit_stencils(&mut |nodes| {
            beyond = beyond.or_else(|| nodes.iter().find(|n| **n > last).map(|n| (element, *n)));
            element += 1;
        });
        if let Some((element, node)) = beyond {
            return Err(BuildError::Node { term: term.name().to_owned(), element, node, last });
        }
        self.model.terms.push(term);
        Ok(())
    }

    /// The finished model.
    pub fn build(mut self) -> Model {
        self.model.layout = Arc::new(self.model.make_layout());
        self.model
    }
}

impl<'a> RopeNodes<'a> {
    fn place(rope: &'a Rope, grippers: &[Gripper], model: &mut Model) -> Self {
        let clamped = |end| grippers.iter().any(|g| g.rope.as_ref() == Some(&rope.name) && g.clamp == Clamp::End(end));
        let n = rope.n_nodes();
        let first = model.masses.len();
        let ghost_first = clamped(End::First).then_some(first);
        let start = first + usize::from(ghost_first.is_some());
        let ghost_last = clamped(End::Last).then_some(start + n);
        let params = RopeParams::push(rope, &mut model.params);
        let fractions = rope.fractions();
        let ghost = NodeMass { ghost: true, ..NodeMass::default() };
        model.masses.extend(ghost_first.map(|_| ghost.clone()));
        for i in 0..n {
            let mut extras = vec![params.first_node_mass + i];
            if i + 1 == n {
                extras.push(params.tip);
            }
            let fraction = voronoi(&fractions, i, n);
            model.masses.push(NodeMass { fraction, length: params.length, density: params.density, extras, ghost: false });
        }
        model.masses.extend(ghost_last.map(|_| ghost));
        let span = RopeSpan { name: rope.name.clone(), nodes: start..start + n, fractions, length: params.length };
        model.ropes.push(span.clone());
        Self { rope, span, ghost_first, ghost_last, params }
    }

    fn list_elements(&self, gravity: usize, wind: usize, out: &mut Elements) {
        let (p, fractions) = (&self.params, &self.span.fractions);
        let n = self.span.nodes.len();
        let node = |i: usize| self.span.nodes.start + i;
        for i in 0..n {
            let mut params = vec![gravity, gravity + 1, gravity + 2, p.length, p.density, p.first_node_mass + i];
            if i + 1 == n {
                params.push(p.tip);
            }
            let constants = vec![voronoi(fractions, i, n)];
            out.gravity.push(Element { nodes: vec![node(i)], params, constants: constants.clone() });
            let params = vec![p.length, p.drag_linear, p.drag_quadratic, wind, wind + 1, wind + 2];
            out.drag.push(Element { nodes: vec![node(i)], params, constants });
        }
        for (e, &fraction) in fractions.iter().enumerate() {
            let pair = |params| Element { nodes: self.span.edge(e).to_vec(), params, constants: vec![fraction] };
            out.stretch.push(pair(vec![p.length, p.stretch]));
            out.stretch_damping.push(pair(vec![p.length, p.stretch_damping]));
            out.rest_strain.extend(p.first_rest_strain.map(|first| pair(vec![p.length, p.stretch, first + e])));
        }
        if self.rope.twist.is_some() {
            return; // bending of rods knows directions: `add_rods`
        }
        for (nodes, fraction) in self.corners() {
            let constants = vec![fraction];
            let element =
                |stiffness| Element { nodes: nodes.to_vec(), params: vec![p.length, stiffness], constants: constants.clone() };
            out.bend.push(element(p.bend));
            out.bend_damping.push(element(p.bend_damping));
        }
    }

    /// Where the rope bends: nodes before, at and behind, ghosts included, and what of its length each stands for, which is half of
    /// each edge that is no ghost. A closed rope bends at its first node too, before all others.
    pub(super) fn corners(&self) -> Vec<([usize; 3], f64)> {
        let n = self.span.nodes.len();
        let at = |node: usize| voronoi(&self.span.fractions, node - self.span.nodes.start, n);
        let mut chain = self.chain();
        if self.span.is_closed() {
            chain.insert(0, self.span.nodes.end - 1);
            chain.push(self.span.nodes.start);
        }
        chain.windows(3).map(|w| ([w[0], w[1], w[2]], at(w[1]))).collect()
    }

    /// Nodes from end to end, ghosts included.
    fn chain(&self) -> Vec<usize> {
        self.ghost_first.into_iter().chain(self.span.nodes.clone()).chain(self.ghost_last).collect()
    }

    /// Edges from end to end, ghosts' included, and their rest lengths as fractions of the rope's.
    pub(super) fn edges(&self) -> Vec<([usize; 2], f64)> {
        let fractions = &self.span.fractions;
        let first = self.ghost_first.map(|ghost| ([ghost, self.span.nodes.start], fractions[0]));
        let last = self.ghost_last.map(|ghost| ([self.span.nodes.end - 1, ghost], fractions[fractions.len() - 1]));
        let own = fractions.iter().enumerate().map(|(e, &fraction)| (self.span.edge(e), fraction));
        first.into_iter().chain(own).chain(last).collect()
    }

    /// Whether its last node is joined to the first.
    pub(super) fn is_closed(&self) -> bool {
        self.span.is_closed()
    }

    /// The number of a node in the rope: −1 for the ghost before it.
    pub(super) fn number(&self, node: usize) -> i64 {
        node as i64 - self.span.nodes.start as i64
    }

    fn drive_kind(&self, gripper: &Gripper) -> DriveKind {
        let edges = self.span.fractions.len();
        let edge = match &gripper.clamp {
            Clamp::Grasp(_) => return DriveKind::VelocityNodes(Vec::new()), // holds nothing by itself: see `add_grasp`
            Clamp::Nodes(nodes) => {
                let n = self.span.nodes.len() as i64;
                let index = |k: &i64| self.span.nodes.start + (if *k < 0 { k + n } else { *k }) as usize;
                let nodes = nodes.iter().map(index).collect();
                return match gripper.mode {
                    Mode::Prescribed => DriveKind::PrescribedNodes(nodes),
                    Mode::Velocity => DriveKind::VelocityNodes(nodes),
                };
            }
            Clamp::End(End::First) => (self.span.nodes.start, self.ghost_first, self.span.fractions[0]),
            Clamp::End(End::Last) => (self.span.nodes.end - 1, self.ghost_last, self.span.fractions[edges - 1]),
        };
        let (end, ghost, fraction) = edge;
        let clamp = EdgeClamp { end, ghost: ghost.unwrap_or(end), length: self.params.length, fraction };
        match gripper.mode {
            Mode::Prescribed => DriveKind::PrescribedEdge(clamp),
            Mode::Velocity => DriveKind::VelocityEdge(clamp),
        }
    }
}

impl RopeParams {
    fn push(rope: &Rope, params: &mut Params) -> Self {
        let mut entry = |name: &str, unit, bounds, value| params.push(format!("{}.{name}", rope.name), unit, bounds, value);
        let mut out = Self {
            length: entry("length", "m", POSITIVE, rope.length),
            density: entry("linear_density", "kg/m", POSITIVE, rope.linear_density),
            stretch: entry("stretch_stiffness", "N", NON_NEGATIVE, rope.stretch_stiffness),
            stretch_damping: entry("stretch_damping", "N·s", NON_NEGATIVE, rope.stretch_damping),
            bend: entry("bend_stiffness", "N·m²", NON_NEGATIVE, rope.bend_stiffness),
            bend_damping: entry("bend_damping", "N·m²·s", NON_NEGATIVE, rope.bend_damping),
            drag_linear: entry("drag_linear", "kg/(m·s)", NON_NEGATIVE, rope.drag_linear),
            drag_quadratic: entry("drag_quadratic", "kg/m²", NON_NEGATIVE, rope.drag_quadratic),
            tip: entry("tip_mass", "kg", NON_NEGATIVE, rope.tip_mass),
            radius: entry("radius", "m", NON_NEGATIVE, rope.radius),
            first_node_mass: 0,
            first_rest_strain: None,
        };
        let n = rope.n_nodes();
        out.first_node_mass = params.len();
        for i in 0..n {
            let index = |k: i64| if k < 0 { k + n as i64 } else { k };
            let mass = rope.node_mass.iter().filter(|m| index(m.node) == i as i64).map(|m| m.mass).sum();
            params.push(format!("{}.node[{i}].mass", rope.name), "kg", NON_NEGATIVE, mass);
        }
        if let Some(strains) = &rope.edge_rest_strains {
            out.first_rest_strain = Some(params.len());
            for (e, strain) in strains.iter().enumerate() {
                params.push(format!("{}.edge[{e}].rest_strain", rope.name), "-", REST_STRAIN, *strain);
            }
        }
        out
    }
}

impl Model {
    fn add_terms(&mut self, e: Elements) {
        self.terms = vec![
            Arc::new(Gravity::new(e.gravity)),
            Arc::new(Stretch::new(e.stretch)),
            Arc::new(StretchDamping::new(e.stretch_damping)),
            Arc::new(Bend::new(e.bend)),
            Arc::new(BendDamping::new(e.bend_damping)),
            Arc::new(Drag::new(e.drag)),
        ];
        if !e.rest_strain.is_empty() {
            self.terms.push(Arc::new(RestStrain::new(e.rest_strain)));
        }
    }

    fn add_gripper(&mut self, gripper: &Gripper, ropes: &[RopeNodes]) {
        let Some(rope) = ropes.iter().find(|r| Some(&r.rope.name) == gripper.rope.as_ref()) else { return };
        let first_u = self.nu();
        let offset = self.params.len();
        for (a, value) in gripper.offset.iter().enumerate() {
            self.params.push(format!("{}.offset[{a}]", gripper.name), "m", ANY, *value);
        }
        let mut drive = Drive {
            name: gripper.name.clone(),
            kind: rope.drive_kind(gripper),
            first_u,
            offset,
            held: Vec::new(),
            closes: false,
        };
        drive.held = self.held_edges(&drive.kind);
        if drive.is_prescribed() && !drive.held.is_empty() {
            let roll = self.push_roll(gripper);
            drive.held.iter_mut().for_each(|held| held.roll = Some(roll));
        }
        for node in drive.nodes() {
            self.prescribed[node] = true;
        }
        self.drives.push(drive);
    }

    /// The roll of what a gripper holds, then its slopes by direction and by place.
    fn push_roll(&mut self, gripper: &Gripper) -> usize {
        let mut entry = |key: String, unit, value| self.params.push(format!("{}.{key}", gripper.name), unit, ANY, value);
        let roll = entry("roll".to_owned(), "rad", gripper.roll);
        gripper.roll_by_direction.iter().enumerate().for_each(|(a, x)| {
            entry(format!("roll_by_direction[{a}]"), "rad", *x);
        });
        gripper.roll_by_position.iter().enumerate().for_each(|(a, x)| {
            entry(format!("roll_by_position[{a}]"), "rad/m", *x);
        });
        roll
    }

    fn drive_rows(&mut self) {
        let twists = std::iter::repeat_n(false, self.rods.n_twists());
        self.prescribed_rows = self.prescribed.iter().flat_map(|d| [*d; 3]).chain(twists).collect();
        self.drives.iter().flat_map(|d| &d.held).for_each(|held| self.prescribed_rows[held.row] = true);
    }

    fn add_shapes(&mut self, scene: &Scene) {
        for s in &scene.plane {
            let height = self.params.push(format!("{}.height", s.name), "m", ANY, s.height);
            let (name, normal) = (s.name.clone(), Vec3::from(s.normal).normalize());
            let rotation = self.push_rotation(&name);
            self.add_shape(Shape::Plane { name, point: Vec3::from(s.point), normal, height, rotation }, s.friction);
        }
        for s in &scene.sphere {
            let center = self.push_vector(&s.name, "center", s.center);
            let radius = self.params.push(format!("{}.radius", s.name), "m", POSITIVE, s.radius);
            self.add_shape(Shape::Sphere { name: s.name.clone(), center, radius }, s.friction);
        }
        for s in &scene.capsule {
            let a = self.push_vector(&s.name, "a", s.a);
            let b = self.push_vector(&s.name, "b", s.b);
            let radius = self.params.push(format!("{}.radius", s.name), "m", POSITIVE, s.radius);
            self.add_shape(Shape::Capsule { name: s.name.clone(), a, b, radius }, s.friction);
        }
    }

    fn push_vector(&mut self, object: &str, quantity: &str, value: [f64; 3]) -> [usize; 3] {
        [0, 1, 2].map(|a| self.params.push(format!("{object}.{quantity}[{a}]"), "m", ANY, value[a]))
    }

    fn add_shape(&mut self, shape: Shape, friction: f64) {
        let (Shape::Plane { name, .. } | Shape::Sphere { name, .. } | Shape::Capsule { name, .. }) = &shape;
        self.params.push(format!("{name}.friction"), "-", NON_NEGATIVE, friction);
        self.shape_names.push(name.clone());
        self.shapes.push(shape);
    }

    /// Every free node with every shape.
    fn add_pairs(&mut self, ropes: &[RopeNodes]) {
        for (shape, name) in self.shape_names.iter().enumerate() {
            let Some(friction) = self.params.find(&format!("{name}.friction")) else { continue };
            for rope in ropes {
                let free = rope.span.nodes.clone().filter(|&i| !self.prescribed[i]);
                self.pairs.extend(free.map(|node| ContactPair { node, shape, radius: rope.params.radius, friction }));
            }
            for cloth in &self.cloths {
                let free = cloth.nodes.clone().filter(|&i| !self.prescribed[i]);
                self.pairs.extend(free.map(|node| ContactPair { node, shape, radius: cloth.radius, friction }));
            }
        }
    }
}

/// Half of each edge beside node `i` of `n`, as a fraction of the length.
fn voronoi(fractions: &[f64], i: usize, n: usize) -> f64 {
    let before = if i > 0 { fractions[i - 1] } else { fractions.get(n - 1).copied().unwrap_or(0.0) };
    let after = fractions.get(i).copied().unwrap_or(0.0);
    0.5 * (before + after)
}
