//! Blocks of nodes' matrices before constraints were added to them. A closed contact stiffens its nodes' blocks by 1e7 times what they
//! hold otherwise; the matrix at fixed multipliers keeps all digits only if those blocks are kept from before.

use super::Stage;
use crate::constraints::node_of;
use crate::model::Model;
use crate::step::constraints::Constraints;
use nalgebra::Matrix3;
use pliant_linalg::NodeMatrix;

type Block = [[f64; 3]; 3];

/// Blocks of ∂f/∂q̄ and ∂f/∂v̄ before constraints were added, and of K the part that rods' axes contribute by parallel transport.
#[derive(Clone, Copy, Debug, Default)]
struct Before {
    dq: Block,
    dv: Block,
    transported: Block,
}

/// The blocks of a stage that constraints reach.
#[derive(Clone, Debug, Default)]
pub(crate) struct UnconstrainedBlocks {
    /// By row and column node: of every node that may touch, in their order.
    own: Vec<([usize; 2], Before)>,
    /// Of pairs of different nodes that a constraint of this stage joins, of which the first is free.
    between: Vec<([usize; 2], Before)>,
    pairs: Vec<[usize; 2]>,
}

impl UnconstrainedBlocks {
    /// Of the nodes of `model` that may touch.
    pub fn new(model: &Model) -> Self {
        let of_elements = model.elements.iter().flat_map(|f| &f.nodes).copied().filter(|node| !model.prescribed[*node]);
        let balls = model.colliders.iter().filter_map(|s| node_of(s.attachment));
        let mut nodes: Vec<usize> = model.pairs.iter().map(|p| p.node).chain(balls).chain(of_elements).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let own = nodes.into_iter().map(|node| ([node; 2], Before::default())).collect();
        Self { own, ..Self::default() }
    }

    /// Makes room for the pairs of nodes that constraints join.
    pub fn list(&mut self, stage: &Stage, constraints: &Constraints) {
        self.pairs.clear();
        constraints.sets().iter().for_each(|set| set.joined_nodes(stage, &mut self.pairs));
        self.pairs.sort_unstable();
        self.pairs.dedup();
        self.between.clear();
        self.between.extend(self.pairs.iter().map(|pair| (*pair, Before::default())));
    }

    fn each(&mut self) -> impl Iterator<Item = (&[usize; 2], &mut Before)> {
        self.own.iter_mut().chain(&mut self.between).map(|(nodes, before)| (&*nodes, before))
    }

    /// Keeps the blocks as they are.
    pub fn store(&mut self, dq: &NodeMatrix, dv: &NodeMatrix) {
        for ([i, j], before) in self.each() {
            *before = Before { dq: dq.block(*i, *j), dv: dv.block(*i, *j), transported: Block::default() };
        }
    }

    /// ∂f/∂q̄ and ∂f/∂v̄ of a node by itself, if it may touch.
    pub fn own(&self, node: usize) -> Option<(&Block, &Block)> {
        let at = self.own.binary_search_by_key(&node, |(nodes, _)| nodes[0]).ok()?;
        Some((&self.own[at].1.dq, &self.own[at].1.dv))
    }

    /// Takes the blocks out of `k`, leaving zeros.
    pub fn take_out(&mut self, k: &mut NodeMatrix) {
        for ([i, j], before) in self.each() {
            before.transported = k.block(*i, *j);
            k.set_block(*i, *j, &Block::default());
        }
    }

    /// Adds them again, and keeps what was added in between.
    pub fn put_back(&mut self, k: &mut NodeMatrix) {
        for ([i, j], before) in self.each() {
            let whole = std::mem::replace(&mut before.transported, k.block(*i, *j));
            k.add_block(*i, *j, 1.0, &whole);
        }
    }

    /// Puts the blocks of ∂f/∂v̄ back that were before constraints were added, of single nodes.
    pub fn restore_rates(&self, dv: &mut NodeMatrix) {
        self.own.iter().for_each(|([i, j], before)| dv.set_block(*i, *j, &before.dv));
    }

