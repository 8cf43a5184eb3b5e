//! A rank-revealing orthonormal basis of a few long columns.

use nalgebra::{DMatrix, DVector};

/// Q R = A P restricted to the columns that count: Q is n × rank with orthonormal columns, R is rank × rank upper triangular.
#[derive(Debug, Clone)]
pub(crate) struct Basis {
    pub q: DMatrix<f64>,
    pub r: DMatrix<f64>,
    /// Columns of A in the order in which they entered Q.
    pub kept: Vec<usize>,
    /// Columns whose part orthogonal to the kept ones is below tolerance × reference norm, ascending.
    pub dead: Vec<usize>,
}

impl Basis {
    /// Pivoted Gram–Schmidt with reorthogonalization. The pivot is the column that keeps the largest share of its
    /// `reference` norm, so that neither units nor scales decide what counts as dead.
    pub fn new(a: &DMatrix<f64>, reference: &[f64], tolerance: f64) -> Self {
        let mut work = a.clone();
        let mut q: Vec<DVector<f64>> = Vec::new();
        let mut kept: Vec<usize> = Vec::new();
        let mut open: Vec<usize> = (0..a.ncols()).collect();
        let share = |work: &DMatrix<f64>, j: usize| if reference[j] > 0.0 { work.column(j).norm() / reference[j] } else { 0.0 };
        while kept.len() < a.nrows() {
            let best = open.iter().enumerate().map(|(i, &j)| (i, share(&work, j))).max_by(|x, y| x.1.total_cmp(&y.1));
            let Some((place, _)) = best.filter(|b| b.1 > tolerance) else { break };
            let j = open.remove(place);
            let mut column: DVector<f64> = work.column(j).into_owned();
            // A second pass against all of Q: once is not enough after cancellation, twice is.
            for direction in &q {
                let overlap = direction.dot(&column);
                column.axpy(-overlap, direction, 1.0);
            }
            let norm = column.norm();
            if norm <= tolerance * reference[j] {
                continue;
            }
            column /= norm;
            for &l in &open {
                let overlap = column.dot(&work.column(l));
                work.column_mut(l).axpy(-overlap, &column, 1.0);
            }
            q.push(column);
            kept.push(j);
        }
        let dead = (0..a.ncols()).filter(|j| !kept.contains(j)).collect();
        let q = if q.is_empty() { DMatrix::zeros(a.nrows(), 0) } else { DMatrix::from_columns(&q) };
        let chosen = a.select_columns(&kept);
        let r = (q.transpose() * chosen).upper_triangle();
        Self { q, r, kept, dead }
    }

    pub fn rank(&self) -> usize {
        self.kept.len()
    }

    /// X ← (I − Q Qᵀ) X, twice (for the same reason).
    pub fn project_out(&self, x: &mut DMatrix<f64>) {
        if self.rank() == 0 {
            return;
        }
        let q_transposed = self.q.transpose();
        for _ in 0..2 {
            let overlap = &q_transposed * &*x;
            x.gemm(-1.0, &self.q, &overlap, 1.0);
        }
    }

    /// R⁻¹ B; R is regular by construction.
    pub fn solve_r(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        self.r.solve_upper_triangular(b).unwrap_or_else(|| DMatrix::zeros(b.nrows(), b.ncols()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::testing::gaussians;

    #[test]
    fn finds_rank_and_spans() {
        let mut a = DMatrix::from_vec(20, 4, gaussians(80, 1));
        let combination = a.column(0) * 1e-6 + a.column(1) * 2e-6;
        a.set_column(2, &combination);
        let norms: Vec<f64> = a.column_iter().map(|c| c.norm()).collect();
        let basis = Basis::new(&a, &norms, 1e-9);
        assert_eq!(basis.rank(), 3);
        assert_eq!(basis.dead.len(), 1);
        let identity = &basis.q.transpose() * &basis.q;
        assert!((identity - DMatrix::identity(3, 3)).norm() < 1e-14);
        let rebuilt = &basis.q * &basis.r;
        assert!((rebuilt - a.select_columns(&basis.kept)).norm() < 1e-13);
        let mut rest = a.clone();
        basis.project_out(&mut rest);
        assert!(rest.norm() < 1e-13);
    }

    #[test]
    fn zero_columns_and_no_columns() {
        let basis = Basis::new(&DMatrix::zeros(5, 2), &[0.0, 0.0], 1e-9);
        assert_eq!((basis.rank(), basis.dead.len()), (0, 2));
        let mut x = DMatrix::from_element(5, 1, 1.0);
        basis.project_out(&mut x);
        assert_eq!(x.sum(), 5.0);
        assert_eq!(Basis::new(&DMatrix::zeros(5, 0), &[], 1e-9).rank(), 0);
    }
}
