//! Sections that remember, and their derivatives by dual numbers.

use super::{Moments, SectionInput, SectionLaw, SectionPoint};
use nalgebra::SVector;
use num_dual::{Derivative, DualSVec64};
use pliant_math::Real;
use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

/// Most parameters of a section, and directions of a dual number where many are asked for.
const MAX_PARAMS: usize = 14;
const CHUNK: usize = 6;

/// Where a section that remembers is evaluated: see [`SectionPoint`].
#[derive(Clone, Copy, Debug)]
pub struct SectionState<S> {
    /// Number of the joint in the model.
    pub joint: usize,
    /// Its length as a fraction of the rod's.
    pub fraction: f64,
    /// κ₁, κ₂ [-], τ \[rad\].
    pub strain: [S; 3],
    /// The same at the beginning of the (sub)step.
    pub past: [S; 3],
    /// History variables of the beginning, zero beyond [`RememberingSection::memory`].
    pub memory: [S; 3],
    /// Time since then \[s\]; 0 where nothing has moved since: what is remembered stays as it is.
    pub elapsed: f64,
}

/// The law of a section that remembers, for one joint, written once.
pub trait RememberingSection: Debug + Send + Sync {
    /// Name used in errors and reports.
    fn name(&self) -> &str;

    /// Indices in θ of what it reads, in the order it expects; at most [`AutomaticMemory::MAX_PARAMS`].
    fn params(&self) -> &[usize];

    /// Indices in θ of what it reads of this joint alone; they follow the others.
    fn own(&self, _joint: usize) -> Range<usize> {
        0..0
    }

    /// Names of what it remembers of every joint, three at most; they begin at zero.
    fn memory(&self) -> &'static [&'static str];

    /// The moment \[N·m\]; `p`: the parameters' values.
    fn moment<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> [S; 3];

    /// History variables where it is evaluated.
    fn advance<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> [S; 3];

    /// Elastic energy \[J\].
    fn energy<S: Real>(&self, at: &SectionState<S>, p: &[S]) -> S;

    /// Which branch of the law this is on; `None` if it has no kinks between branches.
    fn mode(&self, _at: &SectionState<f64>, _p: &[f64]) -> Option<u8> {
        None
    }

    /// Adds the moment and its slopes by strain where these are known by hand; whether it did.
    fn add_by_hand(&self, _at: &SectionState<f64>, _p: &[f64], _out: &mut Moments) -> bool {
        false
    }

    /// Whether it makes no moment with these parameters whatever the strains are, so that steps need not ask; it remembers all the same.
    fn silent(&self, _p: &[f64]) -> bool {
        false
    }

    /// The law with a rest shape of these strains, joint by joint of the model; `None` if it has no rest shape.
    fn rested(&self, _strains: &[[f64; 3]]) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }
}

/// A section that remembers, with automatic derivatives.
#[derive(Clone, Debug)]
pub struct AutomaticMemory<L> {
    /// The law.
    pub law: L,
}

type Dual<const N: usize> = DualSVec64<N>;

fn seeded<const N: usize>(value: f64, direction: usize) -> Dual<N> {
    let mut unit = SVector::zeros();
    unit[direction] = 1.0;
    Dual::new(value, Derivative::some(unit))
}

impl<L: RememberingSection> AutomaticMemory<L> {
    /// Most parameters that a law may read.
    pub const MAX_PARAMS: usize = MAX_PARAMS;

    /// # Panics
    /// If the law reads more than [`Self::MAX_PARAMS`] parameters or remembers more than three numbers: a mistake in its code.
    pub fn new(law: L) -> Self {
        assert!(law.params().len() + law.own(0).len() <= MAX_PARAMS, "{}: more than {MAX_PARAMS} parameters", law.name());
        assert!(law.memory().len() <= 3, "{}: more than three numbers", law.name());
        Self { law }
    }

    fn params(&self, joint: usize) -> impl Iterator<Item = usize> {
        self.law.params().iter().copied().chain(self.law.own(joint))
    }

    /// Number of the parameters of a joint.
    fn n_params(&self, joint: usize) -> usize {
        self.law.params().len() + self.law.own(joint).len()
    }

    /// Inputs that are parameters: one that stands for two is one input.
    fn thetas(&self, joint: usize) -> Vec<SectionInput> {
        let mut inputs: Vec<SectionInput> = Vec::with_capacity(MAX_PARAMS);
        for k in self.params(joint).map(SectionInput::Theta) {
            if !inputs.contains(&k) {
                inputs.push(k);
            }
        }
        inputs
    }

    /// Values, or dual numbers where `inputs` asks for derivatives.
    fn placed<S: Real>(&self, at: &SectionPoint, number: impl Fn(SectionInput, f64) -> S) -> (SectionState<S>, [S; MAX_PARAMS]) {
        let strain = std::array::from_fn(|s| number(SectionInput::Strain(s), at.strain[s]));
        let past = std::array::from_fn(|s| number(SectionInput::Past(s), at.past[s]));
        let memory = std::array::from_fn(|k| at.memory.get(k).map_or(S::zero(), |z| number(SectionInput::Memory(k), *z)));
        let mut p = [S::zero(); MAX_PARAMS];
        p.iter_mut().zip(self.params(at.joint)).for_each(|(x, k)| *x = number(SectionInput::Theta(k), at.theta[k]));
        (SectionState { joint: at.joint, fraction: at.fraction, strain, past, memory, elapsed: at.elapsed }, p)
    }

