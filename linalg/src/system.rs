//! The whole matrix of a step: ropes' nodes in a band, bodies' degrees of freedom in a full block behind them, and the coupling by
//! contacts between the two.

use crate::coupling::Coupling;
use crate::factor::Factor;
use crate::square::{Square, SquareLu};
use crate::{KktError, Method, NodeLayout, NodeMatrix, Symbolic, Symmetry};
use std::sync::Arc;

/// The first rows belong to nodes and twists (see [`NodeLayout`]), the others to the bodies' degrees of freedom:
/// ```text
/// [ nodes   upper  ]
/// [ lower   bodies ]
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct System {
    /// The nodes' block.
    pub nodes: NodeMatrix,
    /// The bodies' block.
    pub bodies: Square,
    /// Upper and lower block; empty unless nodes touch bodies.
    pub coupling: Coupling,
}

impl System {
    /// The zero matrix.
    pub fn zeros(layout: &Arc<NodeLayout>, n_dofs: usize) -> Self {
        Self { nodes: NodeMatrix::zeros(layout), bodies: Square::zeros(n_dofs), coupling: Coupling::default() }
    }

    /// A matrix without rows.
    pub fn empty() -> Self {
        Self { nodes: NodeMatrix::empty(), bodies: Square::zeros(0), coupling: Coupling::default() }
    }

    /// Number of rows.
    #[inline]
    pub fn dim(&self) -> usize {
        self.nodes.dim() + self.bodies.dim()
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.bodies.clear();
        self.coupling.reset(std::iter::empty(), self.bodies.dim());
    }

    /// `Y += scale · A X` for row-major `X`, `Y` of `dim × columns`.
    pub fn add_mul_many(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        let split = self.nodes.dim() * columns;
        let ((x_nodes, x_bodies), (y_nodes, y_bodies)) = (x.split_at(split), y.split_at_mut(split));
        self.nodes.add_mul_many(scale, x_nodes, y_nodes, columns);
        self.bodies.add_mul_many(scale, x_bodies, y_bodies, columns);
        self.coupling.add_upper_product(scale, x_bodies, y_nodes, columns);
        self.coupling.add_lower_product(scale, x_nodes, y_bodies, columns);
    }

    /// Σ_c |a_rc| y_c of row `r`: how much it may change where each y_c is off by a part of itself, over that part.
    pub fn row_magnitude(&self, r: usize, y: &[f64]) -> f64 {
        let (y_nodes, y_bodies) = y.split_at(self.nodes.dim());
        match r.checked_sub(self.nodes.dim()) {
            None => self.nodes.row_magnitude(r, y_nodes) + self.coupling.upper_magnitude(r, y_bodies),
            Some(dof) => {
                let n = self.bodies.dim();
                let own: f64 = self.bodies.data()[dof * n..(dof + 1) * n].iter().zip(y_bodies).map(|(a, y)| a.abs() * y).sum();
                own + self.coupling.lower_magnitude(dof, y_nodes)
            }
        }
    }

    /// `y += scale · Aᵀ x`.
    pub fn add_mul_transpose(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        let split = self.nodes.dim();
        let ((x_nodes, x_bodies), (y_nodes, y_bodies)) = (x.split_at(split), y.split_at_mut(split));
        self.nodes.add_mul_transpose(scale, x_nodes, y_nodes);
        self.bodies.add_mul_transpose(scale, x_bodies, y_bodies);
        self.coupling.add_upper_transpose(scale, x_nodes, y_bodies);
        self.coupling.add_lower_transpose(scale, x_bodies, y_nodes, 1);
    }
}

/// The factorization of a [`System`]: of the nodes' block N, and of S = bodies − lower N⁻¹ upper.
#[derive(Clone, Debug)]
pub struct SystemFactor {
    nodes: Factor,
    bodies: SquareLu,
    coupling: Coupling,
    /// N⁻¹ upper, row-major; empty without coupling.
    response: Vec<f64>,
    schur: Square,
    ready: bool,
}

impl SystemFactor {
    /// Memory for matrices whose nodes' part is described by `symbolic`.
    pub fn new(symbolic: &Symbolic, n_dofs: usize) -> Self {
        Self {
            nodes: Factor::new(symbolic),
            bodies: SquareLu::new(n_dofs),
            coupling: Coupling::default(),
            response: Vec::new(),
            schur: Square::zeros(0),
            ready: false,
        }
    }

    /// Factors `a`.
    pub fn refactor(&mut self, a: &System) -> Result<(), KktError> {
        self.ready = false;
        if a.nodes.dim() > 0 {
            self.nodes.refactor(&a.nodes)?;
        }
        self.coupling.clone_from(&a.coupling);
        self.response.clear();
        if a.coupling.is_empty() {
            self.bodies.refactor(&a.bodies, a.nodes.dim())?;
        } else {
            let n = a.bodies.dim();
            self.response.resize(a.nodes.dim() * n, 0.0);
            a.coupling.spread_upper(&mut self.response);
            self.nodes.solve_many(&mut self.response, n);
            self.schur.clone_from(&a.bodies);
            a.coupling.add_lower_product(-1.0, &self.response, self.schur.data_mut(), n);
            self.bodies.refactor(&self.schur, a.nodes.dim())?;
        }
        self.ready = true;
        Ok(())
    }

    /// Whether the nodes' pivots are all positive: see [`Factor::all_positive`].
    pub fn all_positive(&self) -> bool {
        self.nodes.all_positive()
    }

