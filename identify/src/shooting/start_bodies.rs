//! Where bodies start: coordinates and velocities that agree with everything their sensors read, and how sure that is.
//!
//! Readings around a sample are fitted by a quadratic each. With ŷ(q) the readings of a state and J = ∂ŷ/∂(q ⊕ t),
//! ```text
//! q: Σ |(y − ŷ(q))/σ|² + |q ⊖ q_scene|²/w²,      v: Σ |(ẏ − J v)/σ̇|² + |v|²/ẇ²
//! ```
//! are minimised (Gauss–Newton); the inverse curvatures are the prior's covariances.

use super::bodies::Bodies;
use super::constants::SHOOTING;
use super::observed::{MarkerPlace, Observed};
use super::plan::Plan;
use super::start::local_fit;
use crate::error::IdentifyError;
use crate::log::{JointQuantity, Record};
use crate::sensor::{BIAS, DELAY, DRIFT, GAIN};
use nalgebra::{Cholesky, DMatrix, DVector, Vector3};
use pliant_math::rotation::{Map, conjugate, from_matrix, logarithm, matrix, product};

/// Bodies' coordinates and velocities, with factors L of their covariances L Lᵀ over the degrees of freedom.
pub(super) struct BodyStart {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub position: DMatrix<f64>,
    pub velocity: DMatrix<f64>,
    /// Sensors at joints, and how coordinates and velocities follow their zeros.
    pub zeros: Vec<(usize, Vec<f64>, Vec<f64>)>,
}

/// Readings at a sample: value, standard deviation and slack of an observed quantity, and of its rate; `Turn`: axes and angular
/// velocity. The slack widens the prior and does not move it.
enum Known {
    Point(usize, Vector3<f64>, Vector3<f64>, [f64; 2]),
    Number(usize, [f64; 3], [f64; 3]),
    Turn(usize, [f64; 4], Vector3<f64>),
}

impl Known {
    /// A sensor at a joint, and its reading.
    fn coordinate(&self) -> Option<(usize, f64)> {
        match self {
            Self::Number(k, [x, ..], _) => Some((*k, *x)),
            Self::Point(..) | Self::Turn(..) => None,
        }
    }
}

/// The bodies' state at a sample of the record as the data have it.
pub(super) fn body_start(plan: &Plan, record: &Record, sample: usize) -> Result<BodyStart, IdentifyError> {
    let (tree, model) = (plan.model.tree(), &plan.model);
    let nv = tree.nv();
    let scene = model.initial_positions()[model.n_node_dofs()..].to_vec();
    let known = known(plan, record, sample);
    let [unread, rate_unread] = [false, true].map(|rate| unread(plan, &known, rate));
    let singular = || IdentifyError::Input("an initial state cannot be read off the log: it is not finite".to_owned());
    let mut q = scene.clone();
    // a link may have turned round many times since: the reading of its own sensor is out of reach of short steps
    for (k, x) in known.iter().filter_map(Known::coordinate) {
        if plan.joints[k].quantity == JointQuantity::Position {
            q[plan.joints[k].q] = x;
        }
    }
    for _ in 0..SHOOTING.pose_steps {
        let mut system = System::new(nv);
        let mut away = vec![0.0; nv];
        tree.subtract(&q, &scene, &mut away);
        unread.iter().for_each(|&l| system.add(&[(l, 1.0)], -away[l], SHOOTING.unread.0));
        let bodies = Bodies::new(model, q.clone(), vec![0.0; nv], vec![0.0; nv], vec![0.0; nv]);
        known.iter().for_each(|k| add_place(plan, &bodies, k, false, &mut system));
        let step = system.solve().ok_or_else(singular)?;
        let size = step.amax();
        let shorter = (SHOOTING.pose_step / size.max(SHOOTING.pose_step)).min(1.0);
        let from = q.clone();
        tree.add(Map::Exponential, &from, (step * shorter).as_slice(), &mut q);
        if size < SHOOTING.pose_settled {
            break;
        }
    }
    let bodies = Bodies::new(model, q.clone(), vec![0.0; nv], vec![0.0; nv], vec![0.0; nv]);
    let placed = |wide: bool| {
        let mut system = System::new(nv);
        unread.iter().for_each(|&l| system.add(&[(l, 1.0)], 0.0, SHOOTING.unread.0));
        known.iter().for_each(|k| add_place(plan, &bodies, k, wide, &mut system));
        system
    };
    let moving = |wide: bool| {
        let mut system = System::new(nv);
        rate_unread.iter().for_each(|&l| system.add(&[(l, 1.0)], 0.0, SHOOTING.unread.1));
        known.iter().for_each(|k| add_rate(plan, &bodies, k, wide, &mut system));
        system
    };
    let v = moving(false).solve().ok_or_else(singular)?.as_slice().to_vec();
    let position = placed(true).factor().ok_or_else(singular)?;
    let [places, rates] = [placed(false), moving(false)].map(|system| system.matrix);
    let zero = |of: &Known| {
        let Known::Number(k, [_, sigma, _], _) = of else { return None };
        let joint = &plan.joints[*k];
        let of_place = joint.quantity == JointQuantity::Position;
        let mut system = System { matrix: if of_place { &places } else { &rates }.clone(), right: DVector::zeros(nv) };
        system.right[joint.v] = -1.0 / (plan.scene_values.joints[*k][GAIN] * sigma * sigma);
        let (moved, still) = (system.solve()?.as_slice().to_vec(), vec![0.0; nv]);
        Some(if of_place { (*k, moved, still) } else { (*k, still, moved) })
    };
    let zeros = known.iter().filter_map(zero).collect();
    Ok(BodyStart { q, v, position, velocity: moving(true).factor().ok_or_else(singular)?, zeros })
}

