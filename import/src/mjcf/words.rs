//! Which elements and attributes MJCF has where, as far as the importer looks into them, and why some do not matter.

/// Sections of a model.
pub const SECTIONS: [&str; 17] = [
    "compiler",
    "option",
    "size",
    "statistic",
    "visual",
    "default",
    "extension",
    "custom",
    "asset",
    "worldbody",
    "deformable",
    "contact",
    "tendon",
    "equality",
    "actuator",
    "sensor",
    "keyframe",
];

/// Elements that a body, a frame or the world may hold.
pub const IN_BODY: [&str; 14] = [
    "inertial",
    "joint",
    "freejoint",
    "geom",
    "site",
    "camera",
    "light",
    "body",
    "frame",
    "replicate",
    "attach",
    "composite",
    "flexcomp",
    "plugin",
];

/// Elements that a default class may hold.
pub const IN_DEFAULT: [&str; 27] = [
    "default",
    "mesh",
    "texture",
    "material",
    "joint",
    "geom",
    "site",
    "camera",
    "light",
    "pair",
    "equality",
    "tendon",
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "orientation",
    "pid",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
    "plugin",
    "flex",
    "skin",
];

/// Kinds of actuators.
pub const ACTUATORS: [&str; 13] = [
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "orientation",
    "pid",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
    "plugin",
];

pub const COMPILER: &str = "alignfree angle assetdir autolimits balanceinertia boundinertia boundmass conflict coordinate discardvisual \
    eulerseq fitaabb fusestatic inertiafromgeom inertiagrouprange meshdir passthrough savecanonical savecompiled saveinertial \
    settotalmass strippath texturedir usethread exactmeshinertia convexhull";

pub const OPTION: &str = "actuatorgroupdisable apirate ccd_iterations ccd_tolerance cone density gravity impratio integrator iterations \
    jacobian ls_iterations ls_tolerance magnetic mpr_iterations mpr_tolerance noslip_iterations noslip_tolerance o_friction o_margin \
    o_solimp o_solref sdf_initpoints sdf_iterations sleep_tolerance solver timestep tolerance viscosity wind collision";

pub const BODY: &str = "axisangle childclass euler fuse gravcomp mocap name pos quat simple sleep user xyaxes zaxis";

pub const FRAME: &str = "axisangle childclass euler name pos quat xyaxes zaxis";

pub const INERTIAL: &str = "axisangle diaginertia euler fullinertia mass pos quat xyaxes zaxis";

pub const JOINT: &str = "actuatorfrclimited actuatorfrcrange actuatorgravcomp armature axis class damping frictionloss group limited \
    margin name pos range ref solimpfriction solimplimit solreffriction solreflimit springdamper springref springyield stiffness type \
    user";

pub const FREEJOINT: &str = "align group name";

pub const GEOM: &str = "adhesion axisangle castshadow class conaffinity condim contype density euler fitscale fluidcoef fluidshape \
    friction fromto gap group hfield margin mass material mesh name pos priority quat rgba shellinertia size solimp solmix solref \
    surfacevel type user xyaxes zaxis";

pub const MESH: &str = "builtin class content_type face file inertia material maxhullvert name normal params refpos refquat scale smoothnormal \
    texcoord vertex";

/// Why attributes of meshes are ignored.
pub const MESH_REASONS: [(&str, &str); 2] = [
    ("maxhullvert", "a hull that touches has as many corners as contact of a scene can try"),
    ("normal texcoord material smoothnormal content_type params", "appearance"),
];

pub const PAIR: &str = "class condim friction gap geom1 geom2 margin name solimp solref solreffriction";

pub const EQUALITY: &str =
    "active anchor body1 body2 class joint1 joint2 name polycoef relpose site1 site2 solimp solref torquescale";

/// Why attributes of constraints are ignored.
pub const EQUALITY_REASONS: [(&str, &str); 2] =
    [("solref solimp torquescale", "what a scene holds together is hard"), ("relpose", "the bodies stand like that in the file")];

/// Why attributes of geoms that touch, and of pairs, are ignored.
pub const CONTACT_REASONS: [(&str, &str); 1] = [(
    "solref solimp solmix solreffriction margin gap adhesion surfacevel",
    "contact of a scene is hard, without rebound or margin",
)];

/// Why attributes of joints are ignored.
pub const JOINT_REASONS: [(&str, &str); 6] = [
    ("range limited", "it is switched off"),
    ("margin solreflimit solimplimit", "stops of a scene are hard"),
    ("solreffriction solimpfriction", "dry friction of a scene sticks"),
    ("actuatorfrcrange actuatorfrclimited", "it is switched off"),
    ("actuatorgravcomp", "what carries the weight does not count in the motor's limits"),
    ("springyield", "yielding springs are not simulated"),
];

/// Why attributes of bodies are ignored.
pub const BODY_REASONS: [(&str, &str); 2] =
    [("user", "data of the user, without effect"), ("sleep fuse simple", "a matter of MuJoCo's numerics")];

/// Why attributes of actuators are ignored.
pub const ACTUATOR_REASONS: [(&str, &str); 6] = [
    ("ctrlrange ctrllimited forcerange forcelimited", "it is switched off"),
    ("inheritrange actrange actlimited velrange ffrange", "what the control makes of itself is not limited"),
    ("dyntype dynprm actdim actearly timeconst", "it has no dynamics, or a scene has them exactly"),
    ("delay interp nsample", "the actuator acts at once: write `delay` in the scene"),
    ("lengthrange cranklength", "a matter of other transmissions"),
    ("group user", "without effect on the motion"),
];

/// Why attributes of options are ignored.
pub const OPTION_REASONS: [(&str, &str); 2] = [
    ("magnetic", "read by sensors only"),
    ("integrator", "the scene's own is `midpoint`; `sdirk2` where something is held together, `euler` with stops and contact"),
];

/// Why whole sections are ignored.
pub const SECTION_REASONS: [(&str, &str); 8] = [
    ("size", "sizes of MuJoCo's memory"),
    ("statistic", "a matter of display"),
    ("visual", "a matter of display"),
    ("asset", "appearance, or shapes that no geom names"),
    ("custom", "data of the user, without effect"),
    ("sensor", "a scene has no sensors: read the state"),
    ("keyframe", "the scene starts where the joints are at zero"),
    ("extension", "plugins are not run"),
];
