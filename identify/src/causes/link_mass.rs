//! The mass of a body that carries another one and that joints move; its distribution in space stays. [`super::payload`] is that of the
//! others.

use super::{Cause, Situation};
use pliant_engine::bodies::Tree;

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    let shape = Cause {
        meaning: "a link that carries others is heavier or lighter than simulated",
        excitation: "weigh it; or hold it in two postures by known torques",
        ..Cause::default()
    };
    at.per_mass(carriers(at.plan.model.tree()), &shape)
}

/// Names of the bodies that carry another one and move. The mass of one that is welded to the world acts on nothing.
fn carriers(tree: &Tree) -> impl Iterator<Item = &String> {
    let bodies = tree.bodies();
    let carries = |body: usize| bodies.iter().any(|b| b.parent == Some(body));
    let on_the_way_down = |body: usize| std::iter::successors(Some(body), |k| bodies[*k].parent);
    let moves = move |body: usize| on_the_way_down(body).any(|k| !bodies[k].joints.is_empty());
    (0..bodies.len()).filter(move |k| carries(*k) && moves(*k)).map(|k| &bodies[k].name)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use pliant_engine::model::ModelBuilder;
    use pliant_scene::{Scene, parse_scene};

    #[test]
    fn links_that_move_and_carry_others_have_a_mass_to_be_tested() {
        let body = |name: &str, parent: &str, joint: &str| {
            format!("[[body]]\nname = \"{name}\"\n{parent}mass = 1.0\ninertia = [0.01, 0.01, 0.01, 0, 0, 0]\n{joint}")
        };
        let on = |parent: &str| format!("parent = \"{parent}\"\n");
        let hinge = |name: &str| format!("[[body.joint]]\nname = \"{name}\"\nkind = \"revolute\"\naxis = [0, 1, 0]\n");
        let text = [
            "schema_version = 1\n[time]\nstep = 0.01\nduration = 1.0\n".to_owned(),
            body("stand", "", ""),
            body("upper", &on("stand"), &hinge("shoulder")),
            body("bracket", &on("upper"), ""),
            body("lower", &on("bracket"), &hinge("elbow")),
        ];
        let scene: Scene = parse_scene(&text.concat(), "scene.toml").unwrap();
        let model = ModelBuilder::new(&scene).unwrap().build();
        // the stand does not move, and the lower link carries none: its mass is a payload
        assert_eq!(carriers(model.tree()).collect::<Vec<_>>(), ["upper", "bracket"]);
    }
}
