//! Loop closures in a stage: points, and of welds axes.

use super::link::Link;
use super::{Beginning, ConeRecord, ConstraintId, ConstraintSet, Evaluation, InputsAt, Loads, Slopes, WarmImpulses, cone};
use crate::bodies::Frames;
use crate::constraints::{ClosureLaw, TieRows, closure_law, pose};
use crate::step::{Stage, StepError};
use nalgebra::Vector4;
use pliant_math::spatial::Force;
use pliant_math::{Input, Vec3};

/// Loop closures of a stage: points, and of welds axes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Closures {
    pub links: Vec<Link>,
    /// Index of the closure, and whether it is about the axes.
    parts: Vec<(usize, bool)>,
}

impl Stage<'_> {
    fn closure_law(&self, link: &Link, closure: usize) -> ClosureLaw {
        let scales = [self.h, self.options.rest_gap];
        closure_law(&self.model.closures[closure], link.rho_t, self.theta, scales, self.options.regularization)
    }
}

impl Closures {
    fn rows(&self, k: usize, stage: &Stage, q: &[f64], frames: &Frames<f64>) -> TieRows {
        let (closure, turn) = self.parts[k];
        let poses = self.links[k].attachments.map(|c| pose(c, q, frames));
        stage.model.closures[closure].rows(turn, [&poses[0], &poses[1]], stage.theta)
    }
}

impl ConstraintSet for Closures {
    fn find(&mut self, stage: &Stage, _at: &Beginning) {
        self.links.clear();
        self.parts.clear();
        for (closure, held) in stage.model.closures.iter().enumerate() {
            for turn in [false, true].into_iter().take(1 + usize::from(held.relative.is_some())) {
                self.links.push(Link::new(ConstraintId::Closure { closure, turn }, held.attachments, [0; 2]));
                self.parts.push((closure, turn));
            }
        }
    }

    fn scale(&mut self, stage: &Stage, at: &Beginning) {
        for k in 0..self.links.len() {
            let rows = self.rows(k, stage, stage.q_ref, at.frames);
            let unit = |k: usize| rows.wrench(&Vector4::from_fn(|r, _| f64::from(u8::from(r == k + 1))));
            let most: f64 = (0..3).map(|i| stage.mobility(self.links[k].attachments, at, &unit(i))).sum();
            (self.links[k].rho_n, self.links[k].rho_t) = (stage.law_step(most), stage.law_step(most));
        }
    }

    fn residual(
        &mut self,
        stage: &Stage,
        at: &Evaluation,
        lambda: &[f64],
        out: &mut [f64],
        loads: &mut Loads,
    ) -> Result<(), StepError> {
        for (k, link) in self.links.iter().enumerate() {
            let (rows, w) = (self.rows(k, stage, at.q, at.frames), cone(lambda, k));
            let f = rows.residual(&stage.closure_law(link, self.parts[k].0), stage.h, &w);
            out[4 * k..4 * k + 4].copy_from_slice(f.as_slice());
            link.push(rows.wrench(&link.load(&w, &f, at)), stage.h, loads);
        }
        Ok(())
    }

    fn linearize(
        &mut self,
        stage: &Stage,
        at: &Evaluation,
        lambda: &[f64],
        out: &mut [f64],
        loads: &mut Loads,
        slopes: &mut Slopes,
    ) -> Result<(), StepError> {
        for k in 0..self.links.len() {
            let (rows, w) = (self.rows(k, stage, at.q, at.frames), cone(lambda, k));
            let law = stage.closure_law(&self.links[k], self.parts[k].0);
            let link = &mut self.links[k];
            link.linear = rows.linearize(&law, stage.h, &w);
            out[4 * k..4 * k + 4].copy_from_slice(link.linear.f.as_slice());
            link.push(rows.wrench(&link.load(&w, &link.linear.f, at)), stage.h, loads);
            link.add_node_blocks(stage.h, slopes);
        }
        Ok(())
    }

    fn start(&self, _stage: &Stage, warm: Option<&WarmImpulses>, lambda: &mut [f64]) {
        for (link, w) in self.links.iter().zip(lambda.chunks_exact_mut(4)) {
            let known = warm.and_then(|warm| warm.of(&link.id)).unwrap_or_else(Vector4::zeros);
            w.copy_from_slice(known.as_slice());
        }
    }

    fn links(&self) -> &[Link] {
        &self.links
    }

    fn visit_fixed_blocks(&self, stage: &Stage, add: &mut dyn FnMut(usize, [[f64; 3]; 3])) {
        self.links.iter().for_each(|link| link.visit_fixed_blocks(stage.h, add));
    }
}

/// ∂(r, F)/∂θ of a closure: its points and its compliance.
pub(super) fn visit_inputs(
    record: &ConeRecord,
    closure: usize,
    turn: bool,
    at: &InputsAt,
    frames: &Frames<f64>,
    visit: &mut dyn FnMut(usize, Input, f64),
) {
    let (closure, h, row) = (&at.model.closures[closure], at.stage.h, record.block.row);
    let law = closure_law(closure, record.rho[1], at.theta, [h, at.stage.rest_gap], 0.0);
    let w = Vec3::new(record.w[1], record.w[2], record.w[3]);
    if let Some(compliance) = closure.compliance {
        (0..3).for_each(|a| visit(row + 1 + a, Input::Theta(compliance), law.rho * w[a] / (h * h)));
    }
    if turn {
        return;
    }
    for (side, sign) in [(0, 1.0), (1, -1.0)] {
        let pose = pose(closure.attachments[side], at.q, frames);
        for axis in 0..3 {
            let param = Input::Theta(closure.points[side] + axis);
            let moved = pose.rotation.column(axis).into_owned();
            (0..3).for_each(|a| visit(row + 1 + a, param, sign * law.rho / h * moved[a]));
            let wrench = Force { n: moved.cross(&w) * (0.5 / h), f: Vec3::zeros() };
            record.visit_wrench(at.model, frames, &wrench, &mut |row, value| visit(row, param, -value));
        }
    }
}
