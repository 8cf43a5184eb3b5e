//! Sensor readings at one instant of a simulation, and their derivatives by all unknowns.

use super::blend::Blend;
use super::bodies::{Bodies, inverse_left_jacobian};
use super::marker_offset::At;
use super::observed::{MarkerPlace, Observed};
use super::run::{Pass, Shot};
use crate::form::Place;
use crate::sensor::{BIAS, DELAY, DRIFT, GAIN, TIME_OFFSET};
use crate::unknown::{Target, Unknown};
use nalgebra::{Matrix3, Vector3};
use pliant_adjoint::Tangent;
use pliant_math::State;
use pliant_math::rotation::{from_matrix, logarithm, matrix};

/// An instant between two states.
pub(super) struct Instant<'a> {
    blend: Blend,
    /// The part of the step.
    part: f64,
    x: [&'a State; 2],
    t: [&'a Tangent; 2],
    bodies: Option<Bodies>,
    /// Tangents of the bodies' coordinates and velocities.
    tangents: (Vec<f64>, Vec<f64>),
    /// Controls, interpolated between the middles of steps, and their rates.
    u: [Vec<f64>; 2],
}

/// A reading of up to three numbers.
struct Reading {
    value: [f64; 3],
    /// Measured − simulated; none where nothing was measured.
    residual: Option<[f64; 3]>,
    /// ∂(reading)/∂(columns), a row per number.
    rows: Vec<f64>,
}

/// A marker's way from the centreline \[m\], its rate, and its derivatives by the offsets.
#[derive(Default)]
struct OffCentreline {
    whole: Vector3<f64>,
    rate: Vector3<f64>,
    axes: [Vector3<f64>; 2],
}

impl<'a> Instant<'a> {
    /// At the part `part` of step `step`.
    pub fn new(pass: &Pass, step: usize, blend: Blend, part: f64, x: [&'a State; 2], t: [&'a Tangent; 2]) -> Self {
        let (model, plan) = (&pass.plan.model, pass.plan);
        let of_bodies = |m: &MarkerPlace| matches!(m, MarkerPlace::Body { .. });
        let seen = !plan.joints.is_empty() || !plan.orientations.is_empty() || plan.markers.iter().any(of_bodies);
        let bodies = seen.then(|| blend.bodies(model, x));
        let wanted = seen && pass.wants.tangents;
        let tangents = if wanted { blend.body_tangents(model, x, t, pass.columns) } else { Default::default() };
        let u = if plan.joints.iter().any(|j| !j.drives.is_empty()) { controls(pass, step, part) } else { Default::default() };
        Self { blend, part, x, t, bodies, tangents, u }
    }
}

/// Controls at a time, linear between the middles of steps, which their values are means over; and their rates [1/s].
fn controls(pass: &Pass, step: usize, part: f64) -> [Vec<f64>; 2] {
    let rows = &pass.rec.inputs;
    let first = (step + usize::from(part >= 0.5)).saturating_sub(1).min(rows.len().saturating_sub(2));
    let (a, b) = (&rows[first], &rows[(first + 1).min(rows.len() - 1)]);
    let along = step as f64 + part - (first as f64 + 0.5);
    let value = a.iter().zip(b).map(|(a, b)| a + along * (b - a)).collect();
    [value, a.iter().zip(b).map(|(a, b)| (b - a) / pass.h).collect()]
}

impl Pass<'_> {
    /// Reads one of the things observed at a sample.
    pub(super) fn observe(&self, sample: usize, observed: Observed, at: &Instant, shot: &mut Shot) {
        match observed {
            Observed::Marker(k) => self.marker(sample, k, at, shot),
            Observed::Joint(k) => self.joint(sample, k, at, shot),
            Observed::Orientation(k) => self.orientation(sample, k, at, shot),
        }
    }

    fn marker(&self, sample: usize, k: usize, at: &Instant, shot: &mut Shot) {
        let m = self.columns;
        let mut point = vec![0.0; 3 * m];
        let mut axes = [Vector3::zeros(); 2];
        let (p, speed) = match (&self.plan.markers[k], &at.bodies) {
            (MarkerPlace::Nodes(pair), _) => {
                let parts = [(pair.node, 1.0 - pair.weight), (pair.next, pair.weight)];
                if self.wants.tangents {
                    for &(node, w) in parts.iter().filter(|(_, w)| *w != 0.0) {
                        at.blend.tangent(at.t, node, m, w, &mut point);
                    }
                }
                let p: Vector3<f64> = parts.iter().map(|&(n, w)| at.blend.position(at.x, n) * w).sum();
                let v: Vector3<f64> = parts.iter().map(|&(n, w)| at.blend.velocity(at.x, n) * w).sum();
                let off = self.off_centreline(k, at, &mut point);
                axes = off.axes;
                (p + off.whole, v + off.rate)
            }
            (MarkerPlace::Body { body, point: place }, Some(bodies)) => {
                let seen = bodies.point(&self.plan.model, *body, place);
                self.add_columns(&seen.by, &at.tangents.0, &mut point);
                (seen.value, seen.rate)
            }
            (MarkerPlace::Body { .. }, None) => return, // an instant with a marker on a body has bodies
        };
        let (y, dy_dp, by) = self.values.sensor.read(p);
        let (measured, time) = (self.rec.record.markers[sample][k], self.rec.record.time[sample]);
        let seen = measured.iter().all(|c| c.is_finite());
        let residual = seen.then(|| (Vector3::from(measured) - y).into());
        let reading = Reading { value: y.into(), residual, rows: turn(&dy_dp, &point, m) };
        let direct = |unknown: &Unknown, axis: usize| match unknown.target {
            Target::Sensor(TIME_OFFSET) => -(dy_dp * speed)[axis],
            Target::Sensor(entry) => by[entry][axis],
            Target::Beside(ref markers, along) if markers.contains(&k) => (dy_dp * axes[along])[axis],
            Target::Form(ref form) if form.place == (Place::Markers { axis }) => form.value(time, 0.0, 0.0),
            _ => 0.0,
        };
        self.store(sample, Observed::Marker(k), reading, &direct, shot);
    }

    /// Offset of a marker from its rod, between two steps; adds its tangents to those of the point.
    fn off_centreline(&self, marker: usize, at: &Instant, point: &mut [f64]) -> OffCentreline {
        let mut out = OffCentreline::default();
        let Some(beside) = &self.beside else { return out };
        for (k, weight, slope) in [(0, 1.0 - at.part, -1.0 / self.h), (1, at.part, 1.0 / self.h)] {
            let tangent = self.wants.tangents.then_some((at.t[k], self.columns));
            let state = At { model: &self.plan.model, x: at.x[k], tangent };
            let offset = beside.offset(marker, self.values, state);
            (0..2).for_each(|a| out.axes[a] += offset.axes[a] * weight);
            out.whole += offset.whole * weight;
            out.rate += offset.whole * slope;
            point.iter_mut().zip(&offset.rows).for_each(|(p, r)| *p += weight * r);
        }
        out
    }

    fn joint(&self, sample: usize, k: usize, at: &Instant, shot: &mut Shot) {
        let Some(bodies) = &at.bodies else { return };
        let (place, m) = (&self.plan.joints[k], self.columns);
        let x = bodies.number(place, [&at.u[0], &at.u[1]], &self.values.theta);
        let sensor = &self.values.joints[k];
        let record = &self.rec.record;
        let (measured, time) = (record.joints[sample][k], record.time[sample]);
        let y = sensor[GAIN] * x.value + sensor[BIAS] + sensor[DRIFT] * (record.from + time);
        let mut rows = vec![0.0; m];
        if self.wants.tangents {
            for (by, tangents) in [(x.by_q, &at.tangents.0), (x.by_v, &at.tangents.1)] {
                let own = &tangents[place.v * m..(place.v + 1) * m];
                rows.iter_mut().zip(own).for_each(|(r, t)| *r += sensor[GAIN] * by * t);
            }
        }
        let residual = measured.is_finite().then_some([measured - y, 0.0, 0.0]);
        let reading = Reading { value: [y, 0.0, 0.0], residual, rows };
        let direct = |unknown: &Unknown, _: usize| match &unknown.target {
            Target::Sensor(TIME_OFFSET) => -sensor[GAIN] * x.rate,
            Target::Joint(sensor, BIAS) if *sensor == k => 1.0,
            Target::Joint(sensor, GAIN) if *sensor == k => x.value,
            Target::Joint(sensor, DRIFT) if *sensor == k => record.from + time,
            Target::Joint(other, DELAY) if *other == k => -sensor[GAIN] * x.rate,
            Target::Form(form) if form.place == Place::Reading(k) => form.value(time, x.value, x.rate),
            Target::Sensor(_) | Target::Joint(..) | Target::Beside(..) | Target::Late(_) | Target::Form(_) => 0.0,
            Target::Theta(_) | Target::Mirrored(..) => {
                let entries = unknown.target.entries();
                let by = |k: usize| x.by_theta.iter().filter(move |(entry, _)| *entry == k).map(|(_, d)| d).sum::<f64>();
                sensor[GAIN] * entries.into_iter().map(|(k, part)| part * by(k)).sum::<f64>()
            }
        };
        self.store(sample, Observed::Joint(k), reading, &direct, shot);
    }

    fn orientation(&self, sample: usize, k: usize, at: &Instant, shot: &mut Shot) {
        let Some(bodies) = &at.bodies else { return };
        let (body, m) = (self.plan.orientations[k].body, self.columns);
        let measured = self.rec.record.orientations[sample][k];
        if measured.iter().any(|x| !x.is_finite()) {
            let reading = Reading { value: [0.0; 3], residual: None, rows: vec![0.0; 3 * m] };
            return self.store(sample, Observed::Orientation(k), reading, &|_, _| 0.0, shot);
        }
        let off = logarithm(&from_matrix(&(bodies.axes(body).transpose() * matrix(&measured))));
        let turned = bodies.turn(&self.plan.model, body);
        let mut turns = vec![0.0; 3 * m];
        self.add_columns(&turned.by, &at.tangents.0, &mut turns);
        let by = inverse_left_jacobian(&off);
        let reading = Reading { value: (-off).into(), residual: Some(off.into()), rows: turn(&by, &turns, m) };
        let direct = |unknown: &Unknown, axis: usize| match unknown.target {
            Target::Sensor(TIME_OFFSET) => -(by * turned.rate)[axis],
            _ => 0.0,
        };
        self.store(sample, Observed::Orientation(k), reading, &direct, shot);
    }

    /// Adds Σ (vector by a degree of freedom) × (its tangents) to three rows.
    fn add_columns(&self, by: &[(usize, Vector3<f64>)], tangents: &[f64], rows: &mut [f64]) {
        let m = self.columns;
        if !self.wants.tangents {
            return;
        }
        for (l, column) in by {
            let own = &tangents[l * m..(l + 1) * m];
            for a in 0..3 {
                rows[a * m..(a + 1) * m].iter_mut().zip(own).for_each(|(r, t)| *r += column[a] * t);
            }
        }
    }

    /// `direct(unknown, number)` is the derivative of a reading by an unknown's value at a fixed state.
    fn store(
        &self,
        sample: usize,
        observed: Observed,
        reading: Reading,
        direct: &dyn Fn(&Unknown, usize) -> f64,
        shot: &mut Shot,
    ) {
        let (m, k) = (self.columns, self.wants.unknowns.len());
        let channels = self.plan.channels_of(observed);
        for (a, channel) in channels.enumerate() {
            let r = sample * self.plan.channels() + channel;
            shot.predicted[r] = reading.value[a];
            let Some(residual) = reading.residual else { continue };
            shot.residual[r] = met(residual[a]);
            if !self.wants.tangents {
                continue;
            }
            let row = &reading.rows[a * m..(a + 1) * m];
            shot.residual[r] = met(residual[a] - row[m - 1]);
            shot.own[r * self.own..(r + 1) * self.own].copy_from_slice(&row[..self.own]);
            for (j, unknown) in self.wants.unknowns.iter().enumerate() {
                let slope = unknown.slope(unknown.value(self.values));
                shot.global[r * k + j] = row[self.own + j] + direct(unknown, a) * slope;
            }
        }
    }
}

/// A residual of a measured sample: never exactly 0, which marks a missing one. A marker on a gripper that the same sensor drives is
/// met exactly or to rounding, by chance, and must count the same both times.
pub(super) fn met(residual: f64) -> f64 {
    if residual == 0.0 { f64::MIN_POSITIVE } else { residual }
}

/// Rows of `by · point`, three rows of `m` columns.
fn turn(by: &Matrix3<f64>, point: &[f64], m: usize) -> Vec<f64> {
    if *by == Matrix3::identity() {
        return point.to_vec();
    }
    let mut out = vec![0.0; 3 * m];
    for a in 0..3 {
        for b in 0..3 {
            let c = by[(a, b)];
            out[a * m..(a + 1) * m].iter_mut().zip(&point[b * m..(b + 1) * m]).for_each(|(o, p)| *o += c * p);
        }
    }
    out
}
