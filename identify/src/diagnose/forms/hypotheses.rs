//! The hypotheses about what is left, place by place, and how they are said.

use super::super::policy::POLICY;
use super::super::result::RemainderForm;
use crate::causes::Cause;
use crate::form::{Bends, Form, Place, Shape, Variable};
use crate::log::JointQuantity;
use crate::number::{number_plain, quantity_plain};
use crate::shooting::{Plan, RecordPlan, Shot};
use crate::stats::score::CandidateScore;
use pliant_engine::bodies::{Joint, JointKind};
use pliant_engine::model::{Model, RopeSpan};
use pliant_math::State;
use std::ops::Range;

/// Powers and sizes of a variable, each with whether it reverses and how it is said.
const SINGLE: [(Variable, Shape, bool, &str); 10] = [
    (Variable::Time, Shape::Power(1), false, "grows with the time, like c·t"),
    (Variable::Time, Shape::Power(1), true, "turns over with the velocity and grows with the time, like c·t·sign(v)"),
    (Variable::Position, Shape::Power(2), false, "depends on the position like c·q²"),
    (Variable::Position, Shape::Power(3), false, "depends on the position like c·q³"),
    (Variable::Position, Shape::Size, false, "depends on the position like c·|q|"),
    (Variable::Position, Shape::Size, true, "turns over with the velocity and grows with the position, like c·|q|·sign(v)"),
    (Variable::Velocity, Shape::Power(0), true, "depends on the velocity like c·sign(v)"),
    (Variable::Velocity, Shape::Power(2), false, "depends on the velocity like c·v²"),
    (Variable::Velocity, Shape::Power(2), true, "depends on the velocity like c·v·|v|"),
    (Variable::Velocity, Shape::Power(3), false, "depends on the velocity like c·v³"),
];

/// Moments in bending: those of a joint's hypotheses that curvature, which has a size and no sign, and its rate have.
const BENDING: [(Variable, Shape, bool, &str); 5] = [
    (Variable::Velocity, Shape::Power(0), true, "turns over with the rate of the curvature, like c·sign(κ̇)"),
    (Variable::Velocity, Shape::Power(2), true, "depends on the rate of the curvature like c·κ̇·|κ̇|"),
    (Variable::Position, Shape::Size, true, "turns over with the rate of the curvature and grows with it, like c·|κ|·sign(κ̇)"),
    (Variable::Position, Shape::Power(2), false, "depends on the curvature like c·κ·|κ|"),
    (Variable::Position, Shape::Power(3), false, "depends on the curvature like c·κ³"),
];

/// Axes of the world, or of the body that a ball joint turns.
const AXES: [&str; 3] = ["x", "y", "z"];

/// A hypothesis: several forms of one place and variable.
pub(super) struct Group {
    pub forms: Vec<Form>,
    pub what: String,
}

