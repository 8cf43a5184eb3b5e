//! Inverse dynamics against energy and its partials against dual numbers.
#![allow(clippy::unwrap_used)]

use super::dynamics::{Displacement, Partials, WrenchPartial, inverse_dynamics};
use super::*;
use nalgebra::{Matrix3, Matrix6};
use num_dual::Dual64;
use pliant_math::inertia::{NUMBERS, from_numbers};
use pliant_math::rotation::{Map, about, product};
use pliant_math::spatial::{Force, Inertia, Motion};
use pliant_math::{Real, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A branching forest with every kind of joint: a free body that carries two arms, and a separate pendulum.
pub(crate) fn forest(rng: &mut Pcg64) -> (Tree, Vec<[f64; NUMBERS]>) {
    let mut tree = Tree::default();
    let mut inertias = Vec::new();
    let kinds: [(Option<usize>, &[JointKind]); 7] = [
        (None, &[JointKind::Prismatic, JointKind::Prismatic, JointKind::Prismatic, JointKind::Ball]),
        (Some(0), &[JointKind::Revolute]),
        (Some(1), &[JointKind::Ball]),
        (Some(0), &[JointKind::Revolute, JointKind::Revolute]),
        (Some(3), &[]),
        (Some(4), &[JointKind::Prismatic]),
        (None, &[JointKind::Revolute]),
    ];
    for (b, (parent, joints)) in kinds.iter().enumerate() {
        let mut vector = || Vec3::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4));
        let joints = joints
            .iter()
            .map(|&kind| Joint {
                name: String::new(),
                kind,
                body: 0,
                axis: (vector() + Vec3::new(0.1, 0.0, 0.5)).normalize(),
                anchor: vector(),
                q: 0,
                v: 0,
                armature: 0,
            })
            .collect();
        let axis = (vector() + Vec3::new(1.0, 0.0, 0.0)).normalize();
        let body = Body {
            name: format!("b{b}"),
            parent: *parent,
            position: vector(),
            rotation: about(&axis, 0.7),
            aligned: false,
            joints: 0..0,
            inertia: None,
        };
        let (c, off) = (vector(), vector() * 0.2);
        inertias.push([1.0 + b as f64 * 0.3, c[0], c[1], c[2], 0.2, 0.15, 0.1, off[0], off[1], off[2]]);
        tree.push(body, joints);
    }
    (tree, inertias)
}

pub(crate) struct Sample {
    pub tree: Tree,
    pub inertias: Vec<[f64; NUMBERS]>,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub a: Vec<f64>,
}

pub(crate) fn sample(seed: u64) -> Sample {
    let mut rng = Pcg64::seed_from_u64(seed);
    let (tree, inertias) = forest(&mut rng);
    let mut random = |n: usize, s: f64| (0..n).map(|_| rng.random_range(-s..s)).collect::<Vec<f64>>();
    let (t, v, a) = (random(tree.nv(), 1.0), random(tree.nv(), 2.0), random(tree.nv(), 3.0));
    let mut q = tree.neutral();
    let from = q.clone();
    tree.add(Map::Exponential, &from, &t, &mut q);
    Sample { tree, inertias, q, v, a }
}

const GRAVITY: [f64; 3] = [0.3, -0.2, -9.81];
const ORIGIN: [f64; 3] = [0.4, 0.1, -0.3];

/// τ for any scalar, with a wrench on bodies 2 and 5 that depends on their pose and velocity.
fn tau<S: Real>(s: &Sample, q: &[S], v: &[S], a: &[S], with_wrench: bool) -> Vec<S> {
    let mut frames = Frames::about(Vec3::from(ORIGIN));
    frames.evaluate(&s.tree, q, v, a, &Vec3::from(GRAVITY).map(S::from));
    let inertias: Vec<Inertia<S>> = s.inertias.iter().map(|x| from_numbers(&x.map(S::from))).collect();
    let wrenches: Vec<Force<S>> =
        if with_wrench { (0..s.tree.bodies().len()).map(|b| wrench(b, &frames.bodies[b])).collect() } else { Vec::new() };
    let mut tau = vec![S::zero(); s.tree.nv()];
    inverse_dynamics(&s.tree, &frames, &inertias, &wrenches, &mut Vec::new(), &mut tau);
    tau
}

/// A spring and a damper at a body point.
fn wrench<S: Real>(b: usize, frame: &Frame<S>) -> Force<S> {
    if b != 2 && b != 5 {
        return Force::zero();
    }
    let point = frames::apply(&frame.rotation, &Vec3::new(0.1, 0.2, -0.1)) + frame.position;
    let speed = frame.velocity.at(&point);
    Force::at(&point, -point * (point.dot(&point) * 3.0 + 5.0) - speed * (speed.dot(&speed) + 2.0))
}

