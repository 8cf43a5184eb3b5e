//! Likely cause and fix of each mistake.

use super::error::{LogMistake as M, Need};
use crate::number::four_digits;
use pliant_scene::words::Num;

/// (likely cause, fix).
pub(super) fn advice(mistake: &M) -> (String, String) {
    of_the_experiment(mistake).or_else(|| of_the_values(mistake)).unwrap_or_else(|| of_the_file(mistake))
}

fn of_the_experiment(mistake: &M) -> Option<(String, String)> {
    Some(match mistake {
        M::NoExperiment => {
            both("the scene was written for simulation", "add an [experiment] with `time`, markers, inputs and records")
        }
        M::NoNode { count, .. } => both(
            "nodes are counted from 0; node (i, j) of a grid of cloth has the number i · nodes[1] + j, and a vertex of a file its number \
             less one",
            format!("write a number from 0 to {}, or a negative one to count from the end", count.saturating_sub(1)),
        ),
        M::Unmarked { .. } => both(
            "the cloth was marked in some places only, and between markers nobody knows how it is folded",
            "write `initial = \"measured\"`, which estimates where it begins, or \"rest\"; or add a marker at every node that no gripper holds",
        ),
        M::NoRecord => both("no log was named", "add a [[experiment.record]], or give `--log FILE`"),
        M::NoMarker { bodies: false } => both(
            "the mapping from log to nodes is missing",
            "add a [[experiment.marker]] with `rope` or `cloth`, `node` and `columns`",
        ),
        M::NoMarker { bodies: true } => both(
            "the mapping from log to joints and bodies is missing",
            "add a [[experiment.joint]] with `joint` and `column`, or a [[experiment.marker]] with `body` and `columns`",
        ),
        M::Misplaced { key, .. } => both("an entry was copied from another object", format!("remove `{key}`")),
        M::TwoSensors { .. } => both("an entry was copied and not changed", "keep one, or correct `joint` or `measures`"),
        M::ShapedTorque { .. } => both(
            "torque readings are modelled for plain motors",
            "measure position or velocity instead, or remove delay, lag, saturation and delta_scale from the motor",
        ),
        M::NoTorque { joint } => both(
            "the log's torque is an input of the simulation, or the actuator is missing",
            format!(
                "add an [[actuator]] with `joint = \"{joint}\"` and read the torque by an [[experiment.input]], or remove the sensor"
            ),
        ),
        M::OrientationColumns { .. } => both("a column was left out", "list four or three columns"),
        M::OnlyCsv => both("the log was saved by another program", "save each record as a CSV file with a header"),
        M::OneOf { keys, given: 0 } => both("a key was left out", format!("give one of {keys}")),
        M::OneOf { keys, .. } => both("they exclude each other", format!("keep one of {keys}")),
        M::Unknown { nearest: Some(nearest), .. } => both("a typing error", format!("did you mean \"{nearest}\"?")),
        M::Unknown { kind, known, .. } => both("it was renamed or removed", format!("name one of the known {kind}s: {known}")),
        M::NoInput { kind, name } => both(
            if *kind == "gripper" { "its motion was not mapped" } else { "its commands were not mapped" },
            format!("add an [[experiment.input]] with `{kind} = \"{name}\"`"),
        ),
        M::TwoInputs { kind, .. } => both("an entry was copied and not renamed", format!("keep one entry per {kind}")),
        M::InputCount { kind, needed, what, .. } => {
            let needed = if *what == "points" { needed / 3 } else { *needed };
            both(
                format!("an input was left out, or belongs to another {kind}"),
                format!("list {needed} {what}, in the order of the inputs"),
            )
        }
        M::Range { low, high, unit, .. } => {
            both("a wrong unit or sign", format!("write a number between {} and {} {unit}", Num(*low), Num(*high)))
        }
        M::TiedSensor { each, .. } => both("a pattern meant for nodes of a rope", format!("free them one by one: {each}")),
        M::FreeTwice { .. } => both("an entry was copied, or a pattern with `*` covers it", "keep one entry per parameter"),
        M::Unphysical { low, high, .. } => {
            both("a sign error, or bounds of another quantity", format!("write bounds from {} to {}", Num(*low), Num(*high)))
        }
        M::Outside { .. } => both(
            "the bounds or the scene's value are in another unit",
            "widen the bounds, or change the value in the scene: the fit starts there",
        ),
        M::NothingFree => both(
            "the experiment was written for `diagnose` alone",
            "add e.g. `free = [{ path = \"cable.bend_stiffness\", lower = 1e-5, upper = 0.1 }]` to [experiment.fit]",
        ),
        M::AllHeldOut => both(
            "`role = \"held_out\"` was copied to all of them",
            "write `role = \"fit\"` for at least one, or leave all roles out: every fourth is then held out",
        ),
        M::Bounds { .. } => both("they were exchanged", "write the smaller number as `lower`"),
        _ => return None,
    })
}

