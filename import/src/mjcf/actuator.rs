//! `<actuator>`: motors and servos at hinges and slides.
//!
//! MuJoCo's force is gain · u + b₀ + b₁ l + b₂ l̇ with the length l = gear · (q + ref) and acts on the joint times gear. Shortcuts
//! (`motor`, `position`, `velocity`) set these numbers, in default classes first, then in the element. A filter of the control is a lag,
//! a range of the force a saturation; so is a range of the control of a torque drive, since nothing else makes its torque.

use super::{Reader, words};
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::view::{View, check_children};
use pliant_engine::model::ModelBuilder;
use pliant_scene::{Actuator, ActuatorKind, JointKind};

/// Numbers of an actuator, as far as they are set.
#[derive(Clone, Debug)]
struct Numbers {
    gear: f64,
    gain: f64,
    bias: [f64; 3],
    /// Whether the bias acts.
    affine: bool,
    /// The shortcut that set them last.
    shortcut: Option<&'static str>,
    armature: f64,
    damping: f64,
    /// Why it is no actuator of a scene.
    odd: Option<String>,
    /// Whether a filter of the first order stands before it, and its time constant [s].
    filtered: bool,
    time: f64,
    /// Ranges of control and force, and whether they count; by default if they are given.
    ranges: [Option<[f64; 2]>; 2],
    limited: [Option<bool>; 2],
}

impl Default for Numbers {
    fn default() -> Self {
        Self {
            gear: 1.0,
            gain: 1.0,
            bias: [0.0; 3],
            affine: false,
            shortcut: None,
            armature: 0.0,
            damping: 0.0,
            odd: None,
            filtered: false,
            time: 1.0,
            ranges: [None; 2],
            limited: [None; 2],
        }
    }
}

impl Numbers {
    /// Takes over the attributes that an element, or a default, sets.
    fn apply(&mut self, element: &Element) -> Result<(), ImportError> {
        let view = View::plain(element);
        if let Some(gear) = view.numbers("gear", 1..=6)? {
            self.gear = gear[0];
        }
        self.armature = view.number("armature")?.unwrap_or(self.armature);
        self.damping = view.numbers("damping", 1..=3)?.map_or(self.damping, |d| d[0]);
        for (k, name) in ["ctrl", "force"].into_iter().enumerate() {
            self.ranges[k] = view.vector::<2>(&format!("{name}range"))?.or(self.ranges[k]);
            let switch = view.word(&format!("{name}limited"), &["auto", "true", "false"])?;
            self.limited[k] = switch.map_or(self.limited[k], |word| (word != "auto").then_some(word == "true"));
        }
        match element.tag.as_str() {
            "general" => self.general(&view)?,
            "motor" => (self.gain, self.affine, self.odd, self.filtered) = (1.0, false, None, false),
            "position" => self.position(&view)?,
            "velocity" => {
                self.begin("velocity");
                self.gain = view.not_negative("kv", self.gain)?;
                (self.bias, self.affine, self.odd, self.filtered) = ([0.0, 0.0, -self.gain], true, None, false);
            }
            other => self.odd = Some(format!("a scene has no actuator like <{other}>")),
        }
        Ok(())
    }

    /// Forgets the numbers of another shortcut.
    fn begin(&mut self, shortcut: &'static str) {
        if self.shortcut.is_some_and(|other| other != shortcut) {
            (self.gain, self.bias) = (1.0, [0.0; 3]);
        }
        self.shortcut = Some(shortcut);
    }

    fn position(&mut self, view: &View) -> Result<(), ImportError> {
        self.begin("position");
        self.gain = view.not_negative("kp", self.gain)?;
        (self.bias[0], self.bias[1], self.affine, self.odd) = (0.0, -self.gain, true, None);
        if view.has("kv") {
            self.bias[2] = -view.not_negative("kv", 0.0)?;
        }
        if view.has("dampratio") {
            self.bias[2] = view.not_negative("dampratio", 0.0)?;
        }
        if let Some(time) = view.number("timeconst")? {
            (self.filtered, self.time) = (time > 0.0, time);
        }
        Ok(())
    }

    /// The damping ratio, from which the damping is computed: in MuJoCo the third number of a servo's bias, if it is positive.
    fn ratio(&self) -> Option<f64> {
        (self.affine && self.gain == -self.bias[1] && self.bias[2] > 0.0).then_some(self.bias[2])
    }