/// Degrees of freedom whose coordinate (whose velocity, by `rate`) no sensor at a joint reads.
fn unread(plan: &Plan, known: &[Known], rate: bool) -> Vec<usize> {
    let read = |l: usize| {
        known.iter().filter_map(Known::coordinate).any(|(k, _)| {
            let joint = &plan.joints[k];
            joint.v == l && (rate || joint.quantity == JointQuantity::Position)
        })
    };
    (0..plan.model.tree().nv()).filter(|&l| !read(l)).collect()
}

fn known(plan: &Plan, record: &Record, sample: usize) -> Vec<Known> {
    let mut out = Vec::new();
    for observed in plan.observed() {
        match observed {
            Observed::Marker(k) if matches!(plan.markers[k], MarkerPlace::Body { .. }) => {
                if let Some((p, v)) = super::start::marker_at(plan, record, k, sample) {
                    out.push(Known::Point(k, p, v, point_slack(record, k)));
                }
            }
            Observed::Joint(k) => out.extend(number_at(plan, record, k, sample)),
            Observed::Orientation(k) => out.extend(turn_at(record, k, sample)),
            Observed::Marker(_) => {}
        }
    }
    out
}

/// Slack of a point's position and velocity \[m\], [m/s].
fn point_slack(record: &Record, k: usize) -> [f64; 2] {
    let rms = |squares: &mut dyn Iterator<Item = f64>| {
        let (sum, n) = squares.filter(|s| s.is_finite()).fold((0.0, 0.0), |(sum, n), s| (sum + s, n + 1.0));
        (sum / f64::max(n, 1.0)).sqrt()
    };
    let place = |t: usize| Vector3::from(record.markers[t][k]);
    let speeds = |t: usize| (place(t + 1) - place(t)).norm_squared() / (record.time[t + 1] - record.time[t]).powi(2);
    let n = record.time.len();
    let distance = rms(&mut (0..n).map(|t| place(t).norm_squared()));
    [SHOOTING.own_motion * distance, SHOOTING.own_speed * rms(&mut (0..n.saturating_sub(1)).map(speeds))]
}

