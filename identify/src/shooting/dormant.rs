//! The scene of a diagnosis: laws that a scene file leaves out, at values where they change nothing.
//!
//! A diagnosis opens parameters and switches no physics; so the parameters that a cause may free have to be in θ before anything is fitted:
//! ```text
//! motors    lag 0, saturation ± the inactive limit
//! rods      rest strains of the edges 0 where they are few, bend_stiffness_2 = bend_stiffness, creep of a fraction 0, flow of bending
//!           in the inactive time, stiffening and friction of bending 0
//! joints    friction_backward = friction, load_friction 0; where there is a spring, plastic_time the inactive time with a yield of nothing
//! ```
//! A motor's delay is none of them: it shifts the inputs, which are known beforehand ([`super::input_delay`]). Nor is
//! cogging: only the scene knows how often it repeats.
//!
//! A backward friction that the scene does not have *follows* the friction of the joint, fitted or not, until a cause frees it; so does a
//! second bending stiffness the first.

use super::constants::SHOOTING;
use crate::unknown::{Target, Unknown, Values};
use pliant_engine::model::Model;
use pliant_scene::{BendFriction, Creep, Joint, JointKind, Plasticity, Rope, Scene, Stiffening};

/// The scene with these laws.
pub(crate) fn opened(scene: &Scene) -> Scene {
    let mut out = scene.clone();
    for actuator in &mut out.actuator {
        actuator.lag.get_or_insert(0.0);
        actuator.saturation.get_or_insert([-SHOOTING.inactive_limit, SHOOTING.inactive_limit]);
    }
    for rope in &mut out.rope {
        let edges = rope.fractions().len();
        if rope.twist.is_some() && edges <= SHOOTING.few_edges {
            rope.edge_rest_strains.get_or_insert_with(|| vec![0.0; edges]);
        }
        if let Some(twist) = &mut rope.twist {
            twist.bend_stiffness_2.get_or_insert(rope.bend_stiffness);
            rope.creep.get_or_insert(Creep { fraction: 0.0, twist_fraction: None, time: 1.0 });
            rope.stiffening.get_or_insert(Stiffening { coefficient: 0.0 });
            rope.bend_friction.get_or_insert(BendFriction { moment: 0.0, curvature: 1.0 });
            rope.plasticity.get_or_insert(Plasticity { yield_curvature: SHOOTING.inactive_limit, time: SHOOTING.inactive_time });
        }
    }
    let prescribed: Vec<String> = out.actuator.iter().map(|a| a.joint.clone()).collect();
    for joint in out.body.iter_mut().flat_map(|body| &mut body.joint) {
        let springy = joint.stiffness != 0.0 || joint.cubic_stiffness != 0.0;
        if has_friction(joint) {
            joint.friction_backward.get_or_insert(joint.friction);
            if springy || prescribed.contains(&joint.name) {
                joint.load_friction.get_or_insert(0.0);
            }
        }
        let creeps = has_friction(joint) || joint.kind == JointKind::Ball;
        if creeps && springy && joint.plastic_time.is_none() {
            (joint.plastic_time, joint.yield_at) = (Some(SHOOTING.inactive_time), Some(SHOOTING.least_yield));
        }
    }
    out
}

fn has_friction(joint: &Joint) -> bool {
    matches!(joint.kind, JointKind::Revolute | JointKind::Prismatic | JointKind::Universal)
}

/// (leader, follower) in θ of every joint whose backward friction the scene does not have, and of every rod's second stiffness.
pub(super) fn followers(scene: &Scene, model: &Model) -> Vec<(usize, usize)> {
    let round = |rope: &&Rope| rope.twist.as_ref().is_some_and(|twist| twist.bend_stiffness_2.is_none());
    let of_rod = |rope: &Rope, key: &str| model.params().find(&format!("{}.{key}", rope.name));
    let rods = scene.rope.iter().filter(round);
    let rods = rods.filter_map(|rope| Some((of_rod(rope, "bend_stiffness")?, of_rod(rope, "bend_stiffness_2")?)));
    let joints = scene.body.iter().flat_map(|body| &body.joint).filter(|j| has_friction(j) && j.friction_backward.is_none());
    let find = |joint: &Joint, key: &str| model.params().find(&format!("{}.{key}", joint.name));
    rods.chain(joints.filter_map(|j| Some((find(j, "friction")?, find(j, "friction_backward")?)))).collect()
}

/// The unknowns, each setting its followers too, but no entry that another of them sets alone.
pub(super) fn tied(followers: &[(usize, usize)], mut unknowns: Vec<Unknown>) -> Vec<Unknown> {
    for &(leader, follower) in followers {
        let sets = |u: &Unknown, k: usize| matches!(&u.target, Target::Theta(entries) if entries.first() == Some(&k));
        let own = unknowns.iter().any(|u| sets(u, follower));
        for u in unknowns.iter_mut().filter(|u| sets(u, leader)) {
            u.target = Target::Theta(if own { vec![leader] } else { vec![leader, follower] });
        }
    }
    let alone: Vec<usize> = unknowns.iter().filter_map(only).collect();
    for u in &mut unknowns {
        if let Target::Theta(entries) = &mut u.target
            && entries.len() > 1
        {
            let (first, others) = (entries[0], entries.iter().any(|k| !alone.contains(k)));
            entries.retain(|k| if others { !alone.contains(k) } else { *k == first });
        }
    }
    unknowns
}

