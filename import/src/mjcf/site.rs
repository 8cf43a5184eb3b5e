//! `<site>`: a place in a body. A scene has none; a constraint between two takes where they stand.

use super::Reader;
use super::body::Part;
use super::contact::no_such;
use super::geom::along;
use crate::error::ImportError;
use crate::pose::Pose;
use crate::view::View;

/// A site under its name.
pub(super) struct Site<'a> {
    name: &'a str,
    /// Its body in the scene; none for the world.
    body: Option<String>,
    part: Part<'a>,
}

impl<'a> Reader<'a> {
    /// Keeps the sites of a body in mind.
    pub(super) fn keep_sites(&mut self, sites: &[Part<'a>], body: Option<&str>) -> Result<(), ImportError> {
        for part in sites {
            self.claim(part.element, "site")?;
            self.work.ignored_whole(part.element, "a scene has no sites; constraints between them take where they stand");
            let body = body.map(str::to_owned);
            self.sites.extend(part.element.value("name").map(|name| Site { name, body, part: *part }));
        }
        Ok(())
    }

    /// The body of the site that an attribute names (none: the world), and where it stands in it.
    pub(super) fn find_site(&self, view: &View, attribute: &str) -> Result<(Option<String>, Pose), ImportError> {
        let name = view.required(attribute)?;
        let known = || self.sites.iter().map(|site| site.name).collect();
        let found = self.sites.iter().find(|site| site.name == name);
        let site = found.ok_or_else(|| view.error(attribute, no_such("site", name, known())))?;
        let own = self.view(site.part.element, site.part.class)?;
        let pose = match own.vector::<6>("fromto")? {
            Some(ends) => along(&own, ends)?.0,
            None => self.pose(&own)?,
        };
        Ok((site.body.clone(), site.part.frame.then(&pose)))
    }
}
