//! Derivatives of a [`JointLaw`] by dual numbers, all directions of an element at once.

use super::{JointElement, JointLaw, JointPoint, JointState, JointTerm};
use crate::bodies::dynamics::Displacement;
use crate::bodies::{JointKind, quaternion};
use nalgebra::{Matrix3, SVector};
use num_dual::{Derivative, Dual64, DualSVec64};
use pliant_math::Input;
use pliant_math::rotation::{logarithm, logarithm_jacobian};

const MAX_DOFS: usize = 6;
const MAX_INPUTS: usize = 8;
/// Coordinates at both ends of a step, internal variables and parameters of an element that remembers.
const MEMORY: usize = 9 + MAX_INPUTS;
type InputDual = DualSVec64<MAX_INPUTS>;
type MemoryDual = DualSVec64<MEMORY>;

/// A joint law and its elements as a [`JointTerm`].
#[derive(Clone, Debug)]
pub struct AutomaticJoint<L> {
    law: L,
    elements: Vec<JointElement>,
}

/// Coordinates, velocities and degrees of freedom of an element.
struct Local {
    n: usize,
    q: [f64; MAX_DOFS],
    v: [f64; MAX_DOFS],
    dofs: [usize; MAX_DOFS],
    /// Coordinates and internal variables at the beginning of the step, of an element that remembers.
    m: usize,
    q_past: [f64; 3],
    z: [f64; 3],
    elapsed: f64,
}

fn local(e: &JointElement, at: &JointPoint) -> Local {
    let mut local = Local {
        n: 0,
        q: [0.0; MAX_DOFS],
        v: [0.0; MAX_DOFS],
        dofs: [0; MAX_DOFS],
        m: e.memory.len(),
        q_past: [0.0; 3],
        z: [0.0; 3],
        elapsed: at.past.elapsed,
    };
    if let (Some(&j), true) = (e.joints.first(), local.m > 0) {
        let joint = &at.tree.joints()[j];
        if joint.kind == JointKind::Ball {
            local.q_past.copy_from_slice(logarithm(&quaternion(at.past.q, joint.q)).as_slice());
        } else {
            local.q_past[0] = at.past.q[joint.q];
        }
        local.z.iter_mut().zip(&e.memory).for_each(|(z, &k)| *z = at.past.z[k]);
    }
    for &j in &e.joints {
        let joint = &at.tree.joints()[j];
        if joint.kind == JointKind::Ball {
            local.q[local.n..local.n + 3].copy_from_slice(logarithm(&quaternion(at.q, joint.q)).as_slice());
        } else {
            local.q[local.n] = at.q[joint.q];
        }
        for a in 0..joint.kind.n_dofs() {
            local.v[local.n] = at.v[joint.v + a];
            local.dofs[local.n] = joint.v + a;
            local.n += 1;
        }
    }
    local
}

impl<L: JointLaw> AutomaticJoint<L> {
    /// Largest number of degrees of freedom of an element.
    pub const MAX_DOFS: usize = MAX_DOFS;
    /// Largest number of controls and parameters of an element.
    pub const MAX_INPUTS: usize = MAX_INPUTS;

    /// Joins a law with the elements it acts on.
    ///
    /// # Panics
    /// If an element exceeds [`Self::MAX_INPUTS`]: a mistake in the law's own file, not in user data.
    pub fn new(law: L, elements: Vec<JointElement>) -> Self {
        assert!(elements.iter().all(|e| e.params.len() + e.controls.len() <= MAX_INPUTS && e.joints.len() <= MAX_DOFS));
        assert!(elements.iter().all(|e| e.memory.len() <= 3 && (e.memory.is_empty() || e.joints.len() == 1)));
        Self { law, elements }
    }

    fn values(indices: &[usize], from: &[f64]) -> [f64; MAX_INPUTS] {
        let mut out = [0.0; MAX_INPUTS];
        out.iter_mut().zip(indices).for_each(|(o, &k)| *o = from[k]);
        out
    }

