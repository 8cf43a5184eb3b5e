//! Fixes for logs that cannot be read while there is no scene yet: in the log, its names and the model.

use super::super::failure::Failure;
use super::log::Log;
use pliant::identify::log::{LogError, LogMistake};

/// The same error with a fix that needs no scene, where its own would be a key of one.
pub fn before_the_scene(error: LogError, logs: &[Log]) -> Failure {
    let LogError::Log(refused) = &error else { return error.into() };
    let clock = &logs[0].header[logs[0].clock];
    let (cause, fix) = match refused.mistake.as_ref() {
        LogMistake::Angles { unit, limits, .. } => {
            let (other, ending) = if *unit == "rad" { ("degrees", "deg") } else { ("mm", "mm") };
            let column = refused.place.field.trim_start_matches("column ");
            let name = column.trim_end_matches("_rad").trim_end_matches("_m");
            let limits = if limits.is_some() { ", or correct the joint's limits in the model" } else { "" };
            (
                if other == "mm" {
                    "the log is in mm, and the column's name does not say so"
                } else {
                    "the log is in degrees, and the column's name does not say so"
                },
                format!("if it is in {other}, rename the column `{name}_{ending}`{limits}"),
            )
        }
        LogMistake::ClockUnit { ratio, .. } => {
            let word = if *ratio < 1.0 { "`time_s` or `time_ms`" } else { "`time_ms`, `time_us` or `time_ns`" };
            ("the clock is in another unit than its name says", format!("rename the column `{clock}` after its unit: {word}"))
        }
        LogMistake::Period { .. } => {
            let step = refused.to_string();
            let step = step.rsplit("fix: ").next().unwrap_or("").to_owned();
            ("the log and the model's step are of different rates", format!("{step} of the model"))
        }
        LogMistake::TooShort { .. } => (
            "the recording stopped early, or the clock is in another unit than its name says",
            format!("record longer, leave this log out, or rename the column `{clock}` after its unit (`time_s`, `time_ms`)"),
        ),
        _ => return error.into(),
    };
    Failure::Init { place: refused.place.to_string(), what: refused.mistake.to_string(), cause, fix }
}
