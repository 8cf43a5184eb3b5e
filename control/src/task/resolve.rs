//! A task's names, found in a scene and its model.

use super::{Cost, Limit, Line, Sensor, Task, When};
use crate::sensing::{Output, Sensors};
use pliant_engine::model::Model;
use pliant_scene::words::nearest;
use pliant_scene::{MOST_STEPS, Mistake, Scene, SceneError, control_list};
use std::ops::Range;
use std::sync::Arc;

/// A cost with numbers for names. `weight` is the square root of twice the file's.
#[derive(Clone, Debug)]
pub(super) enum Part {
    Nodes { nodes: Vec<(usize, [f64; 3])>, weight: [f64; 3], when: When },
    Distance { nodes: [usize; 2], distance: f64, weight: f64, when: When },
    Joint { q: usize, v: usize, goal: f64, weight: f64, when: When },
    JointSpeed { v: usize, weight: f64, when: When },
    Body { body: usize, point: [f64; 3], goal: [f64; 3], weight: [f64; 3], when: When },
    Inputs { inputs: Vec<usize>, target: f64, weight: f64 },
    Reach { grasp: usize, inside: f64, weight: f64 },
}

/// A limit with numbers for names.
#[derive(Clone, Debug)]
pub(super) enum Guard {
    Outside { nodes: Vec<usize>, first: usize, a: [f64; 3], b: [f64; 3], radius: f64, price: f64, object: String },
    Above { nodes: Vec<usize>, first: usize, normal: [f64; 3], offset: f64, price: f64, object: String },
    Joint { q: usize, v: usize, lower: f64, upper: f64, price: f64, joint: String },
}

/// Cost and constraints of a task, for a model.
#[derive(Clone, Debug)]
pub struct TaskProblem {
    pub(super) model: Arc<Model>,
    pub(super) parts: Vec<Part>,
    pub(super) guards: Vec<Guard>,
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
    pub(super) sensors: Option<Sensors>,
}

impl TaskProblem {
    /// Finds the task's names in the scene and its model.
    ///
    /// # Errors
    /// A name that there is not, numbers that do not make sense; the error has the field of the task.
    pub fn new(task: &Task, scene: &Scene, model: &Arc<Model>) -> Result<Self, SceneError> {
        if task.schema_version != 1 {
            return Err(SceneError::at("schema_version", Mistake::Version { found: task.schema_version, known: 1 }));
        }
        let names = Names { model, inputs: control_list(scene).into_iter().map(|control| control.name).collect() };
        let mut out = Self {
            model: Arc::clone(model),
            parts: Vec::new(),
            guards: Vec::new(),
            lower: vec![f64::NEG_INFINITY; model.nu()],
            upper: vec![f64::INFINITY; model.nu()],
            sensors: None,
        };
        for (field, steps) in [("steps", Some(task.steps)), ("horizon", task.horizon)] {
            if steps == Some(0) {
                return Err(SceneError::at(field, Mistake::NotPositive { value: 0.0, unit: "steps" }));
            }
            if let Some(steps) = steps.filter(|steps| *steps > MOST_STEPS) {
                return Err(SceneError::at(field, Mistake::Range { value: steps as f64, low: 1.0, high: MOST_STEPS as f64 }));
            }
        }
        if let Some(horizon) = task.horizon.filter(|horizon| *horizon > task.steps) {
            return Err(SceneError::at("horizon", Mistake::Range { value: horizon as f64, low: 1.0, high: task.steps as f64 }));
        }
        for (i, cost) in task.cost.iter().enumerate() {
            out.parts.push(names.part(cost, &format!("cost[{i}]"))?);
        }
        for (i, limit) in task.limit.iter().enumerate() {
            let field = format!("limit[{i}]");
            if let Limit::Inputs { inputs, lower, upper } = limit {
                if upper.is_nan() || lower.is_nan() || lower > upper {
                    return Err(SceneError::at(
                        format!("{field}.upper"),
                        Mistake::Range { value: *upper, low: *lower, high: f64::INFINITY },
                    ));
                }
                for k in names.inputs(inputs, &field)? {
                    (out.lower[k], out.upper[k]) = (*lower, *upper);
                }
            } else if let Some(guard) = names.guard(limit, &field)? {
                out.guards.push(guard);
            }
        }
        if let Some(sensing) = &task.sensing {
            if sensing.delay > MOST_STEPS {
                let range = Mistake::Range { value: sensing.delay as f64, low: 0.0, high: MOST_STEPS as f64 };
                return Err(SceneError::at("sensing.delay", range));
            }
            not_negative(sensing.initial, "m", "sensing.initial")?;
            let mut outputs = Vec::new();
            for (i, sensor) in sensing.sensor.iter().enumerate() {
                outputs.extend(names.sensor(sensor, &format!("sensing.sensor[{i}]"))?);
            }
            out.sensors = Some(Sensors { outputs, delay: sensing.delay });
        }
        Ok(out)
    }

