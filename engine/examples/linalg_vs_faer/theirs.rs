//! faer's factorizations.

use crate::matrices::{self, largest, numbers};
use crate::timing::{Op, Solver};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::lu::partial_pivoting as dense_lu;
use faer::perm::{Perm, PermRef};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::linalg::lu::{LuRef, LuSymbolicParams, NumericLu, SymbolicLu, factorize_symbolic_lu, simplicial};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, MatMut, MatRef, Par, Side};
use pliant_linalg::{Square, Symbolic, Symmetry};
use std::any::Any;
use std::error::Error;
use std::sync::Arc;

type Sparse = SparseColMat<u32, f64>;

/// Rows up to which a full matrix is tried for nodes.
const DENSE: usize = 400;
/// Rows up to which simplicial factorizations are tried.
const SIMPLICIAL: usize = 4000;

/// A factorization in memory made once. Solves take right-hand sides by columns.
trait Way {
    fn refactor(&mut self, memory: &mut MemStack);
    fn solve(&self, b: MatMut<'_, f64>, transpose: bool, memory: &mut MemStack);
    fn copy(&self) -> Box<dyn Any>;
    /// Scratch for refactoring, and for solving with so many right-hand sides.
    fn scratch(&self, columns: usize) -> MemBuffer;
}

struct DenseLu {
    a: Mat<f64>,
    lu: Mat<f64>,
    rows: [Vec<u32>; 2],
}

impl Way for DenseLu {
    fn refactor(&mut self, memory: &mut MemStack) {
        self.lu.copy_from(&self.a);
        let [forward, inverse] = &mut self.rows;
        dense_lu::factor::lu_in_place(self.lu.as_mut(), forward, inverse, Par::Seq, memory, Default::default());
    }

    fn solve(&self, b: MatMut<'_, f64>, transpose: bool, memory: &mut MemStack) {
        let (lu, rows) = (self.lu.as_ref(), PermRef::new_checked(&self.rows[0], &self.rows[1], self.a.nrows()));
        if transpose {
            dense_lu::solve::solve_transpose_in_place_with_conj(lu, lu, rows, Conj::No, b, Par::Seq, memory);
        } else {
            dense_lu::solve::solve_in_place_with_conj(lu, lu, rows, Conj::No, b, Par::Seq, memory);
        }
    }

    fn copy(&self) -> Box<dyn Any> {
        Box::new((self.lu.clone(), self.rows.clone()))
    }

    fn scratch(&self, columns: usize) -> MemBuffer {
        let n = self.a.nrows();
        let factor = dense_lu::factor::lu_in_place_scratch::<u32, f64>(n, n, Par::Seq, Default::default());
        MemBuffer::new(factor.or(dense_lu::solve::solve_in_place_scratch::<u32, f64>(n, columns, Par::Seq)))
    }
}

struct DenseLlt {
    a: Mat<f64>,
    l: Mat<f64>,
}

impl Way for DenseLlt {
    fn refactor(&mut self, memory: &mut MemStack) {
        self.l.copy_from(&self.a);
        let done = llt::factor::cholesky_in_place(self.l.as_mut(), Default::default(), Par::Seq, memory, Default::default());
        assert!(done.is_ok());
    }

    fn solve(&self, b: MatMut<'_, f64>, _: bool, memory: &mut MemStack) {
        llt::solve::solve_in_place_with_conj(self.l.as_ref(), Conj::No, b, Par::Seq, memory);
    }

    fn copy(&self) -> Box<dyn Any> {
        Box::new(self.l.clone())
    }

    fn scratch(&self, columns: usize) -> MemBuffer {
        let n = self.a.nrows();
        let factor = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default());
        MemBuffer::new(factor.or(llt::solve::solve_in_place_scratch::<f64>(n, columns, Par::Seq)))
    }
}

/// COLAMD's order.
struct SparseLu {
    a: Arc<Sparse>,
    symbolic: SymbolicLu<u32>,
    numeric: NumericLu<u32, f64>,
}

