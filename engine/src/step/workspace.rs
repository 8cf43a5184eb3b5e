//! The memory of a step, allocated once and reused: the Newton loop allocates nothing.

use super::stage::Iterate;
use crate::contact::Condensed;
use crate::kkt::{BlockBand, Factor, KktError, Symbolic};
use crate::model::Model;
use nalgebra::Vector4;

/// Buffers of the solver for one model, and the warm start of its contacts.
#[derive(Clone, Debug)]
pub struct Workspace {
    pub(crate) q_bar: Vec<f64>,
    pub(crate) v_bar: Vec<f64>,
    pub(crate) f: Vec<f64>,
    pub(crate) r: Vec<f64>,
    pub(crate) d: Vec<f64>,
    pub(crate) d_next: Vec<f64>,
    pub(crate) dw: Vec<Vector4<f64>>,
    pub(crate) dw_next: Vec<Vector4<f64>>,
    pub(crate) cone: Vec<Vector4<f64>>,
    pub(crate) contacts: Vec<Condensed>,
    pub(crate) dq: BlockBand,
    pub(crate) dv: BlockBand,
    pub(crate) k: BlockBand,
    pub(crate) factor: Factor,
    pub(crate) it: Iterate,
    pub(crate) trial: Iterate,
    /// Cone variables of the last converged stage; empty before the first.
    pub(crate) warm: Vec<Vector4<f64>>,
}

impl Workspace {
    /// Buffers for `model`; `theta` decides whether its matrices are symmetric.
    pub fn new(model: &Model, theta: &[f64]) -> Result<Self, KktError> {
        let (n, nq, contacts) = (model.n_nodes(), model.nq(), model.pairs.len());
        let zeros = || vec![0.0; nq];
        let cones = || vec![Vector4::zeros(); contacts];
        let band = || BlockBand::zeros(n, model.reach);
        let symbolic = Symbolic::new(model.method(), model.symmetry(theta), n, model.reach, &model.driven, None)?;
        Ok(Self {
            q_bar: zeros(),
            v_bar: zeros(),
            f: zeros(),
            r: zeros(),
            d: zeros(),
            d_next: zeros(),
            dw: cones(),
            dw_next: cones(),
            cone: cones(),
            contacts: vec![Condensed::zero(); contacts],
            dq: band(),
            dv: band(),
            k: band(),
            factor: Factor::new(&symbolic),
            it: Iterate { v: zeros(), w: cones() },
            trial: Iterate { v: zeros(), w: cones() },
            warm: Vec::new(),
        })
    }

    /// Forgets the contacts' warm start, so that what follows depends on its inputs alone.
    pub fn forget(&mut self) {
        self.warm.clear();
    }
}
