//! Measurements, and the one Kalman recursion of them.

use faer::Mat;

use super::error::ObserverError;
use crate::linear::{SemidefiniteCholesky, add_product, add_symmetric_product, mirror, product};
use crate::tube::{TubeError, TubeProblem, check};

/// Measurements y_i = C_i x_i + F_i e_i, |e_i|₂ ≤ 1, i = 0 … N − 1, of which that of x_i arrives for the input of stage i + d.
#[derive(Clone, Debug)]
pub struct Sensing {
    /// C_0 … C_{N−1}, ny × nx.
    pub c: Vec<Mat<f64>>,
    /// F_0 … F_{N−1}, ny × ne.
    pub f: Vec<Mat<f64>>,
    /// Delay d in stages; 0: the input of a stage answers that stage's measurement.
    pub delay: usize,
}

/// The filter x̂⁺ = x̂_i − M_i (y_i − C x̂_i), x̂_{i+1} = A x̂⁺ + B u_i, and its error.
///
/// ```text
/// G_i = F_i F_iᵀ + C Σ_i Cᵀ,   M_i = −Σ_i Cᵀ G_i⁻¹
/// Σ⁺ = (1 + M_i C) Σ_i (1 + M_i C)ᵀ + M_i F_i F_iᵀ M_iᵀ                   Joseph form: Σ stays semidefinite
/// Σ_{i+1} = A Σ⁺ Aᵀ + E_{i+1} E_{i+1}ᵀ,   Σ_0 = E_0 E_0ᵀ
/// x_{i+1} − x̂_{i+1} = A ((1 + M_i C)(x_i − x̂_i) + M_i F_i e_i) + E_{i+1} w_{i+1}
/// ```
/// The recursion does not depend on which stage or row its errors are looked at, so that there is one for all. It takes the balls' shapes
/// for covariances: the gains that minimize the quadratic size of the errors' responses. Measurements that say nothing new (without noise,
/// of what is known) have no part in it: G may be singular.
#[derive(Clone, Debug)]
pub struct Observer {
    /// M_0 … M_{N−1}, nx × ny.
    pub gains: Vec<Mat<f64>>,
    /// Σ_0 … Σ_N, nx × nx, before the measurements of their times.
    pub shapes: Vec<Mat<f64>>,
    /// 1 + M_i C.
    pub(crate) kept: Vec<Mat<f64>>,
}

/// A measurement's effect on an estimate.
pub(crate) struct Correction {
    /// M.
    pub gain: Mat<f64>,
    /// 1 + M C.
    pub kept: Mat<f64>,
    /// Σ⁺.
    pub shape: Mat<f64>,
}

impl Correction {
    /// Of a measurement C x + F e of a state that is known to Σ.
    pub(crate) fn new(sigma: &Mat<f64>, c: &Mat<f64>, f: &Mat<f64>) -> Self {
        let c_sigma = product(c.as_ref(), sigma.as_ref());
        let mut innovation = product(f.as_ref(), f.transpose());
        add_product(innovation.as_mut(), c_sigma.as_ref(), c.transpose(), 1.0);
        let gain = faer::Scale(-1.0) * SemidefiniteCholesky::new(&innovation).solve(&c_sigma).transpose();
        let mut kept = Mat::identity(sigma.nrows(), sigma.nrows());
        add_product(kept.as_mut(), gain.as_ref(), c.as_ref(), 1.0);
        let moved = product(kept.as_ref(), sigma.as_ref());
        let noise = product(gain.as_ref(), f.as_ref());
        let mut shape = square(&noise);
        add_symmetric_product(shape.as_mut(), moved.as_ref(), kept.transpose());
        mirror(&mut shape);
        Self { gain, kept, shape }
    }
}

/// E Eᵀ.
pub(crate) fn square(e: &Mat<f64>) -> Mat<f64> {
    let mut shape = Mat::zeros(e.nrows(), e.nrows());
    add_symmetric_product(shape.as_mut(), e.as_ref(), e.transpose());
    mirror(&mut shape);
    shape
}

/// A Σ Aᵀ + E Eᵀ.
pub(crate) fn predict(a: &Mat<f64>, sigma: &Mat<f64>, e: &Mat<f64>) -> Mat<f64> {
    let mut next = square(e);
    let moved = product(a.as_ref(), sigma.as_ref());
    add_symmetric_product(next.as_mut(), moved.as_ref(), a.transpose());
    mirror(&mut next);
    next
}

impl Observer {
    /// For a problem's dynamics and disturbances.
    ///
    /// # Errors
    /// Sizes.
    pub fn new(problem: &TubeProblem<'_>, sensing: &Sensing) -> Result<Self, ObserverError> {
        sensing.check(problem)?;
        let mut observer = Self { gains: Vec::new(), shapes: vec![square(&problem.columns[0])], kept: Vec::new() };
        for (i, stage) in problem.ocp.stages.iter().enumerate() {
            let Correction { gain, kept, shape } = Correction::new(&observer.shapes[i], &sensing.c[i], &sensing.f[i]);
            observer.shapes.push(predict(&stage.a, &shape, &problem.columns[i + 1]));
            observer.gains.push(gain);
            observer.kept.push(kept);
        }
        Ok(observer)
    }
}

impl Sensing {
    /// The time of the last measurement that the estimate of stage k has; none before the delay is over.
    pub(crate) fn last(&self, k: usize) -> Option<usize> {
        let last = k.checked_sub(self.delay)?.min(self.c.len().checked_sub(1)?);
        Some(last)
    }

    pub(crate) fn check(&self, problem: &TubeProblem<'_>) -> Result<(), ObserverError> {
        let horizon = problem.horizon();
        for (what, count) in [("times of C", self.c.len()), ("times of F", self.f.len())] {
            if count != horizon {
                let (rows, needed_rows) = (count, horizon);
                return Err(TubeError::Size { what, stage: 0, rows, columns: 1, needed_rows, needed_columns: 1 }.into());
            }
        }
        for (i, (c, f)) in self.c.iter().zip(&self.f).enumerate() {
            check("C", i, c, c.nrows(), problem.nx)?;
            check("F", i, f, c.nrows(), f.ncols())?;
        }
        Ok(())
    }
}
