//! The engine's own factorizations.

use crate::matrices::{self, largest, numbers};
use crate::timing::{Op, Solver};
use pliant_linalg::{
    Coupling, Factor, KktError, Method, NodeLayout, NodeMatrix, Square, Symbolic, Symmetry, System, SystemFactor,
};
use std::any::Any;
use std::sync::Arc;

/// Right-hand sides by rows: what is solved for, and where.
struct Sides {
    one: Vec<f64>,
    many: Vec<f64>,
    columns: usize,
    work: Vec<f64>,
}

impl Sides {
    fn new(one: Vec<f64>, columns: usize) -> Self {
        let many = numbers(one.len() * columns);
        Self { one, many, columns, work: Vec::new() }
    }

    fn fresh(&mut self, many: bool) -> &mut [f64] {
        self.work.clear();
        self.work.extend_from_slice(if many { &self.many } else { &self.one });
        &mut self.work
    }
}

/// A [`Factor`].
pub struct Nodes<'a> {
    of: &'a matrices::Nodes,
    factor: Factor,
    sides: Sides,
    inverse: Vec<f64>,
    /// Makes the inverse by solving for unit columns: what the methods of its own are worth.
    by_solves: bool,
}

impl<'a> Nodes<'a> {
    pub fn new(of: &'a matrices::Nodes, symbolic: &Symbolic, columns: usize) -> Result<Self, KktError> {
        let mut factor = Factor::new(symbolic);
        factor.refactor(&of.matrix)?;
        Ok(Self { of, factor, sides: Sides::new(of.right_hand_side(), columns), inverse: Vec::new(), by_solves: false })
    }

    /// The same with the inverse by solves.
    pub fn by_solves(self) -> Self {
        Self { by_solves: true, ..self }
    }
}

impl Solver for Nodes<'_> {
    fn name(&self) -> String {
        if self.by_solves {
            return "the same, inverse by solves".into();
        }
        let symbolic = self.factor.symbolic();
        match (symbolic.method(), symbolic.symmetry()) {
            (Method::Band, Symmetry::General) => "band LU".into(),
            (Method::Band, Symmetry::Symmetric) => "band Cholesky".into(),
            (Method::Dense, _) => "dense".into(),
            (Method::Sparse, Symmetry::General) => "multifrontal LU".into(),
            (Method::Sparse, Symmetry::Symmetric) => "multifrontal Cholesky".into(),
        }
    }

    fn dim(&self) -> usize {
        self.factor.dim()
    }

    fn run(&mut self, op: Op) {
        let columns = self.sides.columns;
        match op {
            Op::Refactor => assert!(self.factor.refactor(&self.of.matrix).is_ok()),
            Op::Solve => self.factor.solve(self.sides.fresh(false)),
            Op::SolveTranspose => self.factor.solve_transpose(self.sides.fresh(false)),
            Op::SolveMany => self.factor.solve_many(self.sides.fresh(true), columns),
            Op::Inverse if self.by_solves => {
                let n = self.dim();
                self.inverse.clear();
                self.inverse.resize(n * n, 0.0);
                (0..n).for_each(|k| self.inverse[k * n + k] = 1.0);
                self.factor.solve_many(&mut self.inverse, n);
            }
            // (as the derivatives of ropes and rods, and those of sheets, ask for it)
            Op::Inverse if self.name() == "band LU" => self.factor.transposed_inverse(self.dim(), &mut self.inverse),
            Op::Inverse => self.factor.inverse(&mut self.inverse),
        }
    }

    fn residual(&mut self) -> f64 {
        self.run(Op::Solve);
        self.of.residual(&self.sides.work, &self.sides.one)
    }

    fn copy(&self) -> Box<dyn Any> {
        Box::new(self.factor.clone())
    }
}

/// A [`SystemFactor`] without nodes.
pub struct Bodies {
    system: System,
    factor: SystemFactor,
    sides: Sides,
}

impl Bodies {
    pub fn new(block: &Square, columns: usize) -> Result<Self, KktError> {
        let system = System { nodes: NodeMatrix::empty(), bodies: block.clone(), coupling: Coupling::default() };
        let symbolic = Symbolic::new(Method::Band, Symmetry::General, &Arc::new(NodeLayout::band(0, 0)), &[])?;
        let mut factor = SystemFactor::new(&symbolic, block.dim());
        factor.refactor(&system)?;
        Ok(Self { system, factor, sides: Sides::new(numbers(block.dim()), columns) })
    }
}

impl Solver for Bodies {
    fn name(&self) -> String {
        "dense LU".into()
    }

    fn dim(&self) -> usize {
        self.system.dim()
    }

    fn run(&mut self, op: Op) {
        let columns = self.sides.columns;
        match op {
            Op::Refactor => assert!(self.factor.refactor(&self.system).is_ok()),
            Op::Solve => self.factor.solve(self.sides.fresh(false)),
            Op::SolveTranspose => self.factor.solve_transpose(self.sides.fresh(false)),
            Op::SolveMany => self.factor.solve_many(self.sides.fresh(true), columns),
            Op::Inverse => {}
        }
    }

    fn residual(&mut self) -> f64 {
        self.run(Op::Solve);
        let mut left = self.sides.one.clone();
        self.system.add_mul_many(-1.0, &self.sides.work, &mut left, 1);
        largest(&left) / largest(&self.sides.one)
    }

    fn copy(&self) -> Box<dyn Any> {
        Box::new(self.factor.clone())
    }
}
