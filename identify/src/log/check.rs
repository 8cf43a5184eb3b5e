//! Refusing experiments that do not fit the scene, and records that cannot be used.

use super::constants::LOG;
use super::error::{LogError, LogMistake};
use super::experiment::{Beginning, Experiment, LEAD_IN, Marker};
use super::joint_sensor::check_angles;
use super::record::Record;
use super::setup::{Setup, suggestion};
use pliant_scene::{Clamp, Place, words};
use std::f64::consts::PI;

/// Checks the experiment against the scene.
pub(super) fn check_experiment(setup: &Setup) -> Result<(), LogError> {
    let experiment = &setup.experiment;
    let check = Check { setup };
    let clock = &experiment.time;
    let given = usize::from(clock.column.is_some()) + usize::from(clock.array.is_some()) + usize::from(clock.rate.is_some());
    check.one_of("experiment.time", "`column`, `array`, `rate`", given)?;
    check.range("experiment.time.rate", clock.rate.unwrap_or(1.0), 1e-3, 1e7, "Hz")?;
    check.range("experiment.noise_floor", experiment.noise_floor, 1e-12, 1.0, "m")?;
    check.range("experiment.lead_in", experiment.lead_in.unwrap_or(0.0), 0.0, 1e6, "s")?;
    check.range("experiment.fit.segment", experiment.fit.segment.unwrap_or(1.0), setup.scene.time.step, 1e6, "s")?;
    if experiment.marker.is_empty() && experiment.joint.is_empty() && experiment.orientation.is_empty() {
        return check
            .refuse("experiment", LogMistake::NoMarker { bodies: setup.scene.rope.is_empty() && setup.scene.cloth.is_empty() });
    }
    experiment.marker.iter().enumerate().try_for_each(|(k, marker)| check.marker(k, marker))?;
    check.marked(experiment)?;
    check.joint_sensors(experiment)?;
    check.orientations(experiment)?;
    check.sensor(experiment)?;
    check.inputs(experiment)?;
    check.free(experiment)
}

pub(super) struct Check<'a> {
    pub(super) setup: &'a Setup,
}

