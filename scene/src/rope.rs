//! Ropes in a scene file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A rope, cable or rod: nodes joined by edges. Its parameters are `name.length`, `name.bend_stiffness`, …
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rope {
    /// Name, unique in the scene, used in parameter paths.
    pub name: String,
    /// Whether an edge from the last node to the first closes it to a ring, which has as many edges as nodes.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub closed: bool,
    /// Number of nodes, with equal edges between them; at most 10⁶ in a scene. Either this or `edge_fractions`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nodes: Option<usize>,
    /// Rest length of each edge as a part of `length` [-], scaled to sum 1. Either this or `nodes`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edge_fractions: Option<Vec<f64>>,
    /// By how much each edge is longer at rest than its share of `length`, as a part of that [-]: only its stretch knows. Zero if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge_rest_strains: Option<Vec<f64>>,
    /// Rest length [m].
    pub length: f64,
    /// Mass per length ρA [kg/m]. Either this or `density`.
    #[serde(default)]
    pub linear_density: f64,
    /// Stretch stiffness EA [N]. Either this and `bend_stiffness`, or `youngs_modulus`.
    #[serde(default)]
    pub stretch_stiffness: f64,
    /// Young's modulus E of a round section [Pa]: EA = E π r², EI = E π r⁴/4. A scene that was read has these instead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub youngs_modulus: Option<f64>,
    /// Shear modulus G of a round section [Pa], of a rope with a `twist`: GJ = G π r⁴/2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear_modulus: Option<f64>,
    /// Poisson's ratio ν [-], instead of the shear modulus: G = E/(2 (1 + ν)).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub poisson_ratio: Option<f64>,
    /// Mass per volume ρ of a round section [kg/m³]: ρA = ρ π r².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Stretch damping c_s [N·s].
    #[serde(default)]
    pub stretch_damping: f64,
    /// Bending stiffness EI [N·m²].
    #[serde(default)]
    pub bend_stiffness: f64,
    /// Bending damping c_b [N·m²·s].
    #[serde(default)]
    pub bend_damping: f64,
    /// Linear air drag per length [kg/(m·s)].
    #[serde(default)]
    pub drag_linear: f64,
    /// Quadratic air drag per length [kg/m²].
    #[serde(default)]
    pub drag_quadratic: f64,
    /// Mass added at the last node [kg].
    #[serde(default)]
    pub tip_mass: f64,
    /// Radius [m]; used by contact, and by a material's stiffnesses and mass.
    #[serde(default)]
    pub radius: f64,
    /// Parts of it that touch fixed shapes.
    #[serde(default, skip_serializing_if = "Touching::is_nodes")]
    pub contact: Touching,
    /// Masses added at nodes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub node_mass: Vec<NodeMass>,
    /// Makes it a rod, which twists and whose bending may be anisotropic. Without it a rope has no rotation about its own tangent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub twist: Option<Twist>,
    /// Part of a rod's stiffness relaxes; of a rope with a `twist`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub creep: Option<Creep>,
    /// A rod that is bent too far stays bent; of a rope with a `twist`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plasticity: Option<Plasticity>,
    /// A rod becomes stiffer, or softer, the more it is bent; of a rope with a `twist`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffening: Option<Stiffening>,
    /// Friction inside a rod that is bent; of a rope with a `twist`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend_friction: Option<BendFriction>,
    /// Where its nodes are at the beginning.
    pub initial: Initial,
    /// Whether `initial` is the start, or the guess of an equilibrium.
    #[serde(default)]
    pub start: Start,
    /// Initial velocity of every node [m/s].
    #[serde(default)]
    pub velocity: [f64; 3],
}

impl Default for Rope {
    fn default() -> Self {
        Self {
            name: "rope".to_owned(),
            closed: false,
            nodes: Some(13),
            edge_fractions: None,
            edge_rest_strains: None,
            length: 1.0,
            linear_density: 0.05,
            stretch_stiffness: 1.0e4,
            youngs_modulus: None,
            shear_modulus: None,
            poisson_ratio: None,
            density: None,
            stretch_damping: 0.0,
            bend_stiffness: 1.0e-3,
            bend_damping: 0.0,
            drag_linear: 0.0,
            drag_quadratic: 0.0,
            tip_mass: 0.0,
            radius: 0.003,
            contact: Touching::default(),
            node_mass: Vec::new(),
            twist: None,
            creep: None,
            plasticity: None,
            stiffening: None,
            bend_friction: None,
            initial: Initial::default(),
            start: Start::default(),
            velocity: [0.0; 3],
        }
    }
}