    fn evaluate(&self, e: &JointElement, at: &JointPoint, x: &Local) -> [f64; MAX_DOFS] {
        let (u, p) = (Self::values(&e.controls, at.u), Self::values(&e.params, at.theta));
        let state = x.state(&u[..e.controls.len()]);
        let mut f = [0.0; MAX_DOFS];
        self.law.force(&state, &p[..e.params.len()], &e.constants, &mut f[..x.n]);
        f
    }

    /// ∂(coordinates)/∂δ for δq̄ = cq J δ.
    fn coordinate_changes(
        e: &JointElement,
        at: &JointPoint,
        x: &Local,
        cq: f64,
        turns: &[Option<Matrix3<f64>>],
    ) -> [[f64; 6]; 6] {
        let mut out = [[0.0; MAX_DOFS]; MAX_DOFS];
        let mut first = 0;
        for &j in &e.joints {
            if at.tree.joints()[j].kind == JointKind::Ball {
                let c = nalgebra::Vector3::new(x.q[first], x.q[first + 1], x.q[first + 2]);
                let jacobian = match turns.get(j) {
                    Some(Some(turn)) => logarithm_jacobian(&c) * turn,
                    _ => logarithm_jacobian(&c),
                };
                (0..3).for_each(|r| (0..3).for_each(|k| out[first + r][first + k] = cq * jacobian[(r, k)]));
                first += 3;
            } else {
                out[first][first] = cq;
                first += 1;
            }
        }
        out
    }
}

impl Local {
    fn state<'a>(&'a self, u: &'a [f64]) -> JointState<'a, f64> {
        let (q_past, z) = (&self.q_past[..self.m], &self.z[..self.m]);
        JointState { q: &self.q[..self.n], v: &self.v[..self.n], u, q_past, z, elapsed: self.elapsed }
    }
}

/// Inputs of an element with history variables, seeded: changes of coordinates at the step's end and beginning, z, parameters.
struct Seeded {
    q: [MemoryDual; 3],
    q_past: [MemoryDual; 3],
    z: [MemoryDual; 3],
    p: [MemoryDual; MAX_INPUTS],
}

impl Seeded {
    fn new(e: &JointElement, at: &JointPoint) -> (Local, Self) {
        let x = local(e, at);
        let seeded = |value: f64, first: usize, row: Vec<f64>| {
            let mut unit = SVector::zeros();
            row.iter().enumerate().for_each(|(k, d)| unit[first + k] = *d);
            MemoryDual::new(value, Derivative::some(unit))
        };
        // a ball's coordinates are changed by turns in its body's axes
        let rows = |c: &[f64]| {
            let jacobian =
                if x.m == 3 { logarithm_jacobian(&nalgebra::Vector3::new(c[0], c[1], c[2])) } else { Matrix3::identity() };
            move |k: usize| jacobian.row(k).iter().copied().collect::<Vec<f64>>()
        };
        let unit = |k: usize| (0..=k).map(|j| f64::from(u8::from(j == k))).collect::<Vec<f64>>();
        let (end, start) = (rows(&x.q[..3]), rows(&x.q_past));
        let mut p = [MemoryDual::from_re(0.0); MAX_INPUTS];
        e.params.iter().enumerate().for_each(|(k, &i)| p[k] = seeded(at.theta[i], 9, unit(k)));
        let seeds = Self {
            q: std::array::from_fn(|k| seeded(x.q[k], 0, end(k))),
            q_past: std::array::from_fn(|k| seeded(x.q_past[k], 3, start(k))),
            z: std::array::from_fn(|k| seeded(x.z[k], 6, unit(k))),
            p,
        };
        (x, seeds)
    }

