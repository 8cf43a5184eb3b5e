//! Nodes along a hanging parabola, at distances that match the rest edges.
//!
//! p(s) = from + s (to − from) + 4 sag s (1 − s) d,   s from 0 to 1, d the unit direction of hanging
//!
//! The nodes walk along it in straight strides λ l_e. With the sag left open it is chosen so that λ = 1: every edge starts at
//! rest length. With a given sag λ is chosen so that the last stride ends at `to`: all edges are strained alike. Strides that
//! cannot cross a parabola as narrow as themselves give way to nodes at proportional arc lengths.

use super::vector::{V3, add, dot, norm, scale, sub, unit};

/// Chords that measure the arc where strides do not fit.
const SAMPLES: usize = 2000;

#[derive(Clone, Copy)]
struct Parabola {
    from: V3,
    chord: V3,
    sag: f64,
    down: V3,
}

impl Parabola {
    fn point(&self, s: f64) -> V3 {
        add(add(self.from, scale(self.chord, s)), scale(self.down, 4.0 * self.sag * s * (1.0 - s)))
    }

    /// The parameter beyond `s` at which the straight distance from p(s) is `stride`.
    fn stride(&self, s: f64, stride: f64) -> f64 {
        let start = self.point(s);
        let distance = |t: f64| norm(sub(self.point(t), start));
        // Longer than the slowest way there; doubled until it is far enough, because the walk may lead past `to`.
        let mut low = s;
        let mut high = s + stride / (norm(self.chord) + 4.0 * self.sag).max(f64::MIN_POSITIVE);
        while distance(high) < stride && high - s < 1e6 {
            (low, high) = (high, s + 1.3 * (high - s));
        }
        bisect(low, high, |t| distance(t) - stride)
    }

    /// Parameters of all nodes for strides of λ l_e; the last one exceeds 1 if the rope is longer than its way.
    fn walk(&self, rest: &[f64], lambda: f64) -> Vec<f64> {
        let mut s = vec![0.0];
        for l in rest {
            s.push(self.stride(s[s.len() - 1], lambda * l));
        }
        s
    }

    /// Arc length from 0 to k/SAMPLES, for each k.
    fn arcs(&self) -> Vec<f64> {
        let point = |k: usize| self.point(k as f64 / SAMPLES as f64);
        let mut arcs = vec![0.0];
        for k in 0..SAMPLES {
            arcs.push(arcs[k] + norm(sub(point(k + 1), point(k))));
        }
        arcs
    }

    /// Parameters of nodes at arc lengths in proportion to the rest edges.
    fn along_the_arc(&self, rest: &[f64]) -> Vec<f64> {
        let arcs = self.arcs();
        let scale = arcs[SAMPLES] / rest.iter().sum::<f64>();
        let mut arc = 0.0;
        let others = rest.iter().map(|l| {
            arc += scale * l;
            let k = arcs.partition_point(|a| *a < arc).clamp(1, SAMPLES);
            let part = (arc - arcs[k - 1]) / (arcs[k] - arcs[k - 1]).max(f64::MIN_POSITIVE);
            (k as f64 - 1.0 + part) / SAMPLES as f64
        });
        std::iter::once(0.0).chain(others).collect()
    }
}

/// Root of an increasing function, to the last bit.
fn bisect(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        if f(middle) < 0.0 { low = middle } else { high = middle }
    }
}

