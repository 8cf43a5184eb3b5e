//! Likely cause and fix of each mistake.

use super::error::ImportMistake;

impl ImportMistake {
    /// (likely cause, fix).
    pub(super) fn advice(&self) -> (String, String) {
        self.advice_on_text().or_else(|| self.advice_on_names()).unwrap_or_else(|| self.advice_on_physics())
    }

    /// Files, elements, attributes.
    fn advice_on_text(&self) -> Option<(String, String)> {
        Some(match self {
            Self::Read { .. } => {
                both("the path is wrong, or the file may not be read", "check the path and the file's permissions")
            }
            Self::Syntax { xacro: true, .. } => {
                both("macros (xacro) that have not been expanded", "expand them first: `xacro robot.urdf.xacro > robot.urdf`")
            }
            Self::Syntax { .. } => both("a tag, quote or bracket is missing or misplaced", "correct this line"),
            Self::NotAModel { .. } => {
                both("another kind of XML file", "give an MJCF file (root <mujoco>) or a URDF file (root <robot>)")
            }
            Self::UnknownElement { nearest: Some(near), .. } => both("a typing error", format!("did you mean <{near}>?")),
            Self::UnknownElement { known, .. } => {
                both("an element of another format, or in the wrong place", format!("remove it; elements known here: {known}"))
            }
            Self::UnknownAttribute { nearest: Some(near), .. } => both("a typing error", format!("did you mean `{near}`?")),
            Self::UnknownAttribute { known, .. } => {
                both("an attribute of another element or version", format!("remove it; attributes known here: {known}"))
            }
            Self::Missing { what } => both("it was left out, or stands in another element", format!("add {what}")),
            Self::NotANumber { .. } => {
                both("a unit, a comma or an unexpanded variable in a number", "write plain numbers, separated by spaces")
            }
            Self::Count { expected, .. } => both("numbers are missing or superfluous", format!("write {expected} numbers")),
            Self::Choice { nearest: Some(near), .. } => both("a typing error", format!("did you mean \"{near}\"?")),
            Self::Choice { choices, .. } => both("a word that this attribute does not know", format!("write one of {choices}")),
            Self::IncludeCycle { .. } => both("two files include each other", "remove one of the <include> elements"),
            Self::MissingFile { path, .. } if path.contains("://") => {
                let package = path.split("://").nth(1).and_then(|p| p.split('/').next()).unwrap_or("NAME");
                both(
                    "the package is in no folder above the model, or its files were not copied along",
                    format!("say where it is: --package {package}=FOLDER (in Python packages={{\"{package}\": FOLDER}})"),
                )
            }
            Self::Mesh { error, .. } => error.advice(),
            Self::MissingFile { .. } => both(
                "the path is relative to another folder, or the file was not copied along",
                "put the file there, or correct the path",
            ),
            _ => return None,
        })
    }

    /// References.
    fn advice_on_names(&self) -> Option<(String, String)> {
        Some(match self {
            Self::UnknownClass { nearest: Some(near), .. } | Self::NoSuch { nearest: Some(near), .. } => {
                both("a typing error", format!("did you mean \"{near}\"?"))
            }
            Self::UnknownClass { known, .. } => {
                both("the class is defined in a file that is not included", format!("define it, or write one of: {known}"))
            }
            Self::NoSuch { what, known, .. } if known.is_empty() => {
                both(format!("the model has no {what} at all"), format!("add a {what}"))
            }
            Self::NoSuch { what, known, .. } => {
                both(format!("the {what} was renamed or removed"), format!("name one of: {known}"))
            }
            Self::Duplicate { what, .. } => both("a part was copied and not renamed", format!("give every {what} its own name")),
            Self::Loop { .. } => both(
                "a kinematic loop, which a tree of links cannot hold",
                "remove one of the two joints; close the loop again by a [[closure]] in the scene",
            ),
            Self::NoRoot => {
                both("parent and child were swapped in a joint", "turn one joint around, so that the links form a tree")
            }
            Self::Roots { .. } => both("a joint is missing", "connect every link but one to a parent by a <joint>"),
            _ => return None,
        })
    }

    /// Masses, units, and features that cannot be kept.
    fn advice_on_physics(&self) -> (String, String) {
        match self {
            Self::Sign { .. } => both("a sign error, or a value left at zero", "correct the number"),
            Self::NoDirection { .. } => both("a vector left at zero", "write a vector with a direction, e.g. \"1 0 0\""),
            Self::Inertia { .. } => both(
                "moments about another point than the centre of mass, products of inertia of the wrong sign, or invented numbers",
                "correct the moments (kg·m², about the centre of mass), or pass --approximate to make them possible",
            ),
            Self::Massless { .. } => both("the mass was left out", "give the body an inertia, or remove its joint"),
            Self::LimitOrder { .. } => both("lower and upper limit were swapped", "write the lower limit first"),
            Self::Unit { likely, unit, .. } => {
                both(format!("{likely}?"), format!("write it in {unit}; if it is meant so, pass --approximate"))
            }
            Self::Overlap { .. } => both(
                "neighbours that are meant to overlap, a start in the ground, or shapes in another unit",
                "move them apart; or let them pass through each other, in MJCF by <exclude> in <contact>, for all such pairs by \
                 --approximate; or leave all shapes out by --no-contact",
            ),
            Self::FreeBelow { .. } => both("a floating link in the middle of a tree", "let it hang on the world, alone"),
            Self::NeedsApproximate { .. } => both(
                "the model uses what scenes do not have yet",
                "pass --approximate to import the model without it; the report says so",
            ),
            Self::Unsupported { .. } => both("the model uses what the importer does not know", "write the model without it"),
            Self::Scene { .. } => both("a value that the format allows and a scene does not", "correct the value named here"),
            _ => both("unknown", "correct what is named here"),
        }
    }
}

fn both(cause: impl Into<String>, fix: impl Into<String>) -> (String, String) {
    (cause.into(), fix.into())
}
