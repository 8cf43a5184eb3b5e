//! The integrators as weights of one stage.

use pliant_math::rotation::Map;

/// Where a stage evaluates forces and where it ends:
/// `q̄ = q + h (a0 v + a1 v⁺)`, `v̄ = b0 v + b1 v⁺`, `q⁺ = q + h (d0 v + d1 v⁺)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Weight of v in q̄.
    pub a0: f64,
    /// Weight of v⁺ in q̄.
    pub a1: f64,
    /// Weight of v in v̄.
    pub b0: f64,
    /// Weight of v⁺ in v̄.
    pub b1: f64,
    /// Weight of v in q⁺.
    pub d0: f64,
    /// Weight of v⁺ in q⁺.
    pub d1: f64,
}

/// Weights of free and of prescribed dofs. A prescribed dof moves uniformly over the step, `v⁺ = Δp/h`, in every scheme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scheme {
    /// Free dofs.
    pub free: Weights,
    /// Driven dofs.
    pub prescribed: Weights,
    /// Map of ball joints on the way to q̄.
    pub middle: Map,
    /// The same on the way to q⁺.
    pub end: Map,
    /// Part of the velocity before that inertia remembers: 1, or 0 where each stage begins at rest.
    pub momentum: f64,
}

impl Scheme {
    /// Whether forces depend on the velocities that a stage begins with other than by the coordinates.
    pub(crate) fn looks_back(&self) -> bool {
        self.free.b0 != 0.0 || self.prescribed.b0 != 0.0
    }
}

const END: Weights = Weights { a0: 0.0, a1: 1.0, b0: 0.0, b1: 1.0, d0: 0.0, d1: 1.0 };

/// Implicit Euler, and each stage of sdirk2.
pub const EULER: Scheme = Scheme { free: END, prescribed: END, middle: Map::Exponential, end: Map::Exponential, momentum: 1.0 };

/// Implicit Euler from rest, `m v⁺/h = f(q⁺, v⁺)`: damping and contact as there, but no momentum. An M/h² regularizes what nothing
/// holds; a free mode of angular frequency ω relaxes by 1/(1 + (hω)²) per step.
pub const QUASI_STATIC: Scheme = Scheme { momentum: 0.0, ..EULER };

/// Implicit midpoint.
pub const MIDPOINT: Scheme = Scheme {
    free: Weights { a0: 0.25, a1: 0.25, b0: 0.5, b1: 0.5, d0: 0.5, d1: 0.5 },
    prescribed: Weights { a0: 0.0, a1: 0.5, b0: 0.0, b1: 1.0, d0: 0.0, d1: 1.0 },
    middle: Map::HalfCayley,
    end: Map::Cayley,
    momentum: 1.0,
};

const AT_REST: Weights = Weights { a0: 0.0, a1: 1.0, b0: 0.0, b1: 0.0, d0: 0.0, d1: 1.0 };

/// Equilibrium: the unknown is a displacement (h = 1), forces are evaluated at zero velocity.
pub const STATIC: Scheme =
    Scheme { free: AT_REST, prescribed: AT_REST, middle: Map::Exponential, end: Map::Exponential, momentum: 1.0 };

/// γ of sdirk2, 1 − 1/√2: the root for which two implicit Euler stages of length γh are second order and L-stable.
pub const SDIRK_GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
