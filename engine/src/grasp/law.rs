//! The law of a grasp, written once for any scalar, and its derivatives.

use super::constants::GRASP;
use super::nearest::{Region, nearest};
use super::{Grasp, Grasping, Reach};
use pliant_math::input::{Dual, differentiate};
use pliant_math::{Input, Real, Vec3};

/// The beginning of a (halved) step, and how far it has come.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Begin<'a> {
    pub q: &'a [f64],
    pub z: &'a [f64],
    pub u: &'a [f64],
    /// Commanded velocities [m/s].
    pub v_cmd: &'a [f64],
    pub theta: &'a [f64],
    pub grasping: Grasping,
    /// Time since the beginning \[s\].
    pub elapsed: f64,
}

/// Phase of a gripper throughout a (sub)step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Phase {
    /// Nothing.
    Open,
    /// Pulls the nearest point by the smoothed activation.
    Near(usize, Region),
    /// Seizes the nearest point.
    Seized(usize, Region),
    /// Holds what it held before.
    Held(usize),
}

impl Phase {
    /// Numbers that tell it apart, for reports of switches.
    pub fn modes(self) -> [u8; 2] {
        let number = |e: usize| (e % 250) as u8;
        match self {
            Self::Open => [0, 255],
            Self::Held(e) => [1, number(e)],
            Self::Seized(e, region) => [10 + region.mode(), number(e)],
            Self::Near(e, region) => [20 + region.mode(), number(e)],
        }
    }
}

/// A spring from fixed weights on an element's nodes to a point that moves as commanded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hold {
    element: [usize; 3],
    corners: usize,
    pub weights: [f64; 3],
    /// \[m\]
    pub target: Vec3<f64>,
    /// [N/m]
    pub stiffness: f64,
}

impl Hold {
    pub(crate) fn nodes(&self) -> &[usize] {
        &self.element[..self.corners]
    }
}

/// Everything that a phase makes of its inputs.
struct Pull<S> {
    weights: [S; 3],
    target: Vec3<S>,
    stiffness: S,
    /// o at the time elapsed.
    offset: Vec3<S>,
}

/// The number of the element that a number of z stands for.
pub(super) fn element_of(z: f64) -> Option<usize> {
    let number = z.round();
    (number >= 1.0).then(|| number as usize - 1)
}

impl Grasp {
    /// The gripper's phase in a step that begins so.
    pub(crate) fn phase(&self, at: &Begin) -> Phase {
        let closed = at.u[self.closing] >= GRASP.closed;
        let held = element_of(at.z[self.memory]).filter(|e| *e < self.elements.len());
        match (held, at.grasping) {
            (Some(element), _) if closed => return Phase::Held(element),
            (_, Grasping::Hard) if !closed => return Phase::Open,
            _ => {}
        }
        let Some((element, region, d2)) = self.nearest(at.q) else { return Phase::Open };
        let reached = d2.sqrt() <= at.theta[self.radius];
        match at.grasping {
            _ if closed && reached => Phase::Seized(element, region),
            Grasping::Hard => Phase::Open,
            Grasping::Smooth => Phase::Near(element, region),
        }
    }

    /// The element nearest to the gripper's point, the part of it, and the squared distance [m²].
    fn nearest(&self, q: &[f64]) -> Option<(usize, Region, f64)> {
        let vec3 = |node: usize| Vec3::new(q[3 * node], q[3 * node + 1], q[3 * node + 2]);
        let p = vec3(self.node);
        let of = |(e, nodes): (usize, &[usize; 3])| {
            let (region, d2) = nearest(&p, &nodes.map(vec3), self.corners);
            (e, region, d2)
        };
        self.elements.iter().enumerate().map(of).min_by(|a, b| a.2.total_cmp(&b.2))
    }

    /// The point of its rope or sheet nearest to the gripper's point at positions `q`, whether it holds something or not; `None` if
    /// there is nothing to seize.
    pub fn reach(&self, q: &[f64]) -> Option<Reach> {
        let (element, region, _) = self.nearest(q)?;
        let vec3 = |node: usize| Vec3::new(q[3 * node], q[3 * node + 1], q[3 * node + 2]);
        let weights = region.weights(&vec3(self.node), &self.elements[element].map(vec3));
        Some(self.reach_to(element, weights, q))
    }

    /// The node `node` of its rope or sheet, as a point that may be held; `None` if it is no node of them.
    pub fn reach_node(&self, node: usize, q: &[f64]) -> Option<Reach> {
        let corner = |nodes: &[usize; 3]| nodes[..self.corners].iter().position(|of| *of == node);
        let (element, corner) = self.elements.iter().enumerate().find_map(|(e, nodes)| Some((e, corner(nodes)?)))?;
        let mut weights = [0.0; 3];
        weights[corner] = 1.0;
        Some(self.reach_to(element, weights, q))
    }

