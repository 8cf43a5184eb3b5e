//! `<contact>`, and the contact of each pair of objects by masks and friction of geoms.
//!
//! MuJoCo decides for every pair of geoms whether they touch, and with which friction: the larger of the two, or that of the geom of
//! higher priority. A scene takes the mean of two shapes, and has rules for pairs of objects (a body with all its shapes is one), so a
//! rule is made wherever the two disagree.

use super::{Reader, words};
use crate::constants::IMPORT;
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::view::{View, check_attributes, check_children};
use pliant_scene::ContactRule;
use pliant_scene::words::nearest;
use std::collections::BTreeMap;

/// A geom that may touch.
#[derive(Clone, Debug)]
pub struct Touching<'a> {
    pub element: &'a Element,
    /// Name in the file; may be empty.
    pub original: &'a str,
    /// Name of the object of the scene that it belongs to.
    pub object: String,
    /// Name in the scene of the body that has it; none if it is the world's.
    pub body: Option<String>,
    /// contype, conaffinity.
    pub masks: [u32; 2],
    /// Sliding friction as the file has it.
    pub friction: f64,
    pub condim: f64,
    pub priority: f64,
}

impl Touching<'_> {
    /// Friction of its shape in the scene.
    fn own(&self) -> f64 {
        if self.condim < 3.0 { 0.0 } else { self.friction }
    }

    /// Whether masks let two touch.
    fn meets(&self, other: &Self) -> bool {
        self.masks[0] & other.masks[1] != 0 || other.masks[0] & self.masks[1] != 0
    }

    /// MuJoCo's friction of two.
    fn friction_with(&self, other: &Self) -> f64 {
        if self.priority != other.priority {
            return if self.priority > other.priority { self.own() } else { other.own() };
        }
        if self.condim.max(other.condim) < 3.0 { 0.0 } else { self.friction.max(other.friction) }
    }
}

/// A `<pair>`.
#[derive(Clone, Debug)]
pub struct Paired<'a> {
    element: &'a Element,
    geoms: [&'a str; 2],
    /// Sliding friction, if it is given.
    friction: Option<f64>,
    condim: Option<f64>,
}

impl Paired<'_> {
    fn joins(&self, a: &Touching, b: &Touching) -> bool {
        let [x, y] = self.geoms;
        (x == a.original && y == b.original) || (x == b.original && y == a.original)
    }
}

/// Contact between two objects.
#[derive(Clone, Debug, Default)]
struct Meeting {
    touching: usize,
    excluded: usize,
    /// Distinct values of MuJoCo's friction, and whether the scene's own differs anywhere.
    frictions: Vec<f64>,
    differs: bool,
}

impl<'a> Reader<'a> {
    /// Reads all `<pair>` elements, before the geoms that they name.
    pub(super) fn read_pairs(&mut self, root: &'a Element) -> Result<(), ImportError> {
        for section in root.children_of("contact") {
            check_children(section, &["pair", "exclude"])?;
            for element in section.children_of("pair") {
                check_attributes(element, words::PAIR)?;
                let view = self.view(element, None)?;
                let geoms = [view.required("geom1")?, view.required("geom2")?];
                let friction = view.numbers("friction", 1..=5)?.map(|f| f[0]);
                if let Some(value) = friction.filter(|f| *f < 0.0) {
                    let mistake = ImportMistake::Sign { attribute: "friction".to_owned(), value, must: "not be negative" };
                    return Err(view.error("friction", mistake));
                }
                let condim = view.number("condim")?;
                self.paired.push(Paired { element, geoms, friction, condim });
            }
        }
        Ok(())
    }

    /// Whether a `<pair>` names that geom.
    pub(super) fn is_paired(&self, geom: &str) -> bool {
        !geom.is_empty() && self.paired.iter().any(|p| p.geoms.contains(&geom))
    }

