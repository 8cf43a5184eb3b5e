//! Raw records, their layout, and the prepared form that the checks read.

use super::constants::AUDIT;
use super::report::{Finding, Place, RecordNoise, Severity};
use super::series::median;
use thiserror::Error;

/// Errors of [`super::audit`].
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum AuditError {
    /// A slice does not have the length its layout asks for.
    #[error("record {record}: {what} has {found} numbers, the layout asks for {expected}")]
    Length {
        /// Record number.
        record: usize,
        /// Which slice.
        what: &'static str,
        /// Numbers found.
        found: usize,
        /// Numbers expected.
        expected: usize,
    },
    /// A pair names a point that does not exist.
    #[error("pair ({first}, {second}) names a point beyond the {points} there are")]
    Pair {
        /// First point.
        first: usize,
        /// Second point.
        second: usize,
        /// Number of points.
        points: usize,
    },
    /// A point has no coordinates.
    #[error("points of dimension 0")]
    Dimension,
}

/// One record as measured. Missing samples are NaN.
#[derive(Debug, Clone, Copy)]
pub struct RawRecord<'a> {
    /// Time stamps (s).
    pub time: &'a [f64],
    /// Measured points, row-major time × point × dimension (m).
    pub points: &'a [f64],
    /// Inputs, row-major time × input; for grippers their positions.
    pub inputs: &'a [f64],
}

/// Meaning of the columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Number of points.
    pub points: usize,
    /// Coordinates per point.
    pub dimension: usize,
    /// Number of input channels.
    pub inputs: usize,
    /// Pairs whose distance cannot exceed a fixed length (neighbours on a rope: the chord of an inextensible arc).
    pub chords: Vec<(usize, usize)>,
    /// Pairs whose distance is fixed (two markers on one body or in one clamp).
    pub rigid: Vec<(usize, usize)>,
    /// Vertical axis, for the static level; none to leave that out.
    pub vertical: Option<usize>,
}

impl Layout {
    /// Points in a row on one rope, in space, the last axis vertical: neighbours are chords, nothing is rigid.
    pub fn rope(points: usize, inputs: usize) -> Self {
        let chords = (1..points).map(|i| (i - 1, i)).collect();
        Self { points, dimension: 3, inputs, chords, rigid: Vec::new(), vertical: Some(2) }
    }

    pub(crate) fn check(&self) -> Result<(), AuditError> {
        if self.dimension == 0 {
            return Err(AuditError::Dimension);
        }
        match self.chords.iter().chain(&self.rigid).find(|p| p.0.max(p.1) >= self.points) {
            Some(&(first, second)) => Err(AuditError::Pair { first, second, points: self.points }),
            None => Ok(()),
        }
    }
}

/// A checked record with gaps filled by straight lines, and quantities that the checks share.
pub(crate) struct Prepared<'a> {
    pub index: usize,
    pub layout: &'a Layout,
    pub time: &'a [f64],
    pub points: Vec<f64>,
    pub inputs: Vec<f64>,
    /// Per channel: σ, and grid step (0 where none).
    pub sigma: Vec<f64>,
    pub quantum: Vec<f64>,
    /// (time, point) filled in, row-major; empty where nothing is missing.
    missing: Vec<bool>,
    /// Steps t → t+1 in which frames are missing: other checks look away there.
    pub lost: Vec<usize>,
}