fn number_at(plan: &Plan, record: &Record, k: usize, sample: usize) -> Option<Known> {
    let place = &plan.joints[k];
    if place.quantity == JointQuantity::Torque {
        return None; // it says little about the state
    }
    let fit = local_fit(record, sample, |t| record.joints[t][k])?;
    let sensor = &plan.scene_values.joints[k];
    let late = plan.scene_values.sensor.time_offset() + sensor[DELAY];
    let zero = sensor[BIAS] + sensor[DRIFT] * (record.from + record.time[sample]);
    let (x, rate) = ((fit.value - zero) / sensor[GAIN], (fit.slope - sensor[DRIFT]) / sensor[GAIN]);
    let read = || record.joints.iter().map(|row| row[k]).filter(|x| x.is_finite());
    let n = read().count().max(1) as f64;
    let mean = read().sum::<f64>() / n;
    let motion = (read().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
    let sigma = (SHOOTING.reading_floors * place.floor).max(SHOOTING.reading_residuals * fit.residual) / sensor[GAIN].abs();
    let slack = SHOOTING.own_motion * motion / sensor[GAIN].abs();
    let speeds = record.joints.windows(2).zip(record.time.windows(2));
    let squares = speeds.map(|(y, t)| ((y[1][k] - y[0][k]) / (t[1] - t[0])).powi(2)).filter(|s| s.is_finite());
    let (sum, count) = squares.fold((0.0, 0.0), |(sum, n), s| (sum + s, n + 1.0));
    let speed = (sum / f64::max(count, 1.0)).sqrt() / sensor[GAIN].abs();
    Some(Known::Number(k, [x + rate * late, sigma, slack], [rate, sigma / fit.half_window, SHOOTING.own_speed * speed]))
}

fn turn_at(record: &Record, k: usize, sample: usize) -> Option<Known> {
    let at = |t: usize| record.orientations.get(t).map(|row| row[k]).filter(|q| q.iter().all(|x| x.is_finite()));
    let here = at(sample)?;
    let (first, last) = (sample.saturating_sub(2), (sample + 2).min(record.time.len() - 1));
    let rate = match (at(first), at(last)) {
        (Some(a), Some(b)) if last > first => logarithm(&product(&conjugate(&a), &b)) / (record.time[last] - record.time[first]),
        _ => Vector3::zeros(),
    };
    Some(Known::Turn(k, here, rate))
}

fn add_place(plan: &Plan, bodies: &Bodies, known: &Known, wide: bool, system: &mut System) {
    let model = &plan.model;
    match known {
        Known::Point(k, p, _, [slack, _]) => {
            if let MarkerPlace::Body { body, point } = &plan.markers[*k] {
                let seen = bodies.point(model, *body, point);
                system.add_vector(
                    &seen.by,
                    &(p - seen.value),
                    if wide { SHOOTING.seen.0.hypot(*slack) } else { SHOOTING.seen.0 },
                );
            }
        }
        Known::Number(k, [x, sigma, slack], _) if plan.joints[*k].quantity == JointQuantity::Position => {
            let place = &plan.joints[*k];
            let sigma = if wide { sigma.hypot(*slack) } else { *sigma };
            system.add(&[(place.v, 1.0)], x - bodies.q[place.q], sigma);
        }
        Known::Number(..) => {}
        Known::Turn(k, measured, _) => {
            let body = plan.orientations[*k].body;
            let off = logarithm(&from_matrix(&(bodies.axes(body).transpose() * matrix(measured))));
            system.add_vector(&bodies.turn(model, body).by, &off, SHOOTING.turned.0);
        }
    }
}

fn add_rate(plan: &Plan, bodies: &Bodies, known: &Known, wide: bool, system: &mut System) {
    let model = &plan.model;
    match known {
        Known::Point(k, _, v, [_, slack]) => {
            if let MarkerPlace::Body { body, point } = &plan.markers[*k] {
                let sigma = if wide { SHOOTING.seen.1.hypot(*slack) } else { SHOOTING.seen.1 };
                system.add_vector(&bodies.point(model, *body, point).by, v, sigma);
            }
        }
        Known::Number(k, value, rate) => {
            let place = &plan.joints[*k];
            let [x, sigma, slack] = if place.quantity == JointQuantity::Position { *rate } else { *value };
            system.add(&[(place.v, 1.0)], x, if wide { sigma.hypot(slack) } else { sigma });
        }
        Known::Turn(k, _, rate) => {
            system.add_vector(&bodies.turn(model, plan.orientations[*k].body).by, rate, SHOOTING.turned.1);
        }
    }
}

/// Normal equations over the degrees of freedom.
struct System {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl System {
    fn new(n: usize) -> Self {
        Self { matrix: DMatrix::zeros(n, n), right: DVector::zeros(n) }
    }

    /// One row: slopes · t = target, with standard deviation σ.
    fn add(&mut self, slopes: &[(usize, f64)], target: f64, sigma: f64) {
        let weight = 1.0 / (sigma * sigma);
        for &(i, a) in slopes {
            self.right[i] += weight * a * target;
            slopes.iter().for_each(|&(j, b)| self.matrix[(i, j)] += weight * a * b);
        }
    }

    fn add_vector(&mut self, by: &[(usize, Vector3<f64>)], target: &Vector3<f64>, sigma: f64) {
        for a in 0..3 {
            let slopes: Vec<(usize, f64)> = by.iter().map(|(l, column)| (*l, column[a])).collect();
            self.add(&slopes, target[a], sigma);
        }
    }

    fn solve(&self) -> Option<DVector<f64>> {
        Cholesky::new(self.matrix.clone()).map(|lower| lower.solve(&self.right))
    }

    /// L with L Lᵀ = matrix⁻¹.
    fn factor(&self) -> Option<DMatrix<f64>> {
        let n = self.matrix.nrows();
        let lower = Cholesky::new(self.matrix.clone())?;
        lower.l().transpose().solve_upper_triangular(&DMatrix::identity(n, n))
    }
}
