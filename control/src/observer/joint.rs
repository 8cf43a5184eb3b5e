//! Output feedback with gains that columns share: estimate and error in one recursion.

use std::ops::Range;

use faer::Mat;
use rayon::prelude::*;

use super::kalman::{Observer, Sensing};
use crate::linear::{add_product, product};
use crate::tube::{Column, Gains, RowValues, TubeProblem};

/// Responses of u = v + K (x̂ − z) to disturbances w_j and noises e_s.
///
/// ```text
/// x_{k+1} = (A + BK) x_k − BK err_k + E_{k+1} w_{k+1}          err: of the estimate that the input of stage k has
/// err_{s+1} = (A + LC) err_s + L F e_{s+1} + E_{s+1} w_{s+1}    of the predictor
/// ```
/// A recursion of 2 nx rows for each column: O(N² nx²) per column of E and F, against the O(N³) block products of
/// [`Responses`](super::Responses).
#[derive(Clone, Debug)]
pub struct JointResponses {
    /// To w_j: P_xx E and P_ux E of stages j … N.
    pub disturbances: Vec<Column>,
    /// To e_s, s = 1 … N, at index s − 1: P_xy F and P_uy F of stages s … N.
    pub noises: Vec<Column>,
    /// h of every row and input.
    pub tightenings: RowValues,
}

impl JointResponses {
    /// Reads K_{k,k} as the gain of all columns.
    pub fn new(problem: &TubeProblem<'_>, sensing: &Sensing, observer: &Observer, gains: &Gains) -> Self {
        let horizon = problem.horizon();
        let sources: Vec<Source> = (0..=horizon).map(Source::Disturbance).chain((1..=horizon).map(Source::Noise)).collect();
        let columns: Vec<Column> = sources.par_iter().map(|source| column(problem, sensing, observer, gains, *source)).collect();
        let mut tightenings = RowValues::zeros(problem.ocp);
        for (source, column) in sources.iter().zip(&columns) {
            let (first, balls): (usize, Vec<Range<usize>>) = match *source {
                Source::Disturbance(j) => (j, problem.balls[j].clone()),
                Source::Noise(s) => (s, std::iter::once(0..column.x[0].ncols()).collect()),
            };
            for (k, x) in (first..).zip(&column.x) {
                let norms = problem.rows[k].norms(x, column.u.get(k - first), &balls);
                for (sum, norm) in tightenings.stage_mut(k).iter_mut().zip(norms) {
                    *sum += norm;
                }
            }
        }
        let mut disturbances = columns;
        let noises = disturbances.split_off(horizon + 1);
        Self { disturbances, noises, tightenings }
    }
}

#[derive(Clone, Copy)]
enum Source {
    /// w_j.
    Disturbance(usize),
    /// e_s.
    Noise(usize),
}

fn column(problem: &TubeProblem<'_>, sensing: &Sensing, observer: &Observer, gains: &Gains, source: Source) -> Column {
    let (first, x, error) = match source {
        Source::Disturbance(j) => (j, problem.columns[j].clone(), problem.columns[j].clone()),
        Source::Noise(s) => {
            let error = product(observer.gains[s - 1].as_ref(), sensing.f[s - 1].as_ref());
            (s, Mat::zeros(problem.nx, error.ncols()), error)
        }
    };
    // of the predictor, at times from `first` on
    let mut errors = vec![error];
    for closed in &observer.closed[first..] {
        errors.push(product(closed.as_ref(), errors[errors.len() - 1].as_ref()));
    }
    let mut column = Column { x: vec![x], u: Vec::new() };
    for (k, stage) in problem.ocp.stages.iter().enumerate().skip(first) {
        let known = sensing.known(k);
        let mut error = match source {
            // a disturbance after the last measured time is an error as a whole
            Source::Disturbance(j) => errors[known.max(j) - j].clone(),
            Source::Noise(s) if s <= known => errors[known - s].clone(),
            Source::Noise(_) => Mat::zeros(problem.nx, errors[0].ncols()),
        };
        for later in &problem.ocp.stages[known.max(first)..k] {
            error = product(later.a.as_ref(), error.as_ref());
        }
        let x = &column.x[k - first];
        let u = product(gains.get(k, k).as_ref(), (x - error).as_ref());
        let mut next = product(stage.a.as_ref(), x.as_ref());
        add_product(next.as_mut(), stage.b.as_ref(), u.as_ref(), 1.0);
        column.x.push(next);
        column.u.push(u);
    }
    column
}