/// Positions of the nodes between two points, for rest edges [m], gravity's direction, and a sag [m] or none.
/// Two points farther apart than the rope is long give a straight, evenly stretched rope.
pub(super) fn nodes_between(from: V3, to: V3, sag: Option<f64>, rest: &[f64], gravity: V3) -> Vec<V3> {
    let chord = sub(to, from);
    let length: f64 = rest.iter().sum();
    let slack = length > norm(chord) * (1.0 + 1e-12);
    let mut curve = Parabola { from, chord, sag: sag.unwrap_or(0.0), down: hanging(chord, gravity) };
    if curve.sag == 0.0 && (sag.is_some() || !slack) {
        let mut arc = 0.0;
        let rest_of = rest.iter().map(|l| {
            arc += l / length;
            curve.point(arc)
        });
        let mut points: Vec<V3> = std::iter::once(from).chain(rest_of).collect();
        points[rest.len()] = to;
        return points;
    }
    let overshoot = |s: &[f64]| s[s.len() - 1] - 1.0;
    let lambda = match sag {
        Some(sag) => {
            // A way of this length or more cannot be walked with smaller strides.
            let most = (norm(chord) + 4.0 * sag) / length;
            bisect(0.0, most, |lambda| overshoot(&curve.walk(rest, lambda)))
        }
        None => {
            let sag_of = |sag| Parabola { sag, ..curve };
            curve.sag = bisect(0.0, length, |sag| -overshoot(&sag_of(sag).walk(rest, 1.0)));
            1.0
        }
    };
    let mut s = curve.walk(rest, lambda);
    if overshoot(&s).abs() > 1e-9 {
        if sag.is_none() {
            curve.sag = bisect(0.0, length, |sag| Parabola { sag, ..curve }.arcs()[SAMPLES] - length);
        }
        s = curve.along_the_arc(rest);
    }
    let mut points: Vec<V3> = s.into_iter().map(|s| curve.point(s)).collect();
    points[rest.len()] = to;
    points
}

/// Where the middle hangs: along gravity, or across a chord that is almost parallel to it.
fn hanging(chord: V3, gravity: V3) -> V3 {
    let Some(axis) = unit(chord) else { return gravity };
    let across = sub(gravity, scale(axis, dot(gravity, axis)));
    if norm(across) > 0.1 {
        return gravity;
    }
    let least = if axis[0].abs() <= axis[1].abs() { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    unit(sub(least, scale(axis, dot(least, axis)))).unwrap_or(gravity)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DOWN: V3 = [0.0, 0.0, -1.0];

    fn edges(points: &[V3]) -> Vec<f64> {
        points.windows(2).map(|w| norm(sub(w[1], w[0]))).collect()
    }

    #[test]
    fn slack_edges_start_at_rest_length() {
        let rest = [0.1, 0.05, 0.15, 0.1, 0.1, 0.2, 0.1, 0.2];
        for to in [[0.7, 0.0, 0.0], [0.3, 0.1, 0.4], [0.2, 0.0, 0.0], [0.0, 0.0, 0.5], [0.5, 0.0, -0.5]] {
            let points = nodes_between([0.0; 3], to, None, &rest, DOWN);
            for (found, rest) in edges(&points).iter().zip(rest) {
                assert!((found - rest).abs() < 1e-9, "to {to:?}: {found} instead of {rest}");
            }
        }
    }

    #[test]
    fn a_given_sag_strains_all_edges_alike() {
        let rest = vec![0.1; 10];
        let points = nodes_between([0.0; 3], [0.9, 0.0, 0.0], Some(0.3), &rest, DOWN);
        assert!((points[5][2] + 0.3).abs() < 1e-9);
        let edges = edges(&points);
        assert!(edges.iter().all(|e| (e - edges[0]).abs() < 1e-9), "{edges:?}");
    }

    #[test]
    fn a_narrow_loop_is_divided_by_arc_length() {
        let points = nodes_between([0.0; 3], [0.02, 0.0, 0.0], None, &[0.1, 0.05, 0.15, 0.1, 0.1, 0.2, 0.1, 0.2], DOWN);
        let total: f64 = edges(&points).iter().sum();
        assert!(total > 0.9 && total < 1.0, "{total}");
        assert_eq!(points[8], [0.02, 0.0, 0.0]);
    }

    #[test]
    fn a_taut_rope_is_straight() {
        let points = nodes_between([0.0; 3], [1.1, 0.0, 0.0], None, &[0.25; 4], DOWN);
        assert!(edges(&points).iter().all(|e| (e - 0.275).abs() < 1e-12));
        assert!(points.iter().all(|p| p[2] == 0.0));
    }
}