    /// Makes the rules of all pairs of objects, and reports `<contact>`.
    pub(super) fn contacts(&mut self, root: &'a Element) -> Result<(), ImportError> {
        let excluded = self.excludes(root)?;
        self.report_pairs()?;
        if !self.physics.filter_parent && !self.touching.is_empty() {
            self.work.approximated(root, "", "filterparent: neighbours at a joint do not touch in a scene");
        }
        let mut objects: BTreeMap<&str, Vec<&Touching>> = BTreeMap::new();
        let touching = std::mem::take(&mut self.touching);
        touching.iter().for_each(|t| objects.entry(&t.object).or_default().push(t));
        let objects: Vec<Vec<&Touching>> = objects.into_values().collect();
        let mut through: Vec<(usize, usize)> = Vec::new();
        let mut rubbing: Vec<(usize, usize, Meeting)> = Vec::new();
        for (i, a) in objects.iter().enumerate() {
            for (j, b) in objects.iter().enumerate().skip(i + 1) {
                if !self.may_touch(a[0].body.as_deref(), b[0].body.as_deref()) {
                    continue;
                }
                let meeting = self.meeting(a, b, &excluded);
                match meeting.touching {
                    0 => through.push((i, j)),
                    _ => rubbing.push((i, j, meeting)),
                }
            }
        }
        self.rule_through(root, &objects, &through, &excluded)?;
        self.rule_rubbing(root, &objects, &rubbing);
        for section in root.children_of("contact") {
            self.closed(section);
        }
        Ok(())
    }

    fn meeting(&self, a: &[&Touching], b: &[&Touching], excluded: &[Excluded]) -> Meeting {
        let mut out = Meeting::default();
        for (x, y) in a.iter().flat_map(|x| b.iter().map(move |y| (*x, *y))) {
            let pair = self.paired.iter().find(|p| p.joins(x, y));
            if pair.is_none() && (!x.meets(y) || excluded.iter().any(|e| e.parts(x, y))) {
                out.excluded += 1;
                continue;
            }
            let with = |condim: f64, friction: f64| if condim < 3.0 { 0.0 } else { friction };
            let theirs = pair.map_or(x.friction_with(y), |p| {
                with(p.condim.unwrap_or(x.condim.max(y.condim)), p.friction.unwrap_or(x.friction.max(y.friction)))
            });
            out.touching += 1;
            out.differs |= (theirs - 0.5 * (x.own() + y.own())).abs() > IMPORT.same_friction;
            if !out.frictions.contains(&theirs) {
                out.frictions.push(theirs);
            }
        }
        out
    }

    /// Whether the scene would let two objects touch: of two bodies, those that are neither one nor neighbours at a joint.
    fn may_touch(&self, a: Option<&str>, b: Option<&str>) -> bool {
        let root = |name: Option<&str>| name.and_then(|n| self.carrier(n));
        let (x, y) = (root(a), root(b));
        let above = |carrier: Option<&str>| self.scene_body(carrier?)?.parent.as_deref().and_then(|p| self.carrier(p));
        x != y && (x.is_none() || y.is_none() || (above(x) != y && above(y) != x))
    }

    fn scene_body(&self, name: &str) -> Option<&pliant_scene::Body> {
        self.work.scene.body.iter().find(|b| b.name == name)
    }

    /// The first body at or above one that has joints; none if it cannot move.
    pub(super) fn carrier(&self, name: &str) -> Option<&str> {
        let body = self.scene_body(name)?;
        if body.joint.is_empty() { body.parent.as_deref().and_then(|p| self.carrier(p)) } else { Some(&body.name) }
    }

    /// Pairs of objects that pass through each other.
    fn rule_through(
        &mut self,
        root: &Element,
        objects: &[Vec<&Touching>],
        pairs: &[(usize, usize)],
        excluded: &[Excluded],
    ) -> Result<(), ImportError> {
        if pairs.len() > IMPORT.pair_rules {
            let reason =
                format!("masks of geoms keep {} pairs of objects apart, more than are written down: they touch", pairs.len());
            return self.work.approximate(root, "contype and conaffinity", &reason);
        }
        let mut said: BTreeMap<usize, Vec<&str>> = BTreeMap::new();
        for (i, j) in pairs {
            let (a, b) = (objects[*i][0], objects[*j][0]);
            self.work.ignore_pair(&a.object, &b.object);
            if !excluded.iter().any(|e| e.parts(a, b)) {
                said.entry(*i).or_default().push(&b.object);
            }
        }
        for (i, others) in said {
            let reason = format!("contype and conaffinity: it passes through {}, as [[contact.pair]]", others.join(", "));
            self.work.kept(objects[i][0].element, &objects[i][0].object, reason);
        }
        Ok(())
    }

