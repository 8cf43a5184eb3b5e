//! `<worldbody>`, `<body>` and `<frame>`.

use super::gravcomp::Carried;
use super::{Reader, words};
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::pose::Pose;
use crate::view::{View, check_attributes, check_children};

/// An element in a body: with the frames around it, and the class of elements that name none.
#[derive(Clone, Copy)]
pub struct Part<'a> {
    pub element: &'a Element,
    pub frame: Pose,
    pub class: Option<&'a str>,
}

/// Elements of a body, those in frames included.
#[derive(Default)]
pub struct Parts<'a> {
    pub joints: Vec<Part<'a>>,
    pub geoms: Vec<Part<'a>>,
    pub bodies: Vec<Part<'a>>,
    pub sites: Vec<Part<'a>>,
    pub inertial: Option<Part<'a>>,
}

impl<'a> Reader<'a> {
    /// The world: bodies on it, and fixed shapes.
    pub(super) fn world(&mut self, world: &'a Element) -> Result<(), ImportError> {
        check_attributes(world, words::BODY)?;
        let class = self.childclass(world, None)?;
        let mut parts = Parts::default();
        self.collect(Part { element: world, frame: Pose::identity(), class }, true, &mut parts)?;
        for geom in parts.geoms {
            self.geom_of_world(&geom)?;
        }
        self.keep_sites(&parts.sites, None)?;
        self.work.kept(world, "", "the world");
        self.work.leftovers(world, "", &words::BODY_REASONS);
        parts.bodies.iter().try_for_each(|body| self.body(body, None))
    }

    fn childclass(&self, element: &'a Element, inherited: Option<&'a str>) -> Result<Option<&'a str>, ImportError> {
        match element.value("childclass") {
            Some(class) => self.defaults.check(element, class).map(|()| Some(class)),
            None => Ok(inherited),
        }
    }

    /// A body, and then those that hang on it.
    fn body(&mut self, part: &Part<'a>, parent: Option<&str>) -> Result<(), ImportError> {
        let element = part.element;
        check_attributes(element, words::BODY)?;
        self.claim(element, "body")?;
        let (view, class) = (View::plain(element), self.childclass(element, part.class)?);
        let pose = part.frame.then(&self.pose(&view)?);
        let name = self.work.names.give(view.text("name").unwrap_or(""), "body", self.work.scene.body.len() + 1);
        let mut parts = Parts::default();
        self.collect(Part { element, frame: Pose::identity(), class }, false, &mut parts)?;
        let mut joints = Vec::new();
        for joint in &parts.joints {
            joints.push(self.joint(joint)?);
        }
        let above = parent.map_or(Some(Pose::identity()), |p| self.work.fixed_pose(p));
        let fixed = above.filter(|_| joints.is_empty()).map(|above| above.then(&pose));
        let (mass, shapes) = self.mass(element, &name, &parts, fixed)?;
        if view.flag("mocap")? == Some(true) {
            self.work.approximated(element, &name, "mocap: the body stays where it is");
        }
        if let Some(part) = view.number("gravcomp")?.filter(|part| *part != 0.0) {
            self.carried.push(Carried { element, body: name.clone(), part });
        }
        self.work.leftovers(element, &name, &words::BODY_REASONS);
        self.work.kept(element, &name, format!("{} kg, {} joint(s)", mass.mass, joints.len()));
        self.work.add_body(element, &name, (parent, &pose), &mass, (joints, shapes));
        self.bodies.push((view.text("name").unwrap_or("").to_owned(), name.clone()));
        self.keep_sites(&parts.sites, Some(&name))?;
        parts.bodies.iter().try_for_each(|body| self.body(body, Some(&name)))
    }

    /// Sorts the elements of a body or frame, opening frames.
    fn collect(&mut self, holder: Part<'a>, in_world: bool, parts: &mut Parts<'a>) -> Result<(), ImportError> {
        let known = if in_world { &words::IN_BODY[3..] } else { &words::IN_BODY[..] };
        check_children(holder.element, known)?;
        for element in &holder.element.children {
            let part = Part { element, ..holder };
            match element.tag.as_str() {
                "joint" | "freejoint" => parts.joints.push(part),
                "geom" => parts.geoms.push(part),
                "body" => parts.bodies.push(part),
                "inertial" if parts.inertial.is_some() => {
                    let first = parts.inertial.map_or(0, |p| p.element.line);
                    let mistake = ImportMistake::Duplicate { what: "inertial", name: String::new(), first };
                    return Err(ImportError::at(element, mistake));
                }
                "inertial" => parts.inertial = Some(part),
                "frame" => self.frame(&part, in_world, parts)?,
                "site" => parts.sites.push(part),
                "camera" | "light" => self.work.ignored_whole(element, "a scene of bodies has none"),
                _ => self.left_out(element)?,
            }
        }
        Ok(())
    }

    fn frame(&mut self, part: &Part<'a>, in_world: bool, parts: &mut Parts<'a>) -> Result<(), ImportError> {
        let element = part.element;
        check_attributes(element, words::FRAME)?;
        let class = self.childclass(element, part.class)?;
        let frame = part.frame.then(&self.pose(&View::plain(element))?);
        element.get("name");
        self.work.kept(element, element.label(), "its place is that of what it holds");
        self.collect(Part { element, frame, class }, in_world, parts)
    }

    /// Elements that would add bodies, masses or forces.
    fn left_out(&mut self, element: &Element) -> Result<(), ImportError> {
        let reason = match element.tag.as_str() {
            "replicate" => "copies are not made; write them out, or save the model from MuJoCo (mj_saveLastXML)",
            "attach" => "models are not put together; save the whole from MuJoCo (mj_saveLastXML)",
            "composite" | "flexcomp" => "its bodies are not made; save the model from MuJoCo (mj_saveLastXML)",
            _ => "plugins are not run",
        };
        self.work.approximate(element, &format!("<{}>", element.tag), reason)?;
        element.mark_all();
        Ok(())
    }

    /// Scales all masses to the sum that the compiler asks for.
    pub(super) fn set_total_mass(&mut self) {
        let Some(wanted) = self.compiler.total_mass else { return };
        let total: f64 = self.work.scene.body.iter().map(|b| b.mass).sum();
        if total > 0.0 {
            for body in &mut self.work.scene.body {
                body.mass *= wanted / total;
                body.inertia = body.inertia.map(|j| j.map(|x| x * wanted / total));
            }
        }
    }
}
