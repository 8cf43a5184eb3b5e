//! Sections besides bodies, actuators and constraints: tendons, and those that are only reported.

use super::{Reader, words};
use crate::element::Element;
use crate::error::ImportError;
use crate::view::{View, check_attributes, check_children};

/// Attributes that make a tendon exert a force.
const PULLS: [&str; 7] = ["stiffness", "damping", "frictionloss", "armature", "range", "limited", "springlength"];

impl<'a> Reader<'a> {
    /// Everything that has not been looked at yet.
    pub(super) fn sections(&mut self, root: &'a Element) -> Result<(), ImportError> {
        for section in &root.children {
            match section.tag.as_str() {
                "compiler" | "option" | "default" | "worldbody" | "actuator" | "contact" => {}
                "equality" => self.equalities(section)?,
                "tendon" => self.tendons(section)?,
                "deformable" => self.deformables(section)?,
                _ => self.ignored_section(section),
            }
        }
        self.report_defaults()
    }

    fn tendons(&mut self, section: &'a Element) -> Result<(), ImportError> {
        check_children(section, &["spatial", "fixed"])?;
        for element in &section.children {
            let class = element.value("class");
            let defaults = self.defaults.chain(element, class, &["tendon"])?;
            let view = View::new(element, defaults.into_iter().rev());
            if PULLS.iter().any(|name| view.has(name)) {
                self.work.approximate(element, "a tendon with a force or a limit", "tendons are not simulated")?;
            } else {
                self.work.ignored(element, element.label(), "a tendon without forces of its own");
            }
            element.mark_all();
        }
        self.closed(section);
        Ok(())
    }

    fn deformables(&mut self, section: &'a Element) -> Result<(), ImportError> {
        check_children(section, &["flex", "skin"])?;
        for element in &section.children {
            if element.tag == "skin" {
                self.work.ignored_whole(element, "bodies are not drawn");
                continue;
            }
            self.work.approximate(element, "a flex", "deformable bodies are not imported")?;
            element.mark_all();
        }
        self.closed(section);
        Ok(())
    }

    /// A section all of whose elements have been reported.
    pub(super) fn closed(&mut self, section: &Element) {
        if section.children.is_empty() {
            self.work.ignored(section, "", "empty");
        }
        section.mark();
    }

    fn ignored_section(&mut self, section: &Element) {
        let reason = words::SECTION_REASONS.iter().find(|(tag, _)| *tag == section.tag).map_or("not simulated", |(_, r)| *r);
        section.children.iter().filter(|c| !c.is_seen()).for_each(|child| self.work.ignored_whole(child, reason));
        if section.children.is_empty() || !section.attributes.is_empty() {
            self.work.ignored(section, "", reason);
            section.attributes.iter().for_each(|a| a.mark());
        }
        section.mark();
    }

    /// Default classes: each element once, with its unread attributes.
    fn report_defaults(&mut self) -> Result<(), ImportError> {
        let elements: Vec<&Element> = self.defaults.elements().collect();
        for element in elements {
            match element.tag.as_str() {
                "joint" => check_attributes(element, words::JOINT)?,
                "geom" => check_attributes(element, words::GEOM)?,
                "pair" => check_attributes(element, words::PAIR)?,
                _ => {}
            }
            let (all, unused) = (element.attributes.len(), element.take_unused());
            if unused.len() < all {
                self.work.kept(element, "", "read where elements of its class are");
            }
            if !unused.is_empty() {
                let reason = format!("{}: without effect here, as in the elements of its class", unused.join(", "));
                self.work.ignored(element, "", reason);
            }
            element.mark_all();
        }
        Ok(())
    }
}
