//! Matrices of scenes.

use pliant_engine::model::ModelBuilder;
use pliant_engine::step::{StageRecord, StepOptions, Stepper};
use pliant_linalg::{KktError, Method, NodeMatrix, Square, Symbolic, Symmetry};
use pliant_scene as scene;
use pliant_scene::Scene;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// Rows up to which a whole inverse is measured, and as many right-hand sides as the state has numbers.
pub const SMALL: usize = 1300;
/// Right-hand sides of larger ones.
const FEW_COLUMNS: usize = 16;

/// The matrix of a scene's last step.
pub struct Case {
    pub name: String,
    pub nodes: Option<Nodes>,
    pub bodies: Option<Square>,
    /// Right-hand sides solved for together.
    pub columns: usize,
}

/// The block of nodes and twists.
pub struct Nodes {
    pub matrix: NodeMatrix,
    /// Node by node.
    pub prescribed: Vec<bool>,
    symmetric: bool,
}

impl Case {
    /// Simulates the scene.
    pub fn of_scene(file: &str) -> Result<Self, Box<dyn Error>> {
        let scene: Scene = scene::parse_scene(&std::fs::read_to_string(file)?, file)?;
        let model = Arc::new(ModelBuilder::new(&scene)?.build());
        let theta = model.params().values();
        let mut stepper = Stepper::new(&model, theta, StepOptions { record: true, ..StepOptions::default() })?;
        let mut state = model.initial_state();
        let mut last = None;
        for u in scene::control_rows(&scene, scene.time.n_steps())? {
            last = stepper.step(&mut state, &u)?.1;
        }
        let (_, stage) = last.and_then(|mut record| record.stages.pop()).ok_or("a scene without steps")?;
        let (nodes, bodies) = condensed(&stage);
        let small = stage.v.len() <= SMALL;
        let name = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
        Ok(Self {
            // (without the number that sorts the files)
            name: name.trim_start_matches(|c: char| c.is_ascii_digit()).trim_start_matches('_').into(),
            nodes: (nodes.dim() > 0).then(|| Nodes {
                matrix: nodes,
                prescribed: model.prescribed().to_vec(),
                symmetric: stage.jacobians.factor.is_symmetric(),
            }),
            bodies: (bodies.dim() > 0).then_some(bodies),
            columns: if small { model.ndx() } else { FEW_COLUMNS },
        })
    }
}

/// K = A with the contacts condensed into it: −K x is what the system leaves of x and the impulses that x makes.
fn condensed(stage: &StageRecord) -> (NodeMatrix, Square) {
    let (mut nodes, mut bodies) = (stage.jacobians.matrix.nodes.clone(), stage.jacobians.matrix.bodies.clone());
    let (n, rows) = (stage.v.len(), stage.n_rows());
    assert!(stage.jacobians.matrix.coupling.is_empty(), "ropes that touch bodies are not compared");
    if rows == n {
        return (nodes, bodies);
    }
    let (mut x, mut product) = (vec![0.0; rows * n], vec![0.0; rows * n]);
    (0..n).for_each(|k| x[k * n + k] = 1.0);
    stage.recover_impulses(&mut x, n);
    stage.subtract_system(&x, &mut product, n);
    let split = nodes.dim();
    for (r, row) in product.chunks_exact(n).take(n).enumerate() {
        for (c, entry) in row.iter().enumerate().filter(|(_, entry)| **entry != 0.0) {
            assert_eq!(r < split, c < split, "ropes that touch bodies are not compared");
            if r < split {
                nodes.add(r, c, -entry - nodes.get(r, c));
            } else {
                bodies.set(r - split, c - split, -entry);
            }
        }
    }
    (nodes, bodies)
}

impl Nodes {
    /// The way the engine factors this matrix; of symmetric ones the general way as well, which contacts would ask for.
    pub fn symbolics(&self) -> Result<Vec<Symbolic>, KktError> {
        let layout = self.matrix.layout();
        let method = if layout.is_sparse() { Method::Sparse } else { Method::Band };
        let symmetries = if self.symmetric { vec![Symmetry::Symmetric, Symmetry::General] } else { vec![Symmetry::General] };
        symmetries.into_iter().map(|symmetry| Symbolic::new(method, symmetry, layout, &self.prescribed)).collect()
    }

    /// Entries (row, column, value), block by block of those that are not zero; prescribed nodes uncoupled if `symmetric`.
    pub fn entries(&self, symmetric: bool) -> Vec<(u32, u32, f64)> {
        let (n, reach, dim) = (self.prescribed.len(), self.matrix.layout().half_width(), self.matrix.dim());
        // a node's rows, and that of the twist of the edge that begins at it
        let rows = |i: usize| (3 * i..3 * i + 3).chain((3 * n + i < dim).then_some(3 * n + i));
        let mut out = Vec::new();
        for j in 0..n {
            for i in j.saturating_sub(reach)..n.min(j + reach + 1) {
                let uncoupled = symmetric && (self.prescribed[i] || self.prescribed[j]);
                let places = rows(j).flat_map(|c| rows(i).map(move |r| (r, c)));
                if uncoupled {
                    out.extend(places.filter(|(r, c)| r == c).map(|(r, c)| (r as u32, c as u32, 1.0)));
                } else if places.clone().any(|(r, c)| self.matrix.get(r, c) != 0.0) {
                    out.extend(places.map(|(r, c)| (r as u32, c as u32, self.matrix.get(r, c))));
                }
            }
        }
        out
    }

    /// Numbers without a pattern to solve for; zero in prescribed rows, so that their coupling does not matter.
    pub fn right_hand_side(&self) -> Vec<f64> {
        let mut b = numbers(self.matrix.dim());
        for (i, _) in self.prescribed.iter().enumerate().filter(|(_, prescribed)| **prescribed) {
            b[3 * i..3 * i + 3].fill(0.0);
        }
        b
    }

    /// Largest of b − K x relative to that of b.
    pub fn residual(&self, x: &[f64], b: &[f64]) -> f64 {
        let mut left = b.to_vec();
        self.matrix.add_mul(-1.0, x, &mut left);
        largest(&left) / largest(b)
    }
}

/// Numbers between −1 and 1.
pub fn numbers(len: usize) -> Vec<f64> {
    (1..=len).map(|k| (1.7 * k as f64 + 0.3 * (k as f64).sqrt()).sin()).collect()
}

/// Largest magnitude.
pub fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |most, x| most.max(x.abs()))
}
