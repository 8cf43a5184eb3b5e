//! Directions in θ, u and in forces from outside, as columns of a tangent.

/// `columns` directions; column c moves parameter k by `weight` for every (c, weight) listed under k, and likewise controls.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seeds {
    /// Number of columns of the tangents they belong to.
    pub columns: usize,
    theta: Vec<Vec<(usize, f64)>>,
    u: Vec<Vec<(usize, f64)>>,
    forces: Vec<(usize, usize, f64)>,
    any_theta: bool,
}

impl Seeds {
    /// No direction in θ or u.
    pub fn none(columns: usize, nu: usize, n_params: usize) -> Self {
        Self { columns, theta: vec![Vec::new(); n_params], u: vec![Vec::new(); nu], forces: Vec::new(), any_theta: false }
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

    /// Column `column` adds a generalized force, constant over the next step and of no law of the model, to a degree of freedom at rate
    /// `weight` [N, or N·m at a turn]; one that a gripper prescribes does not feel it.
    pub fn add_force(&mut self, dof: usize, column: usize, weight: f64) {
        self.forces.push((dof, column, weight));
    }

    /// Forgets the forces, to set those of the next step.
    pub fn clear_forces(&mut self) {
        self.forces.clear();
    }

    /// Forces, as (degree of freedom, column, weight).
    pub fn forces(&self) -> &[(usize, usize, f64)] {
        &self.forces
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
