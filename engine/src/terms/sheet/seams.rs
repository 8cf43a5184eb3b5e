//! The folds of a sheet: each lies between two triangles, and so in two patches.

use super::patch::{Each, FLAPS, Patch};
use crate::terms::stencil::add_node;
use pliant_math::Vec3;
use std::collections::HashMap;

/// A patch's flap as a fold of the sheet.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Flap {
    pub fold: usize,
    /// Whether the patch sees the fold's nodes from the other side: the edge's ends exchanged, and the outer nodes.
    other_side: bool,
    /// Whether the patch is the one that answers for the fold; its first one.
    pub owner: bool,
}

impl Flap {
    /// Numbers of the fold's nodes in the order of the flap's.
    #[inline]
    pub fn turned(&self, x: &[Vec3<f64>; 4]) -> [Vec3<f64>; 4] {
        if self.other_side { [x[1], x[0], x[3], x[2]] } else { *x }
    }
}

/// All folds of a sheet.
#[derive(Clone, Debug)]
pub(super) struct Seams {
    /// The nodes of each, as its owner has them.
    pub folds: Vec<[usize; 4]>,
    /// The flaps of each patch; those beyond its last are not read.
    pub flaps: Vec<Each<Flap>>,
}

impl Seams {
    pub fn new(patches: &[Patch]) -> Self {
        let (mut folds, mut known) = (Vec::new(), HashMap::new());
        let mut flap = |nodes: [usize; 4]| {
            let [a, b, c, d] = nodes;
            if let Some(&fold) = known.get(&[b, a, d, c]) {
                return Flap { fold, other_side: true, owner: false };
            }
            known.insert(nodes, folds.len());
            folds.push(nodes);
            Flap { fold: folds.len() - 1, other_side: false, owner: true }
        };
        let of = |patch: &Patch| {
            let mut out = [Flap::default(); FLAPS];
            out.iter_mut().enumerate().take(patch.shape.flaps).for_each(|(i, out)| *out = flap(patch.flap(i)));
            out
        };
        let flaps = patches.iter().map(of).collect();
        Self { folds, flaps }
    }

    /// Adds the forces −Σ wₖ ∂ψₖ/∂x.
    #[inline]
    pub fn add_force<'a>(&self, f: &mut [f64], w: &[f64], gradient: impl Fn(usize) -> &'a [Vec3<f64>; 4]) {
        for (k, (nodes, w)) in self.folds.iter().zip(w).enumerate() {
            for (node, g) in nodes.iter().zip(gradient(k)) {
                add_node(f, *node, &(g * -w));
            }
        }
    }
}