    /// Sensors of the controller; `None`: it knows the state.
    pub fn sensors(&self) -> Option<&Sensors> {
        self.sensors.as_ref()
    }

    /// The model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }
}

struct Names<'a> {
    model: &'a Model,
    inputs: Vec<String>,
}

impl Names<'_> {
    fn part(&self, cost: &Cost, field: &str) -> Result<Part, SceneError> {
        let root = |weight: f64| -> Result<f64, SceneError> {
            Ok((2.0 * not_negative(weight, "-", &format!("{field}.weight"))?).sqrt())
        };
        Ok(match cost {
            Cost::Nodes { object, nodes, goal, line, weight, axes, when } => {
                let span = self.span(object, field)?;
                let numbers = numbered(nodes.as_deref(), &span, &format!("{field}.nodes"))?;
                let goals = goals(goal.as_deref(), *line, numbers.len(), field)?;
                let weight = root(*weight)?;
                Part::Nodes { nodes: numbers.into_iter().zip(goals).collect(), weight: axes.map(|a| weight * a), when: *when }
            }
            Cost::Distance { object, nodes, distance, weight, when } => {
                let span = self.span(object, field)?;
                let found = numbered(Some(nodes), &span, &format!("{field}.nodes"))?;
                let distance = not_negative(*distance, "m", &format!("{field}.distance"))?;
                Part::Distance { nodes: [found[0], found[1]], distance, weight: root(*weight)?, when: *when }
            }
            Cost::Joint { joint, goal, weight, when } => {
                let (q, v) = self.joint(joint, field)?;
                Part::Joint { q, v, goal: finite(*goal, &format!("{field}.goal"))?, weight: root(*weight)?, when: *when }
            }
            Cost::JointSpeed { joint, weight, when } => {
                Part::JointSpeed { v: self.joint(joint, field)?.1, weight: root(*weight)?, when: *when }
            }
            Cost::Body { body, point, goal, weight, axes, when } => {
                let tree = self.model.tree();
                let names = || tree.bodies().iter().map(|b| b.name.clone()).collect();
                let number = tree.body(body).ok_or_else(|| no_such("body", body, names(), &format!("{field}.body")))?;
                for (a, x) in goal.iter().chain(point).enumerate() {
                    finite(*x, &format!("{field}.{}[{}]", if a < 3 { "goal" } else { "point" }, a % 3))?;
                }
                let weight = root(*weight)?;
                Part::Body { body: number, point: *point, goal: *goal, weight: axes.map(|a| weight * a), when: *when }
            }
            Cost::Inputs { inputs, target, weight } => Part::Inputs {
                inputs: self.inputs(inputs, field)?,
                target: finite(*target, &format!("{field}.target"))?,
                weight: root(*weight)?,
            },
            Cost::Reach { gripper, inside, weight } => {
                let grasp = self.grasp(gripper, field)?;
                Part::Reach { grasp, inside: not_negative(*inside, "m", &format!("{field}.inside"))?, weight: root(*weight)? }
            }
        })
    }

    /// `None` for limits of inputs, which are bounds.
    fn guard(&self, limit: &Limit, field: &str) -> Result<Option<Guard>, SceneError> {
        let paid = |price: f64| not_negative(price, "1/m", &format!("{field}.price"));
        Ok(Some(match limit {
            Limit::Inputs { .. } => return Ok(None),
            Limit::Outside { object, nodes, a, b, radius, price } => {
                let span = self.span(object, field)?;
                let (first, nodes) = (span.start, numbered(nodes.as_deref(), &span, &format!("{field}.nodes"))?);
                let radius = not_negative(*radius, "m", &format!("{field}.radius"))?;
                Guard::Outside { nodes, first, a: *a, b: b.unwrap_or(*a), radius, price: paid(*price)?, object: object.clone() }
            }
            Limit::Above { object, nodes, normal, offset, price } => {
                let span = self.span(object, field)?;
                let (first, nodes) = (span.start, numbered(nodes.as_deref(), &span, &format!("{field}.nodes"))?);
                let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
                if !(length > 0.0 && length.is_finite()) {
                    return Err(SceneError::at(format!("{field}.normal"), Mistake::NotPositive { value: length, unit: "long" }));
                }
                let offset = finite(*offset, &format!("{field}.offset"))?;
                Guard::Above {
                    nodes,
                    first,
                    normal: normal.map(|n| n / length),
                    offset,
                    price: paid(*price)?,
                    object: object.clone(),
                }
            }
            Limit::Joint { joint, lower, upper, price } => {
                let (q, v) = self.joint(joint, field)?;
                if upper.is_nan() || lower.is_nan() || lower > upper {
                    return Err(SceneError::at(
                        format!("{field}.upper"),
                        Mistake::Range { value: *upper, low: *lower, high: f64::INFINITY },
                    ));
                }
                Guard::Joint { q, v, lower: *lower, upper: *upper, price: paid(*price)?, joint: joint.clone() }
            }
        }))
    }

    fn sensor(&self, sensor: &Sensor, field: &str) -> Result<Vec<Output>, SceneError> {
        let noise = |noise: f64, unit: &'static str| not_negative(noise, unit, &format!("{field}.noise"));
        Ok(match sensor {
            Sensor::Nodes { object, nodes, noise: std } => {
                let (span, std) = (self.span(object, field)?, noise(*std, "m")?);
                let nodes = numbered(nodes.as_deref(), &span, &format!("{field}.nodes"))?;
                nodes.into_iter().flat_map(|node| Output::of_node(node, std)).collect()
            }
            Sensor::Gripper { gripper, noise: std } => {
                let std = noise(*std, "m")?;
                Output::of_node(self.model.grasps()[self.grasp(gripper, field)?].node, std).into()
            }
            Sensor::Joint { joint, noise: std } => {
                let (q, column) = self.joint(joint, field)?;
                vec![Output { name: format!("joint \"{joint}\""), q, column, noise: noise(*std, "rad or m")? }]
            }
        })
    }

    fn grasp(&self, gripper: &str, field: &str) -> Result<usize, SceneError> {
        let grasps = self.model.grasps();
        let names = || grasps.iter().map(|g| g.name.clone()).collect();
        let found = grasps.iter().position(|g| g.name == gripper);
        found.ok_or_else(|| no_such("gripper that grasps", gripper, names(), &format!("{field}.gripper")))
    }

    fn span(&self, object: &str, field: &str) -> Result<Range<usize>, SceneError> {
        let ropes = self.model.ropes().iter().map(|r| (r.name.as_str(), r.nodes.clone()));
        let spans: Vec<_> = ropes.chain(self.model.node_spans()).collect();
        let names = || spans.iter().map(|(name, _)| (*name).to_owned()).collect();
        let found = spans.iter().find(|(name, _)| *name == object).map(|(_, span)| span.clone());
        found.ok_or_else(|| no_such("rope or cloth", object, names(), &format!("{field}.object")))
    }

    /// Its place in q and among the degrees of freedom.
    fn joint(&self, name: &str, field: &str) -> Result<(usize, usize), SceneError> {
        let joints = self.model.tree().joints();
        let single = || joints.iter().filter(|j| j.kind.n_dofs() == 1);
        let names = || single().map(|j| j.name.clone()).collect();
        let found = single().find(|j| j.name == name).map(|j| (self.model.n_node_dofs() + j.q, self.model.n_node_dofs() + j.v));
        found.ok_or_else(|| no_such("joint of one coordinate", name, names(), &format!("{field}.joint")))
    }

    fn inputs(&self, names: &[String], field: &str) -> Result<Vec<usize>, SceneError> {
        let one = |(i, name): (usize, &String)| {
            let found = self.inputs.iter().position(|input| input == name);
            found.ok_or_else(|| no_such("input", name, self.inputs.clone(), &format!("{field}.inputs[{i}]")))
        };
        names.iter().enumerate().map(one).collect()
    }
}