impl Way for SparseLu {
    fn refactor(&mut self, memory: &mut MemStack) {
        let done =
            self.symbolic.factorize_numeric_lu(&mut self.numeric, self.a.as_ref().as_ref(), Par::Seq, memory, Default::default());
        assert!(done.is_ok());
    }

    fn solve(&self, b: MatMut<'_, f64>, transpose: bool, memory: &mut MemStack) {
        let lu = LuRef::new_unchecked(&self.symbolic, &self.numeric);
        if transpose {
            lu.solve_transpose_in_place_with_conj(Conj::No, b, Par::Seq, memory);
        } else {
            lu.solve_in_place_with_conj(Conj::No, b, Par::Seq, memory);
        }
    }

    fn copy(&self) -> Box<dyn Any> {
        Box::new(self.numeric.clone())
    }

    fn scratch(&self, columns: usize) -> MemBuffer {
        let factor = self.symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default());
        MemBuffer::new(factor.or(self.symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq)))
    }
}

/// A given order of columns.
struct OrderedLu {
    a: Arc<Sparse>,
    lu: simplicial::SimplicialLu<u32, f64>,
    rows: [Vec<u32>; 2],
    columns: Perm<u32>,
}

impl Way for OrderedLu {
    fn refactor(&mut self, memory: &mut MemStack) {
        let [forward, inverse] = &mut self.rows;
        let (a, columns) = (self.a.as_ref().as_ref(), self.columns.as_ref());
        let done = simplicial::factorize_simplicial_numeric_lu(forward, inverse, &mut self.lu, a, columns, memory);
        assert!(done.is_ok());
    }

    fn solve(&self, b: MatMut<'_, f64>, transpose: bool, memory: &mut MemStack) {
        let (rows, columns) = (PermRef::new_checked(&self.rows[0], &self.rows[1], self.a.nrows()), self.columns.as_ref());
        if transpose {
            self.lu.solve_transpose_in_place_with_conj(rows, columns, Conj::No, b, Par::Seq, memory);
        } else {
            self.lu.solve_in_place_with_conj(rows, columns, Conj::No, b, Par::Seq, memory);
        }
    }

    fn copy(&self) -> Box<dyn Any> {
        Box::new((self.lu.clone(), self.rows.clone()))
    }

    fn scratch(&self, columns: usize) -> MemBuffer {
        let n = self.a.nrows();
        let factor = simplicial::factorize_simplicial_numeric_lu_scratch::<u32, f64>(n, n);
        MemBuffer::new(factor.or(simplicial::solve_in_place_scratch::<u32, f64>(n, columns, Par::Seq)))
    }
}

struct SparseCholesky {
    a: Arc<Sparse>,
    symbolic: Arc<SymbolicCholesky<u32>>,
    values: Vec<f64>,
    /// L D Lᵀ instead of L Lᵀ.
    diagonal: bool,
}

impl Way for SparseCholesky {
    fn refactor(&mut self, memory: &mut MemStack) {
        let (a, l) = (self.a.as_ref().as_ref(), &mut self.values);
        let (regularize, par) = (Default::default(), Par::Seq);
        if self.diagonal {
            let done =
                self.symbolic.factorize_numeric_ldlt(l, a, Side::Lower, Default::default(), par, memory, Default::default());
            assert!(done.is_ok());
        } else {
            let done = self.symbolic.factorize_numeric_llt(l, a, Side::Lower, regularize, par, memory, Default::default());
            assert!(done.is_ok());
        }
    }

    fn solve(&self, b: MatMut<'_, f64>, _: bool, memory: &mut MemStack) {
        if self.diagonal {
            LdltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(Conj::No, b, Par::Seq, memory);
        } else {
            LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(Conj::No, b, Par::Seq, memory);
        }
    }

    fn copy(&self) -> Box<dyn Any> {
        Box::new(self.values.clone())
    }

