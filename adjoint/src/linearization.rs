//! Jacobians of a step.

/// Jacobians of x⁺ = F(x, u, θ), row-major, of changes δx = (δq, δv, δz) with 2 nv + nz entries.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearization {
    /// A = ∂x⁺/∂x, nx × nx.
    pub a: Vec<f64>,
    /// B = ∂x⁺/∂u, nx × nu.
    pub b: Vec<f64>,
    /// C = ∂x⁺/∂θ, nx × n_params.
    pub c: Vec<f64>,
}

/// Numbers in the longest vectors of a processor.
pub(crate) const VECTOR: usize = 8;