    fn general(&mut self, view: &View) -> Result<(), ImportError> {
        if let Some(gain) = view.numbers("gainprm", 1..=10)? {
            self.gain = gain[0];
        }
        if let Some(bias) = view.numbers("biasprm", 1..=10)? {
            bias.iter().take(3).zip(&mut self.bias).for_each(|(b, slot)| *slot = *b);
        }
        let kinds = ["fixed", "affine", "muscle", "dcmotor", "user"];
        if let Some(kind) = view.word("gaintype", &kinds)?.filter(|kind| *kind != "fixed") {
            self.odd = Some(format!("a gain of type `{kind}`"));
        }
        match view.word("biastype", &["none", "affine", "muscle", "dcmotor", "user"])? {
            Some("affine") => self.affine = true,
            Some("none") => self.affine = false,
            Some(kind) => self.odd = Some(format!("a bias of type `{kind}`")),
            None => {}
        }
        let dynamics = ["none", "integrator", "filter", "filterexact", "muscle", "dcmotor", "user"];
        match view.word("dyntype", &dynamics)? {
            Some("none") => self.filtered = false,
            Some("filter" | "filterexact") => self.filtered = true,
            Some(kind) => self.odd = Some(format!("dynamics of type `{kind}`")),
            None => {}
        }
        if let Some(numbers) = view.numbers("dynprm", 1..=10)? {
            self.time = numbers[0];
        }
        Ok(())
    }

    /// A range that counts: of the control (0) or the force (1).
    fn range(&self, which: usize, auto: bool) -> Option<[f64; 2]> {
        self.ranges[which].filter(|[low, high]| low < high && self.limited[which].unwrap_or(auto))
    }
}

impl<'a> Reader<'a> {
    /// All actuators of a section.
    pub(super) fn actuators(&mut self, section: &'a Element) -> Result<(), ImportError> {
        check_children(section, &words::ACTUATORS)?;
        section.mark();
        section.children.iter().try_for_each(|element| self.actuator(element))
    }

    fn actuator(&mut self, element: &'a Element) -> Result<(), ImportError> {
        self.claim(element, "actuator")?;
        let mut numbers = Numbers::default();
        for source in self.defaults.chain(element, element.value("class"), &words::ACTUATORS)?.into_iter().chain([element]) {
            numbers.apply(source)?;
        }
        let Some(joint_name) = element.value("joint").or_else(|| element.value("jointinparent")) else {
            return self.without_joint(element);
        };
        let place = self.find_joint(element, joint_name)?.clone();
        if !matches!(place.kind, JointKind::Revolute | JointKind::Prismatic) {
            numbers.odd = Some("a joint of more than one degree of freedom".to_owned());
        }
        if !self.physics.actuation {
            self.work.ignored_whole(element, "left out: switched off by the option's flag");
            return Ok(());
        }
        if let Some(why) = &numbers.odd {
            return self.leave_out(element, why);
        }
        self.check_ranges(element, &numbers)?;
        self.rotor(element, &place.name, &numbers)?;
        if let Some(ratio) = numbers.ratio() {
            numbers.bias[2] = -self.damping_of(element, &place.name, ratio, &numbers)?;
            let damping = -numbers.bias[2];
            self.work.kept(
                element,
                element.label(),
                format!("dampratio {ratio}, as damping {damping:.6} with all joints at zero"),
            );
        }
        let number = self.work.scene.actuator.len() + 1;
        let name = self.work.names.give(element.label(), "motor", number);
        element.get("name");
        let actuator = Actuator { name, joint: place.name, gear: numbers.gear, ..Actuator::default() };
        self.add(element, &numbers, place.zero, actuator)
    }

    /// An actuator at something else than a joint.
    fn without_joint(&mut self, element: &Element) -> Result<(), ImportError> {
        let other =
            ["tendon", "site", "body", "slidersite", "cranksite", "plugin"].into_iter().find(|name| element.get(name).is_some());
        match other {
            Some(what) => self.leave_out(element, &format!("it acts on a {what}, not on a joint")),
            None => Err(ImportError::at(element, ImportMistake::Missing { what: "`joint`".to_owned() })),
        }
    }

    /// An actuator that the scene goes without, with one control less.
    fn leave_out(&mut self, element: &Element, why: &str) -> Result<(), ImportError> {
        self.work.approximate(element, "an actuator that is left out", why)?;
        element.mark_all();
        Ok(())
    }