impl Check<'_> {
    pub(super) fn refuse<T>(&self, field: &str, mistake: LogMistake) -> Result<T, LogError> {
        Err(LogError::new(self.setup.source.place(field), mistake))
    }

    fn one_of(&self, field: &str, keys: &'static str, given: usize) -> Result<(), LogError> {
        if given == 1 { Ok(()) } else { self.refuse(field, LogMistake::OneOf { keys, given }) }
    }

    pub(super) fn range(&self, field: &str, value: f64, low: f64, high: f64, unit: &'static str) -> Result<(), LogError> {
        if (low..=high).contains(&value) { Ok(()) } else { self.refuse(field, LogMistake::Range { value, low, high, unit }) }
    }

    pub(super) fn unknown<T>(&self, field: &str, kind: &'static str, name: &str, known: &[&str]) -> Result<T, LogError> {
        let (nearest, known) = suggestion(name, known);
        self.refuse(field, LogMistake::Unknown { kind, name: name.to_owned(), nearest, known })
    }

    fn marker(&self, k: usize, marker: &Marker) -> Result<(), LogError> {
        let at = |key: &str| format!("experiment.marker[{k}].{key}");
        let scene = &self.setup.scene;
        let item = format!("experiment.marker[{k}]");
        let on = [marker.rope.is_some(), marker.cloth.is_some(), marker.body.is_some()];
        self.one_of(&item, "`rope`, `cloth`, `body`", on.into_iter().map(usize::from).sum())?;
        self.one_of(&item, "`columns`, `index`", usize::from(marker.columns.is_some()) + usize::from(marker.index.is_some()))?;
        if let Some(body) = &marker.body {
            return self.body_marker(&item, body, marker);
        }
        if marker.point.is_some() {
            return self.refuse(&at("point"), LogMistake::Misplaced { key: "point", owner: "markers on bodies" });
        }
        if let Some(cloth) = &marker.cloth {
            return self.cloth_marker(&item, cloth, marker);
        }
        let name = marker.rope.as_deref().unwrap_or("");
        let Some(rope) = scene.rope.iter().find(|rope| rope.name == name) else {
            let names: Vec<&str> = scene.rope.iter().map(|rope| rope.name.as_str()).collect();
            return self.unknown(&at("rope"), "rope", name, &names);
        };
        self.one_of(&item, "`node`, `arc`", usize::from(marker.node.is_some()) + usize::from(marker.arc.is_some()))?;
        self.range(&at("arc"), marker.arc.unwrap_or(0.0), 0.0, rope.length, "m")?;
        if let Some(node) = marker.node.filter(|node| rope.node(*node).is_none()) {
            let (name, count) = (name.to_owned(), rope.n_nodes());
            return self.refuse(&at("node"), LogMistake::NoNode { kind: "rope", name, node, count });
        }
        if marker.offset.is_some() && rope.twist.is_none() {
            return self.refuse(&at("offset"), LogMistake::Misplaced { key: "offset", owner: "markers on ropes that twist" });
        }
        let offset = marker.offset.unwrap_or_default().into_iter().enumerate();
        offset.into_iter().try_for_each(|(a, x)| self.range(&at(&format!("offset[{a}]")), x, -rope.length, rope.length, "m"))
    }

    fn cloth_marker(&self, item: &str, name: &str, marker: &Marker) -> Result<(), LogError> {
        let cloths = &self.setup.scene.cloth;
        let Some(cloth) = cloths.iter().find(|cloth| cloth.name == name) else {
            let names: Vec<&str> = cloths.iter().map(|cloth| cloth.name.as_str()).collect();
            return self.unknown(&format!("{item}.cloth"), "cloth", name, &names);
        };
        let keys = [
            ("arc", marker.arc.is_some(), "markers on ropes"),
            ("offset", marker.offset.is_some(), "markers on ropes that twist"),
        ];
        if let Some((key, _, owner)) = keys.into_iter().find(|(_, given, _)| *given) {
            return self.refuse(&format!("{item}.{key}"), LogMistake::Misplaced { key, owner });
        }
        self.one_of(item, "`node`", usize::from(marker.node.is_some()))?;
        match marker.node.filter(|node| cloth.node(*node).is_none()) {
            Some(node) => {
                let (name, count) = (name.to_owned(), cloth.n_nodes());
                self.refuse(&format!("{item}.node"), LogMistake::NoNode { kind: "cloth", name, node, count })
            }
            None => Ok(()),
        }
    }

    /// A cloth that begins as the data have it has a marker at every free node: of a sheet a few points say too little for a start that
    /// nothing corrects.
    fn marked(&self, experiment: &Experiment) -> Result<(), LogError> {
        if experiment.initial != Beginning::Given {
            return Ok(());
        }
        for cloth in &self.setup.scene.cloth {
            let of = |name: &Option<String>| name.as_ref() == Some(&cloth.name);
            let marked = experiment.marker.iter().filter(|marker| of(&marker.cloth)).filter_map(|marker| marker.node);
            let clamps = self.setup.scene.gripper.iter().filter(|gripper| of(&gripper.cloth)).map(|gripper| &gripper.clamp);
            let held =
                clamps.filter_map(|clamp| if let Clamp::Nodes(nodes) = clamp { Some(nodes) } else { None }).flatten().copied();
            let known: Vec<usize> = marked.chain(held).filter_map(|number| cloth.node(number)).collect();
            if let Some(node) = (0..cloth.n_nodes()).find(|node| !known.contains(node)) {
                return self.refuse("experiment.initial", LogMistake::Unmarked { cloth: cloth.name.clone(), node });
            }
        }
        Ok(())
    }

    fn body_marker(&self, item: &str, body: &str, marker: &Marker) -> Result<(), LogError> {
        let names: Vec<&str> = self.setup.scene.body.iter().map(|body| body.name.as_str()).collect();
        if !names.contains(&body) {
            return self.unknown(&format!("{item}.body"), "body", body, &names);
        }
        let keys = [("node", marker.node.is_some()), ("arc", marker.arc.is_some()), ("offset", marker.offset.is_some())];
        for (key, given) in keys {
            if given {
                return self.refuse(&format!("{item}.{key}"), LogMistake::Misplaced { key, owner: "markers on ropes" });
            }
        }
        (0..3).try_for_each(|a| {
            let x = marker.point.map_or(0.0, |point| point[a]);
            self.range(&format!("{item}.point[{a}]"), x, -1e3, 1e3, "m")
        })
    }

    fn sensor(&self, experiment: &Experiment) -> Result<(), LogError> {
        let at = |key: &str| format!("experiment.sensor.{key}");
        let sensor = &experiment.sensor;
        self.range(&at("scale"), sensor.scale, 0.5, 2.0, "")?;
        self.range(&at("time_offset"), sensor.time_offset, -10.0, 10.0, "s")?;
        for a in 0..3 {
            self.range(&at(&format!("bias[{a}]")), sensor.bias[a], -1e3, 1e3, "m")?;
            self.range(&at(&format!("rotation[{a}]")), sensor.rotation[a], -PI, PI, "rad")?;
        }
        Ok(())
    }

    fn inputs(&self, experiment: &Experiment) -> Result<(), LogError> {
        let grippers: Vec<&str> = self.setup.scene.gripper.iter().map(|gripper| gripper.name.as_str()).collect();
        let actuators: Vec<&str> = self.setup.scene.actuator.iter().map(|actuator| actuator.name.as_str()).collect();
        for (k, input) in experiment.input.iter().enumerate() {
            let item = format!("experiment.input[{k}]");
            // before there were actuators, `gripper` was the one key that had to be there
            let keys = usize::from(input.gripper.is_some()) + usize::from(input.actuator.is_some());
            self.one_of(&item, "`gripper`, `actuator`", keys)?;
            let (kind, known) = if input.gripper.is_some() { ("gripper", &grippers) } else { ("actuator", &actuators) };
            let name = input.target().to_owned();
            if !known.contains(&name.as_str()) {
                return self.unknown(&format!("{item}.{kind}"), kind, &name, known);
            }
            if experiment.input[..k].iter().any(|other| other.target() == name) {
                return self.refuse(&item, LogMistake::TwoInputs { kind, name });
            }
            self.one_of(
                &item,
                "`columns`, `indices`",
                usize::from(input.columns.is_some()) + usize::from(input.indices.is_some()),
            )?;
            let (found, what, key, each) = match (&input.columns, &input.indices) {
                (Some(columns), _) => (columns.len(), "columns", "columns", 1),
                (None, indices) => (indices.iter().flatten().count(), "points", "indices", 3),
            };
            let controls = self.setup.controls_of(&name);
            let of_torque = input.actuator.is_some() && controls.iter().all(|control| control.unit == "-");
            if !of_torque && !input.torque_unit.is_si() {
                let mistake = LogMistake::Misplaced { key: "torque_unit", owner: "inputs of torque motors" };
                return self.refuse(&format!("{item}.torque_unit"), mistake);
            }
            if found * each != controls.len() {
                let names = words::list(controls.iter().map(|control| control.name.as_str()));
                let mistake = LogMistake::InputCount { kind, name, found, what, needed: controls.len(), names };
                return self.refuse(&format!("{item}.{key}"), mistake);
            }
        }
        let without = |names: &[&str]| {
            let found = names.iter().find(|name| !experiment.input.iter().any(|input| input.target() == **name));
            found.map(|name| (*name).to_owned())
        };
        match (without(&grippers), without(&actuators)) {
            (Some(name), _) => self.refuse("experiment", LogMistake::NoInput { kind: "gripper", name }),
            (None, Some(name)) => self.refuse("experiment", LogMistake::NoInput { kind: "actuator", name }),
            (None, None) => Ok(()),
        }
    }

    fn free(&self, experiment: &Experiment) -> Result<(), LogError> {
        for (k, free) in experiment.fit.free.iter().enumerate() {
            let item = format!("experiment.fit.free[{k}]");
            // Written so that NaN is refused too.
            if !(free.lower < free.upper && free.lower.is_finite() && free.upper.is_finite()) {
                return self.refuse(&format!("{item}.lower"), LogMistake::Bounds { lower: free.lower, upper: free.upper });
            }
            if let Some(prior) = &free.prior {
                self.range(&format!("{item}.prior.mean"), prior.mean, free.lower, free.upper, "(its bounds)")?;
                self.range(&format!("{item}.prior.std"), prior.std, f64::MIN_POSITIVE, f64::MAX, "")?;
            }
        }
        Ok(())
    }
}