    fn scratch(&self, columns: usize) -> MemBuffer {
        let factor = if self.diagonal {
            self.symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default())
        } else {
            self.symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default())
        };
        MemBuffer::new(factor.or(self.symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq)))
    }
}

/// Ways by name.
type Ways = Vec<(String, Box<dyn Way>)>;

/// Largest deviation of a solution from one.
type Residual<'a> = Box<dyn Fn(&[f64], &[f64]) -> f64 + 'a>;

/// One of faer's factorizations with its memory.
struct Faer<'a> {
    name: String,
    way: Box<dyn Way>,
    memory: MemBuffer,
    one: Vec<f64>,
    many: Vec<f64>,
    columns: usize,
    work: Vec<f64>,
    residual: Residual<'a>,
}

impl<'a> Faer<'a> {
    fn boxed(name: &str, mut way: Box<dyn Way>, one: Vec<f64>, columns: usize, residual: Residual<'a>) -> Box<dyn Solver + 'a> {
        let (many, mut memory) = (numbers(one.len() * columns), way.scratch(columns.max(one.len())));
        way.refactor(MemStack::new(&mut memory));
        Box::new(Self { name: name.into(), way, memory, one, many, columns, work: Vec::new(), residual })
    }

    fn solve(&mut self, columns: usize, transpose: bool) {
        let b = MatMut::from_column_major_slice_mut(&mut self.work, self.one.len(), columns);
        self.way.solve(b, transpose, MemStack::new(&mut self.memory));
    }
}

impl Solver for Faer<'_> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn dim(&self) -> usize {
        self.one.len()
    }

    fn run(&mut self, op: Op) {
        let n = self.dim();
        self.work.clear();
        match op {
            Op::Refactor => self.way.refactor(MemStack::new(&mut self.memory)),
            Op::Solve | Op::SolveTranspose => {
                self.work.extend_from_slice(&self.one);
                self.solve(1, op == Op::SolveTranspose);
            }
            Op::SolveMany => {
                self.work.extend_from_slice(&self.many);
                self.solve(self.columns, false);
            }
            Op::Inverse => {
                self.work.resize(n * n, 0.0);
                (0..n).for_each(|k| self.work[k * n + k] = 1.0);
                self.solve(n, false);
            }
        }
    }

    fn residual(&mut self) -> f64 {
        self.run(Op::Solve);
        (self.residual)(&self.work, &self.one)
    }

    fn copy(&self) -> Box<dyn Any> {
        self.way.copy()
    }
}

/// Those for a block of bodies.
pub fn of_bodies(block: &Square, columns: usize) -> Result<Vec<Box<dyn Solver + '_>>, Box<dyn Error>> {
    let n = block.dim();
    let a = MatRef::from_row_major_slice(block.data(), n, n).to_owned();
    let way = Box::new(DenseLu { lu: a.clone(), a, rows: [vec![0; n], vec![0; n]] });
    let residual = move |x: &[f64], b: &[f64]| {
        let mut left = b.to_vec();
        block.add_mul_many(-1.0, x, &mut left, 1);
        largest(&left) / largest(b)
    };
    Ok(vec![Faer::boxed("faer dense LU", way, numbers(n), columns, Box::new(residual))])
}