    /// Refuses limits that are switched on and missing, or the wrong way round.
    fn check_ranges(&self, element: &Element, numbers: &Numbers) -> Result<(), ImportError> {
        for (k, name) in ["ctrlrange", "forcerange"].into_iter().enumerate() {
            let error = |mistake| Err(View::plain(element).error(name, mistake));
            match (numbers.ranges[k], numbers.limited[k]) {
                (None, Some(true)) => return error(ImportMistake::Missing { what: format!("`{name}`") }),
                (Some([low, high]), limited) if low > high && limited.unwrap_or(self.compiler.autolimits) => {
                    return error(ImportMistake::LimitOrder { attribute: name.to_owned(), low, high });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// A motor's own inertia and friction, seen at its joint.
    fn rotor(&mut self, element: &Element, joint: &str, numbers: &Numbers) -> Result<(), ImportError> {
        if numbers.armature == 0.0 && numbers.damping == 0.0 {
            return Ok(());
        }
        let squared = numbers.gear * numbers.gear;
        if let Some(joint) = self.work.scene.body.iter_mut().flat_map(|b| &mut b.joint).find(|j| j.name == joint) {
            joint.armature += squared * numbers.armature;
            joint.damping += squared * numbers.damping;
        }
        self.work.kept(element, joint, "armature and damping of the actuator, as those of its joint");
        Ok(())
    }

    /// The damping of a ratio: ratio · 2 √(kp m), with the inertia m = 1/(M⁻¹)_jj that the joint feels where all joints are at zero and
    /// all others yield.
    fn damping_of(&self, element: &Element, joint: &str, ratio: f64, numbers: &Numbers) -> Result<f64, ImportError> {
        let failed = |error| ImportError::at(element, ImportMistake::Scene { error });
        // contact pairs are not settled yet, and do not matter here
        let mut bare = self.work.scene.clone();
        bare.body.iter_mut().for_each(|b| b.shape.clear());
        let model = match ModelBuilder::new(&bare) {
            Ok(builder) => builder.build(),
            Err(pliant_engine::model::BuildError::Scene(error)) => return Err(failed(error)),
            Err(_) => return Ok(0.0),
        };
        let (theta, n) = (model.params().values(), model.tree().nv());
        let inertia = model.mass_matrix(&model.tree().neutral(), theta);
        let dof = model.tree().joint(joint).map_or(0, |j| model.tree().joints()[j].v);
        let inverse = nalgebra::DMatrix::from_row_slice(n, n, &inertia).cholesky().map(|c| c.inverse());
        let felt = inverse.map_or(inertia[dof * n + dof], |inverse| 1.0 / inverse[(dof, dof)]) / (numbers.gear * numbers.gear);
        Ok(ratio * 2.0 * (numbers.gain * felt).sqrt())
    }

    /// Adds the actuator whose force has these numbers.
    fn add(&mut self, element: &Element, n: &Numbers, zero: f64, mut actuator: Actuator) -> Result<(), ImportError> {
        let [b0, b1, b2] = if n.affine { n.bias } else { [0.0; 3] };
        // b₁ acts on MuJoCo's coordinate, the scene's plus `zero`
        actuator.offset = b0 + b1 * n.gear * zero;
        // the control of a servo in units of its own stiffness or damping
        let (kind, scale) = match (b1, b2) {
            (0.0, 0.0) => (ActuatorKind::Torque, 1.0),
            (0.0, b2) if b2 < 0.0 => (ActuatorKind::Velocity, -n.gain / b2),
            (b1, b2) if b1 < 0.0 && b2 <= 0.0 => (ActuatorKind::Position, -n.gain / b1),
            _ => {
                return self.leave_out(element, "it drives its joint away, which no servo of a scene does");
            }
        };
        (actuator.kind, actuator.stiffness, actuator.damping) = (kind, -b1 + 0.0, -b2 + 0.0);
        if kind == ActuatorKind::Torque {
            actuator.gain = n.gain;
        }
        let name = actuator.name.clone();
        if scale != 1.0 {
            self.work.approximated(element, &name, format!("its control is MuJoCo's times {scale}"));
        }
        if n.filtered && n.time > 0.0 {
            // MuJoCo's filter begins at zero
            (actuator.lag, actuator.start) = (Some(n.time), Some(0.0));
            self.work.kept(element, &name, format!("a filter of {} s, as its lag", n.time));
        }
        let auto = self.compiler.autolimits;
        self.saturate(element, [n.range(0, auto), n.range(1, auto)], &mut actuator);
        self.work.leftovers(element, &name, &words::ACTUATOR_REASONS);
        let what = match kind {
            ActuatorKind::Torque => "torque",
            ActuatorKind::Position => "position",
            ActuatorKind::Velocity => "velocity",
        };
        self.work.kept(element, &name, format!("{what} drive at {}", actuator.joint));
        self.work.scene.actuator.push(actuator);
        Ok(())
    }
}
