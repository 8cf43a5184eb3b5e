//! Inputs between the samples of a log: straight lines, a cubic spline on the samples' own times, or the last sample.
//!
//! Between the samples at t₀ and t₁ = t₀ + d, with a = (t₁ − t)/d and b = (t − t₀)/d,
//! ```text
//! y(t) = a y₀ + b y₁ + ((a³ − a) m₀ + (b³ − b) m₁) d²/6
//! ```
//! where the second derivatives m of a straight line are zero. Those of the spline make its first derivative continuous at every sample
//! between the ends, and its third one at the second sample and the last but one (no knot there): the usual zero at the ends would bend a
//! curve that goes on, and leave there an error of second order.

use super::experiment::Interpolation;

/// One input over time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Curve<'a> {
    /// Times of the samples, increasing.
    time: &'a [f64],
    values: Vec<f64>,
    /// Second derivative at each sample.
    bends: Vec<f64>,
    held: bool,
}

impl<'a> Curve<'a> {
    /// Through these values; there is at least one.
    pub fn new(time: &'a [f64], values: Vec<f64>, interpolation: Interpolation) -> Self {
        let bends = match interpolation {
            Interpolation::Linear | Interpolation::Held => vec![0.0; values.len()],
            Interpolation::Smooth => bends(time, &values),
        };
        Self { time, values, bends, held: interpolation == Interpolation::Held }
    }

    /// Its value at a time; that of the nearest sample outside the log.
    pub fn at(&self, t: f64) -> f64 {
        let after = self.time.partition_point(|sample| *sample < t);
        if after == 0 {
            return self.values[0];
        }
        if after == self.time.len() {
            return self.values[after - 1];
        }
        if self.held {
            return self.values[after - 1];
        }
        let (t0, t1) = (self.time[after - 1], self.time[after]);
        let b = (t - t0) / (t1 - t0);
        let a = 1.0 - b;
        let bend = (a * a * a - a) * self.bends[after - 1] + (b * b * b - b) * self.bends[after];
        a * self.values[after - 1] + b * self.values[after] + bend * (t1 - t0) * (t1 - t0) / 6.0
    }
}

/// Second derivatives of the spline at its samples: of two the line through them, of three the parabola.
fn bends(time: &[f64], values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let d: Vec<f64> = time.windows(2).map(|t| t[1] - t[0]).collect();
    let slopes: Vec<f64> = values.windows(2).zip(&d).map(|(y, d)| (y[1] - y[0]) / d).collect();
    match n {
        0..=2 => return vec![0.0; n],
        3 => return vec![2.0 * (slopes[1] - slopes[0]) / (d[0] + d[1]); 3],
        _ => {}
    }
    // one row (before, own, after, right side) for every sample between the ends
    let row = |k: usize| [d[k - 1], 2.0 * (d[k - 1] + d[k]), d[k], 6.0 * (slopes[k] - slopes[k - 1])];
    let mut rows: Vec<[f64; 4]> = (1..n - 1).map(row).collect();
    // without a knot, the bend at an end continues the line through those at the two samples next to it
    let (first, last) = (d[0] / d[1], d[n - 2] / d[n - 3]);
    rows[0][1] += d[0] * (1.0 + first);
    rows[0][2] -= d[0] * first;
    rows[n - 3][1] += d[n - 2] * (1.0 + last);
    rows[n - 3][0] -= d[n - 2] * last;
    let inner = solved(rows);
    let line = |near: f64, far: f64, ratio: f64| near + ratio * (near - far);
    let begin = line(inner[0], inner[1], first);
    let end = line(inner[n - 3], inner[n - 4], last);
    std::iter::once(begin).chain(inner).chain([end]).collect()
}

/// The solution of a tridiagonal system by elimination. Each row's own entry exceeds the sum of the others, so that none is exchanged.
fn solved(mut rows: Vec<[f64; 4]>) -> Vec<f64> {
    for k in 1..rows.len() {
        let [_, own, after, right] = rows[k - 1];
        let factor = rows[k][0] / own;
        rows[k][1] -= factor * after;
        rows[k][3] -= factor * right;
    }
    let mut out = vec![0.0; rows.len()];
    let mut next = 0.0;
    for (k, [_, own, after, right]) in rows.iter().enumerate().rev() {
        // the last row has nothing after it: its entry there has gone into the others
        let after = if k + 1 == rows.len() { 0.0 } else { *after };
        next = (right - after * next) / own;
        out[k] = next;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn smooth(time: &[f64], y: impl Fn(f64) -> f64) -> Curve<'_> {
        Curve::new(time, time.iter().map(|t| y(*t)).collect(), Interpolation::Smooth)
    }

    /// Largest error between the samples.
    fn error(curve: &Curve, y: impl Fn(f64) -> f64) -> f64 {
        let last = curve.time[curve.time.len() - 1];
        (0..=5000).map(|k| last * f64::from(k) / 5000.0).map(|t| (curve.at(t) - y(t)).abs()).fold(0.0, f64::max)
    }

    /// `n` intervals over two seconds, uneven by this part.
    fn stamps(n: usize, uneven: f64) -> Vec<f64> {
        let stamp =
            |k: usize| (k as f64 + if k == 0 || k == n { 0.0 } else { uneven * (k as f64 * 2.399).sin() }) * 2.0 / n as f64;
        (0..=n).map(stamp).collect()
    }

    #[test]
    fn a_sine_is_read_with_an_error_of_fourth_order() {
        let sine = |t: f64| (5.0 * t + 0.3).sin();
        for uneven in [0.0, 0.3] {
            let errors = [20, 40, 80].map(|n| error(&smooth(&stamps(n, uneven), sine), sine));
            for pair in errors.windows(2) {
                let order = (pair[0] / pair[1]).log2();
                assert!((3.5..4.8).contains(&order), "order {order}, errors {errors:?}");
            }
            let time = stamps(80, uneven);
            let straight = Curve::new(&time, time.iter().map(|t| sine(*t)).collect(), Interpolation::Linear);
            assert!(errors[2] < 0.02 * error(&straight, sine), "{errors:?}");
        }
    }

    #[test]
    fn lines_and_cubics_stay_what_they_are() {
        let cubic = |t: f64| 1.0 - 2.0 * t + 3.0 * t * t - 0.7 * t * t * t;
        for n in [3, 4, 5, 40] {
            let time = stamps(n, 0.4);
            assert!(error(&smooth(&time, |t| 2.0 - 3.0 * t), |t| 2.0 - 3.0 * t) < 1e-13);
            assert!(error(&smooth(&time, cubic), cubic) < 1e-12);
        }
    }

    #[test]
    fn few_samples_give_a_line_or_a_parabola() {
        let parabola = |t: f64| 1.0 + t - 2.0 * t * t;
        assert!(error(&smooth(&[0.0, 0.3, 1.0], parabola), parabola) < 1e-14);
        assert_eq!(smooth(&[0.0, 1.0], parabola).at(0.25), 0.75);
        assert_eq!(smooth(&[0.0], parabola).at(0.4), 1.0);
    }

    #[test]
    fn a_curve_is_held_outside_the_log_and_meets_its_samples() {
        let time = stamps(10, 0.3);
        let curve = smooth(&time, f64::exp);
        assert_eq!((curve.at(-1.0), curve.at(3.0)), (1.0, 2f64.exp()));
        assert!(time.iter().all(|t| (curve.at(*t) - t.exp()).abs() < 1e-14));
    }
}
