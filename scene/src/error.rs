//! Errors of scenes: place, problem, likely cause, and fix.

use super::cloth_error::ClothMistake;
use super::force_error::ForceMistake;
use super::place::Place;
use super::words::Num;
use std::fmt;

/// A scene that is refused.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneError {
    /// Where.
    pub place: Place,
    /// What.
    pub mistake: Box<Mistake>,
}

impl std::error::Error for SceneError {}

impl SceneError {
    pub(super) fn new(place: Place, mistake: Mistake) -> Self {
        Self { place, mistake: Box::new(mistake) }
    }

    /// A mistake in a field, for example `rope[0].length`.
    pub fn at(field: impl Into<String>, mistake: Mistake) -> Self {
        Self { place: Place::field(field), mistake: Box::new(mistake) }
    }
}

/// Three lines: place and mistake, likely cause, fix.
impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (cause, fix) = self.mistake.advice();
        write!(f, "{}: {}\n  likely cause: {cause}\n  fix: {fix}", self.place, self.mistake)
    }
}

/// The problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the fields are the words of the messages
pub enum Mistake {
    /// The file cannot be read.
    #[error("cannot be read: {error}")]
    Read { error: String },
    /// A folder in place of a file; `scene`: the scene that lies in it, if one does.
    #[error("is a folder")]
    Folder { scene: Option<String> },
    /// Not TOML.
    #[error("is not valid TOML: {message}")]
    Syntax { message: String },
    /// A key that does not exist here.
    #[error("unknown key `{key}`")]
    UnknownKey { key: String, nearest: Option<String>, known: String },
    /// A key that must be there.
    #[error("key `{key}` is missing{}", unit_in(unit))]
    MissingKey { key: String, unit: Option<String> },
    /// None of several keys, or more than one.
    #[error("{} of the keys {keys} is given", if *.given == 0 { "none" } else { "more than one" })]
    OneOf { keys: String, given: usize },
    /// A text where a number belongs.
    #[error("is the text \"{found}\", not a number{}", unit_in(unit))]
    Text { found: String, unit: Option<String>, value: Option<f64> },
    /// A value of another type.
    #[error("is {found}, not {expected}{}", unit_in(unit))]
    WrongType { found: String, expected: String, unit: Option<String> },
    /// A word that is not among the choices.
    #[error("\"{found}\" is none of {choices}")]
    Choice { found: String, choices: String, nearest: Option<String> },
    /// A list of the wrong length.
    #[error("has {found} entries instead of {expected}")]
    Count { found: usize, expected: usize },
    /// Anything else the reader refuses.
    #[error("{message}")]
    Refused { message: String },
    /// Another version of the format.
    #[error("is {found}, but this version of pliant reads {known}")]
    Version { found: u32, known: u32 },
    /// Not a finite number.
    #[error("is {value}, not a finite number")]
    NotFinite { value: f64 },
    /// Zero or negative.
    #[error("is {} {unit}, but must be positive", Num(*.value))]
    NotPositive { value: f64, unit: &'static str },
    /// Negative.
    #[error("is {} {unit}, but must not be negative", Num(*.value))]
    Negative { value: f64, unit: &'static str },
    /// Outside its interval.
    #[error("is {}, but must lie between {} and {}", Num(*.value), Num(*.low), Num(*.high))]
    Range { value: f64, low: f64, high: f64 },
    /// A size that betrays another unit.
    #[error("is {} {unit}{reason}", Num(*.value))]
    Unit { value: f64, unit: &'static str, reason: String, likely: &'static str, instead: f64 },
    /// The simulated time is shorter than one step.
    #[error("is {} s, shorter than one step of {} s", Num(*.duration), Num(*.step))]
    NoStep { duration: f64, step: f64 },
    /// More steps than are kept in memory.
    #[error("is {} s, which is {} steps of {} s; a scene may have {most}", Num(*.duration), Num((*.duration / *.step).round()), Num(*.step))]
    TooManySteps { duration: f64, step: f64, most: usize },
    /// More nodes than are simulated.
    #[error("the scene has {nodes} nodes; it may have {most}")]
    TooManyNodes { nodes: usize, most: usize },
    /// More memory than the machine has.
    #[error("{what} take at least {} GB ({bytes} bytes), and {} GB are free", gigabytes(*.bytes), gigabytes(*.available))]
    Memory { what: String, bytes: u64, available: u64 },
    /// Bodies whose dense matrix is large.
    #[error("the bodies have {dofs} degrees of freedom, whose dense matrix takes {} GB and {flops:.1e} operations per factorization", gigabytes(*.bytes))]
    DenseBodies { dofs: u64, bytes: u64, flops: f64 },
    /// A rope whose nodes overlap each other.
    #[error("is {} m, more than the shortest edge of {} m: balls at neighbouring nodes overlap", Num(*.radius), Num(*.edge))]
    Thick { radius: f64, edge: f64 },
    /// A name that cannot stand in a parameter path.
    #[error("the name \"{name}\" cannot be part of a parameter path")]
    Name { name: String },
    /// A name that another object has.
    #[error("the name \"{name}\" is taken by {other}")]
    NameTaken { name: String, other: String },
    /// Nothing to simulate.
    #[error("the scene has nothing that moves")]
    Nothing,
    /// An object that the scene does not have.
    #[error("there is no {what} \"{name}\"")]
    NoSuch { what: &'static str, name: String, nearest: Option<String>, known: String },
    /// A body that hangs on itself.
    #[error("body \"{body}\" hangs on itself: its parents form a circle")]
    Cycle { body: String },
    /// A mass that cannot be.
    #[error("{error}")]
    Inertia { error: pliant_math::inertia::InertiaError, hint: &'static str },
    /// A joint that moves nothing.
    #[error("this joint of body \"{body}\" moves no mass: neither the body nor any beyond it has one")]
    Massless { body: String },
    /// A free joint that is not alone at the world.
    #[error("body \"{body}\" has a free joint, but a parent or other joints too")]
    FreeBelow { body: String },
    /// Limits in the wrong order.
    #[error("the lower limit {low} is not below the upper limit {high}")]
    Limits { low: f64, high: f64 },
    /// A torque that repeats too seldom.
    #[error("a torque that repeats {found} time(s) per turn is not cogging, which repeats {fewest} times or more")]
    Cycles { found: u32, fewest: u32 },
    /// A delay beyond the longest.
    #[error("the delay of {} s is longer than `max_delay`, {} s", Num(*.delay), Num(*.longest))]
    Delay { delay: f64, longest: f64 },
    /// Midpoint with stops.
    #[error("the midpoint integrator cannot be used with stops, and {joints} joint(s) have limits")]
    MidpointStops { joints: usize },
    /// Not a unit quaternion.
    #[error("has length {norm}, not 1")]
    Quaternion { norm: f64 },
    /// Too few nodes.
    #[error("the rope has {nodes} nodes; {why} needs at least {needed}")]
    TooFewNodes { nodes: usize, needed: usize, why: &'static str },
    /// A node that the rope does not have.
    #[error("rope \"{rope}\" has no node {node}: it has {nodes} nodes")]
    NoSuchNode { rope: String, node: i64, nodes: usize },
    /// A rope that the scene does not have.
    #[error("there is no rope \"{rope}\"")]
    NoSuchRope { rope: String, nearest: Option<String>, known: String },
    /// As many points as nodes are needed.
    #[error("has {points} points, but the rope has {nodes} nodes")]
    PointCount { points: usize, nodes: usize },
    /// A vector of length zero.
    #[error("has length zero, so it has no direction")]
    NoDirection,
    /// Two neighbouring nodes at one place.
    #[error("nodes {first} and {second} are at the same place")]
    Coincident { first: usize, second: usize },
    /// Neighbouring edges that point in opposite directions.
    #[error("the rope folds back onto itself at node {node}, where its curvature is infinite")]
    Fold { node: usize },
    /// Positions far from the rest length.
    #[error("the edge from node {edge} to node {end} is {length:.4} m long, but {rest:.4} m at rest")]
    Stretched { edge: usize, end: usize, length: f64, rest: f64 },
    /// A closed rope without a shape that closes, or a shape that closes of an open one.
    #[error("a {kind} rope cannot begin {shape}")]
    Shape { kind: &'static str, shape: &'static str },
    /// Edges that make no polygon around a centre.
    #[error("edge {edge} of {} m is too long for a circle with the others' {} m", Num(*.length), Num(*.others))]
    NoPolygon { edge: usize, length: f64, others: f64 },
    /// An end of a closed rope.
    #[error("rope \"{rope}\" is closed, so it has no {what}")]
    NoEnds { rope: String, what: &'static str },
    /// A gripper without nodes.
    #[error("the gripper holds no node")]
    HoldsNothing,
    /// Times of a schedule that do not rise.
    #[error("is at {} s, not after the entry before it, at {} s", Num(*.time), Num(*.before))]
    NotLater { time: f64, before: f64 },
    /// A rotation of something that has none.
    #[error("{what} cannot be turned about itself")]
    NothingToTurn { what: String },
    /// A rod's table at a rope.
    #[error("the rope has a `{key}`, which belongs to a rod, but no `twist`")]
    NeedsTwist { key: &'static str },
    /// A section of its own where no edges meet.
    #[error("no two edges of rope \"{rope}\" meet at node {node}")]
    NoJoint { rope: String, node: i64 },
    /// Two sections for one joint.
    #[error("node {node} of rope \"{rope}\" has a section of its own already")]
    JointTwice { rope: String, node: i64 },
    /// A scene made in a program, with a material that no stiffness was made of.
    #[error("the `{key}` has not been made stiffness and mass")]
    Unresolved { key: &'static str },
    /// Two commands for one node.
    #[error("node {node} of rope \"{rope}\" is already held by gripper \"{other}\"")]
    HeldTwice { rope: String, node: usize, other: String, own: bool },
    /// An equilibrium of something that nothing holds.
    #[error("nothing holds {what} \"{name}\", so it has no equilibrium: the matrix of statics is singular")]
    Unheld { what: &'static str, name: String },
    /// An equilibrium of a rope of any length.
    #[error(
        "is 0 N, so rope \"{rope}\" has no equilibrium: its edges may have any length, and the matrix of statics is singular"
    )]
    Unstretched { rope: String },
    /// An equilibrium of a rod that does not mind its twist.
    #[error("is 0 N·m², so edges of rope \"{rope}\" turn about themselves without a force: the matrix of statics is singular")]
    Untwisted { rope: String },
    /// An equilibrium of a rod that may turn about itself.
    #[error(
        "rope \"{rope}\" may turn about itself without a force, so its equilibrium is not unique: the matrix of statics is singular"
    )]
    Rolls { rope: String },
    /// A rod much thicker than its edges are long.
    #[error("is {} m, but the longest edge, from node {first} to node {}, is {} m long at rest", Num(*.radius), .first + 1, Num(*.edge))]
    FinelyDivided { radius: f64, edge: f64, first: usize, nodes: usize },
    /// A capsule whose ends coincide.
    #[error("the two ends of the capsule are the same point")]
    PointCapsule,
    /// Midpoint with shapes.
    #[error("the midpoint integrator cannot be used with contact, and the scene has {shapes} shape(s)")]
    MidpointContact { shapes: usize },
    /// Contact rows that would act on commanded nodes alone.
    #[error("the scene has {shapes} shape(s) to touch, but no rope or cloth, so contact could move nothing")]
    NothingFree { shapes: usize },
    /// A rope that no shape can move.
    #[error("grippers hold every node of rope \"{rope}\", so it goes through the scene's {shapes} shape(s) and touches none")]
    AllHeld { rope: String, shapes: usize },
    /// A size that this kind of shape needs.
    #[error("a {kind} needs `{key}`")]
    NoSize { kind: &'static str, key: &'static str },
    /// A size that this kind of shape does not have.
    #[error("a {kind} has no `{key}`")]
    OtherSize { kind: &'static str, key: &'static str },
    /// Too few or too many points of a hull.
    #[error("has {found} points, but a hull needs {least} to {most}")]
    HullPoints { found: usize, least: usize, most: usize },
    /// A hull without a volume.
    #[error("the {points} points lie in one plane, so their hull has no volume")]
    FlatHull { points: usize },
    /// Two objects that overlap as the scene begins.
    #[error("{first} and {second} overlap by {depth:.2e} m as the scene begins")]
    Overlap { first: String, second: String, depth: f64 },
    /// Points of a closure that are not at one place.
    #[error("the two points of the closure are {} m apart as the scene begins", Num(*.distance))]
    Open { distance: f64 },
    /// A closure that holds nothing.
    #[error("the closure holds nothing: {why}")]
    HoldsNoBody { why: &'static str },
    /// Midpoint with closures or couplings.
    #[error("the midpoint integrator cannot be used with closures and couplings, and the scene has {closures}")]
    MidpointClosure { closures: usize },
    /// A joint coupled to itself.
    #[error("joint \"{joint}\" follows itself")]
    FollowsItself { joint: String },
    /// A joint of several coordinates in a coupling.
    #[error("joint \"{joint}\" has {dofs} degrees of freedom; a coupling is between joints of one")]
    CouplesMany { joint: String, dofs: usize },
    /// A polynomial without coefficients, or with too many.
    #[error("has {found} coefficients, not 1 to {most}")]
    Coefficients { found: usize, most: usize },
    /// Numbers that need a leading joint.
    #[error("no joint leads, so there is nothing that {} could multiply", if *.coefficients > 1 { "further coefficients" } else { "a reference" })]
    NobodyLeads { coefficients: usize },
    /// A joint that starts elsewhere than its coupling has it.
    #[error("joint \"{joint}\" starts at {}, but follows to {}", Num(*.start), Num(*.wanted))]
    StartsApart { joint: String, start: f64, wanted: f64 },
    /// A rule for a pair that does not touch anyway.
    #[error("\"{first}\" and \"{second}\" never touch: {why}")]
    NeverTouch { first: String, second: String, why: &'static str },
    /// Two rules for one pair.
    #[error("\"{first}\" and \"{second}\" have a rule already: contact.pair[{other}]")]
    RuleTwice { first: String, second: String, other: usize },
    /// Compliance where it is not modelled.
    #[error("compliance is modelled between bodies and what they touch, with Coulomb's law: {why}")]
    NoCompliance { why: &'static str },
    /// Contact of edges without a radius.
    #[error("is 0 m, but what touches with its edges needs a radius")]
    ThinEdges,
    /// Links that are no longer than they are thick.
    #[error("{links} links are {} m long each, no longer than they are thick ({} m)", Num(*.link), Num(*.diameter))]
    ShortLinks { links: usize, link: f64, diameter: f64 },
    /// Anything wrong with a sheet of cloth.
    #[error("{error}")]
    Cloth { error: ClothMistake },
    /// Anything wrong with a force of one's own.
    #[error("{error}")]
    Force { error: ForceMistake },
    /// A node that starts inside a shape.
    #[error("node {node} of rope \"{rope}\" starts {depth:.4} m inside {shape} (its centre, not only its surface)")]
    Inside { rope: String, node: usize, depth: f64, shape: String },
}

/// Three digits of bytes in GB.
fn gigabytes(bytes: u64) -> String {
    let digits = format!("{:.2e}", bytes as f64 * 1e-9);
    digits.parse::<f64>().map_or(digits, |x| Num(x).to_string())
}

/// ` [m]`, or nothing.
fn unit_in(unit: &Option<String>) -> String {
    unit.as_ref().map_or_else(String::new, |unit| format!(" [{unit}]"))
}