    /// Calls `out(input, derivative of value)`.
    fn emit(&self, x: &Local, e: &JointElement, value: &MemoryDual, out: &mut dyn FnMut(Input, f64)) {
        let Some(by) = value.eps.0 else { return };
        let inputs = (0..x.m).flat_map(|k| {
            let dof = x.dofs[k];
            [(k, Input::QNext(dof)), (3 + k, Input::Q(dof)), (6 + k, Input::Z(e.memory[k]))]
        });
        let inputs = inputs.chain(e.params.iter().enumerate().map(|(k, &i)| (9 + k, Input::Theta(i))));
        inputs.filter(|(k, _)| by[*k] != 0.0).for_each(|(k, input)| out(input, by[k]));
    }
}

impl<L: JointLaw> AutomaticJoint<L> {
    fn remembering(&self) -> impl Iterator<Item = &JointElement> {
        self.elements.iter().filter(|e| !e.memory.is_empty())
    }

    fn local(e: &JointElement, at: &JointPoint) -> Local {
        local(e, at)
    }

    /// Adds the change of an element's force with dual numbers of `N` directions, as many as it has degrees of freedom or more.
    #[allow(clippy::too_many_arguments)] // an element where it is, and where its change goes
    fn add_local_change<const N: usize>(
        &self,
        e: &JointElement,
        at: &JointPoint,
        x: &Local,
        changes: &[[f64; MAX_DOFS]; MAX_DOFS],
        cv: f64,
        out: &mut [f64],
        stride: usize,
    ) {
        let constant = DualSVec64::<N>::from_re;
        let (mut q, mut v) = ([constant(0.0); N], [constant(0.0); N]);
        for k in 0..x.n {
            q[k] = DualSVec64::new(x.q[k], Derivative::some(SVector::from_fn(|i, _| changes[k][i])));
            let mut unit = SVector::zeros();
            unit[k] = cv;
            v[k] = DualSVec64::new(x.v[k], Derivative::some(unit));
        }
        let u = Self::values(&e.controls, at.u).map(constant);
        let p = Self::values(&e.params, at.theta).map(constant);
        let (q_past, z) = (x.q_past.map(constant), x.z.map(constant));
        let (q_past, z, elapsed) = (&q_past[..x.m], &z[..x.m], x.elapsed);
        let state = JointState { q: &q[..x.n], v: &v[..x.n], u: &u[..e.controls.len()], q_past, z, elapsed };
        let mut f = [constant(0.0); N];
        self.law.force(&state, &p[..e.params.len()], &e.constants, &mut f[..x.n]);
        for (row, f) in x.dofs.iter().zip(&f[..x.n]) {
            let Some(change) = f.eps.0 else { continue };
            x.dofs[..x.n].iter().zip(change.iter()).for_each(|(column, d)| out[row * stride + column] += d);
        }
    }

    /// Whether an element does nothing at these parameters.
    fn idle(&self, e: &JointElement, theta: &[f64]) -> bool {
        self.law.vanishes(&Self::values(&e.params, theta)[..e.params.len()])
    }

    /// Index of the only coordinate and degree of freedom of an element on one joint of one axis.
    fn single(e: &JointElement, at: &JointPoint) -> Option<(usize, usize)> {
        let [joint] = e.joints[..] else { return None };
        let joint = &at.tree.joints()[joint];
        (joint.kind != JointKind::Ball).then_some((joint.q, joint.v))
    }

    /// Force of an element on one axis at (q, v).
    fn single_force<S: pliant_math::Real>(&self, e: &JointElement, at: &JointPoint, q: S, v: S) -> S {
        self.single_force_with(e, at, q, v, |_, x| S::from(x))
    }

