//! Which link hangs on which.

use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::view::View;
use pliant_scene::words::nearest;

/// A joint between two links.
#[derive(Clone, Copy, Debug)]
pub struct Edge<'a> {
    pub joint: &'a Element,
    pub parent: &'a str,
    pub child: &'a str,
}

/// All links, and the joints between them.
#[derive(Clone, Debug)]
pub struct Links<'a> {
    links: Vec<&'a Element>,
    edges: Vec<Edge<'a>>,
}

impl<'a> Links<'a> {
    /// Reads links and joints; each link has one parent at most.
    pub fn read(root: &'a Element) -> Result<Self, ImportError> {
        let links: Vec<&Element> = root.children_of("link").collect();
        unique(&links, "link")?;
        let joints: Vec<&Element> = root.children_of("joint").collect();
        unique(&joints, "joint")?;
        let mut tree = Self { links, edges: Vec::new() };
        for joint in joints {
            let (parent, child) = (tree.end(joint, "parent")?, tree.end(joint, "child")?);
            if let Some(first) = tree.edges.iter().find(|e| e.child == child) {
                let (first, second) = (first.joint.label().to_owned(), joint.label().to_owned());
                return Err(ImportError::at(joint, ImportMistake::Loop { link: child.to_owned(), first, second }));
            }
            tree.edges.push(Edge { joint, parent, child });
        }
        Ok(tree)
    }

    /// The link at one end of a joint.
    fn end(&self, joint: &'a Element, tag: &'static str) -> Result<&'a str, ImportError> {
        let missing = || ImportError::at(joint, ImportMistake::Missing { what: format!("<{tag} link=\"…\"/>") });
        let element = joint.child(tag).ok_or_else(missing)?;
        element.mark();
        let name = View::plain(element).required("link")?;
        if self.find(name).is_some() {
            return Ok(name);
        }
        let names = || self.links.iter().map(|l| l.label());
        let mistake = ImportMistake::NoSuch {
            what: "link",
            name: name.to_owned(),
            nearest: nearest(name, names()).map(str::to_owned),
            known: names().collect::<Vec<_>>().join(", "),
        };
        Err(ImportError::at(element, mistake))
    }

    /// The link of that name.
    pub fn find(&self, name: &str) -> Option<&'a Element> {
        self.links.iter().find(|l| l.label() == name).copied()
    }

    /// The joint of that name.
    pub fn joint(&self, name: &str) -> Option<&'a Element> {
        self.edges.iter().map(|e| e.joint).find(|j| j.label() == name)
    }

    /// Names of all joints.
    pub fn joint_names(&self) -> impl Iterator<Item = &'a str> + '_ {
        self.edges.iter().map(|e| e.joint.label())
    }

    /// The joints whose parent is a link, in the file's order.
    pub fn below(&self, link: &Element) -> Vec<Edge<'a>> {
        self.edges.iter().filter(|e| e.parent == link.label()).copied().collect()
    }

    /// The one link that has no parent.
    pub fn root(&self, robot: &Element) -> Result<&'a Element, ImportError> {
        let is_root = |l: &&&Element| self.edges.iter().all(|e| e.child != l.label());
        let roots: Vec<&Element> = self.links.iter().filter(is_root).copied().collect();
        match roots[..] {
            [] if self.links.is_empty() => Err(ImportError::at(robot, ImportMistake::Missing { what: "a <link>".to_owned() })),
            [] => Err(ImportError::at(self.links[0], ImportMistake::NoRoot)),
            [root] => self.reaches_all(root).map(|()| root),
            [_, second, ..] => {
                let links = roots.iter().map(|l| format!("\"{}\"", l.label())).collect::<Vec<_>>().join(", ");
                Err(ImportError::at(second, ImportMistake::Roots { links }))
            }
        }
    }

    /// Refuses a circle beside the tree.
    fn reaches_all(&self, root: &'a Element) -> Result<(), ImportError> {
        let mut reached = vec![root];
        let mut next = 0;
        while next < reached.len() {
            reached.extend(self.below(reached[next]).iter().filter_map(|e| self.find(e.child)));
            next += 1;
        }
        let lost = self.links.iter().find(|l| !reached.iter().any(|r| std::ptr::eq(*r, **l)));
        lost.map_or(Ok(()), |link| Err(ImportError::at(link, ImportMistake::NoRoot)))
    }
}

fn unique(elements: &[&Element], what: &'static str) -> Result<(), ImportError> {
    for (k, element) in elements.iter().enumerate() {
        let name = View::plain(element).required("name")?;
        if let Some(first) = elements[..k].iter().find(|e| e.label() == name) {
            let mistake = ImportMistake::Duplicate { what, name: name.to_owned(), first: first.line };
            return Err(ImportError::at(element, mistake));
        }
    }
    Ok(())
}
