//! Sheets of cloth: strips against the elastica, and what a free sheet conserves.

use crate::common::Case;
use crate::common::sheets::{rippling, thrown};
use pliant_engine::equilibrium::equilibrium;
use pliant_engine::step::StepOptions;
use pliant_scene::{Clamp, Cloth, Diagonal, Grid, Gripper, Integrator, Scene, resting_inputs};

/// A strip clamped at one end and bent by its own weight, k = w L³/(D b), cut into `cells` and a half along its length.
///
/// Two rows of nodes are held. The slope between them is fixed, and the fold at the second row is the bend of the strip from half
/// a cell before it to half a cell behind; so the clamp is half a cell before the second row, and L is counted from there.
struct Strip {
    k: f64,
    cells: usize,
    across: usize,
    diagonal: Diagonal,
    nu: f64,
    width: f64,
}

const LENGTH: f64 = 0.5;

impl Strip {
    fn scene(&self) -> Scene {
        let a = LENGTH / (self.cells as f64 + 0.5);
        let nodes = [self.cells + 2, self.across + 1];
        let grid = Grid { nodes, size: [a * (self.cells + 1) as f64, self.width], diagonal: self.diagonal };
        let weight = 0.2 * 9.81;
        let sheet = Cloth {
            grid: Some(grid),
            origin: [-0.5 * a, 0.0, 0.0],
            area_density: Some(0.2),
            thickness: 1e-3,
            youngs_modulus: 1e8,
            poisson_ratio: self.nu,
            bend_stiffness: Some(weight * LENGTH.powi(3) / self.k),
            ..Cloth::default()
        };
        let held = (0..2 * nodes[1]).map(|n| n as i64).collect();
        let hand = Gripper { rope: None, cloth: Some("sheet".to_owned()), clamp: Clamp::Nodes(held), ..Gripper::default() };
        Scene { cloth: vec![sheet], gripper: vec![hand], ..Scene::default() }
    }

    /// (sag, shortening) of the middle of the end over L, and its angle \[rad\].
    fn tip(&self) -> [f64; 3] {
        let scene = self.scene();
        let case = Case::new(&scene, 1);
        let q = equilibrium(&case.model, &case.theta, &case.x0.q, &resting_inputs(&scene).unwrap()).unwrap().q;
        let row = self.across + 1;
        let at = |i: usize| &q[3 * (i * row + self.across / 2)..][..3];
        let (end, before) = (at(self.cells + 1), at(self.cells));
        let angle = (before[2] - end[2]).atan2(end[0] - before[0]);
        [-end[2] / LENGTH, (LENGTH - end[0]) / LENGTH, angle]
    }
}

/// Self-weight elastica: k, sag/L, shortening/L, end angle.
const ELASTICA: [(f64, [f64; 3]); 4] = [
    (1.0, [0.12347, 0.00875, 0.16512]),
    (4.0, [0.42516, 0.10989, 0.58859]),
    (8.0, [0.64063, 0.27558, 0.94012]),
    (32.0, [0.87846, 0.67151, 1.46136]),
];

#[test]
fn a_strip_bends_as_the_elastica() {
    for diagonal in [Diagonal::Up, Diagonal::Down] {
        for (k, expected) in ELASTICA {
            let error = |cells: usize| {
                let tip = Strip { k, cells, across: 2, diagonal, nu: 0.0, width: 0.05 }.tip();
                [0, 1, 2].map(|a| tip[a] - expected[a])
            };
            let errors = [10, 20, 40].map(error);
            println!("{diagonal:?} k {k}: {errors:.5?}");
            for a in 0..3 {
                // second order, down to the five digits of the reference
                let fall = errors[0][a] / errors[1][a];
                assert!(errors[2][a].abs() < 1.3e-3, "{diagonal:?} {k} {a}: {errors:?}");
                assert!(errors[0][a].abs() < 1e-4 || (3.4..4.3).contains(&fall), "{diagonal:?} {k} {a}: {errors:?}");
            }
        }
    }
}

/// A narrow strip curls across as it bends (D (1 − ν²) then resists), a wide one is flat but for its edges (D).
#[test]
fn poissons_ratio_softens_a_narrow_strip() {
    let strip = |nu: f64, across: usize, width: f64| Strip { k: 1.0, cells: 20, across, diagonal: Diagonal::Up, nu, width };
    let sag = |nu, across, width| strip(nu, across, width).tip()[0];
    let reference = sag(0.0, 2, 0.05);
    let (narrow, wide) = (sag(0.3, 4, 0.05) / reference, sag(0.3, 20, 0.5) / reference);
    println!("ν = 0.3: narrow {narrow:.4}, square {wide:.4} of the sag at ν = 0");
    // the sag of a soft cantilever grows less than its compliance, 1/(1 − ν²) = 1.099
    assert!((1.07..1.1).contains(&narrow) && wide < narrow && wide > 1.0);
}

#[test]
fn cells_cut_in_turn_bend_alike() {
    for (k, expected) in ELASTICA {
        let tip = Strip { k, cells: 20, across: 4, diagonal: Diagonal::Alternating, nu: 0.0, width: 0.1 }.tip();
        println!("alternate k {k}: {:.5?}", [0, 1, 2].map(|a| tip[a] - expected[a]));
        assert!((0..3).all(|a| (tip[a] - expected[a]).abs() < 0.02 * expected[a] + 5e-3), "{k}: {tip:?}");
    }
}

/// Linear and angular momentum.
fn momentum(case: &Case, q: &[f64], v: &[f64]) -> [f64; 6] {
    let mut out = [0.0; 6];
    for (i, m) in case.model.masses(&case.theta).iter().enumerate() {
        for a in 0..3 {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            out[a] += m * v[3 * i + a];
            out[3 + a] += m * (q[3 * i + b] * v[3 * i + c] - q[3 * i + c] * v[3 * i + b]);
        }
    }
    out
}

#[test]
fn a_free_sheet_keeps_momentum_and_midpoint_its_energy() {
    for (integrator, damping) in [(Integrator::Midpoint, 0.0), (Integrator::Midpoint, 1.0), (Integrator::Euler, 1.0)] {
        let mut scene = thrown(integrator, 2.0, damping);
        scene.gravity.magnitude = 0.0;
        let case = rippling(&scene);
        let run = case.run(StepOptions { record: false, ..StepOptions::default() });
        let of = |k: usize| momentum(&case, &run.states[k].q, &run.states[k].v);
        let (first, last) = (of(0), of(run.states.len() - 1));
        let kept = if integrator == Integrator::Midpoint { 6 } else { 3 };
        for a in 0..kept {
            assert!((first[a] - last[a]).abs() < 1e-10, "{integrator:?} {damping}: {first:?} {last:?}");
        }
        let energy = run.energy();
        let tail = &energy[energy.len() / 2..];
        let drift = (tail.iter().sum::<f64>() / tail.len() as f64 / energy[0] - 1.0).abs();
        println!("{integrator:?}, damping {damping}: mean energy of the second half differs by {drift:.2e}");
        if integrator == Integrator::Midpoint && damping == 0.0 {
            assert!(drift < 5e-3 && run.retries() == 0, "{drift} {}", run.retries());
        } else {
            assert!(energy[energy.len() - 1] < energy[0]);
        }
    }
}