/// Refuses times [s] that do not count up. `place` locates a sample's clock.
pub(super) fn check_clock(time: &[f64], place: &dyn Fn(usize) -> Place) -> Result<(), LogError> {
    match (1..time.len()).find(|&k| time[k] <= time[k - 1]) {
        Some(k) => {
            let reversed = time.windows(2).all(|pair| pair[1] < pair[0]);
            Err(LogError::new(place(k), LogMistake::Clock { before: time[k - 1], after: time[k], reversed }))
        }
        None => Ok(()),
    }
}

/// Checks a record as read. `place` locates a sample's clock.
pub(super) fn check_record(setup: &Setup, record: &Record, place: &dyn Fn(usize) -> Place) -> Result<(), LogError> {
    let n = record.time.len();
    let last = place(n.saturating_sub(1));
    if n < LOG.samples {
        return Err(LogError::new(last, LogMistake::TooFew { found: n, needed: LOG.samples }));
    }
    check_clock(&record.time, place)?;
    let (period, step) = (record.period(), setup.scene.time.step);
    let ratio = period / step;
    if !(LOG.steps.0..=LOG.steps.1).contains(&ratio) {
        return Err(LogError::new(place(0), LogMistake::ClockUnit { period, step, ratio }));
    }
    if ratio.round() < 1.0 || (ratio / ratio.round() - 1.0).abs() > LOG.period_error {
        return Err(LogError::new(place(0), LogMistake::Period { period, step, ratio }));
    }
    let duration = record.time[n - 1] - record.time[0];
    let needs =
        [("segment", setup.experiment.fit.segment.unwrap_or(0.0)), ("lead_in", setup.experiment.lead_in.unwrap_or(LEAD_IN))];
    if let Some((key, needed)) = needs.into_iter().find(|(_, needed)| duration < *needed) {
        return Err(LogError::new(last, LogMistake::TooShort { duration, key, needed }));
    }
    check_angles(setup, record, place)?;
    extent(setup, record, place)
}

