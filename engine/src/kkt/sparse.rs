//! Sparse factorizations by faer; the analysis of the pattern is made once and shared.

use super::band_cholesky::BandCholesky;
use super::band_lu::BandLu;
use super::layout::{NodeLayout, Pattern};
use super::symbolic::Shared;
use super::{KktError, NodeMatrix, Symmetry};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, factorize_symbolic_cholesky};
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};

/// How far the solution for A·1 may be from 1 before a matrix counts as singular.
const PROBE_LIMIT: f64 = 1e-3;

/// Pattern by columns, where each entry comes from, and its analysis.
#[derive(Debug)]
pub(super) struct SparsePattern {
    pattern: SymbolicSparseColMat<usize>,
    /// For each entry its position in [`NodeMatrix::data`].
    source: Vec<Source>,
    analysis: Analysis,
}

#[derive(Clone, Copy, Debug)]
enum Source {
    At(usize),
    One,
    Zero,
}

#[derive(Debug)]
enum Analysis {
    Lu(SymbolicLu<usize>),
    Cholesky(SymbolicCholesky<usize>),
}

impl SparsePattern {
    /// In storage order; structurally symmetric.
    pub fn new(symmetry: Symmetry, layout: &NodeLayout, driven: &[bool]) -> Result<Self, KktError> {
        let (dim, size) = (layout.stored(), layout.block());
        let (mut column_starts, mut rows, mut source) = (vec![0], Vec::new(), Vec::new());
        for c in 0..dim {
            let j = c / size;
            for r in layout.row(j).flat_map(|i| size * i..size * i + size) {
                let i = r / size;
                let Some(at) = layout.entry(r, c).map(Source::At) else { continue };
                match symmetry {
                    Symmetry::Symmetric if r < c => continue, // the lower triangle serves
                    Symmetry::Symmetric if driven[i] || driven[j] => {
                        source.push(if r == c { Source::One } else { Source::Zero });
                    }
                    _ => source.push(at),
                }
                rows.push(r);
            }
            column_starts.push(rows.len());
        }
        let pattern = SymbolicSparseColMat::new_checked(dim, dim, column_starts, None, rows);
        let analysis = match symmetry {
            Symmetry::General => factorize_symbolic_lu(pattern.as_ref(), Default::default()).map(Analysis::Lu),
            Symmetry::Symmetric => {
                factorize_symbolic_cholesky(pattern.as_ref(), Side::Lower, Default::default(), Default::default())
                    .map(Analysis::Cholesky)
            }
        }
        .map_err(|source| KktError::Analysis { dim, source })?;
        Ok(Self { pattern, source, analysis })
    }

    fn load(&self, a: &NodeMatrix, values: &mut [f64]) {
        for (value, source) in values.iter_mut().zip(&self.source) {
            *value = match source {
                Source::At(k) => a.data()[*k],
                Source::One => 1.0,
                Source::Zero => 0.0,
            };
        }
    }
}

/// Numeric half of a sparse factorization.
#[derive(Clone, Debug)]
pub(super) struct Sparse {
    values: Vec<f64>,
    numeric: Numeric,
}

#[derive(Clone, Debug)]
enum Numeric {
    Lu(Box<NumericLu<usize, f64>>),
    Cholesky(Vec<f64>),
    /// The model has no sparse pattern; cannot be reached through [`super::Factor`].
    None,
}

impl Sparse {
    pub fn new(shared: &Shared) -> Self {
        let numeric = match shared.sparse.as_ref().map(|p| &p.analysis) {
            Some(Analysis::Lu(_)) => Numeric::Lu(Box::default()),
            Some(Analysis::Cholesky(symbolic)) => Numeric::Cholesky(vec![0.0; symbolic.len_val()]),
            None => Numeric::None,
        };
        Self { values: vec![0.0; shared.sparse.as_ref().map_or(0, |p| p.source.len())], numeric }
    }

