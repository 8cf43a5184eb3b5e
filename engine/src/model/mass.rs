//! Lumped masses.

/// Mass of a node, `m = ρA · length · fraction + Σ extras` \[kg\], as indices into θ.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeMass {
    /// Part of the rope's length, or of a sheet's area, that belongs to the node; 0 for ghosts.
    pub fraction: f64,
    /// Index of the length \[m\]; of a sheet, of its area \[m²\].
    pub length: usize,
    /// Index of the mass per length [kg/m], or per area [kg/m²].
    pub density: usize,
    /// Indices of added masses \[kg\].
    pub extras: Vec<usize>,
    /// A ghost: no mass whatever θ.
    pub ghost: bool,
}

impl NodeMass {
    /// Mass \[kg\].
    pub fn mass(&self, theta: &[f64]) -> f64 {
        if self.ghost {
            return 0.0;
        }
        theta[self.density] * theta[self.length] * self.fraction + self.extras.iter().map(|&k| theta[k]).sum::<f64>()
    }

    /// Calls `visit(parameter, ∂m/∂θ)`.
    pub fn visit(&self, theta: &[f64], visit: &mut dyn FnMut(usize, f64)) {
        if self.ghost {
            return;
        }
        visit(self.density, theta[self.length] * self.fraction);
        visit(self.length, theta[self.density] * self.fraction);
        for &k in &self.extras {
            visit(k, 1.0);
        }
    }
}