    fn reach_to(&self, element: usize, weights: [f64; 3], q: &[f64]) -> Reach {
        let vec3 = |node: usize| Vec3::new(q[3 * node], q[3 * node + 1], q[3 * node + 2]);
        let (nodes, from) = (self.elements[element], vec3(self.node));
        let point: Vec3<f64> = (0..self.corners).map(|k| vec3(nodes[k]) * weights[k]).sum();
        let distance = (point - from).norm();
        Reach { gripper: self.node, element, nodes, weights, corners: self.corners, point, from, distance }
    }

    /// Writes into `z` that the gripper holds the point `reach`, which stays where it is from the gripper: what seizing at a distance
    /// would be.
    pub fn hold_at_distance(&self, reach: &Reach, z: &mut [f64]) {
        let own = &mut z[self.memory..self.memory + Self::n_memory(self.corners)];
        own[0] = (reach.element + 1) as f64;
        own[1..self.corners].copy_from_slice(&reach.weights[1..self.corners]);
        own[self.corners..].copy_from_slice((reach.point - reach.from).as_slice());
    }

    /// The spring of a phase; none if it is open.
    pub(crate) fn hold(&self, phase: Phase, at: &Begin) -> Option<Hold> {
        let element = self.element(phase)?;
        let pull = self.pull(phase, &|input| value(input, at), at.elapsed);
        let Pull { weights, target, stiffness, .. } = pull;
        Some(Hold { element, corners: self.corners, weights, target, stiffness })
    }

    fn element(&self, phase: Phase) -> Option<[usize; 3]> {
        match phase {
            Phase::Open => None,
            Phase::Near(e, _) | Phase::Seized(e, _) | Phase::Held(e) => self.elements.get(e).copied(),
        }
    }

    /// The law. An open phase pulls nothing.
    fn pull<S: Real>(&self, phase: Phase, get: &dyn Fn(Input) -> S, elapsed: f64) -> Pull<S> {
        let vec3 = |at: &dyn Fn(usize) -> Input| Vec3::new(get(at(0)), get(at(1)), get(at(2)));
        let theta = |k: usize| get(Input::Theta(k));
        let p = vec3(&|a| Input::Q(3 * self.node + a));
        let moved = p + vec3(&|a| Input::Command(3 * self.node + a)) * S::from(elapsed);
        let closing = theta(self.stiffness) * logistic(theta(self.steepness) * (get(Input::U(self.closing)) - GRASP.closed));
        let zero = Vec3::repeat(S::zero());
        let on = |e: usize, region: Region| {
            let x = self.elements[e].map(|node| vec3(&|a| Input::Q(3 * node + a)));
            let w = region.weights(&p, &x);
            (w, x[0] * w[0] + x[1] * w[1] + x[2] * w[2] - p)
        };
        match phase {
            Phase::Open => Pull { weights: [S::zero(); 3], target: zero, stiffness: S::zero(), offset: zero },
            Phase::Near(e, region) => {
                let (weights, away) = on(e, region);
                Pull { weights, target: moved, stiffness: closing * self.activation(&away, &theta), offset: zero }
            }
            Phase::Seized(e, region) => {
                let (weights, away) = on(e, region);
                let offset = away * decay(theta(self.closing_time), elapsed);
                Pull { weights, target: moved + offset, stiffness: closing, offset }
            }
            Phase::Held(_) => {
                let (z, first) = (|k: usize| get(Input::Z(self.memory + k)), self.corners);
                let mut weights = [S::one(), S::zero(), S::zero()];
                for (k, w) in (1..self.corners).map(|k| (k, z(k))) {
                    weights[k] = w;
                    weights[0] -= w;
                }
                let offset = Vec3::new(z(first), z(first + 1), z(first + 2)) * decay(theta(self.closing_time), elapsed);
                Pull { weights, target: moved + offset, stiffness: closing, offset }
            }
        }
    }

    /// a(d), d the length of `away`.
    fn activation<S: Real>(&self, away: &Vec3<S>, theta: &dyn Fn(usize) -> S) -> S {
        let d2 = away.dot(away);
        let d = if d2.re() > 0.0 { d2.sqrt() } else { S::zero() };
        let (tail, far) = (theta(self.tail), d / theta(self.tail_reach));
        let near = logistic((theta(self.radius) - d) / theta(self.smoothing));
        (-tail + 1.0) * near + tail / (far * far + 1.0)
    }