/// ∂W of [`wrench`] by duals: displaced along twist e_k at fixed V, and V along e_k.
fn wrench_partial(b: usize, frame: &Frame<f64>) -> WrenchPartial {
    let (mut displaced, mut moving) = (Matrix6::zeros(), Matrix6::zeros());
    for k in 0..6 {
        let eps = Dual64::from(0.0).derivative();
        let unit = |c: usize| if c == k { eps } else { Dual64::from(0.0) };
        let xi = Motion { w: Vec3::new(unit(0), unit(1), unit(2)), v: Vec3::new(unit(3), unit(4), unit(5)) };
        let lift = |x: &Vec3<f64>| x.map(Dual64::from);
        let rotation = frame.rotation.map(Dual64::from);
        let turned = Matrix3::from_fn(|r, c| {
            let col = rotation.column(c).into_owned();
            col[r] + xi.w.cross(&col)[r]
        });
        let position = lift(&frame.position);
        let velocity = Motion { w: lift(&frame.velocity.w), v: lift(&frame.velocity.v) };
        let at_rest = Frame { rotation, position, velocity, acceleration: Motion::zero() };
        let moved = Frame { rotation: turned, position: position + xi.at(&position), ..at_rest };
        let faster = Frame { velocity: velocity + xi, ..at_rest };
        for (m, w) in [(&mut displaced, wrench(b, &moved)), (&mut moving, wrench(b, &faster))] {
            for r in 0..3 {
                m[(r, k)] = w.n[r].eps;
                m[(3 + r, k)] = w.f[r].eps;
            }
        }
    }
    WrenchPartial { body: b, displaced, moving }
}

/// Coordinates moved along body-axes tangent `t` (exact to first order).
fn moved(tree: &Tree, q: &[f64], t: &[Dual64]) -> Vec<Dual64> {
    let mut out: Vec<Dual64> = q.iter().map(|&x| Dual64::from(x)).collect();
    for joint in tree.joints() {
        if joint.kind == JointKind::Ball {
            let turn = Map::Exponential.turn(&Vec3::new(t[joint.v], t[joint.v + 1], t[joint.v + 2]));
            let old = quaternion(&out, joint.q);
            out[joint.q..joint.q + 4].copy_from_slice(&product(&old, &turn));
        } else {
            out[joint.q] += t[joint.v];
        }
    }
    out
}

fn check_partials(with_wrench: bool) {
    for seed in 0..5 {
        let s = sample(seed);
        let n = s.tree.nv();
        let mut frames = Frames::about(Vec3::from(ORIGIN));
        frames.evaluate(&s.tree, &s.q, &s.v, &s.a, &Vec3::from(GRAVITY));
        let inertias: Vec<Inertia<f64>> = s.inertias.iter().map(from_numbers).collect();
        let (mut wrenches, mut changes) = (Vec::new(), Vec::new());
        if with_wrench {
            wrenches = (0..s.tree.bodies().len()).map(|b| wrench(b, &frames.bodies[b])).collect();
            changes = [2, 5].map(|b| wrench_partial(b, &frames.bodies[b])).to_vec();
        }
        let mut partials = Partials::default();
        partials.gather(&s.tree, &frames, &inertias, &wrenches, &changes);
        let mut rng = Pcg64::seed_from_u64(seed + 100);
        let turns: Vec<Option<Matrix3<f64>>> = s
            .tree
            .joints()
            .iter()
            .map(|j| (j.kind == JointKind::Ball).then(|| Matrix3::from_fn(|_, _| rng.random_range(-1.0..1.0))))
            .collect();
        let by = Displacement { cm: 3.0, cv: 0.7, cq: 0.2 };
        let mut matrix = vec![0.0; n * n];
        partials.add(&s.tree, &frames, by, &turns, &mut matrix, n);
        let scale = matrix.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        for l in 0..n {
            let mut t = vec![Dual64::from(0.0); n];
            let mut tq = vec![0.0; n];
            tq[l] = by.cq;
            let joint = s.tree.dofs()[l].joint;
            if let Some(j) = &turns[joint] {
                let first = s.tree.joints()[joint].v;
                (0..3).for_each(|a| tq[first + a] = by.cq * j[(a, l - first)]);
            }
            (0..n).for_each(|k| t[k] = Dual64::new(0.0, tq[k]));
            let seeded = |x: &[f64], w: f64| (0..n).map(|k| Dual64::new(x[k], if k == l { w } else { 0.0 })).collect::<Vec<_>>();
            let change = tau(&s, &moved(&s.tree, &s.q, &t), &seeded(&s.v, by.cv), &seeded(&s.a, by.cm), with_wrench);
            for i in 0..n {
                let error = (change[i].eps - matrix[i * n + l]).abs();
                assert!(error < 1e-12 * scale, "({i}, {l}): {} against {}", change[i].eps, matrix[i * n + l]);
            }
        }
        let mut again = vec![0.0; n];
        partials.tau(&s.tree, &frames, &mut again);
        for (a, b) in again.iter().zip(tau(&s, &s.q, &s.v, &s.a, with_wrench)) {
            assert!((a - b).abs() < 1e-12 * scale);
        }
    }
}

