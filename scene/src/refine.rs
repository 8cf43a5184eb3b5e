//! The same scene with every edge halved, for mesh convergence.

use super::file::Scene;
use super::gripper::{Clamp, Mode};
use super::held::Held;
use super::refine_cloth::Halves;
use super::rope::{Initial, JointSection, Rope, Twist};

/// A refined scene and how its inputs follow from the original's. Node i of a rope becomes node 2i, that of a sheet keeps its number.
#[derive(Clone, Debug, PartialEq)]
pub struct Refined {
    /// The scene.
    pub scene: Scene,
    /// Each input as the mean of two of the original's (the same twice where it is a copy).
    pub inputs: Vec<[usize; 2]>,
    /// Whether a gripper clamps an edge of a rope by its two nodes, or a triangle by its three.
    pub clamps_edges: bool,
}

impl Refined {
    /// The refined scene's input for an input of the original.
    pub fn input(&self, u: &[f64]) -> Vec<f64> {
        self.inputs.iter().map(|&[a, b]| 0.5 * (u[a] + u[b])).collect()
    }
}

impl Scene {
    /// Halves every edge of every rope and sheet. A gripper that holds neighbouring nodes holds the new node between them too, in the middle.
    ///
    /// Materials and forces of one's own on whole ropes and sheets are per length or area and stay; node numbers, points and edges of ropes are doubled.
    pub fn refined(&self) -> Refined {
        let (mut scene, mut inputs, mut first) = (self.clone(), Vec::new(), 0);
        let mut clamps_edges = false;
        let halves: Vec<Option<Halves>> = self.cloth.iter().map(Halves::of).collect();
        for gripper in &mut scene.gripper {
            let held = self.held(gripper);
            match (&mut gripper.clamp, held) {
                (Clamp::Nodes(numbers), Some(of)) => {
                    let held: Vec<usize> = numbers.iter().filter_map(|&number| of.node(number)).collect();
                    let (pairs, nodes, clamps) = match of {
                        Held::Rope(rope, _) => on_rope(&held, rope),
                        Held::Cloth(_, c) => on_sheet(&held, halves[c].as_ref()),
                    };
                    clamps_edges |= clamps;
                    *numbers = nodes.into_iter().map(as_number).collect();
                    if gripper.mode == Mode::Prescribed {
                        let copies = (0..held.len()).map(|k| [k, k]);
                        let sources: Vec<[usize; 2]> = copies.chain(pairs).collect();
                        inputs.extend(sources.iter().flat_map(|s| (0..3).map(|a| s.map(|k| first + 3 * k + a))));
                        first += 3 * held.len();
                    } else {
                        inputs.extend((first..first + 3).map(|k| [k, k]));
                        first += 3;
                    }
                }
                (Clamp::Grasp(_), _) => {
                    inputs.extend((first..first + 4).map(|k| [k, k]));
                    first += 4;
                }
                _ => {
                    inputs.extend((first..first + 6).map(|k| [k, k]));
                    first += 6;
                }
            }
        }
        for force in &mut scene.force {
            let Some(numbers) = &mut force.nodes else { continue };
            let rope = self.rope.iter().find(|rope| Some(&rope.name) == force.rope.as_ref());
            let cloth = self.cloth.iter().find(|cloth| Some(&cloth.name) == force.cloth.as_ref());
            let place = |number: i64| match (rope, cloth) {
                (Some(rope), _) => rope.node(number).map(|node| 2 * node),
                (None, cloth) => cloth?.node(number),
            };
            *numbers = numbers.iter().filter_map(|&number| place(number)).map(as_number).collect();
        }
        scene.rope.iter_mut().for_each(halve_edges);
        for (c, (cloth, halves)) in scene.cloth.iter_mut().zip(&halves).enumerate() {
            if let Some(refined) = halves.as_ref().and_then(|halves| halves.refined(cloth, c)) {
                *cloth = refined;
            }
        }
        Refined { scene, inputs, clamps_edges }
    }
}

fn as_number(node: usize) -> i64 {
    i64::try_from(node).unwrap_or(i64::MAX)
}

/// Pairs of held nodes that an edge joins, by their places in the list; the held nodes of the refined scene, those that halve these edges
/// last; whether an edge or triangle cannot turn.
type Grip = (Vec<[usize; 2]>, Vec<usize>, bool);

fn on_rope(held: &[usize], rope: &Rope) -> Grip {
    let pairs = held_pairs(held, rope);
    let nodes = held.iter().map(|i| 2 * i).chain(pairs.iter().map(|p| 2 * held[p[0]] + 1)).collect();
    let clamps = !pairs.is_empty();
    (pairs, nodes, clamps)
}