impl Rope {
    /// Number of nodes, without ghosts; 0 if the scene gives neither `nodes` nor `edge_fractions`.
    pub fn n_nodes(&self) -> usize {
        self.edge_fractions.as_ref().map_or(self.nodes.unwrap_or(0), |f| f.len() + usize::from(!self.closed))
    }

    /// The node of that number, negative ones counted from the end; `None` if there is no such node.
    pub fn node(&self, number: i64) -> Option<usize> {
        let n = self.n_nodes();
        let index = if number < 0 { number.checked_add(i64::try_from(n).ok()?)? } else { number };
        usize::try_from(index).ok().filter(|index| *index < n)
    }

    /// Moment of inertia about the own axis per length [kg·m], if it twists.
    pub fn twist_inertia(&self) -> Option<f64> {
        let twist = self.twist.as_ref()?;
        Some(twist.inertia.unwrap_or(0.5 * self.linear_density * self.radius * self.radius))
    }

    /// Rest length of each edge as a part of the rope's length; they sum to 1.
    pub fn fractions(&self) -> Vec<f64> {
        match &self.edge_fractions {
            Some(given) => {
                let sum: f64 = given.iter().sum();
                given.iter().map(|f| f / sum).collect()
            }
            None => {
                let edges = self.n_nodes().saturating_sub(usize::from(!self.closed));
                vec![1.0 / edges as f64; edges]
            }
        }
    }
}

/// Parts of a rope or a sheet that touch fixed spheres, capsules and boxes. (Planes and cylinders are touched by nodes either way.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Touching {
    /// Its nodes, as balls of its radius.
    #[default]
    Nodes,
    /// Its edges too, and the triangles of a sheet, thick by its radius.
    Edges,
}

impl Touching {
    /// Whether it is the default.
    pub(super) fn is_nodes(&self) -> bool {
        *self == Self::Nodes
    }
}

/// A mass added at a node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodeMass {
    /// Node number; negative numbers count from the end.
    pub node: i64,
    /// Added mass [kg].
    pub mass: f64,
}

/// Twist of a rod, and its section and rest shape where they are not round and straight. Its material axes turn about its edges
/// with the twist; the first one is `director` at the first edge as the scene begins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Twist {
    /// Twisting stiffness GJ [N·m²]. Either this, or a `shear_modulus` or `poisson_ratio` of the rope.
    #[serde(default)]
    pub stiffness: f64,
    /// Twisting damping c_t [N·m²·s].
    #[serde(default)]
    pub damping: f64,
    /// Moment of inertia about the own axis per length, ρI_p [kg·m]; without it that of a round section, linear_density · radius²/2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia: Option<f64>,
    /// Bending stiffness EI₂ towards the second principal axis [N·m²]; without it `bend_stiffness`, as towards the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend_stiffness_2: Option<f64>,
    /// Angle of the principal axes from the material ones about the rod's direction [rad].
    #[serde(default)]
    pub section_roll: f64,
    /// The shape without forces, to which `rest_curvature` and `rest_twist` are added.
    #[serde(default)]
    pub rest: Rest,
    /// Curvature at rest towards the two principal axes [1/m].
    #[serde(default)]
    pub rest_curvature: [f64; 2],
    /// Twist at rest per length [rad/m].
    #[serde(default)]
    pub rest_twist: f64,
    /// First material axis at the first edge (its part across the edge) [-]; without it any direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub director: Option<[f64; 3]>,
    /// Twist from the first edge to the last as the scene begins [rad], even along the rod. Of a closed rope that of the whole ring: if
    /// it does not come out even, the ends are joined turned against each other.
    #[serde(default)]
    pub initial: f64,
    /// Sections at single nodes that differ from the rest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint: Vec<JointSection>,
}