#[test]
fn partials_are_those_of_dual_numbers() {
    check_partials(false);
}

#[test]
fn wrenches_from_outside_are_carried_along() {
    check_partials(true);
}

/// Power balance: v · τ = d/dt (kinetic energy) − gravity's power, along any smooth motion.
#[test]
fn power_of_the_joint_forces_is_the_change_of_energy() {
    let s = sample(7);
    let n = s.tree.nv();
    let inertias: Vec<Inertia<f64>> = s.inertias.iter().map(from_numbers).collect();
    let energy = |time: Dual64| {
        let t: Vec<Dual64> = (0..n).map(|k| time * s.v[k]).collect();
        let v: Vec<Dual64> = (0..n).map(|k| time * s.a[k] + s.v[k]).collect();
        let zero = vec![Dual64::from(0.0); n];
        let mut frames = Frames::about(Vec3::zeros());
        frames.evaluate(&s.tree, &moved(&s.tree, &s.q, &t), &v, &zero, &Vec3::repeat(Dual64::from(0.0)));
        let g = Vec3::from(GRAVITY).map(Dual64::from);
        frames.bodies.iter().zip(&inertias).fold(Dual64::from(0.0), |sum, (frame, x)| {
            let x = Inertia { m: Dual64::from(x.m), h: x.h.map(Dual64::from), j: x.j.map(Dual64::from) };
            let x = x.placed(&frame.rotation, &frame.position);
            sum + frame.velocity.dot(&x.mul(&frame.velocity)) * 0.5 - x.h.dot(&g)
        })
    };
    let power: f64 = tau(&s, &s.q, &s.v, &s.a, false).iter().zip(&s.v).map(|(t, v)| t * v).sum();
    let change = energy(Dual64::new(0.0, 1.0)).eps;
    assert!((power - change).abs() < 1e-11 * change.abs().max(1.0), "{power} against {change}");
}

#[test]
fn mass_matrix_is_symmetric() {
    let s = sample(3);
    let n = s.tree.nv();
    let mut frames = Frames::about(Vec3::zeros());
    frames.evaluate(&s.tree, &s.q, &s.v, &s.a, &Vec3::from(GRAVITY));
    let inertias: Vec<Inertia<f64>> = s.inertias.iter().map(from_numbers).collect();
    let mut partials = Partials::default();
    partials.gather(&s.tree, &frames, &inertias, &[], &[]);
    let mut m = vec![0.0; n * n];
    partials.add_mass(&s.tree, &frames, &mut m, n);
    // what accelerations alone change
    let mut change = vec![0.0; n * n];
    partials.add(&s.tree, &frames, Displacement { cm: 1.0, cv: 0.0, cq: 0.0 }, &[], &mut change, n);
    for i in 0..n {
        for j in 0..n {
            assert!((m[i * n + j] - change[i * n + j]).abs() < 1e-13 && m[i * n + j] == m[j * n + i]);
        }
        assert!(m[i * n + i] > 0.0);
    }
}

/// Ω against J M⁻¹ Jᵀ with the full mass matrix.
#[test]
fn mobilities_are_those_of_the_mass_matrix() {
    let s = sample(5);
    let n = s.tree.nv();
    let mut frames = Frames::about(Vec3::from(ORIGIN));
    frames.evaluate(&s.tree, &s.q, &s.v, &s.a, &Vec3::from(GRAVITY));
    let inertias: Vec<Inertia<f64>> = s.inertias.iter().map(from_numbers).collect();
    let mut partials = Partials::default();
    partials.gather(&s.tree, &frames, &inertias, &[], &[]);
    let mut m = vec![0.0; n * n];
    partials.add(&s.tree, &frames, Displacement { cm: 1.0, cv: 0.0, cq: 0.0 }, &[], &mut m, n);
    let mut stiffening = vec![0.0; n * n];
    for (l, dof) in s.tree.dofs().iter().enumerate() {
        stiffening[l * n + l] = 0.1 + 0.05 * dof.joint as f64;
    }
    let m = nalgebra::DMatrix::from_row_slice(n, n, &m) + nalgebra::DMatrix::from_row_slice(n, n, &stiffening);
    let inverse = m.try_inverse().unwrap();
    let mut omega = Vec::new();
    super::operational::mobilities(&s.tree, &frames, &inertias, &stiffening, &mut omega);
    for (b, omega) in omega.iter().enumerate() {
        let chain: Vec<usize> = s.tree.chain(s.tree.last_dof(b)).collect();
        let mut expected = Matrix6::zeros();
        for &i in &chain {
            for &l in &chain {
                let (a, c) = (pliant_math::spatial::column(&frames.axes[i].s), pliant_math::spatial::column(&frames.axes[l].s));
                expected += a * c.transpose() * inverse[(i, l)];
            }
        }
        assert!((omega - expected).amax() < 1e-9 * expected.amax(), "body {b}: {}", (omega - expected).amax());
    }
}
