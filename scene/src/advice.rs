//! Likely cause and fix of each mistake.

use super::error::Mistake;
use super::words::Num;

impl Mistake {
    /// (likely cause, fix).
    pub(super) fn advice(&self) -> (String, String) {
        self.advice_on_text().or_else(|| self.advice_on_values()).unwrap_or_else(|| self.advice_on_objects())
    }

    /// Keys, types and words.
    fn advice_on_text(&self) -> Option<(String, String)> {
        Some(match self {
            Self::Read { .. } => {
                both("the path is wrong, or the file may not be read", "check the path and the file's permissions")
            }
            Self::Folder { scene: Some(scene) } => both("the scene's folder was given in its place", format!("write {scene}")),
            Self::Folder { scene: None } => both("the path ends too early", "write the path of the scene's file"),
            Self::Syntax { .. } => {
                both("a bracket, quote or equals sign is missing or misplaced", "correct this line; see https://toml.io")
            }
            Self::UnknownKey { nearest: Some(nearest), .. } => both("a typing error", format!("did you mean `{nearest}`?")),
            Self::UnknownKey { known, .. } => {
                both("a typing error, or a key of another object", format!("remove it; keys known here: {known}"))
            }
            Self::MissingKey { key, unit } => {
                let unit = unit.as_ref().map_or_else(String::new, |unit| format!(", in {unit}"));
                both("the key was left out, or stands in another table", format!("add `{key} = …`{unit}"))
            }
            Self::OneOf { keys, given: 0 } => both("a key was left out", format!("give one of {keys}")),
            Self::OneOf { keys, .. } => both("they exclude each other", format!("keep one of {keys}")),
            Self::Text { value: Some(value), unit, .. } => {
                let unit = unit.as_deref().unwrap_or("SI units");
                both("numbers are written without unit; the unit is fixed", format!("write {value} (in {unit}, without quotes)"))
            }
            Self::Text { unit, .. } => {
                let unit = unit.as_deref().unwrap_or("SI units");
                both("numbers are written without quotes and without unit", format!("write the number alone, in {unit}"))
            }
            Self::WrongType { expected, .. } => {
                both("the value is of another type than this key takes", format!("write {expected}"))
            }
            Self::Choice { nearest: Some(nearest), .. } => both("a typing error", format!("did you mean \"{nearest}\"?")),
            Self::Choice { choices, .. } => both("a word that this key does not know", format!("write one of {choices}")),
            Self::Count { expected, .. } => both("entries are missing or superfluous", format!("write {expected} entries")),
            Self::Refused { .. } => {
                both("the value does not fit this key", "compare with `pliant schema`, which describes every key")
            }
            Self::Version { known, .. } => both(
                "the scene was written for another version",
                format!("write `schema_version = {known}` after comparing the keys"),
            ),
            _ => return None,
        })
    }

    /// Numbers.
    fn advice_on_values(&self) -> Option<(String, String)> {
        Some(match self {
            Self::NotFinite { .. } => {
                both("a division by zero or a missing value where the number was made", "write a finite number")
            }
            Self::NotPositive { unit, .. } => {
                both("a sign error, or a value left at zero", format!("write a number above 0, in {unit}"))
            }
            Self::Negative { unit, .. } => both("a sign error", format!("write 0 or a positive number, in {unit}")),
            Self::Range { low, high, .. } => {
                both("a wrong order of magnitude", format!("write a number between {} and {}", Num(*low), Num(*high)))
            }
            Self::Unit { unit, likely, instead, .. } => {
                both(format!("given in {likely} instead of {unit}"), format!("if so, write {} (in {unit})", Num(*instead)))
            }
            Self::TooManySteps { step, most, .. } => both(
                "the duration or the step is in another unit",
                format!("write a duration of at most {} s, or a longer step", Num(step * *most as f64)),
            ),
            Self::Memory { .. } => both(
                "a typing error in a count, a step in another unit, or more than one scene should hold",
                "simulate fewer bodies, nodes or steps at once; long runs can be continued from their last state",
            ),
            Self::DenseBodies { .. } => both(
                "all bodies of a scene are solved together, and their matrix has no pattern yet",
                "split what does not touch into scenes of its own, or give it time and memory: twice the bodies take eight times as long",
            ),
            Self::Thick { .. } => both(
                "a radius in another unit, or a rope divided more finely than it is thick; nodes of one rope do not touch each other, so \
                 it runs",
                "write the radius in m, or fewer nodes: edges shorter than the radius cost time and show no shape that the rope could take",
            ),
            Self::NoStep { step, .. } => {
                both("the duration or the step is in another unit", format!("write a duration of at least {} s", Num(*step)))
            }
            _ => return None,
        })
    }

