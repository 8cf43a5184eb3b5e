//! How easily each body moves where it is pushed: the inverse of the inertia that a force on it meets, all joints yielding.
//!
//! With the articulated inertias A_b of the subtrees and D = SᵀA S + K of a joint (K its armature, damping and stiffness as inertia),
//! ```text
//! A_p += A_b − A_b S D⁻¹ Sᵀ A_b                       leaves first
//! Ω_b = (1 − S D⁻¹ Sᵀ A_b) Ω_p (1 − …)ᵀ + S D⁻¹ Sᵀ     roots first, Ω = 0 for the world
//! ```
//! Reference: K. Kreutz-Delgado, A. Jain, G. Rodriguez (1992), Int. J. Robotics Research 11(4), for the recursion of Ω.

use super::frames::Frames;
use super::tree::Tree;
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector6};
use pliant_math::spatial::{Force, Inertia, column, full, hat, product, transposed_product};

/// Ω of every body in world axes about the origin of `frames` [1/kg, 1/(kg·m), 1/(kg·m²)]: rows and columns as six-vectors, angular
/// part first; `stiffening` is K of all degrees of freedom, row-major, of which the entries within a joint count.
pub fn mobilities(tree: &Tree, frames: &Frames<f64>, inertia: &[Inertia<f64>], stiffening: &[f64], out: &mut Vec<Matrix6<f64>>) {
    let n = tree.nv();
    let mut articulated: Vec<Matrix6<f64>> = frames
        .bodies
        .iter()
        .zip(inertia)
        .map(|(frame, inertia)| matrix(&inertia.placed(&frame.rotation, &frame.position)))
        .collect();
    let axis = |l: usize| column(&frames.axes[l].s);
    // per joint: its axes, and S D⁻¹
    let mut responses: Vec<Option<Response>> = vec![None; tree.joints().len()];
    for (b, body) in tree.bodies().iter().enumerate().rev() {
        let mut a = articulated[b];
        for j in body.joints.clone().rev() {
            let joint = &tree.joints()[j];
            let dofs = joint.v..joint.v + joint.kind.n_dofs();
            let mut s = SMatrix::<f64, 6, 3>::zeros();
            dofs.clone().enumerate().for_each(|(k, l)| s.set_column(k, &axis(l)));
            let mut d = transposed_product(&s, &product(&a, &s));
            for (r, i) in dofs.clone().enumerate() {
                for (c, l) in dofs.clone().enumerate() {
                    d[(r, c)] += stiffening[i * n + l];
                }
            }
            (dofs.len()..3).for_each(|k| d[(k, k)] = 1.0);
            let Some(inverse) = d.try_inverse() else { continue };
            let response = Response { s, gain: product(&s, &inverse), articulated: a };
            a -= product(&product(&a, &response.gain), &transposed_product(&s, &a));
            responses[j] = Some(response);
        }
        if let Some(p) = body.parent {
            articulated[p] += a;
        }
    }
    out.clear();
    for body in tree.bodies() {
        // none for the world
        let mut omega = body.parent.map(|p| out[p]);
        for response in body.joints.clone().filter_map(|j| responses[j].as_ref()) {
            let own = product(&response.gain, &response.s.transpose());
            omega = Some(omega.map_or(own, |omega| {
                let pass = Matrix6::identity() - product(&response.gain, &transposed_product(&response.s, &response.articulated));
                product(&product(&pass, &omega), &pass.transpose()) + own
            }));
        }
        out.push(omega.unwrap_or_else(Matrix6::zeros));
    }
}

#[derive(Clone)]
struct Response {
    s: SMatrix<f64, 6, 3>,
    gain: SMatrix<f64, 6, 3>,
    articulated: Matrix6<f64>,
}

/// A rigid inertia as a matrix on (ω; v).
fn matrix(inertia: &Inertia<f64>) -> Matrix6<f64> {
    let mut m = Matrix6::zeros();
    let h = hat(&inertia.h);
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(&full(&inertia.j));
    m.fixed_view_mut::<3, 3>(0, 3).copy_from(&h);
    m.fixed_view_mut::<3, 3>(3, 0).copy_from(&-h);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(&Matrix3::from_diagonal_element(inertia.m));
    m
}

/// W·Ω W: how fast a body moves along a unit impulse W when it is given it [1/kg or 1/(kg·m²)].
pub fn yields(omega: &Matrix6<f64>, wrench: &Force<f64>) -> f64 {
    let w = Vector6::new(wrench.n[0], wrench.n[1], wrench.n[2], wrench.f[0], wrench.f[1], wrench.f[2]);
    w.dot(&product(omega, &w))
}
