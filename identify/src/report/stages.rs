//! The error after each accepted cause, as bars.

use super::plot::escape;
use super::story::words;
use crate::diagnose::Stage;
use crate::number::quantity;
use std::fmt::Write;

const WIDTH: f64 = 760.0;
const ROW: f64 = 44.0;
const LEFT: f64 = 190.0;
const RIGHT: f64 = 90.0;

/// Two bars per stage (fitted and held out), and a line at the noise level `sigma` [m].
pub(super) fn bars(stages: &[Stage], sigma: f64, unit: &str) -> String {
    let errors = stages.iter().flat_map(|s| [s.rmse_fit, s.rmse_held_out]).filter(|e| e.is_finite());
    let longest = errors.fold(sigma.max(1e-12), f64::max);
    let length = |e: f64| if e.is_finite() { (WIDTH - LEFT - RIGHT) * e / longest } else { 0.0 };
    let height = ROW * stages.len() as f64 + 24.0;
    let mut out = format!(r#"<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="Error after each accepted cause">"#);
    for (k, stage) in stages.iter().enumerate() {
        let y = ROW * k as f64 + 4.0;
        let name = if k == 0 { words(&stage.name) } else { format!("+ {}", words(&stage.name)) };
        let _ =
            write!(out, r#"<text class="name" x="{}" y="{}" text-anchor="end">{}</text>"#, LEFT - 10.0, y + 22.0, escape(&name));
        for (class, error, y) in [("held", stage.rmse_held_out, y + 2.0), ("fit", stage.rmse_fit, y + 19.0)] {
            if error.is_finite() {
                let w = length(error);
                let _ = write!(out, r#"<rect class="{class}" x="{LEFT}" y="{y}" width="{w:.1}" height="15" rx="2"/>"#);
                let _ = write!(
                    out,
                    r#"<text class="tick" x="{:.1}" y="{}">{}</text>"#,
                    LEFT + w + 6.0,
                    y + 12.0,
                    quantity(error, unit)
                );
            }
        }
    }
    let (x, low) = (LEFT + length(sigma), height - 20.0);
    let _ = write!(out, r#"<line class="noise" x1="{x:.1}" x2="{x:.1}" y1="0" y2="{low}"/>"#);
    let _ = write!(
        out,
        r#"<text class="tick" x="{x:.1}" y="{}" text-anchor="middle">noise {}</text>"#,
        height - 6.0,
        quantity(sigma, unit)
    );
    out + "</svg>"
}
