//! Directions in θ and u, as columns of a tangent.

/// `columns` directions; column c moves parameter k by `weight` for every (c, weight) listed under k, and likewise controls.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seeds {
    /// Number of columns of the tangents they belong to.
    pub columns: usize,
    theta: Vec<Vec<(usize, f64)>>,
    u: Vec<Vec<(usize, f64)>>,
    any_theta: bool,
}

impl Seeds {
    /// No direction in θ or u.
    pub fn none(columns: usize, nu: usize, n_params: usize) -> Self {
        Self { columns, theta: vec![Vec::new(); n_params], u: vec![Vec::new(); nu], any_theta: false }
    }

    /// Column `column` moves parameter `param` at rate `weight`.
    pub fn add_theta(&mut self, param: usize, column: usize, weight: f64) {
        self.theta[param].push((column, weight));
        self.any_theta = true;
    }

    /// Column `column` moves control `control` at rate `weight`.
    pub fn add_u(&mut self, control: usize, column: usize, weight: f64) {
        self.u[control].push((column, weight));
    }

    /// Forgets the directions in u, to set those of the next step.
    pub fn clear_u(&mut self) {
        self.u.iter_mut().for_each(Vec::clear);
    }

    /// Columns that move a parameter.
    pub fn theta(&self, param: usize) -> &[(usize, f64)] {
        &self.theta[param]
    }

    /// Columns that move a control.
    pub fn u(&self, control: usize) -> &[(usize, f64)] {
        &self.u[control]
    }

    pub(crate) fn has_theta(&self) -> bool {
        self.any_theta
    }
}