    /// Pairs of objects that touch, with another friction than their mean, or only with some of their shapes.
    fn rule_rubbing(&mut self, root: &Element, objects: &[Vec<&Touching>], pairs: &[(usize, usize, Meeting)]) {
        let differing = pairs.iter().filter(|(_, _, m)| m.differs).count();
        if differing > IMPORT.pair_rules {
            let reason = format!("friction of {differing} pairs of objects: the mean of the two counts, not MuJoCo's larger one");
            self.work.approximated(root, "", reason);
        }
        let mut said: BTreeMap<(usize, bool, u64), Vec<&str>> = BTreeMap::new();
        for (i, j, meeting) in pairs {
            let (a, b) = (objects[*i][0], objects[*j][0]);
            if meeting.excluded > 0 {
                let reason = format!("some of its geoms pass through some of \"{}\" in MuJoCo; here all of them touch", b.object);
                self.work.approximated(a.element, &a.object, reason);
            }
            if !meeting.differs || differing > IMPORT.pair_rules {
                continue;
            }
            let largest = meeting.frictions.iter().copied().fold(0.0, f64::max);
            let between = [a.object.clone(), b.object.clone()];
            self.work.scene.contact.pair.push(ContactRule { between, friction: Some(largest), ..ContactRule::default() });
            said.entry((*i, meeting.frictions.len() > 1, largest.to_bits())).or_default().push(&b.object);
        }
        for ((i, mixed, friction), others) in said {
            let (friction, others, object) = (f64::from_bits(friction), others.join(", "), objects[i][0]);
            let given = format!("friction {friction} with {others}, as [[contact.pair]]");
            if mixed {
                self.work.approximated(object.element, &object.object, format!("{given}: the largest of its geoms there"));
            } else {
                let reason = format!("{given}: MuJoCo's choice of the two, where a scene takes the mean");
                self.work.kept(object.element, &object.object, reason);
            }
        }
    }

    /// Reads and reports `<exclude>`.
    fn excludes(&mut self, root: &'a Element) -> Result<Vec<Excluded>, ImportError> {
        let mut out = Vec::new();
        for section in root.children_of("contact") {
            for element in section.children_of("exclude") {
                check_attributes(element, "name body1 body2")?;
                let view = View::plain(element);
                view.text("name");
                let bodies = [self.find_body(&view, "body1")?, self.find_body(&view, "body2")?];
                let [a, b] = [0, 1].map(|k| bodies[k].as_deref().unwrap_or("the world"));
                self.work.kept(element, element.label(), format!("{a} and {b} pass through each other"));
                out.push(Excluded(bodies));
            }
        }
        Ok(out)
    }

    /// The body that an attribute names, in the scene; none for the world.
    pub(super) fn find_body(&self, view: &View, attribute: &str) -> Result<Option<String>, ImportError> {
        let name = view.required(attribute)?;
        if name == "world" {
            return Ok(None);
        }
        let found = self.bodies.iter().find(|(original, _)| original == name).map(|(_, name)| name.clone());
        let names = || self.bodies.iter().map(|(original, _)| original.as_str()).filter(|n| !n.is_empty());
        found.map(Some).ok_or_else(|| view.error(attribute, no_such("body", name, names().collect())))
    }

    fn report_pairs(&mut self) -> Result<(), ImportError> {
        for pair in self.paired.clone() {
            let find = |name: &str| self.touching.iter().find(|t| t.original == name);
            self.work.leftovers(pair.element, pair.element.label(), &words::CONTACT_REASONS);
            let [Some(a), Some(b)] = pair.geoms.map(find) else {
                // one that is not there, or one that has no shape
                let lost = pair.geoms.into_iter().find(|name| find(name).is_none()).unwrap_or("");
                let reason = format!("geom \"{lost}\" has no shape in the scene");
                if self.known_geoms.contains(lost) {
                    self.work.ignored(pair.element, pair.element.label(), reason);
                    continue;
                }
                let names = self.known_geoms.iter().map(String::as_str).collect();
                return Err(ImportError::at(pair.element, no_such("geom", lost, names)));
            };
            if self.may_touch(a.body.as_deref(), b.body.as_deref()) {
                let reason = format!("\"{}\" and \"{}\" touch", a.object, b.object);
                self.work.kept(pair.element, pair.element.label(), reason);
            } else {
                let reason = "neighbours at a joint do not touch in a scene";
                self.work.approximated(pair.element, pair.element.label(), reason);
            }
        }
        Ok(())
    }
}

/// Two bodies of the scene that pass through each other; none is the world.
struct Excluded([Option<String>; 2]);

impl Excluded {
    fn parts(&self, a: &Touching, b: &Touching) -> bool {
        let [x, y] = &self.0;
        (*x == a.body && *y == b.body) || (*x == b.body && *y == a.body)
    }
}

pub(super) fn no_such(what: &'static str, name: &str, known: Vec<&str>) -> ImportMistake {
    ImportMistake::NoSuch {
        what,
        name: name.to_owned(),
        nearest: nearest(name, known.iter().copied()).map(str::to_owned),
        known: known.join(", "),
    }
}
