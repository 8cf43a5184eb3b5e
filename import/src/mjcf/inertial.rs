//! The mass of a body: `<inertial>`, or the sum of its geoms.

use super::body::{Part, Parts};
use super::compiler::FromGeoms;
use super::{Reader, words};
use crate::element::Element;
use crate::error::{ImportError, ImportMistake};
use crate::inertia::Mass;
use crate::pose::Pose;
use crate::view::{View, check_attributes};
use pliant_math::spatial::full;
use pliant_scene::BodyShape;

impl<'a> Reader<'a> {
    /// A body's mass as the compiler makes it, and the shapes it touches with; `fixed` is where it stands if it cannot move.
    pub(super) fn mass(
        &mut self,
        element: &Element,
        name: &str,
        parts: &Parts<'a>,
        fixed: Option<Pose>,
    ) -> Result<(Mass, Vec<BodyShape>), ImportError> {
        let from_geoms = match self.compiler.from_geoms {
            FromGeoms::Auto => parts.inertial.is_none(),
            FromGeoms::Always => true,
            FromGeoms::Never => false,
        };
        let (mut masses, mut shapes) = (Vec::new(), Vec::new());
        for geom in &parts.geoms {
            let (mass, shape) = self.geom(geom, name, from_geoms, fixed)?;
            masses.extend(mass);
            shapes.extend(shape);
        }
        let given = match &parts.inertial {
            Some(part) if from_geoms => {
                self.work.ignored_whole(part.element, "inertiafromgeom=\"true\" takes the mass from the geoms");
                None
            }
            Some(part) => Some(self.inertial(part, name)?),
            None => None,
        };
        let mass = self.bounded(given.unwrap_or_else(|| Mass::sum(&masses)));
        let mass = if mass.mass == 0.0 { Mass::none() } else { self.work.possible(element, name, mass)? };
        Ok((mass, shapes))
    }

    fn inertial(&mut self, part: &Part<'a>, body: &str) -> Result<Mass, ImportError> {
        let element = part.element;
        check_attributes(element, words::INERTIAL)?;
        let view = View::plain(element);
        let pose = part.frame.then(&self.pose(&view)?);
        let mass = view.number("mass")?.ok_or_else(|| view.missing("`mass`"))?;
        if mass < 0.0 {
            return Err(
                view.error("mass", ImportMistake::Sign { attribute: "mass".to_owned(), value: mass, must: "not be negative" })
            );
        }
        let (diagonal, matrix) = (view.vector::<3>("diaginertia")?, view.vector::<6>("fullinertia")?);
        let inertia = match (diagonal, matrix) {
            (Some(_), Some(_)) => {
                let what = "`fullinertia` beside `diaginertia`".to_owned();
                let reason = "an inertia can be given in one way only".to_owned();
                return Err(view.error("fullinertia", ImportMistake::Unsupported { what, reason }));
            }
            (Some(moments), None) => Mass::principal(mass, moments, &pose),
            // xx, yy, zz, xy, xz, yz
            (None, Some(numbers)) => Mass::with_inertia(mass, &full(&numbers), &pose),
            (None, None) => Mass::principal(mass, [0.0; 3], &Pose { position: pose.position, ..Pose::identity() }),
        };
        self.work.kept(element, body, format!("{mass} kg"));
        Ok(inertia)
    }

    /// Lower bounds and the balance of principal moments, as the compiler asks for them.
    fn bounded(&self, mass: Mass) -> Mass {
        let (least, floor) = (self.compiler.bound_mass, self.compiler.bound_inertia);
        let mut out = Mass { mass: mass.mass.max(least), ..mass };
        if floor > 0.0 {
            out = out.with_moments(|m| m.map(|x| x.max(floor)));
        }
        if self.compiler.balance && out.is_unbalanced() {
            out = out.with_moments(|m| [(m[0] + m[1] + m[2]) / 3.0; 3]);
        }
        out
    }
}
