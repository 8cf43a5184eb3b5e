//! Ropes and sheets on balls, bars and bricks: where they fall from, and how near edges and triangles come to what they fall on.

use nalgebra::{Quaternion, UnitQuaternion};
use pliant_engine::model::Model;
use pliant_scene::{Block, Capsule, Cloth, Contact, Grid, Initial, Integrator, Plane, Rope, Scene, Sphere, Time, Touching};

pub type V3 = nalgebra::Vector3<f64>;

/// Distance of a point from the nearest of the scene's spheres, capsules and boxes \[m\]; of boxes negative inside.
fn distance(scene: &Scene, p: &V3) -> f64 {
    let spheres = scene.sphere.iter().map(|s| (p - V3::from(s.center)).norm() - s.radius);
    let capsules = scene.capsule.iter().map(|s| {
        let (a, axis) = (V3::from(s.a), V3::from(s.b) - V3::from(s.a));
        let t = ((p - a).dot(&axis) / axis.norm_squared()).clamp(0.0, 1.0);
        (p - a - axis * t).norm() - s.radius
    });
    let blocks = scene.block.iter().map(|s| {
        let [w, x, y, z] = s.quaternion;
        let turn = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        let y = turn.inverse() * (p - V3::from(s.position));
        let over = V3::from_fn(|k, _| y[k].abs() - s.half_extents[k]);
        over.map(|x| x.max(0.0)).norm() + over.max().min(0.0)
    });
    spheres.chain(capsules).chain(blocks).fold(f64::INFINITY, f64::min)
}

/// The least gap along an edge between two points: sampled, and refined where it is least \[m\].
fn edge_gap(scene: &Scene, [a, b]: [V3; 2]) -> f64 {
    let at = |s: f64| distance(scene, &a.lerp(&b, s));
    let samples = 40;
    let best = (0..=samples).min_by(|i, j| at(f64::from(*i) / 40.0).total_cmp(&at(f64::from(*j) / 40.0))).unwrap();
    let [mut low, mut high] = [-1.0, 1.0].map(|d| ((f64::from(best) + d) / 40.0).clamp(0.0, 1.0));
    for _ in 0..40 {
        let (s, t) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if at(s) < at(t) { high = t } else { low = s }
    }
    at(0.5 * (low + high)).min(at(f64::from(best) / 40.0))
}

/// The least gap of a triangle's inside: sampled, and that of boxes' corners under it \[m\].
fn inside_gap(scene: &Scene, [a, b, c]: [V3; 3]) -> f64 {
    let mut least = f64::INFINITY;
    for i in 1..16 {
        for j in 1..16 - i {
            let p = a + (b - a) * (f64::from(i) / 16.0) + (c - a) * (f64::from(j) / 16.0);
            least = least.min(distance(scene, &p));
        }
    }
    for block in &scene.block {
        let [w, x, y, z] = block.quaternion;
        let turn = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        for k in 0..8 {
            let out = V3::from_fn(|a, _| if k >> a & 1 == 0 { 1.0 } else { -1.0 });
            let corner = V3::from(block.position) + turn * out.component_mul(&V3::from(block.half_extents));
            let n = (b - a).cross(&(c - a)).normalize();
            let foot = corner - n * n.dot(&(corner - a));
            let inside = [(a, b), (b, c), (c, a)].iter().all(|(p, q)| n.dot(&(q - p).cross(&(foot - p))) >= 0.0);
            // a corner far inside is none that the sheet lies on
            let gap = n.dot(&(a - corner)) * n.dot(&(turn * out)).signum();
            if inside && gap > -0.01 && n.dot(&(turn * out)).abs() > 1.0 {
                least = least.min(gap);
            }
        }
    }
    least
}

