//! The system of a stage with its constraints *not* condensed, for derivatives:
//! ```text
//! [ A     −P/h ] [v⁺]     A  = ∂r/∂v⁺ at fixed multipliers,      P   = ∂p/∂λ
//! [ F_v   F_λ  ] [λ ]     F_v = h a1 ∂F/∂q⁺ + ∂F/∂v⁺,            F_λ = ∂F/∂λ
//! ```
//! A closed contact at a nanometre's rest gap is 1e7 times stiffer than the rope. Condensed, K = A + P F_λ⁻¹ F_v/h, that stiffness
//! stands in the same numbers as the rope's and eats seven of their sixteen digits; here all entries are of their natural size.
//! K's factor solves this system too, and refinement against it recovers what condensing lost.
//!
//! Vectors have nv rows, then one per joint friction, limit or coupling, then four per contact and closure; `columns` numbers per row.
//! Every constraint is a [`Block`] over the degrees of freedom it reaches, whatever its kind.

use super::StageRecord;
use super::system_rows::{Rows, Task};
use crate::step::constraints::{Block, ConstraintId};
use nalgebra::{Matrix3, Matrix4x3, SVector};
use pliant_linalg::NodeMatrix;

/// A node and a block of its rows and columns.
pub type NodeBlock = (usize, [[f64; 3]; 3]);

fn rows_of(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|a| [m[(a, 0)], m[(a, 1)], m[(a, 2)]])
}

/// Numbers of a constraint's rows.
fn part<const M: usize>(x: &[f64], row: usize) -> SVector<f64, M> {
    SVector::from_column_slice(&x[row..row + M])
}

fn add_part<const M: usize>(x: &mut [f64], row: usize, by: &SVector<f64, M>) {
    x[row..row + M].iter_mut().zip(by.iter()).for_each(|(x, by)| *x += by);
}

// One column: the operations of the transpose, in the same order, so that products with the one and the other agree.
impl<const M: usize> Block<M> {
    fn subtract(&self, h: f64, x: &[f64], out: &mut [f64]) {
        let (lambda, mut f) = (part::<M>(x, self.row), part::<M>(out, self.row));
        for dof in &self.dofs {
            out[dof.v] += (dof.impulse / h).dot(&lambda);
            f -= dof.slope * x[dof.v];
        }
        f -= self.f_lambda * lambda;
        out[self.row..self.row + M].copy_from_slice(f.as_slice());
    }

    fn subtract_transpose(&self, h: f64, x: &[f64], out: &mut [f64]) {
        let (lambda, mut f) = (part::<M>(x, self.row), part::<M>(out, self.row));
        for dof in &self.dofs {
            f += dof.impulse / h * x[dof.v];
            out[dof.v] -= dof.slope.dot(&lambda);
        }
        f -= self.f_lambda.tr_mul(&lambda);
        out[self.row..self.row + M].copy_from_slice(f.as_slice());
    }

    /// `b_v += impulse F_λ⁻¹ b_λ/h`; F_λ⁻¹ first: its large entries cancel there.
    fn eliminate(&self, h: f64, b: &mut [f64]) {
        let lambda = self.inverse * part::<M>(b, self.row);
        self.dofs.iter().for_each(|dof| b[dof.v] += dof.impulse.dot(&lambda) / h);
    }

    /// `b_λ ← F_λ⁻¹ (b_λ − slope b_v)`.
    fn recover(&self, b: &mut [f64]) {
        let mut lambda = part::<M>(b, self.row);
        self.dofs.iter().for_each(|dof| lambda -= dof.slope * b[dof.v]);
        b[self.row..self.row + M].copy_from_slice((self.inverse * lambda).as_slice());
    }

    /// `b_λ ← F_λ⁻ᵀ b_λ`, `b_v −= slopeᵀ b_λ`.
    fn eliminate_transpose(&self, b: &mut [f64]) {
        let lambda = self.inverse.tr_mul(&part::<M>(b, self.row));
        b[self.row..self.row + M].copy_from_slice(lambda.as_slice());
        self.dofs.iter().for_each(|dof| b[dof.v] -= dof.slope.dot(&lambda));
    }

    /// `b_λ += F_λ⁻ᵀ impulseᵀ b_v/h`.
    fn recover_transpose(&self, h: f64, b: &mut [f64]) {
        let pulled: SVector<f64, M> = self.dofs.iter().map(|dof| dof.impulse * b[dof.v]).sum();
        add_part(b, self.row, &(self.inverse.tr_mul(&pulled) / h));
    }

    fn add_positions(&self, scale: f64, q: &[f64], out: &mut [f64]) {
        self.dofs.iter().for_each(|dof| add_part(out, self.row, &(dof.by_q * (scale * q[dof.v]))));
    }