fn of_the_values(mistake: &M) -> Option<(String, String)> {
    Some(match mistake {
        M::NotANumber { found } if found.replace(',', ".").parse::<f64>().is_ok() => both(
            "the log was saved with decimal commas",
            "save it with decimal points (in a file whose cells are parted by `;` or tabs: replace every `,` by `.`)",
        ),
        M::NotANumber { .. } => both("a unit or a word in the cell", "write the number alone, with a decimal point"),
        M::Missing { of: Need::Clock, .. } => both("a lost row", "remove the row: a sample without time cannot be used"),
        M::Missing { of: Need::Input, .. } => both(
            "a lost sample; inputs drive the simulation and cannot be missing",
            "write the command that was in force into the cell, or end the record before this row",
        ),
        M::Missing { of: Need::Reading | Need::HiddenReading, .. } => {
            both("a lost sample", "write `may_be_missing = true` for this sensor, or cut the record there")
        }
        M::Quaternion { .. } => {
            both("the columns are in another order, or hold something else", "list the columns of w, x, y, z")
        }
        M::Angles { unit: "rad", limits, .. } => both(
            match limits {
                Some(limits) => format!("the log is in degrees; the joint's limits are {} rad apart", four_digits(*limits)),
                None => "the log is in degrees".to_owned(),
            },
            "write `angle_unit = \"deg\"` for this sensor, or correct the joint's limits",
        ),
        M::Angles { .. } => both("the log is in mm", "write `unit = \"mm\"` for this sensor, or correct the joint's limits"),
        M::Missing { .. } => {
            both("a hidden marker or a lost sample", "write `may_be_missing = true` for this marker, or cut the record there")
        }
        M::Clock { reversed: true, .. } => {
            both("the rows are in reverse order, the last sample first", "reverse the order of the rows below the header")
        }
        M::Clock { before, after, .. } if after == before => both("a sample was logged twice", "remove one of the two rows"),
        M::Clock { .. } => both(
            "two recordings in one file, a clock that was set, or rows out of order",
            "split the file where the clock restarts, or sort its rows",
        ),
        M::TooFew { found, needed } => both(
            if *found == 0 { "nothing was recorded: the file has a header and no rows" } else { "the recording stopped early" },
            format!("record at least {needed} samples, or leave this record out"),
        ),
        M::TooShort { key, .. } => {
            both("the recording stopped early", format!("record longer, leave this record out, or shorten {key}"))
        }
        M::Period { period, step, .. } => {
            let steps = (period / step).ceil().max(1.0);
            let fits = format!("{:.3e}", period / steps).parse::<f64>().unwrap_or(period / steps);
            both(
                "log and scene were set up for different rates, or `time.unit` is wrong",
                format!("write `step = {fits}` in [time]"),
            )
        }
        M::ClockUnit { ratio, .. } if *ratio < 1.0 => {
            both("the clock is not in the unit that `time.unit` says", "write `unit = \"s\"` (or \"ms\") in `time`")
        }
        M::ClockUnit { .. } => {
            both("the clock is not in the unit that `time.unit` says", "write `unit = \"ms\"` (or \"us\") in `time`")
        }
        M::Extent { extent, length } if extent > length => both(
            "markers or inputs are in another unit than `unit` says, e.g. mm",
            "write `unit = \"mm\"` for those that are in mm, or correct the size of ropes and cloth",
        ),
        M::Extent { .. } => {
            both("the log is in m, not mm", "write `unit = \"m\"` for the markers, or correct the size of ropes and cloth")
        }
        _ => return None,
    })
}

fn of_the_file(mistake: &M) -> (String, String) {
    match mistake {
        M::Read { .. } => {
            both("the path is wrong, or the file is damaged", "check the path; in a scene it is relative to the scene's folder")
        }
        M::Empty => both("the recording did not begin, or another file was meant", "record again, or leave this file out"),
        M::Kind => both(
            "another format",
            "`python -m pliant.logs` writes CSV files of MCAP, ROS bags, Parquet, HDF5 and arrays (docs/logs.md)",
        ),
        M::Mapping { key, kind } => both(
            "the mapping was written for the other kind of file",
            format!("add `{key}`, or name a file of the other kind (this one is {kind})"),
        ),
        M::NoColumn { nearest: Some(nearest), known, .. } => {
            both("a typing error", format!("did you mean \"{nearest}\"? The file has {known}"))
        }
        M::NoColumn { known, .. } => both("the log was made by another program", format!("name one of {known}")),
        M::TwoColumns { .. } => both("columns were joined from two files", "rename one of them in the file"),
        M::Ragged { found, expected } if *found == 2 * expected => both(
            "decimal commas in a file whose cells are parted by commas",
            "save the log with decimal points, or with `;` between the cells",
        ),
        M::Ragged { .. } => both("the row was cut off, or has a comma too many", "correct or remove the row"),
        M::SameRecord { .. } => both(
            "a file was listed twice, given by `--log` again, or copied under another name",
            "keep one of the two: what is fitted cannot also be held out, and nothing counts twice",
        ),
        M::NoArray { nearest: Some(nearest), known, .. } => {
            both("a typing error", format!("did you mean \"{nearest}\"? The file has {known}"))
        }
        M::NoArray { known, .. } => both("the log was made by another program", format!("name one of {known}")),
        M::WhichArray { .. } => both("the file holds several arrays", "write `array = \"…\"` in the [[experiment.record]]"),
        M::Type { .. } => both("integers, texts or objects were saved", "save with numpy as float64"),
        M::Shape { .. } => both("axes were exchanged or joined", "reshape the array before saving it"),
        M::NoPoint { count, .. } => {
            both("indices are counted from 0", format!("write an index from 0 to {}", count.saturating_sub(1)))
        }
        M::Disagree { .. } => both("arrays of different recordings", "save arrays that belong together with equal lengths"),
        _ => both("unknown", "compare with `pliant schema`"),
    }
}

fn both(cause: impl Into<String>, fix: impl Into<String>) -> (String, String) {
    (cause.into(), fix.into())
}