    pub fn refactor(&mut self, a: &NodeMatrix, shared: &Shared) -> Result<(), KktError> {
        let Some(pattern) = &shared.sparse else { return Ok(()) };
        let dim = shared.layout.stored();
        if let Some(row) = (0..dim).find(|&r| !super::sum_abs(a.row(r)).is_finite()) {
            return Err(KktError::NotFinite { row, dim });
        }
        pattern.load(a, &mut self.values);
        let matrix = SparseColMatRef::new(pattern.pattern.as_ref(), &self.values);
        match (&pattern.analysis, &mut self.numeric) {
            (Analysis::Lu(symbolic), Numeric::Lu(numeric)) => {
                let mut memory = MemBuffer::new(symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default()));
                let stack = MemStack::new(&mut memory);
                let done = symbolic.factorize_numeric_lu(numeric, matrix, Par::Seq, stack, Default::default());
                match done {
                    Ok(_) => {}
                    Err(LuError::SymbolicSingular { index }) => return Err(blame(a, shared, index)),
                    Err(LuError::Generic(source)) => return Err(KktError::Analysis { dim, source }),
                }
            }
            (Analysis::Cholesky(symbolic), Numeric::Cholesky(values)) => {
                let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()));
                let (stack, regularization) = (MemStack::new(&mut memory), Default::default());
                let done = symbolic.factorize_numeric_llt(
                    values,
                    matrix,
                    Side::Lower,
                    regularization,
                    Par::Seq,
                    stack,
                    Default::default(),
                );
                done.map_err(|LltError::NonPositivePivot { index }| blame(a, shared, index))?;
            }
            _ => {}
        }
        self.probe(matrix, a, shared)
    }

    /// faer factors singular matrices without complaint: solve for A·1, and name the row where 1 does not come back.
    fn probe(&self, matrix: SparseColMatRef<'_, usize, f64>, a: &NodeMatrix, shared: &Shared) -> Result<(), KktError> {
        let dim = shared.layout.stored();
        let mut x = vec![0.0; dim];
        for c in 0..dim {
            for (r, &value) in matrix.row_idx_of_col(c).zip(matrix.val_of_col(c)) {
                x[r] += value;
                if shared.symmetry == Symmetry::Symmetric && r != c {
                    x[c] += value;
                }
            }
        }
        self.solve(shared, &mut x, 1, false);
        let error = |x: f64| if x.is_finite() { (x - 1.0).abs() } else { f64::INFINITY };
        let errors = x.iter().map(|x| error(*x)).enumerate();
        let (row, worst) = errors.fold((0, 0.0), |worst, next| if next.1 > worst.1 { next } else { worst });
        if worst > PROBE_LIMIT { Err(blame(a, shared, row)) } else { Ok(()) }
    }

    pub fn solve(&self, shared: &Shared, b: &mut [f64], columns: usize, transpose: bool) {
        let Some(pattern) = &shared.sparse else { return };
        let b = MatMut::from_row_major_slice_mut(b, shared.layout.stored(), columns);
        match (&pattern.analysis, &self.numeric) {
            (Analysis::Lu(symbolic), Numeric::Lu(numeric)) => {
                let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq));
                let (lu, stack) = (LuRef::new_unchecked(symbolic, numeric), MemStack::new(&mut memory));
                if transpose {
                    lu.solve_transpose_in_place_with_conj(Conj::No, b, Par::Seq, stack);
                } else {
                    lu.solve_in_place_with_conj(Conj::No, b, Par::Seq, stack);
                }
            }
            (Analysis::Cholesky(symbolic), Numeric::Cholesky(values)) => {
                let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq));
                let stack = MemStack::new(&mut memory);
                LltRef::new(symbolic, values).solve_in_place_with_conj(Conj::No, b, Par::Seq, stack);
            }
            _ => {}
        }
    }
}

/// Names the row at fault by eliminating in the band, since faer counts in its own order or not at all; `row` if that succeeds.
#[cold]
fn blame(a: &NodeMatrix, shared: &Shared, row: usize) -> KktError {
    let dim = shared.layout.stored();
    let in_band = match (&shared.layout.pattern, shared.symmetry, shared.layout.block()) {
        (Pattern::Band(half_width), Symmetry::General, 3) => BandLu::<3>::new(shared.layout.n_nodes(), *half_width).refactor(a),
        (Pattern::Band(half_width), Symmetry::Symmetric, 3) => {
            BandCholesky::new(shared.layout.n_nodes(), *half_width).refactor(a, &shared.driven)
        }
        _ => Ok(()),
    };
    match in_band {
        Err(KktError::Growth { row, .. }) => KktError::Singular { row, dim, pivot: 0.0, size: super::sum_abs(a.row(row)) },
        Err(error) => error,
        Ok(()) => KktError::Singular { row, dim, pivot: 0.0, size: super::sum_abs(a.row(row)) },
    }
}