    fn values(&self, at: &SectionPoint) -> (SectionState<f64>, [f64; MAX_PARAMS]) {
        self.placed(at, |_, value| value)
    }

    /// Calls `visit(input, value and derivative)` of what `of` makes, for each of `inputs`.
    fn slopes(
        &self,
        at: &SectionPoint,
        inputs: &[SectionInput],
        of: impl Fn(&SectionState<Dual<CHUNK>>, &[Dual<CHUNK>]) -> [Dual<CHUNK>; 3],
        visit: &mut dyn FnMut(SectionInput, [f64; 3]),
    ) {
        for inputs in inputs.chunks(CHUNK) {
            let (state, p) = self.placed(at, |input, value| {
                inputs.iter().position(|i| *i == input).map_or(Dual::from_re(value), |d| seeded(value, d))
            });
            let out = of(&state, &p[..self.n_params(at.joint)]);
            for (d, &input) in inputs.iter().enumerate() {
                visit(input, out.map(|x| x.eps.0.map_or(0.0, |by| by[d])));
            }
        }
    }
}

/// Inputs that are strains now, strains then, and numbers remembered.
fn strains() -> [SectionInput; 3] {
    [0, 1, 2].map(SectionInput::Strain)
}

impl<L: RememberingSection + 'static> SectionLaw for AutomaticMemory<L> {
    fn name(&self) -> &str {
        self.law.name()
    }

    fn add_moment(&self, at: &SectionPoint, m: &mut [f64; 3]) {
        let (state, p) = self.values(at);
        if self.law.silent(&p) {
            return;
        }
        let by = self.law.moment(&state, &p[..self.n_params(at.joint)]);
        m.iter_mut().zip(by).for_each(|(m, by)| *m += by);
    }

    fn add(&self, at: &SectionPoint, out: &mut Moments) {
        let (state, p) = self.values(at);
        if self.law.silent(&p) || self.law.add_by_hand(&state, &p[..self.n_params(at.joint)], out) {
            return;
        }
        let (state, p) = self.placed(at, |input, value| match input {
            SectionInput::Strain(s) => seeded::<3>(value, s),
            _ => Dual::from_re(value),
        });
        for (s, m) in self.law.moment(&state, &p[..self.n_params(at.joint)]).into_iter().enumerate() {
            out.m[s] += m.re;
            if let Some(by) = m.eps.0 {
                (0..3).for_each(|k| out.by_strain[s][k] += by[k]);
            }
        }
    }

    fn visit_theta(&self, at: &SectionPoint, visit: &mut dyn FnMut(usize, [f64; 3])) {
        self.slopes(at, &self.thetas(at.joint), |at, p| self.law.moment(at, p), &mut |input, m| {
            if let SectionInput::Theta(k) = input {
                visit(k, m);
            }
        });
    }

    fn energy(&self, at: &SectionPoint) -> f64 {
        let (state, p) = self.values(at);
        self.law.energy(&state, &p[..self.n_params(at.joint)])
    }

    fn resting(&self, strains: &[[f64; 3]]) -> Option<Arc<dyn SectionLaw>> {
        Some(Arc::new(Self::new(self.law.rested(strains)?)))
    }

    fn memory(&self) -> &'static [&'static str] {
        self.law.memory()
    }

    fn mode(&self, at: &SectionPoint) -> Option<u8> {
        let (state, p) = self.values(at);
        self.law.mode(&state, &p[..self.n_params(at.joint)])
    }

    fn visit_past(&self, at: &SectionPoint, visit: &mut dyn FnMut(SectionInput, [f64; 3])) {
        if self.law.silent(&self.values(at).1) {
            return;
        }
        let past = [0, 1, 2].map(SectionInput::Past);
        let memory = (0..self.law.memory().len()).map(SectionInput::Memory);
        // where no time has passed, the beginning is where the moment is evaluated
        let inputs: Vec<SectionInput> = past.into_iter().filter(|_| at.elapsed > 0.0).chain(memory).collect();
        self.slopes(at, &inputs, |at, p| self.law.moment(at, p), visit);
    }

    fn advance(&self, at: &SectionPoint, z: &mut [f64]) {
        let (state, p) = self.values(at);
        let next = self.law.advance(&state, &p[..self.n_params(at.joint)]);
        z.iter_mut().zip(next).for_each(|(z, next)| *z = next);
    }

    fn visit_advance(&self, at: &SectionPoint, visit: &mut dyn FnMut(usize, SectionInput, f64)) {
        let n = self.law.memory().len();
        let mut inputs: Vec<SectionInput> = strains().into_iter().chain([0, 1, 2].map(SectionInput::Past)).collect();
        inputs.extend((0..n).map(SectionInput::Memory));
        inputs.extend(self.thetas(at.joint));
        self.slopes(at, &inputs, |at, p| self.law.advance(at, p), &mut |input, by| {
            (0..n).filter(|k| by[*k] != 0.0).for_each(|k| visit(k, input, by[k]));
        });
    }
}