    /// Whether the nodes' block is symmetric but for prescribed rows.
    #[inline]
    pub fn is_symmetric(&self) -> bool {
        self.nodes.symbolic().symmetry() == Symmetry::Symmetric
    }

    /// The inverse of the nodes' block, row-major: see [`Factor::inverse`].
    pub fn inverse_of_nodes(&self, out: &mut Vec<f64>) {
        self.nodes.inverse(out);
    }

    /// The transposed inverse of the nodes' block: see [`Factor::transposed_inverse`].
    pub fn transposed_inverse_of_nodes(&self, columns: usize, out: &mut Vec<f64>) {
        self.nodes.transposed_inverse(columns, out);
    }

    /// `B ← N⁻ᵀ B` with the nodes' block N, row-major with `columns` right-hand sides.
    pub fn solve_nodes_transpose(&self, b: &mut [f64], columns: usize) {
        self.nodes.solve_transpose_many(b, columns);
    }

    /// The same and its transpose: see [`Factor::inverse_and_transpose`].
    pub fn inverses_of_nodes(&self, out: &mut Vec<f64>, transposed: &mut Vec<f64>) {
        self.nodes.inverse_and_transpose(out, transposed);
    }

    /// Whether the nodes' block is factored in fronts.
    #[inline]
    pub fn is_sparse(&self) -> bool {
        self.nodes.symbolic().method() == Method::Sparse
    }

    /// `b ← A⁻¹ b`.
    pub fn solve(&self, b: &mut [f64]) {
        self.solve_many(b, 1);
    }

    /// `B ← A⁻¹ B`, row-major with `columns` right-hand sides.
    pub fn solve_many(&self, b: &mut [f64], columns: usize) {
        if !self.ready {
            b.fill(f64::NAN);
            return;
        }
        let (nodes, bodies) = b.split_at_mut(self.nodes.dim() * columns);
        if !nodes.is_empty() {
            self.nodes.solve_many(nodes, columns);
        }
        self.coupling.add_lower_product(-1.0, nodes, bodies, columns);
        if !bodies.is_empty() {
            self.bodies.solve(bodies, columns, false);
        }
        for (row, response) in nodes.chunks_exact_mut(columns).zip(self.response.chunks_exact(self.schur.dim().max(1))) {
            for (r, x) in response.iter().zip(bodies.chunks_exact(columns)) {
                row.iter_mut().zip(x).for_each(|(y, x)| *y -= r * x);
            }
        }
    }

    /// `b ← A⁻ᵀ b`.
    pub fn solve_transpose(&self, b: &mut [f64]) {
        if !self.ready {
            b.fill(f64::NAN);
            return;
        }
        let (nodes, bodies) = b.split_at_mut(self.nodes.dim());
        for (x, response) in nodes.iter().zip(self.response.chunks_exact(self.schur.dim().max(1))) {
            bodies.iter_mut().zip(response).for_each(|(y, r)| *y -= r * x);
        }
        if !bodies.is_empty() {
            self.bodies.solve(bodies, 1, true);
        }
        self.coupling.add_lower_transpose(-1.0, bodies, nodes, 1);
        if !nodes.is_empty() {
            self.nodes.solve_transpose(nodes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn solves_are_inverse_to_products_with_coupled_blocks() {
        let mut rng = Pcg64Mcg::seed_from_u64(9);
        let mut a = System::zeros(&Arc::new(NodeLayout::band(6, 2)), 4);
        a.clear();
        for i in 0..6_usize {
            for j in i.saturating_sub(2)..(i + 3).min(6) {
                let block = std::array::from_fn(|r| {
                    std::array::from_fn(|c| rng.random_range(-1.0..1.0) + if i == j && r == c { 8.0 } else { 0.0 })
                });
                a.nodes.add_block(i, j, 1.0, &block);
            }
        }
        a.coupling.reset([1, 4].into_iter(), 4);
        for r in 0..4 {
            for c in 0..4 {
                a.bodies.set(r, c, rng.random_range(-1.0..1.0) + if r == c { 6.0 } else { 0.0 });
            }
            for (node, axis) in [1, 4].into_iter().flat_map(|node| [(node, 0), (node, 1), (node, 2)]) {
                a.coupling.add_upper(node, axis, r, rng.random_range(-1.0..1.0));
                a.coupling.add_lower(r, node, axis, rng.random_range(-1.0..1.0));
            }
        }
        let symbolic =
            Symbolic::new(Method::Band, Symmetry::General, a.nodes.layout(), &[false; 6]).unwrap_or_else(|e| unreachable!("{e}"));
        let mut factor = SystemFactor::new(&symbolic, 4);
        assert!(factor.refactor(&a).is_ok());
        let x: Vec<f64> = (0..22 * 3).map(|_| rng.random_range(-1.0..1.0)).collect();
        let mut b = vec![0.0; 22 * 3];
        a.add_mul_many(1.0, &x, &mut b, 3);
        factor.solve_many(&mut b, 3);
        assert!(x.iter().zip(&b).all(|(x, b)| (x - b).abs() < 1e-13));
        let mut b = vec![0.0; 22];
        a.add_mul_transpose(1.0, &x[..22], &mut b);
        factor.solve_transpose(&mut b);
        assert!(x.iter().zip(&b).all(|(x, b)| (x - b).abs() < 1e-13));
    }
}