    fn add_positions_transpose(&self, scale: f64, x: &[f64], out: &mut [f64]) {
        let lambda = part::<M>(x, self.row);
        self.dofs.iter().for_each(|dof| out[dof.v] += scale * dof.by_q.dot(&lambda));
    }
}

/// Calls a method of every block.
macro_rules! for_blocks {
    ($stage:expr, $block:ident => $call:expr) => {{
        // plain loops: a closure over vectors is not always inlined, and then is slow
        for joint in &$stage.constraints.joints {
            let $block = &joint.block;
            $call
        }
        for cone in &$stage.constraints.cones {
            let $block = &cone.block;
            $call
        }
    }};
}
pub(super) use for_blocks;

impl StageRecord {
    /// Rows of the system: nv, one per joint friction, limit or coupling, four per contact and closure.
    pub fn n_rows(&self) -> usize {
        self.constraints.rows
    }

    /// Whether a constraint is listed anew in each stage: contact of colliders, edges or triangles, or a closure.
    pub fn has_listed_contacts(&self) -> bool {
        !self.constraints.cones.iter().all(|cone| cone.is_of_node())
    }

    /// Whether the rows beyond those of velocities are of contacts of nodes alone.
    pub fn has_contacts_of_nodes_alone(&self) -> bool {
        self.constraints.of_nodes_alone()
    }

    /// `out −= system · x`.
    pub fn subtract_system(&self, x: &[f64], out: &mut [f64], columns: usize) {
        let split = self.v.len() * columns;
        self.jacobians.matrix.add_mul_many(-1.0, &x[..split], &mut out[..split], columns);
        if columns == 1 {
            for_blocks!(self, block => block.subtract(self.h, x, out));
        } else {
            self.run(Task::Subtract { x: Rows { data: x, columns }, out });
        }
    }

    /// `out −= systemᵀ · x`, one column.
    pub fn subtract_system_transpose(&self, x: &[f64], out: &mut [f64]) {
        let split = self.v.len();
        self.jacobians.matrix.add_mul_transpose(-1.0, &x[..split], &mut out[..split]);
        for_blocks!(self, block => block.subtract_transpose(self.h, x, out));
    }

    /// `b ← system⁻¹ b`, by the factor of K.
    pub fn solve_system(&self, b: &mut [f64], columns: usize) {
        self.solve_velocities(b, columns);
        self.recover_impulses(b, columns);
    }

    /// The rows of `system⁻¹ b` that are velocities; the others stay as they are, for [`StageRecord::recover_impulses`].
    pub fn solve_velocities(&self, b: &mut [f64], columns: usize) {
        if columns == 1 {
            for_blocks!(self, block => block.eliminate(self.h, b));
        } else {
            self.run(Task::Eliminate { b, columns });
        }
        self.jacobians.factor.solve_many(&mut b[..self.v.len() * columns], columns);
    }

    /// The other rows of `system⁻¹ b` after [`StageRecord::solve_velocities`].
    pub fn recover_impulses(&self, b: &mut [f64], columns: usize) {
        if columns == 1 {
            for_blocks!(self, block => block.recover(b));
        } else {
            self.run(Task::Recover { b, columns });
        }
    }

    /// `b ← system⁻ᵀ b`, one column.
    pub fn solve_system_transpose(&self, b: &mut [f64]) {
        for_blocks!(self, block => block.eliminate_transpose(b));
        self.jacobians.factor.solve_transpose(&mut b[..self.v.len()]);
        for_blocks!(self, block => block.recover_transpose(self.h, b));
    }

    /// `out += scale · ∂(r, F)/∂q̄ · q`, with `q` of nv rows.
    pub fn add_position_product(&self, scale: f64, q: &[f64], out: &mut [f64], columns: usize) {
        self.jacobians.dq.add_mul_many(-scale, q, &mut out[..self.v.len() * columns], columns);
        if columns == 1 {
            for_blocks!(self, block => block.add_positions(scale, q, out));
        } else {
            self.run(Task::Positions { scale, q: Rows { data: q, columns }, out });
        }
    }

    /// `out += scale · (∂(r, F)/∂q̄)ᵀ · x`, one column.
    pub fn add_position_transpose(&self, scale: f64, x: &[f64], out: &mut [f64]) {
        self.jacobians.dq.add_mul_transpose(-scale, &x[..self.v.len()], out);
        for_blocks!(self, block => block.add_positions_transpose(scale, x, out));
    }

    /// `out −= systemᵀ · x` of nodes and their constraints, many columns.
    pub fn subtract_system_transpose_many(&self, x: &[f64], out: &mut [f64], columns: usize) {
        let split = self.v.len() * columns;
        self.jacobians.matrix.nodes.add_mul_transpose_many(-1.0, &x[..split], &mut out[..split], columns);
        self.run(Task::SubtractTranspose { x: Rows { data: x, columns }, out });
    }