/// The least gap of all edges and triangles \[m\].
pub fn least_gap(scene: &Scene, model: &Model, q: &[f64]) -> f64 {
    let at = |node: usize| V3::new(q[3 * node], q[3 * node + 1], q[3 * node + 2]);
    let mut least = f64::INFINITY;
    for (rope, span) in scene.rope.iter().zip(model.ropes()) {
        for node in span.nodes.clone().skip(1) {
            least = least.min(edge_gap(scene, [at(node - 1), at(node)]) - rope.radius);
        }
    }
    for (cloth, span) in scene.cloth.iter().zip(model.cloths()) {
        for t in &span.triangles {
            let [a, b, c] = t.map(|k| at(span.nodes.start + k));
            let of_edges = [[a, b], [b, c], [c, a]].map(|e| edge_gap(scene, e)).into_iter().fold(f64::INFINITY, f64::min);
            least = least.min(of_edges.min(inside_gap(scene, [a, b, c])) - cloth.contact_radius());
        }
    }
    least
}

/// Numbers by a linear congruence (Knuth's MMIX).
pub struct Random(pub u64);

impl Random {
    pub fn within(&mut self, a: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        a * ((self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
    }
}

pub fn ball() -> Sphere {
    Sphere { name: "ball".into(), center: [0.0; 3], radius: 0.06, friction: 0.4 }
}

pub fn bar() -> Capsule {
    Capsule { name: "bar".into(), a: [-0.07, 0.0, 0.0], b: [0.08, 0.02, 0.01], radius: 0.025, friction: 0.4 }
}

pub fn brick() -> Block {
    let quaternion = UnitQuaternion::from_euler_angles(0.5, 0.4, 0.2);
    let quaternion = [quaternion.w, quaternion.i, quaternion.j, quaternion.k];
    Block { name: "brick".into(), position: [0.0; 3], quaternion, half_extents: [0.06, 0.05, 0.04], friction: 0.4 }
}

/// Puts shape `kind` (0 ball, 1 bar, 2 brick) over a floor.
pub fn furnish(scene: &mut Scene, kind: usize) {
    scene.plane = vec![Plane { height: -0.12, friction: 0.4, ..Plane::default() }];
    match kind {
        0 => scene.sphere = vec![ball()],
        1 => scene.capsule = vec![bar()],
        _ => scene.block = vec![brick()],
    }
}

pub fn dropped(kind: usize, sheet: bool, contact: Touching, step: f64, rng: &mut Random) -> Scene {
    let mut scene = Scene { contact: Contact { rest_gap: 1e-6, ..Contact::default() }, ..Scene::default() };
    scene.time = Time { step, duration: 1.0, integrator: Integrator::Euler };
    let mut random = |a: f64| rng.within(a);
    let angle = random(3.0);
    let velocity = [random(0.3), random(0.3), random(0.5) - 0.5];
    let (x, y) = (random(0.05), random(0.05));
    let along = [angle.cos(), angle.sin(), 0.0];
    if sheet {
        let across = [-along[1], along[0], 0.0];
        let origin = [0, 1].map(|a| [x, y][a] - 0.15 * along[a] - 0.125 * across[a]);
        scene.cloth = vec![Cloth {
            grid: Some(Grid { nodes: [7, 6], size: [0.3, 0.25], ..Grid::default() }),
            origin: [origin[0], origin[1], 0.12],
            u_axis: Some(along),
            v_axis: Some(across),
            velocity,
            thickness: 2e-3,
            youngs_modulus: 2e4,
            bend_stiffness: Some(1e-5),
            membrane_damping: 20.0,
            bend_damping: 1e-7,
            contact,
            ..Cloth::default()
        }];
    } else {
        let from = [x - 0.25 * along[0], y - 0.25 * along[1], 0.12];
        scene.rope = vec![Rope {
            nodes: Some(10),
            length: 0.5,
            stretch_stiffness: 1e3,
            stretch_damping: 0.05,
            bend_stiffness: 3e-4,
            bend_damping: 1e-5,
            radius: 0.004,
            velocity,
            initial: Initial::Straight { from, direction: along },
            contact,
            ..Rope::default()
        }];
    }
    furnish(&mut scene, kind);
    scene
}