/// Something that may have a force or an error that no law describes.
pub(super) enum Site<'a> {
    /// A joint with one degree of freedom, and its sensors by number.
    Joint { joint: &'a Joint, sensors: Vec<usize> },
    /// A ball joint about one of its axes.
    Ball { joint: &'a Joint, axis: usize },
    /// The nodes of a rope or sheet, and those that no gripper holds.
    Nodes { name: &'a str, all: Range<usize>, free: Vec<usize> },
    /// Where a rope that does not twist bends; the sections of one that does have laws of their own.
    Bends { name: &'a str, bends: Bends },
    /// All markers along one axis of the world.
    Markers { axis: usize },
}

/// All of a plan.
pub(super) fn sites(plan: &Plan) -> Vec<Site<'_>> {
    let axes = || 0..AXES.len();
    let sensors = |joint: &Joint| {
        let own = |k: &usize| plan.joints[*k].v == joint.v && plan.joints[*k].quantity != JointQuantity::Torque;
        (0..plan.joints.len()).filter(own).collect()
    };
    let mut out = Vec::new();
    for joint in plan.model.tree().joints() {
        match joint.kind {
            JointKind::Ball => out.extend(axes().map(|axis| Site::Ball { joint, axis })),
            _ => out.push(Site::Joint { joint, sensors: sensors(joint) }),
        }
    }
    let of_span = |(name, all): (_, Range<usize>)| Site::Nodes { name, free: free_nodes(&plan.model, all.clone()), all };
    out.extend(plan.model.node_spans().map(of_span));
    let twists = |rope: &RopeSpan| plan.model.params().find(&format!("{}.twist_stiffness", rope.name)).is_some();
    let bending = plan.model.ropes().iter().enumerate().filter(|(_, rope)| !twists(rope));
    out.extend(bending.map(|(k, rope)| Site::Bends { name: &rope.name, bends: Bends::of(k, rope) }));
    if !plan.markers.is_empty() {
        out.extend(axes().map(|axis| Site::Markers { axis }));
    }
    out
}

/// Nodes that forces can move.
fn free_nodes(model: &Model, nodes: Range<usize>) -> Vec<usize> {
    let held = |node: &usize| model.prescribed_rows().get(3 * node).is_some_and(|held| *held);
    nodes.filter(|node| !held(node)).collect()
}

/// Ranges of the variables that the records visit; of what is no joint the time alone has one.
pub(super) struct Ranges {
    time: [f64; 2],
    position: [f64; 2],
    velocity: [f64; 2],
}

impl Ranges {
    /// None of a joint that does not move.
    pub fn new(plan: &Plan, records: &[RecordPlan], shots: &[Shot], site: &Site) -> Option<Self> {
        let of_record = |rec: &RecordPlan| rec.record.time.last().copied().unwrap_or(0.0);
        let time = [0.0, records.iter().map(of_record).fold(0.0, f64::max)];
        let Some(place) = site.force() else {
            return Some(Self { time, position: [0.0; 2], velocity: [0.0; 2] });
        };
        let first = plan.model.n_node_dofs();
        let visited = |of: &dyn Fn(&State) -> f64| {
            let mut all: Vec<f64> = shots.iter().flat_map(|shot| shot.states.iter().map(of)).collect();
            all.sort_by(f64::total_cmp);
            let at = |part: f64| all.get((all.len().saturating_sub(1) as f64 * part) as usize).copied().unwrap_or(0.0);
            [at(POLICY.form_range), at(1.0 - POLICY.form_range)]
        };
        let position = visited(&|x: &State| place.position(&x.q[first..]));
        let velocity = visited(&|x: &State| place.velocity(&x.v[first..]));
        let wide = |[low, high]: [f64; 2]| high > low;
        [time, position, velocity].into_iter().all(wide).then_some(Self { time, position, velocity })
    }
}

/// Any function over a range, as a sum of hats.
fn hats([low, high]: [f64; 2], place: Place, variable: Variable, reversing: bool) -> Vec<Form> {
    let (last, width) = (POLICY.form_hats - 1, (high - low) / (POLICY.form_hats - 1) as f64);
    let hat = |k: usize| Shape::Hat { peak: low + k as f64 * width, width, first: k == 0, last: k == last };
    (0..=last).map(|k| Form { place, variable, shape: hat(k), reversing }).collect()
}

impl Site<'_> {
    /// The force at a joint.
    fn force(&self) -> Option<Place> {
        match self {
            Self::Joint { joint, .. } => Some(Place::Force { q: joint.q, v: joint.v }),
            Self::Ball { joint, axis } => Some(Place::Moment { q: joint.q, v: joint.v, axis: *axis }),
            Self::Nodes { .. } | Self::Bends { .. } | Self::Markers { .. } => None,
        }
    }

    /// Whether a hypothesis is another function of the variable that the force of this cause depends on, at the same place.
    pub fn has_law(&self, cause: &Cause, group: &Group) -> bool {
        let form = &group.forms[0];
        let name = match (self, form.place) {
            (Self::Joint { joint, .. }, Place::Force { .. }) => joint.name.as_str(),
            (Self::Ball { joint, .. }, _) => joint.name.as_str(),
            (Self::Bends { name, .. }, _) => name,
            _ => return false,
        };
        let of_it = |path: &str| path.strip_prefix(name).is_some_and(|rest| rest.starts_with('.'));
        cause.variable == Some(form.variable) && cause.unknowns.iter().any(|unknown| of_it(&unknown.path))
    }

    /// Forces that may push here for a moment.
    pub fn pushed(&self) -> Vec<Place> {
        match self {
            Self::Nodes { all, .. } => (0..3).map(|axis| along(all, axis)).collect(),
            _ => self.force().into_iter().collect(),
        }
    }

    /// The hypotheses of a place.
    pub fn groups(&self, ranges: &Ranges) -> Vec<Group> {
        let said = |forms, what: &str| Group { forms, what: what.to_owned() };
        let over_time = |place| said(hats(ranges.time, place, Variable::Time, false), "depends on the time");
        let (joint, sensors) = match self {
            Self::Joint { joint, sensors } => (joint, sensors.as_slice()),
            Self::Ball { joint, .. } => (joint, [].as_slice()),
            Self::Nodes { all, free, .. } => {
                let steady = |node: &usize| {
                    let one = |axis| Form {
                        place: Place::Nodes { first: *node, number: 1, axis },
                        variable: Variable::Time,
                        shape: Shape::Power(0),
                        reversing: false,
                    };
                    said((0..3).map(one).collect(), "is always there")
                };
                return free.iter().map(steady).chain((0..3).map(|axis| over_time(along(all, axis)))).collect();
            }
            Self::Bends { bends, .. } => {
                let one = |bends, variable, shape, reversing| Form { place: Place::Bends(bends), variable, shape, reversing };
                let single =
                    BENDING.map(|(variable, shape, reversing, what)| said(vec![one(*bends, variable, shape, reversing)], what));
                let stiffness = bends.each().map(|node| one(node, Variable::Position, Shape::Power(1), false)).collect();
                let uneven = said(stiffness, "grows with the curvature otherwise at every node");
                return single.into_iter().chain([uneven]).collect();
            }
            Self::Markers { axis } => {
                let place = Place::Markers { axis: *axis };
                let (shape, variable) = (Shape::Power(1), Variable::Time);
                let drift = Form { place, variable, shape, reversing: false };
                return vec![said(vec![drift], "grows with the time, like c·t"), over_time(place)];
            }
        };
        let mut out = Vec::new();
        for place in self.force().into_iter().chain(sensors.iter().map(|k| Place::Reading(*k))) {
            for (variable, shape, reversing, what) in SINGLE {
                out.push(said(vec![Form { place, variable, shape, reversing }], what));
            }
            let any = |range, variable, reversing, what| said(hats(range, place, variable, reversing), what);
            out.push(over_time(place));
            out.push(any(ranges.position, Variable::Position, false, "depends on the position"));
            out.push(any(ranges.velocity, Variable::Velocity, false, "depends on the velocity"));
            out.push(any(ranges.position, Variable::Position, true, "turns over with the velocity and depends on the position"));
            out.push(any(ranges.time, Variable::Time, true, "turns over with the velocity and depends on the time"));
            if joint.kind != JointKind::Ball {
                out.extend(waves(ranges.position, place, length(joint)));
            }
        }
        out
    }

    /// The object and what it has, with its unit.
    fn named(&self, plan: &Plan, place: Place) -> (String, String, &'static str) {
        match (self, place) {
            (_, Place::Reading(k)) => {
                let sensor = &plan.joints[k];
                (sensor.name.clone(), format!("an error of the sensor of `{}`", sensor.name), sensor.unit)
            }
            (Self::Joint { joint, .. }, _) => {
                let (what, unit) = if joint.kind == JointKind::Prismatic { ("force", "N") } else { ("torque", "N·m") };
                (joint.name.clone(), format!("a {what} at `{}`", joint.name), unit)
            }
            (Self::Ball { joint, axis }, _) => {
                (joint.name.clone(), format!("a torque at `{}` about {}", joint.name, AXES[*axis]), "N·m")
            }
            (Self::Nodes { name, all, .. }, Place::Nodes { first, number: 1, .. }) => {
                ((*name).to_owned(), format!("a force on node {} of `{name}`", first - all.start), "N")
            }
            (Self::Nodes { name, .. }, Place::Nodes { axis, .. }) => {
                ((*name).to_owned(), format!("a force along {} on each node of `{name}`", AXES[axis]), "N")
            }
            (Self::Nodes { name, .. }, _) => ((*name).to_owned(), format!("a force on `{name}`"), "N"),
            (Self::Bends { name, .. }, _) => ((*name).to_owned(), format!("a moment in the bending of `{name}`"), "N·m²"),
            (Self::Markers { axis }, _) => ("markers".to_owned(), format!("an error of all markers along {}", AXES[*axis]), "m"),
        }
    }

    /// A hypothesis and its score, in words.
    pub fn told(&self, plan: &Plan, group: &Group, score: &CandidateScore) -> RemainderForm {
        let form = &group.forms[0];
        let (object, of, unit) = self.named(plan, form.place);
        let coordinate = match self {
            Self::Joint { joint, .. } | Self::Ball { joint, .. } => length(joint),
            Self::Nodes { .. } | Self::Markers { .. } => "m",
            Self::Bends { .. } => "-",
        };
        let variable = match form.variable {
            Variable::Time => "s".to_owned(),
            Variable::Position => coordinate.to_owned(),
            Variable::Velocity if coordinate == "-" => "1/s".to_owned(),
            Variable::Velocity => format!("{coordinate}/s"),
        };
        let values = group.forms.iter().zip(&score.theta).filter_map(|(form, size)| match form.shape {
            Shape::Hat { peak, .. } => Some([peak, *size]),
            _ => None,
        });
        let values: Vec<[f64; 2]> = values.collect();
        let ends = |by: fn(&&[f64; 2], &&[f64; 2]) -> std::cmp::Ordering| values.iter().min_by(by);
        let (least, most) = (ends(|a, b| a[1].total_cmp(&b[1])), ends(|a, b| b[1].total_cmp(&a[1])));
        let at = |[x, y]: &[f64; 2]| format!("{} {unit} at {} {variable}", number_plain(*y), number_plain(*x));
        let range = match (values.as_slice(), least, most) {
            ([[_, size]], ..) => format!(" ({})", quantity_plain(*size, unit)),
            (_, Some(a), Some(b)) => format!(" ({} to {})", at(a), at(b)),
            _ => String::new(),
        };
        RemainderForm {
            what: format!("{of} that {}{range}", group.what),
            object,
            taken: score.lm,
            numbers: score.rank,
            p: score.p,
            unit: unit.to_owned(),
            variable_unit: variable,
            values,
        }
    }
}

/// A force of one size on every one of these nodes.
fn along(nodes: &Range<usize>, axis: usize) -> Place {
    Place::Nodes { first: nodes.start, number: nodes.len(), axis }
}

/// Waves of the position, alone and turning over with the velocity.
fn waves([low, high]: [f64; 2], place: Place, unit: &str) -> Vec<Group> {
    let mut out = Vec::new();
    for waves in POLICY.form_waves {
        for (reversing, turns) in [(false, ""), (true, "turns over with the velocity and ")] {
            let period = (high - low) / waves;
            let k = std::f64::consts::TAU / period;
            let wave = |shape| Form { place, variable: Variable::Position, shape, reversing };
            let what = format!("{turns}repeats every {} of the position", quantity_plain(period, unit));
            out.push(Group { forms: vec![wave(Shape::Sine(k)), wave(Shape::Cosine(k))], what });
        }
    }
    out
}

/// Unit of a joint's coordinate.
fn length(joint: &Joint) -> &'static str {
    if joint.kind == JointKind::Prismatic { "m" } else { "rad" }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::audit::starts::tests::plan_of;
    use super::super::super::procedure::Bench;
    use super::super::{forms, simulated};
    use super::*;
    use crate::fit::fit;
    use crate::log::Record;
    use crate::shooting::{ShotWants, shoot};
    use crate::stats::ar::ArModel;
    use crate::stats::testing::gaussians;
    use crate::unknown::Unknown;

    const SAMPLES: usize = 60;
    const NOISE: f64 = 1e-4;

    /// A cord that hangs from a moving hand, and a link on a ball joint, with markers.
    fn scene(what: &str, markers: &str) -> String {
        format!(
            "schema_version = 1\n[time]\nstep = 0.005\nduration = 1.0\nintegrator = \"midpoint\"\n{what}\n[experiment]\n\
             initial = \"measured\"\ntime = {{ column = \"t\" }}\n{markers}\n[[experiment.record]]\nfile = \"run.csv\"\n"
        )
    }

    fn cord() -> String {
        let markers = [1, 2, 3, 4]
            .map(|k| format!("[[experiment.marker]]\nrope = \"cord\"\nnode = {k}\ncolumns = [\"x{k}\", \"y{k}\", \"z{k}\"]\n"));
        let input = "[[experiment.input]]\ngripper = \"hand\"\ncolumns = [\"hx\", \"hy\", \"hz\"]\n";
        scene(
            "[[rope]]\nname = \"cord\"\nnodes = 5\nlength = 0.4\nlinear_density = 0.05\nstretch_stiffness = 50.0\n\
             stretch_damping = 0.05\nbend_stiffness = 1e-4\ndrag_linear = 0.02\n\
             [rope.initial]\nshape = \"straight\"\nfrom = [0, 0, 0]\ndirection = [0, 0, -1]\n\
             [[gripper]]\nname = \"hand\"\nrope = \"cord\"\nnodes = [0]\n",
            &(markers.concat() + input),
        )
    }

    fn ball() -> String {
        let markers = [[0.05, 0.0, -0.3], [0.0, 0.05, -0.3]]
            .map(|point| format!("[[experiment.marker]]\nbody = \"link\"\npoint = {point:?}\ncolumns = [\"x\", \"y\", \"z\"]\n"));
        scene(
            "[[body]]\nname = \"link\"\nmass = 0.5\ncenter_of_mass = [0, 0, -0.3]\ninertia = [1e-3, 1e-3, 1e-3, 0, 0, 0]\n\
             [[body.joint]]\nname = \"pivot\"\nkind = \"ball\"\n",
            &markers.concat(),
        )
    }

    /// Six motions without readings.
    fn motions(text: &str) -> Vec<Record> {
        let held = text.contains("gripper");
        let one = |k: usize| {
            let at = |t: usize| 0.005 * t as f64;
            let hand = |t: usize| vec![0.05 * (9.0 * at(t) + k as f64).sin(), 0.04 * (7.0 * at(t) - k as f64).cos(), 0.0];
            Record {
                name: format!("run{k}"),
                inputs: (0..SAMPLES).map(|t| if held { hand(t) } else { Vec::new() }).collect(),
                phase: vec![0.5; if held { 3 } else { 0 }],
                joints: vec![Vec::new(); SAMPLES],
                orientations: vec![Vec::new(); SAMPLES],
                markers: vec![vec![[f64::NAN; 3]; if held { 4 } else { 2 }]; SAMPLES],
                time: (0..SAMPLES).map(at).collect(),
                ..Record::default()
            }
        };
        (0..6).map(one).collect()
    }

    /// Hypotheses about such motions at the scene, of a truth that has other parameters and markers that drift [m/s].
    fn found(text: &str, hidden: &[(&str, f64)], drift: f64) -> Vec<RemainderForm> {
        found_with(text, hidden, drift, &|_| None)
    }

    /// The same with a form of this size hidden as well.
    fn found_with(
        text: &str,
        hidden: &[(&str, f64)],
        drift: f64,
        form: &dyn Fn(&Plan) -> Option<(Form, f64)>,
    ) -> Vec<RemainderForm> {
        let mut plan = plan_of(text, motions(text)).0;
        let form = form(&plan);
        let mut truth = plan.scene_values.clone();
        for (path, value) in hidden {
            truth.theta[plan.model.params().find(path).unwrap()] = *value;
        }
        for (k, mut rec) in plan.fitted.clone().into_iter().enumerate() {
            // somewhere, with some velocity
            rec.start.z.iter_mut().enumerate().for_each(|(i, z)| *z = 0.5 * ((3 * k + 7 * i) as f64).sin());
            let shot = simulated(&plan, &rec, &truth).unwrap();
            let (n, noise) = (plan.channels(), gaussians(SAMPLES * plan.channels(), 90 + k as u64));
            let late = |row: usize| if row.is_multiple_of(3) { drift * 0.005 * (row / n) as f64 } else { 0.0 };
            let moved = form.as_ref().map_or_else(|| vec![0.0; SAMPLES * n], |(form, size)| moved_by(&plan, &rec, form, *size));
            let read = |row: usize| shot.predicted[row] + moved[row] + late(row) + NOISE * noise[row];
            let read: Vec<f64> = (0..SAMPLES * n).map(read).collect();
            let triples = |row: &[f64]| row.chunks_exact(3).map(|x| [x[0], x[1], x[2]]).collect();
            plan.fitted[k].record.markers = read.chunks_exact(n).map(triples).collect();
            plan.fitted[k].start.z.clone_from(&rec.start.z);
        }
        let white = ArModel::white(vec![NOISE; plan.channels()]).unwrap();
        let fitted = fit(&plan, &plan.fitted, &plan.scene_values, &[], Some(&white), &POLICY.fine).unwrap();
        forms(&Bench { plan: &plan, declared: Vec::new(), white }, &fitted, &[], &[]).unwrap()
    }

    /// Change of the readings of a record by a form of a small size.
    fn moved_by(plan: &Plan, rec: &RecordPlan, form: &Form, size: f64) -> Vec<f64> {
        let mut seen = rec.clone();
        seen.record.markers = vec![vec![[0.0; 3]; plan.markers.len()]; SAMPLES];
        let unknowns = [Unknown::of_form("form".to_owned(), form.clone())];
        let wants = ShotWants { unknowns: &unknowns, tangents: true, ..ShotWants::default() };
        let shot = shoot(plan, &seen, &plan.scene_values, wants).unwrap();
        // derivatives are those of what is left
        shot.global.iter().map(|d| -size * d).collect()
    }

    /// Friction and stiffening of a rope, of which it has no laws, are told by what they leave.
    #[test]
    fn moments_in_bending_are_said_in_words() {
        let all = |plan: &Plan| Place::Bends(Bends::of(0, &plan.model.ropes()[0]));
        let of = |variable, shape, reversing, size: f64| {
            let damped = cord().replace("bend_stiffness = 1e-4", "bend_stiffness = 1e-4\nbend_damping = 1e-5");
            found_with(&damped, &[], 0.0, &|plan| Some((Form { place: all(plan), variable, shape, reversing }, size)))
        };
        let rubbed = of(Variable::Velocity, Shape::Power(0), true, -1e-5);
        let friction = "a moment in the bending of `cord` that turns over with the rate of the curvature, like c·sign(κ̇)";
        assert_eq!(rubbed.first().map(|form| form.what.as_str()), Some(friction), "{rubbed:?}");
        let stiffer = of(Variable::Position, Shape::Power(3), false, -2e-4);
        let cubic = "a moment in the bending of `cord` that depends on the curvature like c·κ³";
        assert_eq!(stiffer.first().map(|form| form.what.as_str()), Some(cubic), "{stiffer:?}");
    }

    /// Moments along the curvature and its rate are those of the laws, whose derivatives are the engine's.
    #[test]
    fn moments_that_grow_in_proportion_are_those_of_the_laws() {
        let text = cord().replace("bend_stiffness = 1e-4", "bend_stiffness = 1e-4\nbend_damping = 1e-5");
        let mut plan = plan_of(&text, motions(&text)).0;
        let place = Place::Bends(Bends::of(0, &plan.model.ropes()[0]));
        let form = |variable, reversing| {
            Unknown::of_form("form".to_owned(), Form { place, variable, shape: Shape::Power(1), reversing })
        };
        let law = |path: &str| Unknown::of_theta(&plan.model, path, 1.0).unwrap();
        let unknowns = [
            law("cord.bend_stiffness"),
            form(Variable::Position, false),
            law("cord.bend_damping"),
            form(Variable::Velocity, true),
        ];
        let rec = &mut plan.fitted[1];
        rec.start.z.iter_mut().enumerate().for_each(|(i, z)| *z = 0.5 * ((3 + 7 * i) as f64).sin());
        rec.record.markers = vec![vec![[0.0; 3]; 4]; SAMPLES];
        let wants = ShotWants { unknowns: &unknowns, tangents: true, ..ShotWants::default() };
        let shot = shoot(&plan, &plan.fitted[1], &plan.scene_values, wants).unwrap();
        let slopes = unknowns.each_ref().map(|u| u.slope(u.value(&plan.scene_values)));
        for (law, form) in [(0, 1), (2, 3)] {
            let of = |k: usize| shot.global.iter().skip(k).step_by(4).map(move |d| d / slopes[k]);
            let largest = of(law).fold(0.0, |a: f64, b| a.max(b.abs()));
            assert!(largest > 0.0);
            of(law).zip(of(form)).for_each(|(a, b)| assert!((a + b).abs() < 1e-9 * largest, "{a} {b} of {largest}"));
        }
    }

    #[test]
    fn what_is_left_of_ropes_balls_and_markers_is_said_in_words() {
        let says = |found: &[RemainderForm], what: &str| found.iter().any(|form| form.what.starts_with(what));
        let blown = found(&cord(), &[("air.wind[0]", 0.5)], 0.0);
        assert!(says(&blown, "a force along x on each node of `cord` that depends on the time"), "{blown:?}");
        let drifting = found(&cord(), &[], 0.01);
        let drift = "an error of all markers along x that grows with the time, like c·t";
        assert_eq!(drifting.first().map(|form| form.what.as_str()), Some(drift), "{drifting:?}");
        let damped = found(&ball(), &[("pivot.quadratic_damping", 0.02)], 0.0);
        assert!(says(&damped, "a torque at `pivot` about "), "{damped:?}");
        assert_eq!(found(&cord(), &[], 0.0), []);
        assert_eq!(found(&ball(), &[], 0.0), []);
    }

    /// A steady force moves what begins at rest under it as the same force of a formula does, whose derivative is the engine's.
    #[test]
    fn a_steady_force_is_there_before_a_record_begins() {
        let pull = "[[force]]\nname = \"pull\"\nrope = \"cord\"\nnodes = [2]\nformula = [\"f\", \"0\", \"0\"]\nparameters = { f = 0.0 }\n";
        let text = cord().replace("\"measured\"", "\"rest\"").replace("[experiment]", &format!("{pull}[experiment]"));
        let mut plan = plan_of(&text, motions(&text)).0;
        let place = Place::Nodes { first: 2, number: 1, axis: 0 };
        let form = Form { place, variable: Variable::Time, shape: Shape::Power(0), reversing: false };
        let unknowns = [Unknown::of_theta(&plan.model, "pull.f", 1.0).unwrap(), Unknown::of_form("form".to_owned(), form)];
        let seen: Vec<Vec<[f64; 3]>> = vec![vec![[0.0; 3]; 4]; SAMPLES];
        plan.fitted[0].record.markers = seen;
        let wants = ShotWants { unknowns: &unknowns, tangents: true, ..ShotWants::default() };
        let shot = shoot(&plan, &plan.fitted[0], &plan.scene_values, wants).unwrap();
        let largest = shot.global.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        assert!(shot.global[..2 * plan.channels()].iter().any(|d| d.abs() > 0.01 * largest));
        for by in shot.global.chunks_exact(2) {
            assert!((by[0] - by[1]).abs() < 1e-9 * largest, "{by:?} of {largest}");
        }
    }
}
