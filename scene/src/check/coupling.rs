//! Refusing couplings that make no sense.

use super::not_negative;
use crate::body::Joint;
use crate::coupling::Coupling;
use crate::error::{Mistake, SceneError};
use crate::file::Scene;
use crate::words::nearest;

/// Most coefficients of a polynomial.
const MOST: usize = 5;

pub(super) fn check(scene: &Scene) -> Result<(), SceneError> {
    scene.coupling.iter().enumerate().try_for_each(|(k, coupling)| one(scene, coupling, &format!("coupling[{k}]")))
}

fn one(scene: &Scene, coupling: &Coupling, field: &str) -> Result<(), SceneError> {
    single(scene, &coupling.joint, &format!("{field}.joint"))?;
    if let Some(to) = &coupling.to {
        single(scene, to, &format!("{field}.to"))?;
        if *to == coupling.joint {
            return Err(SceneError::at(format!("{field}.to"), Mistake::FollowsItself { joint: to.clone() }));
        }
    }
    let (found, low) = (coupling.coefficients.len(), 1);
    if !(low..=MOST).contains(&found) {
        return Err(SceneError::at(format!("{field}.coefficients"), Mistake::Coefficients { found, most: MOST }));
    }
    if coupling.to.is_none() && (found > 1 || coupling.reference != 0.0) {
        let (key, likely) = if found > 1 { ("coefficients", found) } else { ("reference", 1) };
        return Err(SceneError::at(format!("{field}.{key}"), Mistake::NobodyLeads { coefficients: likely }));
    }
    coupling.compliance.map_or(Ok(()), |c| not_negative(&format!("{field}.compliance"), c, "rad/(N·m)"))
}

/// The joint is there, and has one coordinate.
fn single(scene: &Scene, name: &str, field: &str) -> Result<(), SceneError> {
    let joints = || scene.body.iter().flat_map(|b| &b.joint);
    let names = || joints().map(|j: &Joint| j.name.as_str());
    let Some(joint) = joints().find(|j| j.name == name) else {
        let mistake = Mistake::NoSuch {
            what: "joint",
            name: name.to_owned(),
            nearest: nearest(name, names()).map(str::to_owned),
            known: names().collect::<Vec<_>>().join(", "),
        };
        return Err(SceneError::at(field, mistake));
    };
    match joint.kind.n_dofs() {
        1 => Ok(()),
        dofs => Err(SceneError::at(field, Mistake::CouplesMany { joint: name.to_owned(), dofs })),
    }
}