/// Those for nodes.
pub fn of_nodes<'a>(
    of: &'a matrices::Nodes,
    symbolic: &Symbolic,
    columns: usize,
) -> Result<Vec<Box<dyn Solver + 'a>>, Box<dyn Error>> {
    let symmetric = symbolic.symmetry() == Symmetry::Symmetric;
    let entries = of.entries(symmetric);
    let n = of.matrix.dim();
    let mut ways = Ways::new();
    if n <= DENSE {
        let mut a = Mat::zeros(n, n);
        entries.iter().for_each(|&(r, c, x)| a[(r as usize, c as usize)] = x);
        if symmetric {
            ways.push(("faer dense LLᵀ".into(), Box::new(DenseLlt { l: a.clone(), a })));
        } else {
            ways.push(("faer dense LU".into(), Box::new(DenseLu { lu: a.clone(), a, rows: [vec![0; n], vec![0; n]] })));
        }
    }
    let triplets: Vec<_> =
        entries.iter().filter(|(r, c, _)| !symmetric || r >= c).map(|&(r, c, x)| Triplet::new(r, c, x)).collect();
    let a = Arc::new(Sparse::try_new_from_triplets(n, n, &triplets)?);
    let order: Vec<u32> = symbolic.elimination_order().into_iter().map(|row| row as u32).collect();
    ways.extend(if symmetric { choleskys(&a, &order)? } else { lus(&a, &order)? });
    let solver = |(name, way): (String, Box<dyn Way>)| {
        let residual = |x: &[f64], b: &[f64]| of.residual(x, b);
        Faer::boxed(&name, way, of.right_hand_side(), columns, Box::new(residual))
    };
    Ok(ways.into_iter().map(solver).collect())
}

fn permutation(order: &[u32]) -> Perm<u32> {
    let mut inverse = vec![0; order.len()];
    order.iter().enumerate().for_each(|(at, row)| inverse[*row as usize] = at as u32);
    Perm::new_checked(order.into(), inverse.into(), order.len())
}

fn thresholds(n: usize) -> Vec<(&'static str, SupernodalThreshold)> {
    let mut out = vec![("supernodal", SupernodalThreshold::FORCE_SUPERNODAL)];
    if n <= SIMPLICIAL {
        out.push(("simplicial", SupernodalThreshold::FORCE_SIMPLICIAL));
    }
    out
}

fn choleskys(a: &Arc<Sparse>, order: &[u32]) -> Result<Ways, Box<dyn Error>> {
    let (own, mut out) = (permutation(order), Ways::new());
    for (kind, supernodal_flop_ratio_threshold) in thresholds(a.nrows()) {
        for (by, ordering) in [("AMD", SymmetricOrdering::Amd), ("our order", SymmetricOrdering::Custom(own.as_ref()))] {
            let params = CholeskySymbolicParams { supernodal_flop_ratio_threshold, ..CholeskySymbolicParams::default() };
            let symbolic = Arc::new(factorize_symbolic_cholesky(a.symbolic(), Side::Lower, ordering, params)?);
            let diagonals = if by == "AMD" { &[("LLᵀ", false), ("LDLᵀ", true)][..] } else { &[("LLᵀ", false)] };
            for &(name, diagonal) in diagonals {
                let values = vec![0.0; symbolic.len_val()];
                let way = SparseCholesky { a: Arc::clone(a), symbolic: Arc::clone(&symbolic), values, diagonal };
                out.push((format!("faer {kind} {name}, {by}"), Box::new(way)));
            }
        }
    }
    Ok(out)
}

fn lus(a: &Arc<Sparse>, order: &[u32]) -> Result<Ways, Box<dyn Error>> {
    let (n, mut out) = (a.nrows(), Ways::new());
    for (kind, supernodal_flop_ratio_threshold) in thresholds(n) {
        let params = LuSymbolicParams { supernodal_flop_ratio_threshold, ..LuSymbolicParams::default() };
        let symbolic = factorize_symbolic_lu(a.symbolic(), params)?;
        let way = SparseLu { a: Arc::clone(a), symbolic, numeric: NumericLu::new() };
        out.push((format!("faer {kind} LU, COLAMD"), Box::new(way)));
    }
    if n <= SIMPLICIAL {
        let rows = [vec![0; n], vec![0; n]];
        let way = OrderedLu { a: Arc::clone(a), lu: simplicial::SimplicialLu::new(), rows, columns: permutation(order) };
        out.push(("faer simplicial LU, our order".into(), Box::new(way)));
    }
    Ok(out)
}