    /// As [`Self::single_force`], with `lift` making scalars of controls and, counted on, parameters.
    fn single_force_with<S: pliant_math::Real>(
        &self,
        e: &JointElement,
        at: &JointPoint,
        q: S,
        v: S,
        lift: impl Fn(usize, f64) -> S,
    ) -> S {
        let lifted = |first: usize, indices: &[usize], from: &[f64]| -> [S; MAX_INPUTS] {
            std::array::from_fn(|k| indices.get(k).map_or(S::zero(), |&i| lift(first + k, from[i])))
        };
        let (u, p) = (lifted(0, &e.controls, at.u), lifted(e.controls.len(), &e.params, at.theta));
        let mut f = [S::zero()];
        let joint = &at.tree.joints()[e.joints[0]];
        let past: [S; 2] = e.memory.first().map_or([S::zero(); 2], |&k| [at.past.q[joint.q], at.past.z[k]].map(S::from));
        let m = e.memory.len();
        let (q_past, z, elapsed) = (&past[..m], &past[1..1 + m], at.past.elapsed);
        let state = JointState { q: &[q], v: &[v], u: &u[..e.controls.len()], q_past, z, elapsed };
        self.law.force(&state, &p[..e.params.len()], &e.constants, &mut f);
        f[0]
    }
}

impl<L: JointLaw> JointTerm for AutomaticJoint<L> {
    fn name(&self) -> &str {
        self.law.name()
    }

    fn add_force(&self, at: &JointPoint, f: &mut [f64]) {
        for e in self.elements.iter().filter(|e| !self.idle(e, at.theta)) {
            if let Some((q, v)) = Self::single(e, at) {
                f[v] += self.single_force(e, at, at.q[q], at.v[v]);
                continue;
            }
            let x = Self::local(e, at);
            let force = self.evaluate(e, at, &x);
            (0..x.n).for_each(|k| f[x.dofs[k]] += force[k]);
        }
    }

    fn add_change(&self, at: &JointPoint, by: Displacement, turns: &[Option<Matrix3<f64>>], out: &mut [f64], stride: usize) {
        for e in self.elements.iter().filter(|e| !self.idle(e, at.theta)) {
            if let Some((q, v)) = Self::single(e, at) {
                let f = self.single_force(e, at, Dual64::new(at.q[q], by.cq), Dual64::new(at.v[v], by.cv));
                out[v * stride + v] += f.eps;
                continue;
            }
            let x = Self::local(e, at);
            let changes = Self::coordinate_changes(e, at, &x, by.cq, turns);
            if x.n <= 3 {
                self.add_local_change::<3>(e, at, &x, &changes, by.cv, out, stride);
            } else {
                self.add_local_change::<MAX_DOFS>(e, at, &x, &changes, by.cv, out, stride);
            }
        }
    }

    fn is_prescribed(&self) -> bool {
        self.elements.iter().any(|e| !e.controls.is_empty())
    }

    fn visit_inputs(&self, at: &JointPoint, all: bool, visit: &mut dyn FnMut(usize, Input, f64)) {
        for e in self.elements.iter().filter(|e| all || !e.controls.is_empty()) {
            if let Some((q, v)) = Self::single(e, at) {
                let (q, speed) = (at.q[q], at.v[v]);
                let inputs =
                    e.controls.iter().map(|&c| Input::U(c)).chain(e.params.iter().filter(|_| all).map(|&c| Input::Theta(c)));
                for (seed, input) in inputs.enumerate() {
                    let lift = |k: usize, x: f64| Dual64::new(x, if k == seed { 1.0 } else { 0.0 });
                    visit(v, input, self.single_force_with(e, at, Dual64::from(q), Dual64::from(speed), lift).eps);
                }
                continue;
            }
            let x = Self::local(e, at);
            let constant = |values: [f64; MAX_DOFS]| values.map(InputDual::from_re);
            let seeded = |value: f64, k: usize| {
                let mut unit = SVector::zeros();
                unit[k] = 1.0;
                InputDual::new(value, Derivative::some(unit))
            };
            let (q, v) = (constant(x.q), constant(x.v));
            let (u, p) = (Self::values(&e.controls, at.u), Self::values(&e.params, at.theta));
            let (nu, np) = (e.controls.len(), e.params.len());
            let u: Vec<InputDual> = (0..nu).map(|k| seeded(u[k], k)).collect();
            let p: Vec<InputDual> = (0..np).map(|k| seeded(p[k], nu + k)).collect();
            let mut f = [InputDual::from_re(0.0); MAX_DOFS];
            let (q_past, z) = (x.q_past.map(InputDual::from_re), x.z.map(InputDual::from_re));
            let (q_past, z, elapsed) = (&q_past[..x.m], &z[..x.m], x.elapsed);
            let state = JointState { q: &q[..x.n], v: &v[..x.n], u: &u, q_past, z, elapsed };
            self.law.force(&state, &p, &e.constants, &mut f[..x.n]);
            for (row, f) in x.dofs.iter().zip(&f[..x.n]) {
                let Some(change) = f.eps.0 else { continue };
                e.controls.iter().enumerate().for_each(|(k, &c)| visit(*row, Input::U(c), change[k]));
                if all {
                    e.params.iter().enumerate().for_each(|(k, &c)| visit(*row, Input::Theta(c), change[nu + k]));
                }
            }
        }
    }

