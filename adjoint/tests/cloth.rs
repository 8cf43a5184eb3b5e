//! Sheets of cloth: against the elastica, conservation laws, and gradients against differences.
#![allow(clippy::unwrap_used)]

mod common;

use common::Case;
use pliant_adjoint::gradcheck::{DOT_TEST, FLOOR_FACTOR, RELATIVE_ERROR, gradcheck};
use pliant_engine::equilibrium::equilibrium;
use pliant_engine::model::Model;
use pliant_engine::scene::{
    Clamp, Cloth, Diagonal, Gravity, Grid, Gripper, Integrator, Scene, Solver, Sphere, Time, resting_inputs,
};
use pliant_engine::step::StepOptions;

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
    for diagonal in [Diagonal::Up, Diagonal::Down, Diagonal::Alternate] {
        for (k, expected) in ELASTICA {
            let error = |cells: usize| {
                let tip = Strip { k, cells, across: 2, diagonal, nu: 0.0, width: 0.05 }.tip();
                [0, 1, 2].map(|a| tip[a] - expected[a])
            };
            let errors = [5, 10, 20, 40].map(error);
            println!("{diagonal:?} k {k}: {errors:.5?}");
            // what is left at 40 cells: second order from 10 on, and the five digits of the reference
            for a in 0..3 {
                assert!(errors[3][a].abs() < 2e-3, "{diagonal:?} {k} {a}: {errors:?}");
                let fall = (errors[1][a] / errors[2][a]).abs();
                assert!(errors[1][a].abs() < 1e-4 || (3.0..5.5).contains(&fall), "{diagonal:?} {k} {a}: {errors:?}");
            }
        }
    }
}