    /// Inputs of a phase's force and history beside the nodes' positions where the force is evaluated.
    fn inputs(&self, phase: Phase) -> Vec<Input> {
        let of_node = |node: usize| (0..3).map(move |a| Input::Q(3 * node + a));
        let mut out: Vec<Input> = of_node(self.node).chain((0..3).map(|a| Input::Command(3 * self.node + a))).collect();
        out.push(Input::U(self.closing));
        out.extend([self.stiffness, self.steepness].map(Input::Theta));
        match phase {
            Phase::Open => return Vec::new(),
            Phase::Held(_) => {
                out.extend((1..Self::n_memory(self.corners)).map(|k| Input::Z(self.memory + k)));
                out.push(Input::Theta(self.closing_time));
            }
            Phase::Near(e, _) | Phase::Seized(e, _) => {
                out.extend(self.elements[e][..self.corners].iter().copied().flat_map(of_node));
                if matches!(phase, Phase::Seized(..)) {
                    out.push(Input::Theta(self.closing_time));
                } else {
                    out.extend([self.radius, self.smoothing, self.tail, self.tail_reach].map(Input::Theta));
                }
            }
        }
        out
    }

    /// Calls `visit(row, input, −∂f_row/∂input)` at the positions `q_bar` where the force was evaluated, these held fixed.
    pub(crate) fn visit_force(&self, phase: Phase, at: &Begin, q_bar: &[f64], visit: &mut dyn FnMut(usize, Input, f64)) {
        let Some(element) = self.element(phase) else { return };
        let x = element.map(|node| Vec3::new(q_bar[3 * node], q_bar[3 * node + 1], q_bar[3 * node + 2]));
        let mut nonzero = |row, input, value: f64| {
            if value != 0.0 {
                visit(row, input, value);
            }
        };
        let value = |input| value(input, at);
        differentiate(
            &self.inputs(phase),
            &value,
            &|get| {
                let pull = self.pull(phase, get, at.elapsed);
                let point =
                    (0..3).fold(Vec3::repeat(Dual::from_re(0.0)), |sum, k| sum + x[k].map(Dual::from_re) * pull.weights[k]);
                let force = (point - pull.target) * pull.stiffness;
                let nodes = element[..self.corners].iter().zip(pull.weights);
                nodes.flat_map(|(node, w)| (0..3).map(move |a| (3 * node + a, force[a] * w))).collect()
            },
            &mut nonzero,
        );
    }

    /// Moves its part of z on to the end of a (halved) step: `at.elapsed` is the whole of it.
    pub(crate) fn advance(&self, phase: Phase, at: &Begin, z: &mut [f64]) {
        let pull = self.pull(phase, &|input| value(input, at), at.elapsed);
        let own = &mut z[self.memory..self.memory + Self::n_memory(self.corners)];
        own.fill(0.0);
        if let Phase::Seized(e, _) | Phase::Held(e) = phase {
            own[0] = (e + 1) as f64;
            own[1..self.corners].copy_from_slice(&pull.weights[1..self.corners]);
            own[self.corners..].copy_from_slice(pull.offset.as_slice());
        }
    }

    /// Calls `visit(place, input, ∂z⁺[place]/∂input)`, for every place at least once.
    pub(crate) fn visit_advance(&self, phase: Phase, at: &Begin, visit: &mut dyn FnMut(usize, Input, f64)) {
        // what is not visited stays as it was
        (self.memory..self.memory + Self::n_memory(self.corners)).for_each(|place| visit(place, Input::Z(place), 0.0));
        if !matches!(phase, Phase::Seized(..) | Phase::Held(_)) {
            return;
        }
        let value = |input| value(input, at);
        let mut nonzero = |row, input, value: f64| {
            if value != 0.0 {
                visit(row, input, value);
            }
        };
        differentiate(
            &self.inputs(phase),
            &value,
            &|get| {
                let pull = self.pull(phase, get, at.elapsed);
                let weights = (1..self.corners).map(|k| (self.memory + k, pull.weights[k]));
                weights.chain((0..3).map(|a| (self.memory + self.corners + a, pull.offset[a]))).collect()
            },
            &mut nonzero,
        );
    }
}

fn value(input: Input, at: &Begin) -> f64 {
    match input {
        Input::Q(k) => at.q[k],
        Input::Z(k) => at.z[k],
        Input::U(k) => at.u[k],
        Input::Theta(k) => at.theta[k],
        Input::Command(k) => at.v_cmd[k],
        Input::QNext(_) | Input::VNext(_) => 0.0, // a grasp reads none of them
    }
}

/// 1/(1 + e^{−x}), without overflow.
fn logistic<S: Real>(x: S) -> S {
    if x.re() >= 0.0 {
        ((-x).exp() + 1.0).recip()
    } else {
        let e = x.exp();
        e / (e + 1.0)
    }
}

/// e^{−t/τ}; 0 where τ is 0 or next to it, with slope 0.
fn decay<S: Real>(tau: S, t: f64) -> S {
    if tau.re() * GRASP.long > t { (-(tau.recip() * t)).exp() } else { S::zero() }
}
