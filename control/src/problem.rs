//! Cost and constraints along a rollout, with their derivatives.
//!
//! ```text
//! J(u) = Σ_{k=0}^{N} ½ |r_k(x_k, u_k)|² + ℓ_k(x_k, u_k)     x_{k+1} = F(x_k, u_k; θ),  no u_N
//! c_k(x_k, u_k) ≤ 0                              each with a price per unit of its violation
//! lower_k ≤ u_k ≤ upper_k
//! ```
//! Residuals r make the Gauss–Newton matrix rᵤᵀ rᵤ, which needs no second derivative and is never indefinite. Costs ℓ that are no sums of
//! squares are given by value and slope; a plan finds their curvature from one step to the next.

use pliant_math::State;

/// Values of one stage and their derivatives, by a change of x (ndx columns) and then by u (nu columns).
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// The values.
    pub values: Vec<f64>,
    /// Derivatives (row, column, value): columns from 0 are those of a change of x, from ndx on those of u.
    pub entries: Vec<(usize, usize, f64)>,
}

impl Rows {
    /// Adds a row without derivatives and returns its number.
    pub fn push(&mut self, value: f64) -> usize {
        self.values.push(value);
        self.values.len() - 1
    }

    /// Adds a derivative of a row.
    pub fn slope(&mut self, row: usize, column: usize, value: f64) {
        self.entries.push((row, column, value));
    }

    fn clear(&mut self) {
        self.values.clear();
        self.entries.clear();
    }
}

/// Residuals and constraints of one stage.
#[derive(Clone, Debug, Default)]
pub struct Terms {
    /// r_k.
    pub residuals: Rows,
    /// Summands of ℓ_k.
    pub values: Rows,
    /// c_k.
    pub constraints: Rows,
    /// Prices of the constraints' violations, per unit.
    pub prices: Vec<f64>,
}

impl Terms {
    /// Adds a constraint c ≤ 0 of that price per unit of its violation, and returns its row.
    pub fn constrain(&mut self, value: f64, price: f64) -> usize {
        self.prices.push(price);
        self.constraints.push(value)
    }

    /// Forgets all rows and keeps their memory.
    pub fn clear(&mut self) {
        self.residuals.clear();
        self.values.clear();
        self.constraints.clear();
        self.prices.clear();
    }

    /// ½ |r|² + ℓ.
    pub fn cost(&self) -> f64 {
        0.5 * self.residuals.values.iter().map(|r| r * r).sum::<f64>() + self.values.values.iter().sum::<f64>()
    }

    /// Σ price · max(0, c).
    pub fn penalty(&self) -> f64 {
        self.constraints.values.iter().zip(&self.prices).map(|(c, price)| price * c.max(0.0)).sum()
    }
}

/// Cost and constraints.
pub trait Problem: Sync {
    /// Adds the rows of stage `k` of `n` to `out`, at x_k and, but for k = n, u_k. The number of rows of a stage and what they are may
    /// not depend on x and u.
    ///
    /// # Errors
    /// The reason, in words, why a row cannot be evaluated.
    fn evaluate(&self, k: usize, n: usize, x: &State, u: Option<&[f64]>, out: &mut Terms) -> Result<(), String>;

    /// Bounds of u_k (nu each), infinite where there are none.
    fn bounds(&self, k: usize, lower: &mut [f64], upper: &mut [f64]);

    /// Words for row `row` of the constraints of stage `k`, for messages.
    fn constraint(&self, k: usize, n: usize, row: usize) -> String {
        format!("constraint {row} of stage {k} of {n}")
    }
}

impl<P: Problem + Send + Sync + ?Sized> Problem for std::sync::Arc<P> {
    fn evaluate(&self, k: usize, n: usize, x: &State, u: Option<&[f64]>, out: &mut Terms) -> Result<(), String> {
        (**self).evaluate(k, n, x, u, out)
    }

    fn bounds(&self, k: usize, lower: &mut [f64], upper: &mut [f64]) {
        (**self).bounds(k, lower, upper);
    }

    fn constraint(&self, k: usize, n: usize, row: usize) -> String {
        (**self).constraint(k, n, row)
    }
}
