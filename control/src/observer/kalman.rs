//! Measurements, and the one Kalman recursion of them.

use faer::Mat;

use super::error::ObserverError;
use crate::linear::{Cholesky, add_product, add_symmetric_product, mirror, product};
use crate::tube::{TubeError, TubeProblem, check};

/// Measurements y_s = C_{s−1} x_{s−1} + F_s e_s, |e_s|₂ ≤ 1, s = 1 … N, of which that of x_{s−1} arrives for the input of stage
/// s − 1 + d.
#[derive(Clone, Debug)]
pub struct Sensing {
    /// C_0 … C_{N−1}, ny × nx.
    pub c: Vec<Mat<f64>>,
    /// F_1 … F_N, ny × ne, at index s − 1.
    pub f: Vec<Mat<f64>>,
    /// Delay d ≥ 1 in stages.
    pub delay: usize,
}

/// The predictor x̂_s = A x̂_{s−1} + B u_{s−1} − L_s (y_s − C x̂_{s−1}) and its error.
///
/// ```text
/// G_s = F_s F_sᵀ + C Σ_{s−1} Cᵀ,   L_s = −A Σ_{s−1} Cᵀ G_s⁻¹
/// Σ_s = (A + L_s C) Σ_{s−1} (A + L_s C)ᵀ + L_s F_s F_sᵀ L_sᵀ + E_s E_sᵀ,   Σ_0 = E_0 E_0ᵀ          Joseph form: Σ stays semidefinite
/// x_s − x̂_s = (A + L_s C)(x_{s−1} − x̂_{s−1}) + L_s F_s e_s + E_s w_s
/// ```
/// The recursion does not depend on which stage or row its errors are looked at, so that there is one for all. It takes the balls' shapes
/// for covariances: the gains that minimize the quadratic size of the errors' responses.
#[derive(Clone, Debug)]
pub struct Observer {
    /// L_1 … L_N, nx × ny, at index s − 1.
    pub gains: Vec<Mat<f64>>,
    /// Σ_0 … Σ_N, nx × nx.
    pub shapes: Vec<Mat<f64>>,
    /// A + L_s C at index s − 1.
    pub(crate) closed: Vec<Mat<f64>>,
}

impl Observer {
    /// For a problem's dynamics and disturbances.
    ///
    /// # Errors
    /// [`ObserverError::Innovation`]; sizes.
    pub fn new(problem: &TubeProblem<'_>, sensing: &Sensing) -> Result<Self, ObserverError> {
        sensing.check(problem)?;
        let nx = problem.nx;
        let shape = |e: &Mat<f64>| {
            let mut shape = Mat::zeros(nx, nx);
            add_symmetric_product(shape.as_mut(), e.as_ref(), e.transpose());
            mirror(&mut shape);
            shape
        };
        let mut observer = Self { gains: Vec::new(), shapes: vec![shape(&problem.columns[0])], closed: Vec::new() };
        for s in 1..=problem.horizon() {
            let (a, c, f) = (&problem.ocp.stages[s - 1].a, &sensing.c[s - 1], &sensing.f[s - 1]);
            let sigma = &observer.shapes[s - 1];
            let c_sigma = product(c.as_ref(), sigma.as_ref());
            let mut innovation = product(f.as_ref(), f.transpose());
            add_product(innovation.as_mut(), c_sigma.as_ref(), c.transpose(), 1.0);
            let factor =
                Cholesky::new(innovation).map_err(|component| ObserverError::Innovation { measurement: s, component })?;
            // Lᵀ = −G⁻¹ C Σ Aᵀ
            let mut gain = product(c_sigma.as_ref(), a.transpose());
            factor.solve(gain.as_mut());
            let gain = faer::Scale(-1.0) * gain.transpose();
            let mut closed = a.clone();
            add_product(closed.as_mut(), gain.as_ref(), c.as_ref(), 1.0);
            let mut next = shape(&problem.columns[s]);
            let moved = product(closed.as_ref(), sigma.as_ref());
            add_symmetric_product(next.as_mut(), moved.as_ref(), closed.transpose());
            let noise = product(gain.as_ref(), f.as_ref());
            add_symmetric_product(next.as_mut(), noise.as_ref(), noise.transpose());
            mirror(&mut next);
            observer.gains.push(gain);
            observer.shapes.push(next);
            observer.closed.push(closed);
        }
        Ok(observer)
    }
}

impl Sensing {
    /// The time up to which the estimate of stage k has measurements: x̂ of it is the predictor's, later ones follow without.
    pub(crate) fn known(&self, k: usize) -> usize {
        (k + 1).saturating_sub(self.delay)
    }

    pub(crate) fn check(&self, problem: &TubeProblem<'_>) -> Result<(), ObserverError> {
        let horizon = problem.horizon();
        if self.delay == 0 {
            return Err(ObserverError::NoDelay);
        }
        for (what, count) in [("times of C", self.c.len()), ("times of F", self.f.len())] {
            if count != horizon {
                let (rows, needed_rows) = (count, horizon);
                return Err(TubeError::Size { what, stage: 0, rows, columns: 1, needed_rows, needed_columns: 1 }.into());
            }
        }
        for (s, (c, f)) in self.c.iter().zip(&self.f).enumerate() {
            check("C", s, c, c.nrows(), problem.nx)?;
            check("F", s + 1, f, c.nrows(), f.ncols())?;
        }
        Ok(())
    }
}