fn no_such(what: &'static str, name: &str, known: Vec<String>, field: &str) -> SceneError {
    let nearest = nearest(name, known.iter().map(String::as_str)).map(str::to_owned);
    SceneError::at(field, Mistake::NoSuch { what, name: name.to_owned(), nearest, known: known.join(", ") })
}

/// Nodes of a span by their own numbers, negative ones from the end; all if none are given.
fn numbered(numbers: Option<&[i64]>, span: &Range<usize>, field: &str) -> Result<Vec<usize>, SceneError> {
    let Some(numbers) = numbers else { return Ok(span.clone().collect()) };
    let n = span.len() as i64;
    let one = |(i, &k): (usize, &i64)| {
        let from_start = if k < 0 { k + n } else { k };
        let range = Mistake::Range { value: k as f64, low: -(n as f64), high: (n - 1) as f64 };
        (0..n)
            .contains(&from_start)
            .then(|| span.start + from_start as usize)
            .ok_or_else(|| SceneError::at(format!("{field}[{i}]"), range))
    };
    numbers.iter().enumerate().map(one).collect()
}

fn goals(points: Option<&[[f64; 3]]>, line: Option<Line>, nodes: usize, field: &str) -> Result<Vec<[f64; 3]>, SceneError> {
    match (points, line) {
        (Some(points), None) => {
            let field = format!("{field}.goal");
            if points.len() != nodes {
                return Err(SceneError::at(field, Mistake::Count { found: points.len(), expected: nodes }));
            }
            for (i, point) in points.iter().enumerate() {
                for (a, x) in point.iter().enumerate() {
                    finite(*x, &format!("{field}[{i}][{a}]"))?;
                }
            }
            Ok(points.to_vec())
        }
        (None, Some(line)) => {
            for a in 0..3 {
                finite(line.from[a], &format!("{field}.line.from[{a}]"))?;
                finite(line.to[a], &format!("{field}.line.to[{a}]"))?;
            }
            let at = |k: usize| {
                let t = if nodes > 1 { k as f64 / (nodes - 1) as f64 } else { 0.0 };
                std::array::from_fn(|a| line.from[a] + t * (line.to[a] - line.from[a]))
            };
            Ok((0..nodes).map(at).collect())
        }
        (points, _) => {
            let given = if points.is_some() { 2 } else { 0 };
            Err(SceneError::at(field, Mistake::OneOf { keys: "goal, line".to_owned(), given }))
        }
    }
}

fn finite(value: f64, field: &str) -> Result<f64, SceneError> {
    if value.is_finite() { Ok(value) } else { Err(SceneError::at(field, Mistake::NotFinite { value })) }
}

fn not_negative(value: f64, unit: &'static str, field: &str) -> Result<f64, SceneError> {
    let value = finite(value, field)?;
    if value >= 0.0 { Ok(value) } else { Err(SceneError::at(field, Mistake::Negative { value, unit })) }
}