    /// `b ← system⁻ᵀ b` of nodes and their constraints, many columns.
    pub fn solve_system_transpose_many(&self, b: &mut [f64], columns: usize) {
        self.run(Task::EliminateTranspose { b, columns });
        self.jacobians.factor.solve_nodes_transpose(&mut b[..self.v.len() * columns], columns);
        self.run(Task::RecoverTranspose { b, columns });
    }

    /// The first nv rows of the inverse of the system of nodes and their constraints, as columns: the first of `columns`, the others
    /// zero.
    pub fn transposed_inverse(&self, columns: usize, out: &mut Vec<f64>) {
        debug_assert!(self.has_contacts_of_nodes_alone());
        self.jacobians.factor.transposed_inverse_of_nodes(columns, out);
        out.resize(self.n_rows() * columns, 0.0);
        self.run(Task::RecoverTranspose { b: out, columns });
    }

    /// Contacts of nodes: the node, and the contact's block.
    fn node_contacts(&self) -> impl Iterator<Item = (usize, &Block<4>)> {
        let cones = self.constraints.cones.iter();
        cones.filter(|cone| matches!(cone.id, ConstraintId::Node(_))).map(|cone| (cone.block.dofs[0].v / 3, &cone.block))
    }

    /// Calls `visit(first row of its node, first row of the contact, ∂F/∂v⁺ with positions as they are, ∂F/∂q̄)` for every contact of a node.
    pub fn visit_contact_rates(&self, mut visit: impl FnMut(usize, usize, [[f64; 3]; 4], [[f64; 3]; 4])) {
        let rows = |m: &Matrix4x3<f64>| std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]));
        for (node, block) in self.node_contacts() {
            let by_q = Matrix4x3::from_fn(|r, a| block.dofs[a].by_q[r]);
            visit(3 * node, block.row, rows(&self.rates(block)), rows(&by_q));
        }
    }

    /// ∂F/∂v⁺ of a node's contact, positions as they are.
    fn rates(&self, block: &Block<4>) -> Matrix4x3<f64> {
        let way = self.h * self.scheme.free.a1;
        Matrix4x3::from_fn(|r, a| block.dofs[a].slope[r] - block.dofs[a].by_q[r] * way)
    }

    /// ∂p/∂λ F_λ⁻¹ X of a node's contact.
    fn pushed(&self, block: &Block<4>, x: &Matrix4x3<f64>) -> Matrix3<f64> {
        let y = block.inverse * x;
        Matrix3::from_fn(|r, c| block.dofs[r].impulse.dot(&y.column(c)))
    }

    /// Calls `visit(node, −∂p/∂v⁺/h)` for every contact of a node condensed, positions as they are \[kg/s\].
    pub fn visit_contact_damping(&self, mut visit: impl FnMut(usize, [[f64; 3]; 3])) {
        self.node_contacts().for_each(|(node, block)| visit(node, rows_of(&(self.pushed(block, &self.rates(block)) / self.h))));
    }

    /// Of a stage by implicit Euler B and the blocks of P such that K⁻¹ ∂f/∂q̄ = K⁻¹ B − P/h, contacts of nodes condensed: P projects the
    /// nodes that touch onto their normals, and
    /// ```text
    /// B = ∂f/∂q̄ (λ fixed) − ∂p/∂λ F_λ⁻¹ ∂F/∂q̄ (1 − P)/h + A P/h
    /// ```
    /// A closed contact resists along its normal by 1e7 times what else there is in K and in ∂f/∂q̄; of B and P all entries are of their
    /// natural size. `None` if two contacts of a node are closed.
    pub fn positions_beside_normals(&self) -> Option<(NodeMatrix, Vec<NodeBlock>)> {
        let (mut out, mut normals) = (self.jacobians.dq.nodes.clone(), Vec::with_capacity(self.constraints.cones.len()));
        for (node, block) in self.node_contacts() {
            let normal = SVector::<f64, 3>::from_fn(|a, _| block.dofs[a].impulse[0]);
            let by_q = Matrix4x3::from_fn(|r, a| block.dofs[a].by_q[r]);
            let mut own = self.pushed(block, &by_q) * (-1.0 / self.h);
            let other = self.jacobians.matrix.nodes.block(node, node);
            let resists = |a: usize| normal[a] * (0..3).map(|b| other[a][b] * normal[b]).sum::<f64>();
            if -self.h * normal.dot(&(own * normal)) > (0..3).map(resists).sum() {
                let along = normal * normal.transpose();
                own -= own * along;
                normals.push((node, rows_of(&along)));
            }
            out.add_block(node, node, 1.0, &rows_of(&own));
        }
        normals.sort_unstable_by_key(|(node, _)| *node);
        if normals.windows(2).any(|pair| pair[0].0 == pair[1].0) {
            return None;
        }
        for (node, along) in &normals {
            out.add_columns_times(&self.jacobians.matrix.nodes, *node, 1.0 / self.h, along);
        }
        Some((out, normals))
    }
}
