//! Pictures of ropes and cloth: measured against simulated, before and after.

use super::plot::{Frame, Point, range};
use crate::diagnose::Snapshot;
use crate::number::number;

/// Pictures at most.
const MOST: usize = 4;

/// A picture and its caption.
#[derive(Clone, Debug, serde::Serialize)]
pub(super) struct Figure {
    /// SVG; our own, with every text in it escaped.
    pub svg: minijinja::Value,
    /// Caption.
    pub caption: String,
}

impl Figure {
    pub(super) fn new(svg: String, caption: String) -> Self {
        Self { svg: minijinja::Value::from_safe_string(svg), caption }
    }
}

/// One picture per snapshot, all at the same scale.
pub(super) fn figures(snapshots: &[Snapshot]) -> Vec<Figure> {
    let shown = &snapshots[..snapshots.len().min(MOST)];
    let view = View::of(shown);
    let all: Vec<Point> =
        shown.iter().flat_map(|s| [&s.measured, &s.before, &s.after]).flat_map(|points| view.see(points)).collect();
    let frame = Frame::new(520.0, 340.0, range(all.iter().map(|p| p.0)), range(all.iter().map(|p| p.1))).equal();
    shown.iter().map(|snapshot| figure(snapshot, &view, &frame)).collect()
}

fn figure(snapshot: &Snapshot, view: &View, frame: &Frame) -> Figure {
    let body = frame.axes(&view.across, &view.up)
        + &frame.line("before", &view.see(&snapshot.before))
        + &frame.line("after", &view.see(&snapshot.after))
        + &frame.dots("measured", 4.0, &view.see(&snapshot.measured));
    let caption = format!("{}, t = {} s", snapshot.record, number(snapshot.time));
    Figure::new(frame.svg(&format!("Shape: {caption}"), &body), caption)
}

/// A direction to look from.
struct View {
    right: [f64; 3],
    upward: [f64; 3],
    across: String,
    up: String,
}

/// Height below which a shape lies flat, as a part of its width.
const FLAT: f64 = 0.02;
/// Ratio by which another view must show more of the change than the view from the side to replace it [-].
const CLEARER: f64 = 2.0;

impl View {
    /// From the side, where the shape is widest; if the change from before to after is much clearer from above, from there.
    fn of(snapshots: &[Snapshot]) -> Self {
        let points = || {
            snapshots
                .iter()
                .flat_map(|s| s.measured.iter().chain(&s.before).chain(&s.after))
                .filter(|p| p.iter().all(|c| c.is_finite()))
        };
        let n = points().count().max(1) as f64;
        let mean = [0, 1, 2].map(|a| points().map(|p| p[a]).sum::<f64>() / n);
        let cov = |a: usize, b: usize| points().map(|p| (p[a] - mean[a]) * (p[b] - mean[b])).sum::<f64>() / n;
        // Principal direction in the horizontal plane: tan 2φ = 2 c_xy/(c_xx − c_yy).
        let phi = 0.5 * (2.0 * cov(0, 1)).atan2(cov(0, 0) - cov(1, 1));
        let (s, c) = phi.sin_cos();
        let (along, beside) = ([c, s, 0.0], [-s, c, 0.0]);
        let change = |direction: [f64; 3]| {
            let pairs = snapshots.iter().flat_map(|s| s.before.iter().zip(&s.after));
            let squares = pairs.map(|(b, a)| (dot(a, &direction) - dot(b, &direction)).powi(2));
            squares.filter(|square| square.is_finite()).sum::<f64>()
        };
        let vertical = [0.0, 0.0, 1.0];
        let flat = cov(2, 2) < FLAT * FLAT * (cov(0, 0) + cov(1, 1));
        let clearer = change(along) + change(beside) > CLEARER * (change(along) + change(vertical));
        if flat || clearer {
            let up = name(phi + std::f64::consts::FRAC_PI_2) + ", seen from above";
            return Self { right: along, upward: beside, across: name(phi), up };
        }
        Self { right: along, upward: vertical, across: name(phi), up: "z [m]".into() }
    }

    fn see(&self, points: &[[f64; 3]]) -> Vec<Point> {
        points.iter().map(|p| (dot(p, &self.right), dot(p, &self.upward))).collect()
    }
}

/// Name of a horizontal direction, turned by `phi` from x towards y.
fn name(phi: f64) -> String {
    let (s, c) = phi.sin_cos();
    let sign = |v: f64| if v < 0.0 { "−" } else { "" };
    match () {
        () if s.abs() < 1e-2 => format!("{}x [m]", sign(c)),
        () if c.abs() < 1e-2 => format!("{}y [m]", sign(s)),
        () => format!("horizontal, {:.0}° from x to y [m]", phi.to_degrees()).replace('-', "−"),
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot(points: &[[f64; 3]]) -> Snapshot {
        Snapshot { record: "<run>".into(), time: 0.5, measured: points.to_vec(), ..Snapshot::default() }
    }

    #[test]
    fn a_flat_rope_is_seen_from_above() {
        let flat = snapshot(&[[0.0, 0.0, 0.1], [1.0, 0.3, 0.1001], [2.0, 0.1, 0.1]]);
        let view = View::of(&[flat]);
        assert!(view.upward[2] == 0.0 && view.up.ends_with("seen from above"));
    }

    #[test]
    fn a_hanging_rope_is_seen_from_the_side_where_it_is_widest() {
        let view = View::of(&[snapshot(&[[0.0, 0.0, 0.0], [1.0, 1.0, -1.0], [2.0, 2.0, 0.0]])]);
        assert!((view.right[0] - view.right[1]).abs() < 1e-12);
        assert_eq!(view.across, "horizontal, 45° from x to y [m]");
        assert_eq!(view.see(&[[0.0, 0.0, 3.0]]), [(0.0, 3.0)]);
    }

    #[test]
    fn a_change_to_the_side_is_seen_from_above() {
        let before = vec![[0.0, 0.0, 0.0], [1.0, 0.0, -1.0], [2.0, 0.0, 0.0]];
        let after = vec![[0.0, 0.0, 0.0], [1.0, 0.3, -1.0], [2.0, 0.0, 0.0]];
        let view = View::of(&[Snapshot { before, after, ..Snapshot::default() }]);
        assert!(view.up.ends_with("seen from above"));
        assert_eq!((name(0.0), name(-std::f64::consts::FRAC_PI_2)), ("x [m]".to_owned(), "−y [m]".to_owned()));
    }

    #[test]
    fn nothing_to_show_is_no_figure() {
        assert!(figures(&[]).is_empty());
        let figures = figures(&[snapshot(&[])]);
        assert!(figures[0].svg.to_string().contains("&lt;run&gt;"));
    }
}