    fn visit_past(&self, at: &JointPoint, visit: &mut dyn FnMut(usize, Input, f64)) {
        for e in self.remembering() {
            let (x, seeds) = Seeded::new(e, at);
            let p = Self::values(&e.params, at.theta).map(MemoryDual::from_re);
            let u = Self::values(&e.controls, at.u).map(MemoryDual::from_re);
            let (q, v) = (x.q.map(MemoryDual::from_re), x.v.map(MemoryDual::from_re));
            let (q_past, z, elapsed) = (&seeds.q_past[..x.m], &seeds.z[..x.m], x.elapsed);
            let state = JointState { q: &q[..x.n], v: &v[..x.n], u: &u[..e.controls.len()], q_past, z, elapsed };
            let mut f = [MemoryDual::from_re(0.0); MAX_DOFS];
            self.law.force(&state, &p[..e.params.len()], &e.constants, &mut f[..x.n]);
            for (row, f) in x.dofs.iter().zip(&f[..x.n]) {
                seeds.emit(&x, e, f, &mut |input, d| visit(*row, input, d));
            }
        }
    }

    fn modes(&self, at: &JointPoint, out: &mut Vec<u8>) {
        out.extend(self.elements.iter().filter_map(|e| {
            let (x, u, p) = (local(e, at), Self::values(&e.controls, at.u), Self::values(&e.params, at.theta));
            self.law.mode(&x.state(&u[..e.controls.len()]), &p[..e.params.len()])
        }));
    }

    fn advance(&self, at: &JointPoint, z: &mut [f64]) {
        for e in self.remembering() {
            let x = Self::local(e, at);
            let p = Self::values(&e.params, at.theta);
            let mut next = [0.0; 3];
            self.law.advance(&x.state(&[]), &p[..e.params.len()], &e.constants, &mut next[..x.m]);
            e.memory.iter().zip(next).for_each(|(&k, value)| z[k] = value);
        }
    }

    fn visit_advance(&self, at: &JointPoint, visit: &mut dyn FnMut(usize, Input, f64)) {
        for e in self.remembering() {
            let (x, seeds) = Seeded::new(e, at);
            let (zero, v) = (MemoryDual::from_re(0.0), x.v.map(MemoryDual::from_re));
            let (q_past, z, elapsed) = (&seeds.q_past[..x.m], &seeds.z[..x.m], x.elapsed);
            let state = JointState { q: &seeds.q[..x.n], v: &v[..x.n], u: &[], q_past, z, elapsed };
            let mut next = [zero; 3];
            self.law.advance(&state, &seeds.p[..e.params.len()], &e.constants, &mut next[..x.m]);
            for (&place, next) in e.memory.iter().zip(&next) {
                seeds.emit(&x, e, next, &mut |input, d| visit(place, input, d));
            }
        }
    }

    fn energy(&self, at: &JointPoint) -> f64 {
        let energy = |e: &JointElement| {
            let x = Self::local(e, at);
            let p = Self::values(&e.params, at.theta);
            self.law.energy(&x.state(&[]), &p[..e.params.len()], &e.constants)
        };
        self.elements.iter().map(energy).sum()
    }
}
