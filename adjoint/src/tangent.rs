//! Tangents of many directions carried along a rollout, step by step: the sensitivities that fits are made of.

use crate::seeds::Seeds;
use crate::stage::{Context, Memory};
use crate::step::{Tangent, step_tangent};
use pliant_engine::model::Model;
use pliant_engine::step::StepRecord;

/// Carries a block of tangents (of x₀, u and θ at once) through recorded steps.
#[derive(Clone, Debug)]
pub struct TangentStepper<'m> {
    model: &'m Model,
    theta: &'m [f64],
    mass: Vec<f64>,
    /// Directions in θ and u of each column; change those in u between steps as needed.
    pub seeds: Seeds,
    /// The tangents at the current state.
    pub x: Tangent,
    memory: Memory,
}

impl<'m> TangentStepper<'m> {
    /// Starts with zero tangents of the state.
    pub fn new(model: &'m Model, theta: &'m [f64], seeds: Seeds) -> Self {
        let zero = vec![0.0; model.nv() * seeds.columns];
        let x = Tangent { q: zero.clone(), v: zero, z: vec![0.0; model.ndz() * seeds.columns] };
        Self { model, theta, mass: model.row_masses(theta), seeds, x, memory: Memory::default() }
    }

    /// Another one of the same model at the same θ.
    pub(crate) fn with_seeds(&self, seeds: Seeds) -> Self {
        Self::new(self.model, self.theta, seeds)
    }

    /// Makes room for more columns: those that there are keep their numbers, the new ones are zero and have no direction. Directions in
    /// u of the columns that there are, which belong to the last step, are forgotten.
    pub fn grow(&mut self, columns: usize) {
        let before = self.seeds.columns;
        self.seeds.clear_u();
        if columns <= before {
            return;
        }
        let rows = [self.model.nv(), self.model.nv(), self.model.ndz()];
        for (block, rows) in [&mut self.x.q, &mut self.x.v, &mut self.x.z].into_iter().zip(rows) {
            let mut wider = vec![0.0; rows * columns];
            for row in 0..rows {
                wider[row * columns..][..before].copy_from_slice(&block[row * before..][..before]);
            }
            *block = wider;
        }
        self.seeds.columns = columns;
        self.memory = Memory::default();
    }

    /// Pushes the tangents through one step.
    pub fn step(&mut self, record: &StepRecord) {
        let cx = Context { model: self.model, theta: self.theta, mass: &self.mass };
        step_tangent(cx, record, &mut self.x, &self.seeds, &mut self.memory);
    }

    /// Arguments of the steps' derivatives.
    pub(crate) fn context(&self) -> Context<'_> {
        Context { model: self.model, theta: self.theta, mass: &self.mass }
    }
}
