//! The whole matrix of a step: ropes' nodes in a band, bodies' degrees of freedom in a full block behind them.

use super::factor::Factor;
use super::square::{Square, SquareLu};
use super::{BlockBand, KktError, Symbolic};

/// Rows 0 … 3 n_nodes − 1 belong to nodes, the others to the bodies' degrees of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct System {
    /// The nodes' block.
    pub nodes: BlockBand,
    /// The bodies' block.
    pub bodies: Square,
}

impl System {
    /// The zero matrix.
    pub fn zeros(n_nodes: usize, half_width: usize, n_dofs: usize) -> Self {
        Self { nodes: BlockBand::zeros(n_nodes, half_width), bodies: Square::zeros(n_dofs) }
    }

    /// Number of rows.
    pub fn dim(&self) -> usize {
        self.nodes.dim() + self.bodies.dim()
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.bodies.clear();
    }

    /// `Y += scale · A X` for row-major `X`, `Y` of `dim × columns`.
    pub fn add_mul_many(&self, scale: f64, x: &[f64], y: &mut [f64], columns: usize) {
        let split = self.nodes.dim() * columns;
        let ((x_nodes, x_bodies), (y_nodes, y_bodies)) = (x.split_at(split), y.split_at_mut(split));
        self.nodes.add_mul_many(scale, x_nodes, y_nodes, columns);
        self.bodies.add_mul_many(scale, x_bodies, y_bodies, columns);
    }

    /// `y += scale · Aᵀ x`.
    pub fn add_mul_transpose(&self, scale: f64, x: &[f64], y: &mut [f64]) {
        let split = self.nodes.dim();
        let ((x_nodes, x_bodies), (y_nodes, y_bodies)) = (x.split_at(split), y.split_at_mut(split));
        self.nodes.add_mul_transpose(scale, x_nodes, y_nodes);
        self.bodies.add_mul_transpose(scale, x_bodies, y_bodies);
    }
}

/// The factorization of a [`System`].
#[derive(Clone, Debug)]
pub struct SystemFactor {
    nodes: Factor,
    bodies: SquareLu,
    ready: bool,
}

impl SystemFactor {
    /// Memory for matrices whose nodes' part is described by `symbolic`.
    pub fn new(symbolic: &Symbolic, n_dofs: usize) -> Self {
        Self { nodes: Factor::new(symbolic), bodies: SquareLu::new(n_dofs), ready: false }
    }

    /// Factors `a`.
    pub fn refactor(&mut self, a: &System) -> Result<(), KktError> {
        self.ready = false;
        if a.nodes.n_blocks() > 0 {
            self.nodes.refactor(&a.nodes)?;
        }
        self.bodies.refactor(&a.bodies, a.nodes.dim())?;
        self.ready = true;
        Ok(())
    }

    /// `b ← A⁻¹ b`.
    pub fn solve(&self, b: &mut [f64]) {
        self.apply(b, 1, false);
    }

    /// `b ← A⁻ᵀ b`.
    pub fn solve_transpose(&self, b: &mut [f64]) {
        self.apply(b, 1, true);
    }

    /// `B ← A⁻¹ B`, row-major with `columns` right-hand sides.
    pub fn solve_many(&self, b: &mut [f64], columns: usize) {
        self.apply(b, columns, false);
    }

    fn apply(&self, b: &mut [f64], columns: usize, transpose: bool) {
        if !self.ready {
            b.fill(f64::NAN);
            return;
        }
        let split = self.nodes.dim() * columns;
        let (nodes, bodies) = b.split_at_mut(split);
        if !nodes.is_empty() {
            match transpose {
                false => self.nodes.solve_many(nodes, columns),
                true => self.nodes.solve_transpose_many(nodes, columns),
            }
        }
        if !bodies.is_empty() {
            self.bodies.solve(bodies, columns, transpose);
        }
    }
}
