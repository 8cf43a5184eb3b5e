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
/// err_{i+1} = A ((1 + MC) err_i + M F e_i) + E_{i+1} w_{i+1}    of the filter, before the measurement of its time
/// ```
/// A recursion of 2 nx rows for each column: O(N² nx²) per column of E and F, against the O(N³) block products of
/// [`Responses`](super::Responses).
#[derive(Clone, Debug)]
pub struct JointResponses {
    /// To w_j: P_xx E and P_ux E of stages j … N.
    pub disturbances: Vec<Column>,
    /// To e_i, i = 0 … N − 1: P_xy F and P_uy F of stages i … N.
    pub noises: Vec<Column>,
    /// h of every row and input.
    pub tightenings: RowValues,
}

impl JointResponses {
    /// Reads K_{k,k} as the gain of all columns.
    pub fn new(problem: &TubeProblem<'_>, sensing: &Sensing, observer: &Observer, gains: &Gains) -> Self {
        let horizon = problem.horizon();
        let sources: Vec<Source> = (0..=horizon).map(Source::Disturbance).chain((0..horizon).map(Source::Noise)).collect();
        let columns: Vec<Column> = sources.par_iter().map(|source| column(problem, sensing, observer, gains, *source)).collect();
        let mut tightenings = RowValues::zeros(problem.ocp);
        for (source, column) in sources.iter().zip(&columns) {
            let (first, balls): (usize, Vec<Range<usize>>) = match *source {
                Source::Disturbance(j) => (j, problem.balls[j].clone()),
                Source::Noise(i) => (i, std::iter::once(0..column.x[0].ncols()).collect()),
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
    /// e_i.
    Noise(usize),
}

fn column(problem: &TubeProblem<'_>, sensing: &Sensing, observer: &Observer, gains: &Gains, source: Source) -> Column {
    let (first, x) = match source {
        Source::Disturbance(j) => (j, problem.columns[j].clone()),
        Source::Noise(i) => (i, Mat::zeros(problem.nx, sensing.f[i].ncols())),
    };
    // of the filter, after the measurements of times from `first` on
    let (mut errors, mut before) = (Vec::new(), x.clone());
    for (i, stage) in problem.ocp.stages.iter().enumerate().skip(first) {
        let mut error = product(observer.kept[i].as_ref(), before.as_ref());
        if matches!(source, Source::Noise(own) if own == i) {
            add_product(error.as_mut(), observer.gains[i].as_ref(), sensing.f[i].as_ref(), 1.0);
        }
        before = product(stage.a.as_ref(), error.as_ref());
        errors.push(error);
    }
    let mut column = Column { x: vec![x], u: Vec::new() };
    for (k, stage) in problem.ocp.stages.iter().enumerate().skip(first) {
        // a disturbance after the last measured time is an error as a whole, and a noise is none
        let (mut error, from) = match sensing.last(k).filter(|last| *last >= first) {
            Some(last) => (errors[last - first].clone(), last),
            None => (column.x[0].clone(), first),
        };
        for later in &problem.ocp.stages[from..k] {
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