fn on_sheet(held: &[usize], halves: Option<&Halves>) -> Grip {
    let Some(halves) = halves else { return (Vec::new(), held.to_vec(), false) };
    let all = (0..held.len()).flat_map(|a| (0..a).map(move |b| [a, b]));
    let found = all.filter_map(|pair| Some((pair, halves.between(held[pair[0]], held[pair[1]])?)));
    let (pairs, middles): (Vec<_>, Vec<_>) = found.unzip();
    (pairs, held.iter().copied().chain(middles).collect(), halves.clamps(held))
}

/// Positions in `held` of nodes that an edge joins, the one that it begins at first.
fn held_pairs(held: &[usize], rope: &Rope) -> Vec<[usize; 2]> {
    let place = |node: usize| held.iter().position(|&h| h == node);
    let next = |node: usize| if rope.closed { (node + 1) % rope.n_nodes().max(1) } else { node + 1 };
    (0..held.len()).filter_map(|k| Some([k, place(next(held[k]))?])).collect()
}

/// Sections of single joints, each where it was, and halfway to the next one the mean of both.
fn halve_joints(rope: &Rope, joints: &[JointSection]) -> Vec<JointSection> {
    let n = rope.n_nodes();
    let at = |node: usize| {
        let own = joints.iter().find(|joint| rope.node(joint.node) == Some(node));
        own.cloned().unwrap_or(JointSection { node: as_number(node), ..JointSection::default() })
    };
    let between = |node: usize| {
        let (before, after) = if rope.closed {
            (node, (node + 1) % n)
        } else {
            (node.max(1), (node + 1).min(n - 2)) // most ends have no joint
        };
        let (a, b) = (at(before), at(after));
        let rest_curvature = [0, 1].map(|k| 0.5 * (a.rest_curvature[k] + b.rest_curvature[k]));
        JointSection { node: as_number(2 * node + 1), rest_curvature, bend_factor: 0.5 * (a.bend_factor + b.bend_factor) }
    };
    let doubled = (0..n).map(|node| JointSection { node: as_number(2 * node), ..at(node) });
    let all = doubled.chain((0..n - usize::from(!rope.closed)).map(between));
    all.filter(|joint| JointSection { node: JointSection::default().node, ..joint.clone() } != JointSection::default()).collect()
}

