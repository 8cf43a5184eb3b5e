//! How far the mass of a body is spread about its centre: its inertia, with mass and centre as they are.
//!
//! About one axis a only I_a = m (tr S − aᵀ S a), S = U Uᵀ, can be seen, so a body turned by a joint of one axis has one number: the
//! diagonal entry of U that changes I_a most, ∂I_a/∂U_kk = 2 m (U_kk − (U_k · a) a_k). Other bodies have three.

use super::{Cause, Situation};
use crate::unknown::Unknown;
use nalgebra::Vector3;
use pliant_engine::bodies::JointKind;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let bodies = at.plan.model.tree().bodies().iter().enumerate();
    let one = |(k, name): (usize, &String)| {
        let unknowns = unknowns(at, k, name);
        (!unknowns.is_empty()).then(|| Cause {
            object: Some(name.clone()),
            meaning: "a link's mass is spread wider or closer about its centre",
            unknowns,
            excitation: "swing the link free about two parallel axes",
            ..Cause::default()
        })
    };
    bodies.filter_map(|(k, body)| one((k, &body.name))).collect()
}

fn unknowns(at: &Situation, body: usize, name: &str) -> Vec<Unknown> {
    let tree = at.plan.model.tree();
    let spread = |k: usize| at.value(&format!("{name}.spread[{k}]"));
    // of a body that turns freely all three may grow by one factor: in logarithms that changes nothing of what is seen of their ratios
    let one = |k: usize| at.theta(&format!("{name}.spread[{k}]"), 0.01).map(Unknown::logarithmic);
    let all = (0..3).filter_map(one);
    let joints = &tree.joints()[tree.bodies()[body].joints.clone()];
    let [joint] = joints else { return all.collect() };
    if joint.kind != JointKind::Revolute {
        return all.collect();
    }
    let columns = [
        Vector3::new(spread(0), 0.0, 0.0),
        Vector3::new(spread(3), spread(1), 0.0),
        Vector3::new(spread(4), spread(5), spread(2)),
    ];
    let effect = |k: usize| (columns[k][k] - columns[k].dot(&joint.axis) * joint.axis[k]).abs();
    let strongest = (0..3).max_by(|&i, &j| effect(i).total_cmp(&effect(j))).unwrap_or(0);
    all.skip(strongest).take(1).collect()
}
