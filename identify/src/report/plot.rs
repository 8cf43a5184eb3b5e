//! Drawing axes, lines and dots as SVG. Colours are CSS classes, so that the page decides them for light and dark.

use crate::number::number;
use std::fmt::Write;

/// A point to draw; not drawn unless finite.
pub(super) type Point = (f64, f64);

/// A plot: its size and margins in pixels, and the ranges its axes show.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub width: f64,
    pub height: f64,
    pub left: f64,
    pub bottom: f64,
    pub x: (f64, f64),
    pub y: (f64, f64),
}

const TOP: f64 = 10.0;
const RIGHT: f64 = 12.0;
/// Points of a line beyond which some are left out.
const MOST_POINTS: usize = 700;

impl Frame {
    /// A frame of a size whose axes show these ranges.
    pub(super) fn new(width: f64, height: f64, x: (f64, f64), y: (f64, f64)) -> Self {
        Self { width, height, left: 52.0, bottom: 38.0, x: wide(x), y: wide(y) }
    }

    /// Widens one range so that both axes have the same scale.
    pub(super) fn equal(mut self) -> Self {
        let (w, h) = (self.width - self.left - RIGHT, self.height - TOP - self.bottom);
        let scale = ((self.x.1 - self.x.0) / w).max((self.y.1 - self.y.0) / h);
        let around = |(low, high): (f64, f64), size: f64| {
            let middle = f64::midpoint(low, high);
            (middle - 0.5 * scale * size, middle + 0.5 * scale * size)
        };
        (self.x, self.y) = (around(self.x, w), around(self.y, h));
        self
    }

    fn at(&self, (x, y): Point) -> Point {
        let (w, h) = (self.width - self.left - RIGHT, self.height - TOP - self.bottom);
        let part = |v: f64, (low, high): (f64, f64)| (v - low) / (high - low);
        (self.left + w * part(x, self.x), TOP + h * (1.0 - part(y, self.y)))
    }

    /// Grid, numbers and names of both axes.
    pub(super) fn axes(&self, x_name: &str, y_name: &str) -> String {
        let mut out = String::new();
        for x in ticks(self.x, 6) {
            let (px, low) = self.at((x, self.y.0));
            let _ = write!(out, r#"<line class="grid" x1="{px:.1}" x2="{px:.1}" y1="{TOP}" y2="{low:.1}"/>"#);
            let _ =
                write!(out, r#"<text class="tick" x="{px:.1}" y="{:.1}" text-anchor="middle">{}</text>"#, low + 15.0, number(x));
        }
        for y in ticks(self.y, 5) {
            let (left, py) = self.at((self.x.0, y));
            let right = self.width - RIGHT;
            let _ = write!(out, r#"<line class="grid" x1="{left:.1}" x2="{right:.1}" y1="{py:.1}" y2="{py:.1}"/>"#);
            let _ = write!(
                out,
                r#"<text class="tick" x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"#,
                left - 6.0,
                py + 4.0,
                number(y)
            );
        }
        let middle = f64::midpoint(self.left, self.width - RIGHT);
        let _ = write!(
            out,
            r#"<text class="axis" x="{middle:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
            self.height - 5.0,
            escape(x_name)
        );
        let middle = f64::midpoint(TOP, self.height - self.bottom);
        let _ = write!(
            out,
            r#"<text class="axis" transform="translate(12 {middle:.1}) rotate(-90)" text-anchor="middle">{}</text>"#,
            escape(y_name)
        );
        out
    }

    /// A line through points, broken where one is not finite.
    pub(super) fn line(&self, class: &str, points: &[Point]) -> String {
        let stride = points.len().div_ceil(MOST_POINTS).max(1);
        let mut path = String::new();
        let mut pen = 'M';
        for (k, &point) in points.iter().enumerate() {
            if !(point.0.is_finite() && point.1.is_finite()) {
                pen = 'M';
            } else if k % stride == 0 || k + 1 == points.len() || pen == 'M' {
                let (x, y) = self.at(point);
                let _ = write!(path, "{pen}{x:.1} {y:.1}");
                pen = 'L';
            }
        }
        format!(r#"<path class="{class}" d="{path}"/>"#)
    }

    /// A dot at each finite point.
    pub(super) fn dots(&self, class: &str, radius: f64, points: &[Point]) -> String {
        let stride = points.len().div_ceil(MOST_POINTS).max(1);
        let mut out = format!(r#"<g class="{class}">"#);
        for &point in points.iter().step_by(stride).filter(|p| p.0.is_finite() && p.1.is_finite()) {
            let (x, y) = self.at(point);
            let _ = write!(out, r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}"/>"#);
        }
        out + "</g>"
    }

    /// The whole picture; `label` is the text for screen readers.
    pub(super) fn svg(&self, label: &str, body: &str) -> String {
        format!(r#"<svg viewBox="0 0 {} {}" role="img" aria-label="{}">{body}</svg>"#, self.width, self.height, escape(label))
    }
}

/// Range of all finite numbers, with a margin; (0, 1) if there are none.
pub(super) fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        values.filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    let margin = 0.05 * (high - low);
    (low - margin, high + margin)
}

/// A range that is not empty.
fn wide((low, high): (f64, f64)) -> (f64, f64) {
    let least = 1e-9 * low.abs().max(high.abs()).max(1e-6);
    if high - low > least { (low, high) } else { (low - 0.5 * low.abs().max(1e-6), high + 0.5 * high.abs().max(1e-6)) }
}

/// About `count` round numbers (1, 2 or 5 times a power of ten apart) within a range.
fn ticks((low, high): (f64, f64), count: u32) -> Vec<f64> {
    let raw = (high - low) / f64::from(count);
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|step| *step >= raw).unwrap_or(raw);
    let first = (low / step).ceil() as i64;
    // Counted in whole steps, so that zero is exactly zero.
    (first..).map(|k| k as f64 * step).take_while(|t| *t <= high + 1e-9 * step).take(20).collect()
}

/// Text inside SVG or HTML.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&#39;",
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        assert_eq!(ticks((-0.05, 1.0), 5), [0.0, 0.5, 1.0]);
        assert_eq!(ticks((0.0, 2.5), 5), [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]);
        assert!(ticks(wide((3.0, 3.0)), 5).len() > 1 && ticks(wide((0.0, 0.0)), 5).len() > 1);
    }

    #[test]
    fn a_line_is_broken_where_a_sample_is_missing() {
        let frame = Frame::new(100.0, 100.0, (0.0, 3.0), (0.0, 1.0));
        let points = [(0.0, 0.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, 1.0)];
        assert_eq!(frame.line("after", &points).matches('M').count(), 2);
        assert_eq!(frame.dots("measured", 1.0, &points).matches("<circle").count(), 3);
        let many: Vec<Point> = (0..5000).map(|k| (3.0 * f64::from(k) / 5000.0, 0.5)).collect();
        assert!(frame.line("after", &many).matches('L').count() <= MOST_POINTS + 1);
    }

    #[test]
    fn equal_axes_have_one_scale() {
        let frame = Frame::new(464.0, 248.0, (0.0, 1.0), (0.0, 0.1)).equal();
        assert!(((frame.x.1 - frame.x.0) / (frame.y.1 - frame.y.0) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn names_are_escaped() {
        let frame = Frame::new(100.0, 100.0, (0.0, 1.0), (0.0, 1.0));
        assert!(!frame.svg("<b>\"", &frame.axes("<i>", "&")).contains("<i>"));
        assert!(range([f64::NAN].into_iter()) == (0.0, 1.0));
    }
}
