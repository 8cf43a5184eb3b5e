//! Blocks of inputs and random directions in them.

use super::constants::GRADCHECK;
use super::{Inputs, Random};
use crate::RolloutCotangent;
use pliant_engine::model::Model;

/// A direction in one block of inputs, scaled to the size of the quantities that it moves.
pub(crate) struct Block {
    pub name: String,
    pub size: usize,
    pub x0: Vec<f64>,
    pub u: Vec<Vec<f64>>,
    pub theta: Vec<f64>,
    /// L is even in these values: coefficients of contact friction, all zero. The convex relaxation holds their squares alone, so the
    /// derivative is 0; a one-sided difference sees it only at coefficients below the rest gap over the distance slid in a step,
    /// which rounding hides, and finds the slope of the cone above.
    pub even: bool,
    /// Typical size of the block's values; 0 if they are all zero, so that no relative step makes sense.
    pub scale: f64,
    /// Smallest and largest ε (in units of the direction) the bounds of θ allow.
    pub range: (f64, f64),
}

impl Block {
    fn empty(name: &str, model: &Model, inputs: &Inputs) -> Self {
        Self {
            name: name.to_owned(),
            size: 0,
            x0: vec![0.0; model.ndx()],
            u: inputs.u.iter().map(|row| vec![0.0; row.len()]).collect(),
            theta: vec![0.0; inputs.theta.len()],
            even: false,
            scale: 1.0,
            range: (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    /// ⟨gradient, direction⟩.
    pub(crate) fn dot(&self, gradient: &RolloutCotangent) -> f64 {
        super::dot(&self.x0, &gradient.x0)
            + super::dot(&self.theta, &gradient.theta)
            + self.u.iter().zip(&gradient.u).map(|(a, b)| super::dot(a, b)).sum::<f64>()
    }

    /// Inputs moved by ε along the direction.
    pub(crate) fn moved(&self, model: &Model, inputs: &Inputs, eps: f64) -> Inputs {
        let add = |a: &[f64], d: &[f64]| a.iter().zip(d).map(|(a, d)| a + eps * d).collect();
        Inputs {
            x0: model.displaced(&inputs.x0, &self.x0.iter().map(|d| eps * d).collect::<Vec<_>>()),
            u: inputs.u.iter().zip(&self.u).map(|(a, d)| add(a, d)).collect(),
            theta: add(&inputs.theta, &self.theta),
        }
    }
}

/// One block for positions, velocities, internal variables, controls, and every quantity of θ (indices joined).
pub(crate) fn all(model: &Model, inputs: &Inputs, random: &mut Random) -> Vec<Block> {
    let nv = model.nv();
    let mut blocks = Vec::new();
    for (name, range) in [("x0.q", 0..nv), ("x0.v", nv..2 * nv), ("x0.z", 2 * nv..model.ndx())] {
        if range.is_empty() {
            continue;
        }
        let mut block = Block::empty(name, model, inputs);
        block.size = range.len();
        block.x0[range].iter_mut().for_each(|d| *d = random.symmetric());
        block.scale = if name == "x0.v" { GRADCHECK.of_velocities } else { GRADCHECK.of_coordinates };
        blocks.push(block);
    }
    if model.nu() > 0 && !inputs.u.is_empty() {
        let mut block = Block::empty("u", model, inputs);
        block.size = model.nu() * inputs.u.len();
        block.u.iter_mut().flatten().for_each(|d| *d = random.symmetric());
        block.scale = GRADCHECK.of_coordinates;
        blocks.push(block);
    }
    let mut names: Vec<String> = Vec::new();
    for info in model.params().infos() {
        let name = without_indices(&info.path);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    blocks.extend(names.iter().map(|name| theta_block(name, model, inputs, random)));
    blocks
}

fn theta_block(name: &str, model: &Model, inputs: &Inputs, random: &mut Random) -> Block {
    let mut block = Block::empty(name, model, inputs);
    let members: Vec<usize> =
        (0..inputs.theta.len()).filter(|&k| without_indices(&model.params().info(k).path) == name).collect();
    block.size = members.len();
    block.scale = members.iter().map(|&k| inputs.theta[k].abs()).fold(0.0, f64::max);
    // (friction of joints is a force or a torque, and not even; Coulomb's law begins linearly)
    let coefficients = members.iter().all(|&k| model.params().info(k).unit == "-");
    block.even = name.ends_with(".friction") && coefficients && block.scale == 0.0 && model.friction_is_even();
    for k in members {
        let info = model.params().info(k);
        let (value, at_bound) = (inputs.theta[k], inputs.theta[k] <= info.lower);
        // at a lower bound only the inward direction is physical
        let d = if at_bound { 0.5 + 0.5 * random.unit() } else { random.symmetric() };
        block.theta[k] = d;
        for bound in [info.lower, info.upper].into_iter().filter(|b| b.is_finite()) {
            let reach = (bound - value) / d;
            if reach > 0.0 || (at_bound && bound == info.upper) {
                block.range.1 = block.range.1.min(reach);
            } else {
                block.range.0 = block.range.0.max(reach);
            }
        }
    }
    block
}

/// `cable.node[3].mass` → `cable.node[*].mass`.
fn without_indices(path: &str) -> String {
    let mut out = String::new();
    let mut inside = false;
    for c in path.chars() {
        if c == ']' {
            inside = false;
            out.push('*');
        }
        if !inside {
            out.push(c);
        }
        inside |= c == '[';
    }
    out
}