impl<'a> Prepared<'a> {
    pub fn new(index: usize, raw: &RawRecord<'a>, layout: &'a Layout, out: &mut Vec<Finding>) -> Result<Self, AuditError> {
        let times = raw.time.len();
        let check = |what: &'static str, found: usize, expected: usize| {
            if found == expected { Ok(()) } else { Err(AuditError::Length { record: index, what, found, expected }) }
        };
        check("points", raw.points.len(), times * layout.points * layout.dimension)?;
        check("inputs", raw.inputs.len(), times * layout.inputs)?;
        let mut record = Self {
            index,
            layout,
            time: raw.time,
            points: raw.points.to_vec(),
            inputs: raw.inputs.to_vec(),
            sigma: Vec::new(),
            quantum: Vec::new(),
            missing: Vec::new(),
            lost: Vec::new(),
        };
        if raw.points.iter().any(|x| !x.is_finite()) {
            record.missing = raw.points.chunks_exact(layout.dimension).map(|p| p.iter().any(|x| !x.is_finite())).collect();
        }
        record.report_missing(out);
        fill_missing(&mut record.points, layout.points * layout.dimension);
        fill_missing(&mut record.inputs, layout.inputs);
        Ok(record)
    }

    pub fn set_noise(&mut self, noise: &RecordNoise) {
        self.sigma = noise.sigma.clone();
        self.quantum = noise.quantum.iter().map(|q| q.unwrap_or(0.0)).collect();
    }

    fn report_missing(&self, out: &mut Vec<Finding>) {
        for point in 0..self.layout.points {
            let missing: Vec<usize> =
                (0..self.times()).filter(|&t| self.point(t, point).iter().any(|x| !x.is_finite())).collect();
            let Some(&first) = missing.first() else { continue };
            let share = missing.len() as f64 / self.times() as f64;
            out.push(Finding {
                severity: if share > AUDIT.missing_faulty { Severity::Faulty } else { Severity::Warning },
                record: self.index,
                place: Place::Point(point),
                time_s: self.time.get(first).copied(),
                what: format!("{} of {} samples missing", missing.len(), self.times()),
                number: missing.len() as f64,
                unit: "samples",
                advice: "leave the missing samples out of the fit; do not interpolate them",
            });
        }
        for input in 0..self.layout.inputs {
            let missing = (0..self.times()).filter(|&t| !self.inputs[t * self.layout.inputs + input].is_finite()).count();
            if missing > 0 {
                out.push(Finding {
                    severity: Severity::Faulty,
                    record: self.index,
                    place: Place::Input(input),
                    time_s: None,
                    what: format!("{missing} samples of the input are missing"),
                    number: missing as f64,
                    unit: "samples",
                    advice: "the simulation needs every input: cut the record there or leave it out",
                });
            }
        }
    }

    pub fn times(&self) -> usize {
        self.time.len()
    }

    /// Coordinates of a point at a time.
    pub fn point(&self, t: usize, point: usize) -> &[f64] {
        let d = self.layout.dimension;
        let start = (t * self.layout.points + point) * d;
        &self.points[start..start + d]
    }

    /// Whether a point was missing within `reach` samples of t.
    pub fn missing_near(&self, t: usize, point: usize, reach: usize) -> bool {
        let n = self.layout.points;
        let mut around = t.saturating_sub(reach)..(t + reach + 1).min(self.times());
        !self.missing.is_empty() && around.any(|s| self.missing[s * n + point])
    }

    /// Distance of two points over time, at the samples where both were seen, with those samples.
    pub fn distances(&self, pair: (usize, usize)) -> (Vec<usize>, Vec<f64>) {
        let seen = (0..self.times()).filter(|&t| !self.missing_near(t, pair.0, 0) && !self.missing_near(t, pair.1, 0));
        seen.map(|t| (t, super::series::distance(self.point(t, pair.0), self.point(t, pair.1)))).unzip()
    }

    /// One point coordinate over time; channel = point · dimension + axis.
    pub fn channel(&self, channel: usize) -> Vec<f64> {
        let stride = self.layout.points * self.layout.dimension;
        self.points.iter().skip(channel).step_by(stride.max(1)).copied().collect()
    }

    pub fn input(&self, input: usize) -> Vec<f64> {
        self.inputs.iter().skip(input).step_by(self.layout.inputs.max(1)).copied().collect()
    }

    /// Time at a sample; NaN never leaves this place.
    pub fn at(&self, t: usize) -> Option<f64> {
        self.time.get(t).copied().filter(|x| x.is_finite())
    }

    /// Median sampling interval [s].
    pub fn interval(&self) -> f64 {
        median(&self.time.windows(2).map(|w| w[1] - w[0]).filter(|d| d.is_finite()).collect::<Vec<_>>())
    }

    /// Noise of a point: root mean square of its channels' σ (a grid's Δ/√12 included).
    pub fn point_sigma(&self, point: usize) -> f64 {
        let d = self.layout.dimension;
        let of = |c: usize| (self.sigma[c].powi(2) + self.quantum[c].powi(2) / 12.0).sqrt();
        super::series::rms(&(point * d..(point + 1) * d).map(of).collect::<Vec<_>>())
    }

    /// Whether frames are missing within `reach` samples of t.
    pub fn near_lost(&self, t: usize, reach: usize) -> bool {
        self.lost.iter().any(|&l| t + reach >= l && t <= l + 1 + reach)
    }
}

/// Straight lines across samples that are not finite; ends are held; a channel of nothing becomes zeros.
fn fill_missing(data: &mut [f64], channels: usize) {
    if channels == 0 || data.iter().all(|x| x.is_finite()) {
        return;
    }
    for c in 0..channels {
        let good: Vec<usize> = (0..data.len() / channels).filter(|t| data[t * channels + c].is_finite()).collect();
        for t in 0..data.len() / channels {
            if data[t * channels + c].is_finite() {
                continue;
            }
            let next = good.partition_point(|&g| g < t);
            let value = |i: usize| data[good[i] * channels + c];
            data[t * channels + c] = match (next.checked_sub(1), good.get(next)) {
                (Some(p), Some(&n)) => {
                    let share = (t - good[p]) as f64 / (n - good[p]) as f64;
                    value(p) + share * (value(next) - value(p))
                }
                (Some(p), None) => value(p),
                (None, Some(_)) => value(next),
                (None, None) => 0.0,
            };
        }
    }
}