fn halve_edges(rope: &mut Rope) {
    if let Some(twist) = &rope.twist {
        let joint = halve_joints(rope, &twist.joint);
        rope.twist = Some(Twist { joint, ..twist.clone() });
    }
    for mass in &mut rope.node_mass {
        // the new last node of a closed rope is on its closing edge
        let last = if rope.closed { 0 } else { 1 };
        mass.node = if mass.node < 0 { 2 * mass.node + last } else { 2 * mass.node };
    }
    if let Initial::Points { points } = &mut rope.initial {
        let middle = |pair: &[[f64; 3]]| [pair[0], std::array::from_fn(|a| 0.5 * (pair[0][a] + pair[1][a]))];
        let last = points.last().copied();
        if rope.closed {
            points.push(points[0]);
        }
        *points = points.windows(2).flat_map(middle).chain(last.filter(|_| !rope.closed)).collect();
    }
    rope.nodes = rope.nodes.map(|n| 2 * n - usize::from(!rope.closed));
    if let Some(fractions) = &mut rope.edge_fractions {
        *fractions = fractions.iter().flat_map(|f| [0.5 * f; 2]).collect();
    }
    if let Some(strains) = &mut rope.edge_rest_strains {
        *strains = strains.iter().flat_map(|strain| [*strain; 2]).collect();
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;
    use crate::{Gripper, Nothing, check, parse_scene, resting_inputs};

    const SCENE: &str = r#"
        schema_version = 1
        [time]
        step = 0.01
        [[rope]]
        name = "cable"
        edge_fractions = [0.2, 0.3, 0.5]
        length = 1.0
        linear_density = 0.05
        stretch_stiffness = 100.0
        node_mass = [{ node = 1, mass = 0.1 }, { node = -1, mass = 0.2 }]
        initial = { shape = "points", points = [[0, 0, 0], [0.2, 0, 0], [0.5, 0, 0], [1, 0, 0]] }
        [[gripper]]
        name = "moved"
        rope = "cable"
        nodes = [2]
        mode = "velocity"
        [[gripper]]
        name = "hand"
        rope = "cable"
        nodes = [1, 0]
        [[force]]
        name = "tug"
        rope = "cable"
        nodes = [1, -1]
        formula = ["0", "0", "1"]
    "#;

    #[test]
    fn halves_edges_and_carries_everything_over() {
        let scene: Scene<Nothing> = parse_scene(SCENE, "scene.toml").unwrap();
        let refined = scene.refined();
        check(&refined.scene).unwrap();
        assert!(refined.clamps_edges);
        let rope = &refined.scene.rope[0];
        assert_eq!(rope.fractions(), [0.1, 0.1, 0.15, 0.15, 0.25, 0.25]);
        assert_eq!(rope.node_mass.iter().map(|m| rope.node(m.node).unwrap()).collect::<Vec<_>>(), [2, 6]);
        assert_eq!(refined.scene.force[0].nodes, Some(vec![2, 6]));
        assert_eq!(refined.scene.gripper[0].clamp, Clamp::Nodes(vec![4]));
        assert_eq!(refined.scene.gripper[1].clamp, Clamp::Nodes(vec![2, 0, 1]));
        // the refined scene's own resting input is the one carried over
        let carried = refined.input(&resting_inputs(&scene).unwrap());
        assert_eq!(carried, resting_inputs(&refined.scene).unwrap());
    }

    #[test]
    fn halves_the_closing_edge_of_a_ring_too() {
        let points: Vec<[f64; 3]> = vec![[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.2, 0.0], [0.0, 0.2, 0.0]];
        let rope = Rope {
            closed: true,
            nodes: Some(4),
            length: 0.8,
            node_mass: vec![crate::NodeMass { node: -1, mass: 0.1 }],
            initial: Initial::Points { points },
            ..Rope::default()
        };
        let gripper = vec![Gripper { clamp: Clamp::Nodes(vec![0, 3]), ..Gripper::default() }];
        let refined = Scene::<Nothing> { rope: vec![rope], gripper, ..Scene::default() }.refined();
        check(&refined.scene).unwrap();
        let rope = &refined.scene.rope[0];
        assert_eq!((rope.n_nodes(), rope.fractions().len(), rope.node(rope.node_mass[0].node)), (8, 8, Some(6)));
        let Initial::Points { points } = &rope.initial else { panic!("{rope:?}") };
        assert_eq!((points.len(), points[7]), (8, [0.0, 0.1, 0.0]));
        assert_eq!(refined.scene.gripper[0].clamp, Clamp::Nodes(vec![0, 6, 7]));
    }

    #[test]
    fn halves_edges_of_a_sheet() {
        let text = r#"
            schema_version = 1
            [time]
            step = 0.01
            [[cloth]]
            name = "sheet"
            grid = { nodes = [4, 3], size = [0.3, 0.2] }
            origin = [0, 0, 1]
            u_axis = [0, 0, -1]
            thickness = 1e-3
            area_density = 0.2
            youngs_modulus = 1e4
            [[gripper]]
            name = "hand"
            cloth = "sheet"
            nodes = [2, 0, 1]
            [[force]]
            name = "tug"
            cloth = "sheet"
            nodes = [4, -1]
            formula = ["0", "0", "1"]
        "#;
        let scene: Scene<Nothing> = parse_scene(text, "scene.toml").unwrap();
        let refined = scene.refined();
        check(&refined.scene).unwrap();
        let (coarse, fine) = (scene.cloth[0].rest("cloth").unwrap(), refined.scene.cloth[0].rest("cloth").unwrap());
        assert_eq!((fine.vertices.len(), fine.triangles.len()), (7 * 5, 4 * coarse.triangles.len()));
        assert!((fine.total_area() - coarse.total_area()).abs() < 1e-15);
        assert_eq!(fine.vertices[..12], coarse.vertices[..]);
        assert_eq!(refined.scene.force[0].nodes, Some(vec![4, 11]));
        // one row of nodes is a hinge, and the nodes between them are held too
        let Clamp::Nodes(held) = &refined.scene.gripper[0].clamp else { panic!("{refined:?}") };
        assert!(held.len() == 5 && !refined.clamps_edges);
        let carried = refined.input(&resting_inputs(&scene).unwrap());
        let wanted = resting_inputs(&refined.scene).unwrap();
        assert!(carried.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-15), "{carried:?} {wanted:?}");
        let two_rows = parse_scene::<Nothing>(&text.replace("[2, 0, 1]", "[0, 1, 2, 3, 4, 5]"), "scene.toml").unwrap().refined();
        assert!(two_rows.clamps_edges && two_rows.inputs.len() == 3 * 15);
    }
}