    /// Ropes, grippers, shapes.
    fn advice_on_objects(&self) -> (String, String) {
        match self {
            Self::Cloth { error } => error.advice(),
            Self::Force { error } => error.advice(),
            Self::Name { .. } => both(
                "names become paths such as `cable.bend_stiffness`",
                "use letters, digits, `_` and `-`, beginning with a letter; not gravity, air, sensor",
            ),
            Self::NameTaken { .. } => both(
                "an object was copied and not renamed",
                "give every rope, cloth, body, joint, actuator, gripper, force and shape its own name",
            ),
            Self::Nothing => {
                both("the scene is only a beginning", "add a [[rope]], a [[cloth]], or a [[body]] with a [[body.joint]]")
            }
            Self::NoSuch { nearest: Some(nearest), .. } => both("a typing error", format!("did you mean \"{nearest}\"?")),
            Self::NoSuch { what, known, .. } if known.is_empty() => {
                both(format!("the scene has no {what} at all"), format!("add a {what}"))
            }
            Self::NoSuch { what, known, .. } => {
                both(format!("the {what} was renamed or removed"), format!("name one of: {known}"))
            }
            Self::Cycle { .. } => {
                both("a kinematic loop was written as parents", "leave one `parent` of the circle out: parents form a tree")
            }
            Self::Inertia { hint, .. } => both(
                "moments about another point than the centre of mass, products of inertia of the wrong sign, or another unit",
                format!("give xx, yy, zz, xy, xz, yz about the centre of mass in kg·m² ({hint})"),
            ),
            Self::Massless { .. } => {
                both("a mass was left out", "give the body `mass` and `inertia`, or the joint an `armature`, or remove the joint")
            }
            Self::Limits { .. } => {
                both("the limits are exchanged, or one is in degrees", "write the lower one first, [lower, upper]")
            }
            Self::Cycles { .. } => both(
                "the gear ratio was left out, or a mass off the axis is meant, whose weight acts once per turn",
                "write the least common multiple of the motor's poles and slots, times the gear ratio; for a mass off the axis, move `center_of_mass`",
            ),
            Self::Delay { delay, .. } => both(
                "`max_delay` was left at an earlier delay",
                format!("write `max_delay = {}` or more, or leave it out", Num(*delay)),
            ),
            Self::MidpointStops { .. } => both(
                "midpoint chatters at a stop",
                "write `integrator = \"sdirk2\"` (second order) or \"euler\", or remove the limits",
            ),
            Self::FreeBelow { .. } => both("a free body moves relative to the world", "leave `parent` and the other joints out"),
            Self::Quaternion { .. } => both(
                "another order of its numbers, or Euler angles",
                "write (w, x, y, z) of length 1; [1, 0, 0, 0] does not turn",
            ),
            Self::TooFewNodes { needed, .. } => {
                both("the rope is divided too coarsely", format!("write `nodes = {needed}` or more"))
            }
            Self::NoSuchNode { nodes, .. } => {
                let last = nodes.saturating_sub(1);
                both(
                    "nodes are counted from 0",
                    format!("write a node from 0 to {last}, or from -1 (the last) to -{nodes} (the first)"),
                )
            }
            Self::NoJoint { .. } => both(
                "the first or last node was meant to have a neighbour, or nodes were counted from 1",
                "name a node between two others; an end has a joint only where a gripper clamps it (`end = \"first\"` or \"last\")",
            ),
            Self::JointTwice { .. } => both(
                "a node is listed twice, perhaps once as a negative number",
                "put all that is different there into one entry",
            ),
            Self::NoSuchRope { nearest: Some(nearest), .. } => both("a typing error", format!("did you mean \"{nearest}\"?")),
            Self::NoSuchRope { known, .. } => both("the rope was renamed or removed", format!("name one of: {known}")),
            Self::PointCount { nodes, .. } => both("points were dropped, or `nodes` was changed", format!("give {nodes} points")),
            Self::NoDirection => both("a vector left at zero", "write a vector with a direction, e.g. [1, 0, 0]"),
            Self::Coincident { .. } => both("a point was given twice", "move one of them; neighbouring nodes need a distance"),
            Self::Fold { .. } => both("two points are in the wrong order", "put the points in the order of the rope"),
            Self::Stretched { length, rest, .. } if length > rest => both(
                "positions in mm and length in m, or points in the wrong order, or a rope too short",
                "give positions and `length` in m; the rope may start stretched by half at most",
            ),
            Self::Stretched { .. } => both(
                "positions in m and length in mm, or a rope too long for its points",
                "give positions and `length` in m; an edge may start at a tenth of its length at least",
            ),
            Self::Shape { kind: "closed", .. } => both(
                "the rope was closed, and its initial shape left",
                "write `initial = { shape = \"circle\", center = [0, 0, 0], normal = [0, 0, 1] }`, or give points",
            ),
            Self::Shape { .. } => both("`closed` was left out", "write `closed = true`, or another initial shape"),
            Self::NoPolygon { .. } => {
                both("`edge_fractions` in which one edge is most of the ring", "divide the long edge, or give points")
            }
            Self::NoEnds { .. } => both(
                "a key of an open rope",
                "hold `nodes` instead of an `end`, and give `node_mass` instead of `tip_mass`; or remove `closed`",
            ),
            Self::HoldsNothing => both("an empty list", "write e.g. `nodes = [0]`, or `end = \"first\"`"),
            Self::NotLater { .. } => {
                both("entries in another order", "give the entries in the order of their times, one per time")
            }
            Self::NothingToTurn { .. } => both(
                "the rope has no `[rope.twist]`, or the gripper does not hold both nodes of an edge, or moves nodes, which have no direction",
                "give the rope a `[rope.twist]` and clamp its `end`; or remove `roll` and `spin`",
            ),
            Self::NeedsTwist { key } => both(
                "the table `[rope.twist]` was left out: without it a rope's bending knows no directions",
                format!("add `[rope.twist]` with a `stiffness`, or remove `[rope.{key}]`"),
            ),
            Self::Unresolved { .. } => both(
                "the rope was made in a program, not read from a file",
                "call `Rope::resolve_material` before the model is built",
            ),
            Self::HeldTwice { own: true, .. } => {
                both("a node is listed twice, perhaps once as a negative number", "let one gripper hold each node")
            }
            Self::HeldTwice { other, .. } => both(
                "two grippers command one node, each its own way; an `end` is its node, the direction there, and a rod's axes",
                format!("let one gripper hold each node: remove it here, or from what \"{other}\" holds"),
            ),
            Self::Unheld { .. } => both(
                "it would fall or drift for ever; a gripper that grasps holds nothing as the scene begins",
                "hold nodes of it by a [[gripper]], or remove `start`",
            ),
            Self::Unstretched { .. } => {
                both("a value left at zero", "give `stretch_stiffness` in N, or remove `start = \"equilibrium\"`")
            }
            Self::Untwisted { .. } => {
                both("a value left at zero", "give `stiffness` in N·m², or remove `[rope.twist]`, which says nothing without it")
            }
            Self::Rolls { .. } => both(
                "grippers hold single nodes, and a round section that is straight at rest does not mind how it stands",
                "clamp an `end` or two neighbouring nodes, or remove `[rope.twist]` or `start`",
            ),
            Self::RuleTwice { .. } => {
                both("a rule was copied and not changed", "put what is special into one rule, or remove one")
            }
            Self::FinelyDivided { edge, nodes, .. } => both(
                "the radius is given in mm instead of m, or the rope is divided more finely than bending means anything",
                format!("write a `radius` of at most {} (in m), or at most {nodes} nodes", Num(5.0 * edge)),
            ),
            Self::PointCapsule => both("an end was copied", "move an end, or use a [[sphere]]"),
            Self::MidpointContact { .. } => both(
                "midpoint chatters at contact",
                "write `integrator = \"sdirk2\"` (second order) or \"euler\", or remove the shapes",
            ),
            Self::NothingFree { .. } => both(
                "only nodes of ropes and cloth and bodies with shapes touch",
                "add a [[rope]] or a [[cloth]], or give a body a [[body.shape]], or remove the shapes",
            ),
            Self::NoSize { key, .. } => both("a size was left out", format!("write `{key}` in m")),
            Self::OtherSize { key, .. } => both("a size of another kind of shape", format!("remove `{key}`, or change `kind`")),
            Self::HullPoints { found, most, .. } if found > most => {
                both("all vertices of a mesh", format!("give the corners of a coarser hull, at most {most}; an import makes one"))
            }
            Self::HullPoints { .. } => both("points were left out", "give four or more that do not lie in a plane"),
            Self::FlatHull { .. } => {
                both("a flat mesh, or a coordinate left at zero", "give the points a thickness, or use a thin box")
            }
            Self::Overlap { .. } => both(
                "shapes in another unit, a misplaced start, or neighbours that are meant to overlap",
                "move them apart, or write [[contact.pair]] with `between` and `ignore = true`",
            ),
            Self::Open { .. } => both(
                "joints that start where the loop is not closed",
                "leave `to_point` out, or change `start` of the joints so that the points meet",
            ),
            Self::HoldsNoBody { .. } => both("a body was named twice, or one that is fixed", "name a body that moves"),
            Self::MidpointClosure { .. } => both(
                "closures and couplings hold at the end of a step",
                "write `integrator = \"sdirk2\"` (second order) or \"euler\"",
            ),
            Self::FollowsItself { .. } => both("a name was copied", "name the joint that leads"),
            Self::CouplesMany { .. } => both(
                "ball and universal joints have no single angle",
                "couple revolute or prismatic joints; write a universal joint as two revolute ones",
            ),
            Self::Coefficients { .. } => both("a missing or superfluous number", "write e.g. `coefficients = [0, -2]`"),
            Self::NobodyLeads { .. } => {
                both("`to` was left out", "write `to = …`, or one coefficient, at which the joint is held")
            }
            Self::StartsApart { wanted, .. } => both(
                "the start of one of the two joints was left out, or is in another unit",
                format!("write `start = [{}]` at this joint, or change the first coefficient", Num(*wanted)),
            ),
            Self::ThinEdges => both(
                "a line without thickness slips past what is sharp",
                "give its `radius` in m, or let only nodes touch: `contact = \"nodes\"`",
            ),
            Self::ShortLinks { .. } => both("too many links, or a size in another unit", "write fewer links, or sizes in m"),
            Self::NeverTouch { .. } => both("a rule that does nothing", "remove it"),
            Self::NoCompliance { .. } => both("a number that would do nothing", "remove `compliance`"),
            Self::AllHeld { .. } => {
                both("a gripper holds more nodes than meant", "leave nodes of it free, or remove the rope or the shapes")
            }
            Self::TooManyNodes { .. } => both("a typing error", "divide the ropes less finely"),
            Self::Inside { .. } => {
                both("the start or the shape is misplaced, or in another unit", "move the rope or the shape apart")
            }
            _ => both("unknown", "compare with `pliant schema`"),
        }
    }
}

fn both(cause: impl Into<String>, fix: impl Into<String>) -> (String, String) {
    (cause.into(), fix.into())
}