/// Refuses a measurement that is there twice: fitted, it would count double; held out, it would measure no gain.
///
/// By content, so that a copy under another name is found too. `places` tell where each record is listed.
pub(super) fn check_twice(records: &[Record], places: &[Place]) -> Result<(), LogError> {
    for (k, record) in records.iter().enumerate() {
        if let Some(first) = records[..k].iter().position(|other| record.is_copy_of(other)) {
            let other = format!("{} ({})", records[first].name, places[first]);
            return Err(LogError::new(places[k].clone(), LogMistake::SameRecord { name: record.name.clone(), other }));
        }
    }
    Ok(())
}

/// Markers and grippers spread over a length that ropes and sheets can span, or some are in another unit.
fn extent(setup: &Setup, record: &Record, place: &dyn Fn(usize) -> Place) -> Result<(), LogError> {
    let scene = &setup.scene;
    if scene.rope.is_empty() && scene.cloth.is_empty() {
        return Ok(());
    }
    let mut length: f64 = scene.rope.iter().map(|rope| rope.length).sum();
    for (c, cloth) in scene.cloth.iter().enumerate() {
        length += cloth.rest(&format!("cloth[{c}]"))?.extents().iter().map(|side| side * side).sum::<f64>().sqrt();
    }
    let controls = setup.controls();
    let spread = |a: usize, with_inputs: bool| {
        let ending = [".x", ".y", ".z"][a];
        let positions: Vec<usize> =
            (0..controls.len()).filter(|j| controls[*j].unit == "m" && controls[*j].name.ends_with(ending)).collect();
        let prescribed = record.inputs.iter().flat_map(|row| positions.iter().map(|j| row[*j])).filter(|_| with_inputs);
        let values = record.markers.iter().flatten().map(|p| p[a]).chain(prescribed).filter(|x| x.is_finite());
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        (high - low).max(0.0)
    };
    let extent = |with_inputs| (0..3).map(|a| spread(a, with_inputs)).fold(0.0, f64::max);
    // A single marker, or a rope at rest, may well stay in one place; several markers cannot.
    let (all, markers) = (extent(true), extent(false));
    let too_small = setup.experiment.marker.len() > LOG.judged_markers && markers < LOG.extent.0 * length;
    if all > LOG.extent.1 * length || too_small {
        let place = Place { line: None, column: None, field: "markers".to_owned(), ..place(0) };
        return Err(LogError::new(place, LogMistake::Extent { extent: if too_small { markers } else { all }, length }));
    }
    Ok(())
}