    /// Replaces the blocks of ∂f/∂q̄, ∂f/∂v̄ (unless empty) and A by those with constraints of single nodes at fixed multipliers; of pairs
    /// by those before any constraint.
    pub fn fix(&self, stage: &Stage, constraints: &Constraints, [dq, dv, a]: [&mut NodeMatrix; 3]) {
        let (cq, cv) = (stage.h * stage.scheme.free.a1, stage.scheme.free.b1);
        let mut fixed: Vec<Block> = self.own.iter().map(|(_, before)| before.dq).collect();
        let mut add = |node: usize, block: Block| {
            if let Ok(at) = self.own.binary_search_by_key(&node, |(nodes, _)| nodes[0]) {
                let to = fixed[at].as_flattened_mut();
                to.iter_mut().zip(block.as_flattened()).for_each(|(to, x)| *to += x);
            }
        };
        constraints.sets().iter().for_each(|set| set.visit_fixed_blocks(stage, &mut add));
        let mut put = |[i, j]: [usize; 2], block_q: &Block, before: &Before, inertia: f64| {
            let block = std::array::from_fn(|r| {
                std::array::from_fn(|c| {
                    let own = if r == c { inertia } else { 0.0 };
                    own - (cq * block_q[r][c] + cv * before.dv[r][c]) + before.transported[r][c]
                })
            });
            dq.set_block(i, j, block_q);
            if dv.dim() > 0 {
                dv.set_block(i, j, &before.dv);
            }
            a.set_block(i, j, &block);
        };
        for ((nodes, before), block_q) in self.own.iter().zip(&fixed) {
            let inertia = stage.masses.nodes[nodes[0]] * (stage.inertia + stage.options.damping);
            put(*nodes, block_q, before, inertia);
        }
        self.between.iter().for_each(|(nodes, before)| put(*nodes, &before.dq, before, 0.0));
    }
}

impl Stage<'_> {
    /// The mass that resists a push on a node within the stage \[kg\]: its own, and of what bends, stretches and damps there at least
    /// λ_min(−h² ∂f/∂q̄ − h ∂f/∂v̄) of the node's block. The split law of contact with bodies, boxes and cylinders takes its step ρ from it.
    pub(crate) fn resisting_mass(&self, node: usize, blocks: &UnconstrainedBlocks) -> f64 {
        let Some((dq, dv)) = blocks.own(node) else { return self.masses.nodes[node] };
        let (cq, cv) = (self.h * self.h * self.scheme.free.a1, self.h * self.scheme.free.b1);
        let block = Matrix3::from_fn(|r, c| -(cq * (dq[r][c] + dq[c][r]) + cv * (dv[r][c] + dv[c][r])) * 0.5);
        self.masses.nodes[node] + least_eigenvalue(&block).max(0.0)
    }
}

/// Of a symmetric matrix, by the trigonometric solution of its characteristic equation.
fn least_eigenvalue(m: &Matrix3<f64>) -> f64 {
    let mean = m.trace() / 3.0;
    let deviator = m - Matrix3::from_diagonal_element(mean);
    let size = (deviator.norm_squared() / 6.0).sqrt();
    if size == 0.0 {
        return mean;
    }
    let angle = (0.5 * (deviator / size).determinant()).clamp(-1.0, 1.0).acos() / 3.0;
    mean + 2.0 * size * (angle + 2.0 * std::f64::consts::FRAC_PI_3).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_eigenvalue_is_that_of_the_decomposition() {
        for seed in 0..50 {
            let x = |k: usize| ((seed * 9 + k) as f64 * 0.73).sin();
            let half = Matrix3::from_fn(|r, c| x(3 * r + c) * if seed % 3 == 0 && r == 2 { 1e-8 } else { 1.0 });
            let m = half + half.transpose();
            let least = m.symmetric_eigenvalues().min();
            assert!((least_eigenvalue(&m) - least).abs() < 1e-12 * (1.0 + m.norm()), "{m}: {least}");
        }
        assert_eq!(least_eigenvalue(&Matrix3::identity()), 1.0);
    }
}
