//! A and B of a step of nodes by implicit Euler from the inverse of its matrix, contacts of nodes and damping included.
//!
//! Contacts condensed, the free rows are r = σ M (v⁺ − v) − f(q + h v⁺, v⁺): what they know of v is its momentum, of q the forces. With
//! G = K⁻¹ and F = ∂f/∂q̄, zero in driven rows,
//! ```text
//! ∂v⁺/∂v = G σM (zero in driven columns),   ∂v⁺/∂q = G F = G B − P/h,   ∂v⁺/∂v_cmd = the driven columns of G,   q⁺ = q + h v⁺
//! ```
//! F is sparse and the fronts give G without solves, so that is less than to solve for each column. A closed contact has in K and in F along
//! its normal, and if it sticks in K across it, 1e7 times what the rest has. Along the normal, where all of it is in F, the difference from
//! K is taken instead, by P and B ([`StageRecord::positions_beside_normals`]); across it, where nothing is in F, the product: so no digit is
//! lost. Where a probe shows that refinement against the contacts not condensed changes anything, steps are linearized the general way.
//!
//! Where nothing but contacts depends on velocities, by −∂p/∂v⁺, there is no need of the product: with s = σ m in free columns and 1 in driven ones
//! ```text
//! h F = s − ∂p/∂v⁺/h − K,   ∂v⁺/∂q = (G (s − ∂p/∂v⁺/h) − 1)/h
//! ```
//! but for the nodes' own blocks, where the difference could leave nothing of what sticks or of what hardly anything holds.

use crate::elastic::{add_commands, euler_stage};
use crate::implicit::worth_refining;
use crate::linearization::Linearization;
use crate::stage::Context;
use pliant_engine::step::{StageRecord, StepRecord};
use pliant_math::Input;

/// Memory, kept from one step to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Whole {
    /// K⁻¹ and its transpose, row-major.
    inverse: Vec<f64>,
    transposed: Vec<f64>,
    /// (∂v⁺/∂q)ᵀ.
    by_position: Vec<f64>,
    /// σ m of every column; zero in driven ones.
    momentum: Vec<f64>,
    /// s − ∂p/∂v⁺/h, node by node.
    resting: Vec<Block>,
}

type Block = [[f64; 3]; 3];

/// The only stage of such a step, if this is one.
fn stage_of<'a>(cx: Context, step: &'a StepRecord) -> Option<&'a StageRecord> {
    let of_nodes = |stage: &StageRecord| {
        cx.model.nv() == cx.model.n_node_dofs() && stage.has_contacts_of_nodes_alone() && stage.jacobians.factor.is_sparse()
    };
    let plain =
        |stage: &StageRecord| stage.transport.middle.is_identity() && stage.transport.carry.iter().all(|carry| carry.is_empty());
    euler_stage(cx, step).filter(|stage| of_nodes(stage) && plain(stage) && !probe_refines(cx, step, stage))
}

/// Whether refinement changes the sum of all columns, as the general way asks.
fn probe_refines(cx: Context, step: &StepRecord, stage: &StageRecord) -> bool {
    let n = stage.v.len();
    let mut rhs = vec![0.0; stage.n_rows()];
    stage.add_position_product(-1.0, &vec![1.0; n], &mut rhs, 1);
    let driven = cx.model.driven_rows();
    for row in (0..n).filter(|row| !driven[*row]) {
        rhs[row] += cx.mass[row] * stage.inertia * stage.scheme.momentum;
    }
    for &(row, input, value) in &step.command {
        if matches!(input, Input::Q(_) | Input::U(_)) {
            rhs[row] += value;
        }
    }
    worth_refining(stage, rhs)
}