/// The section of a rod at one node, where it differs from the rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointSection {
    /// Node number; negative numbers count from the end.
    pub node: i64,
    /// Curvature at rest towards the two principal axes, added to that of the rod [1/m].
    #[serde(default)]
    pub rest_curvature: [f64; 2],
    /// Bending stiffness as a multiple of the rod's [-].
    #[serde(default = "one")]
    pub bend_factor: f64,
}

fn one() -> f64 {
    1.0
}

impl Default for JointSection {
    fn default() -> Self {
        Self { node: 1, rest_curvature: [0.0; 2], bend_factor: 1.0 }
    }
}

impl Default for Twist {
    fn default() -> Self {
        Self {
            stiffness: 1e-3,
            damping: 0.0,
            inertia: None,
            bend_stiffness_2: None,
            section_roll: 0.0,
            rest: Rest::default(),
            rest_curvature: [0.0; 2],
            rest_twist: 0.0,
            director: None,
            initial: 0.0,
            joint: Vec::new(),
        }
    }
}

/// A Maxwell element beside a rod's elasticity: in fast bending or twisting the stiffnesses are (1 + fraction) times those of the rope
/// and its twist, which are those of long times. It has relaxed in the initial shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Creep {
    /// Its stiffness over that of long times [-]; 0 is allowed, for parameters that are fitted.
    pub fraction: f64,
    /// The same of twisting, if it is not as of bending [-].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub twist_fraction: Option<f64>,
    /// Time in which it relaxes by 1/e [s].
    pub time: f64,
}

/// Bending beyond a yield curvature flows, so that the rod stays bent: viscous plasticity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plasticity {
    /// Elastic curvature above which it flows [1/m].
    pub yield_curvature: f64,
    /// Time in which the excess over it relaxes by 1/e [s]: if much shorter than the motion's, plasticity is perfect.
    pub time: f64,
}

/// The moment of bending grows faster than the curvature x, as EI x (1 + c x²).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stiffening {
    /// c [m²]: bent to the radius √c the rod is twice as stiff as Hooke's law has it. 0 is allowed, for parameters that are fitted; below, the
    /// rod softens, and beyond the curvature 1/√(−3c) its moment falls.
    pub coefficient: f64,
}

/// Friction between the parts of a rod that is bent, the same however fast (Dahl's model).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BendFriction {
    /// The moment that it tends to [N·m]; 0 is allowed, for parameters that are fitted.
    pub moment: f64,
    /// The change of curvature over which it builds up by 1 − 1/e [1/m].
    pub curvature: f64,
}

/// The shape of a rod without forces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Rest {
    /// Straight and untwisted.
    #[default]
    Straight,
    /// That of the initial positions, with their twist.
    Initial,
}

/// Where a rope's nodes are at the beginning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "lowercase", deny_unknown_fields)]
pub enum Initial {
    /// On a line, at rest length.
    Straight {
        /// Position of the first node [m].
        from: [f64; 3],
        /// Direction from the first node to the last (of any length).
        direction: [f64; 3],
    },
    /// Between two points, hanging through by a parabola along gravity.
    Between {
        /// Position of the first node [m].
        from: [f64; 3],
        /// Position of the last node [m].
        to: [f64; 3],
        /// Depth of the parabola's middle below the chord [m]; without it, as deep as the rest length asks for.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        sag: Option<f64>,
    },
    /// A circle, of a closed rope: its edges at rest length, as many as there are.
    Circle {
        /// Centre [m].
        center: [f64; 3],
        /// Normal of its plane [-] (of any length), about which the nodes go round counter-clockwise.
        normal: [f64; 3],
        /// Direction from the centre to the first node [-] (its part in the plane); without it any.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        first: Option<[f64; 3]>,
    },
    /// Node by node.
    Points {
        /// Position of each node [m].
        points: Vec<[f64; 3]>,
    },
}

impl Default for Initial {
    fn default() -> Self {
        Self::Straight { from: [0.0; 3], direction: [1.0, 0.0, 0.0] }
    }
}

/// Initial state of a rope.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// At the initial positions.
    #[default]
    AsGiven,
    /// At the equilibrium found from the initial positions, with the grippers' first inputs.
    Equilibrium,
}