/// Gives all entries of one of `unknowns` the value of its tie before: an entry that was free on its own goes back into its tie.
pub(super) fn rejoin(before: &[Unknown], unknowns: &[Unknown], values: &mut Values) {
    for u in unknowns {
        let own = u.target.entries();
        let part = |b: &&Unknown| b.target.entries().iter().all(|(k, _)| own.iter().any(|(o, _)| o == k));
        if let (Target::Theta(_), Some(tie)) = (&u.target, before.iter().filter(part).max_by_key(|b| b.target.entries().len())) {
            let value = tie.value(values);
            u.set(values, value);
        }
    }
}

/// The entry of θ that an unknown sets, if it is one.
fn only(u: &Unknown) -> Option<usize> {
    match &u.target {
        Target::Theta(entries) if entries.len() == 1 => entries.first().copied(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use pliant_engine::model::ModelBuilder;
    use pliant_engine::step::{StepOptions, Stepper};
    use pliant_scene::{Nothing, parse_scene};

    const ARM: &str = r#"
schema_version = 1
[time]
step = 0.002
duration = 0.1
integrator = "midpoint"
[[body]]
name = "link"
mass = 0.5
center_of_mass = [0, 0, -0.3]
inertia = [1e-3, 1e-3, 1e-3, 0, 0, 0]
[[body.joint]]
name = "pivot"
kind = "revolute"
axis = [0, -1, 0]
stiffness = 0.3
damping = 0.01
friction = 0.02
[[actuator]]
name = "motor"
joint = "pivot"
kind = "torque"
command = { kind = "sine", amplitude = 0.8, frequency = 3.0 }
"#;

    #[test]
    fn what_is_opened_changes_no_motion() {
        let scene = parse_scene::<Nothing>(ARM, "arm.toml").unwrap();
        let run = |scene: &Scene| {
            let model = ModelBuilder::new(scene).unwrap().build();
            let mut stepper = Stepper::new(&model, model.params().values(), StepOptions::default()).unwrap();
            let mut x = model.initial_state();
            for k in 0..100 {
                stepper.step(&mut x, &[(0.3 * f64::from(k)).sin()]).unwrap();
            }
            x
        };
        let (plain, opened) = (run(&scene), run(&opened(&scene)));
        assert!((plain.q[0] - opened.q[0]).abs() < 1e-9 && (plain.v[0] - opened.v[0]).abs() < 1e-8, "{plain:?} {opened:?}");
        assert!(opened.z.len() >= 3, "{}", opened.z.len());
    }

    #[test]
    fn one_of_several_that_are_tied_may_differ_whichever_it_is() {
        let model = ModelBuilder::new(&parse_scene::<Nothing>(ARM, "arm.toml").unwrap()).unwrap().build();
        let one =
            |k: usize| Unknown { target: Target::Theta(vec![k]), ..Unknown::of_theta(&model, "pivot.damping", 1.0).unwrap() };
        let tie = Unknown { target: Target::Theta(vec![4, 5, 6]), ..one(4) };
        let rest = |alone: &[usize]| {
            let unknowns = std::iter::once(tie.clone()).chain(alone.iter().map(|k| one(*k))).collect();
            tied(&[], unknowns)[0].target.clone()
        };
        assert_eq!(rest(&[]), Target::Theta(vec![4, 5, 6]));
        assert_eq!(rest(&[4]), Target::Theta(vec![5, 6]));
        assert_eq!(rest(&[5]), Target::Theta(vec![4, 6]));
        assert_eq!(rest(&[6, 5, 4]), Target::Theta(vec![4]));
    }

    #[test]
    fn what_was_free_on_its_own_goes_back_into_its_tie() {
        let model = ModelBuilder::new(&parse_scene::<Nothing>(ARM, "arm.toml").unwrap()).unwrap().build();
        let tie = |entries: &[usize]| Unknown {
            target: Target::Theta(entries.to_vec()),
            ..Unknown::of_theta(&model, "pivot.damping", 1.0).unwrap()
        };
        let theta = vec![0.0, 0.0, 0.0, 0.0, 2.0, 7.0, 2.0];
        let mut values = Values { theta, sensor: Default::default(), joints: Vec::new(), offsets: Vec::new(), late: Vec::new() };
        rejoin(&[tie(&[4, 6]), tie(&[5])], &[tie(&[4, 5, 6])], &mut values);
        assert_eq!(values.theta[4..], [2.0, 2.0, 2.0]);
        // the tie's first, too
        values.theta[4] = 7.0;
        rejoin(&[tie(&[5, 6]), tie(&[4])], &[tie(&[4, 5, 6])], &mut values);
        assert_eq!(values.theta[4..], [2.0, 2.0, 2.0]);
    }

    #[test]
    fn backward_friction_follows_until_it_is_freed() {
        let scene = parse_scene::<Nothing>(ARM, "arm.toml").unwrap();
        let model = ModelBuilder::new(&opened(&scene)).unwrap().build();
        let ties = followers(&scene, &model);
        let find = |path: &str| model.params().find(path).unwrap();
        assert_eq!(ties, [(find("pivot.friction"), find("pivot.friction_backward"))]);
        let unknown = |path: &str| Unknown::of_theta(&model, path, 1.0).unwrap();
        let alone = tied(&ties, vec![unknown("pivot.friction")]);
        assert_eq!(alone[0].target, Target::Theta(vec![ties[0].0, ties[0].1]));
        let both = tied(&ties, [alone, vec![unknown("pivot.friction_backward")]].concat());
        assert_eq!(both[0].target, Target::Theta(vec![ties[0].0]));
        assert_eq!(both[1].target, Target::Theta(vec![ties[0].1]));
    }
}