impl Whole {
    /// A and B; C is empty. `None` where two shapes hold a node.
    pub fn linearize(&mut self, cx: Context, step: &StepRecord, nu: usize) -> Option<Linearization> {
        let stage = stage_of(cx, step)?;
        let (n, h) = (stage.v.len(), stage.h);
        let (positions, normals) = stage.positions_beside_normals()?;
        let inertia = stage.inertia * stage.scheme.momentum;
        self.momentum.clear();
        self.momentum.extend(cx.mass.iter().zip(cx.model.driven_rows()).map(|(m, d)| if *d { 0.0 } else { inertia * m }));
        let mut a = vec![0.0; 4 * n * n];
        let lower = &mut a[2 * n * n..];
        if stage.undamped && n == 3 * cx.model.n_nodes() {
            stage.jacobians.factor.inverse_of_nodes(&mut self.inverse);
            self.by_difference(cx, stage, lower);
            let mut own = positions.diagonal_blocks_of_product(&self.inverse);
            normals.iter().for_each(|(node, along)| add_scaled(&mut own[*node], along, -1.0 / h));
            for (k, own) in own.iter().enumerate() {
                own.iter().enumerate().for_each(|(r, row)| lower[(3 * k + r) * 2 * n + 3 * k..][..3].copy_from_slice(row));
            }
        } else {
            stage.jacobians.factor.inverses_of_nodes(&mut self.inverse, &mut self.transposed);
            positions.transpose_times(&self.transposed, &mut self.by_position, n);
            self.by_product(lower);
            for (node, along) in &normals {
                for (r, c) in (0..9).map(|k| (k / 3, k % 3)) {
                    lower[(3 * node + r) * 2 * n + 3 * node + c] -= along[r][c] / h;
                }
            }
        }
        self.by_velocity(h, &mut a);
        let mut out = Linearization { a, b: vec![0.0; 2 * n * nu], c: Vec::new() };
        add_commands(&self.inverse, step, h, [n, nu], &mut out);
        Some(out)
    }

    /// ∂v⁺/∂q, from its transpose.
    fn by_product(&self, lower: &mut [f64]) {
        let n = self.momentum.len();
        // squares that fit into the nearest cache
        for (first, rows) in lower.chunks_mut(2 * n * TILE).enumerate() {
            for start in (0..n).step_by(TILE) {
                for (r, row) in rows.chunks_exact_mut(2 * n).enumerate() {
                    let end = n.min(start + TILE);
                    let column = self.by_position[start * n + first * TILE + r..].iter().step_by(n);
                    row[start..end].iter_mut().zip(column).for_each(|(to, from)| *to = *from);
                }
            }
        }
    }

    /// ∂v⁺/∂q without the nodes' own blocks.
    fn by_difference(&mut self, cx: Context, stage: &StageRecord, lower: &mut [f64]) {
        let (n, per_h, driven) = (self.momentum.len(), 1.0 / stage.h, cx.model.driven_rows());
        let scale = |row: usize| per_h * if driven[row] { 1.0 } else { stage.inertia * cx.mass[row] };
        self.resting.clear();
        let diagonal = |k: usize| [[scale(3 * k), 0.0, 0.0], [0.0, scale(3 * k + 1), 0.0], [0.0, 0.0, scale(3 * k + 2)]];
        self.resting.extend((0..n / 3).map(diagonal));
        stage.visit_contact_damping(|node, block| add_scaled(&mut self.resting[node], &block, per_h));
        for (row, g) in lower.chunks_exact_mut(2 * n).zip(self.inverse.chunks_exact(n)) {
            let nodes = row[..n].as_chunks_mut::<3>().0.iter_mut().zip(g.as_chunks::<3>().0);
            for ((to, g), m) in nodes.zip(&self.resting) {
                *to = [0, 1, 2].map(|c| g[0] * m[0][c] + g[1] * m[1][c] + g[2] * m[2][c]);
            }
        }
    }

    /// The other rows and columns of A, with the commands as they are.
    fn by_velocity(&self, h: f64, a: &mut [f64]) {
        let n = self.momentum.len();
        let (upper, lower) = a.split_at_mut(2 * n * n);
        for (i, (q, v)) in upper.chunks_exact_mut(2 * n).zip(lower.chunks_exact_mut(2 * n)).enumerate() {
            let g = &self.inverse[i * n..(i + 1) * n];
            v[n..].iter_mut().zip(g.iter().zip(&self.momentum)).for_each(|(v, (g, m))| *v = g * m);
            q.iter_mut().zip(v.iter()).for_each(|(q, v)| *q = h * v);
            q[i] += 1.0;
        }
    }
}

fn add_scaled(to: &mut Block, block: &Block, scale: f64) {
    to.as_flattened_mut().iter_mut().zip(block.as_flattened()).for_each(|(to, b)| *to += scale * b);
}

/// Rows and columns of what is transposed together.
const TILE: usize = 16;
