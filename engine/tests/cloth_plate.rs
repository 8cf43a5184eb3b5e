//! A sheet is a plate: natural frequencies of a free square one, whose modes twist, saddle and cup.
#![allow(clippy::unwrap_used)]

use nalgebra::DMatrix;
use pliant_engine::kkt::BlockBand;
use pliant_engine::model::ModelBuilder;
use pliant_engine::scene::{Cloth, Diagonal, Grid, Nothing, Scene};
use pliant_engine::terms::Point;

/// ω L² √(ρ/D) of the three softest bending modes of a free square plate, ν = 0.3 (Leissa 1973; Gorman 1978).
const FREE_SQUARE: [f64; 3] = [13.468, 19.596, 24.270];

fn frequencies(cells: usize, diagonal: Diagonal) -> [f64; 3] {
    let grid = Grid { nodes: [cells + 1; 2], size: [1.0; 2], diagonal };
    let sheet = Cloth { grid: Some(grid), area_density: Some(1.0), bend_stiffness: Some(1.0), ..Cloth::default() };
    let scene = Scene::<Nothing> { cloth: vec![sheet], ..Scene::default() };
    let model = ModelBuilder::new(&scene).unwrap().build();
    let (theta, n) = (model.params().values(), model.n_nodes());
    let (q, v) = (model.initial_positions().to_vec(), vec![0.0; 3 * n]);
    let at = Point { q: &q, v: &v, theta };
    let matrix = || BlockBand::zeros(n, n - 1);
    let (mut f, mut dq, mut dv) = (v.clone(), matrix(), matrix());
    let plate = model.terms().iter().find(|t| t.name() == "plate").unwrap();
    plate.add_jacobian(&at, &mut f, &mut dq, &mut dv);
    let mass = model.masses(theta);
    let stiffness = DMatrix::from_fn(n, n, |i, j| -dq.get(3 * i + 2, 3 * j + 2) / (mass[i] * mass[j]).sqrt());
    let mut squares: Vec<f64> = stiffness.symmetric_eigenvalues().iter().copied().collect();
    squares.sort_by(f64::total_cmp);
    assert!(squares[2].abs() < 1e-6 * squares[3], "three rigid motions: {squares:?}");
    [3, 4, 5].map(|k| squares[k].sqrt())
}

#[test]
fn a_free_square_sheet_has_the_frequencies_of_a_plate() {
    for diagonal in [Diagonal::Up, Diagonal::Down, Diagonal::Alternate] {
        let errors = [6, 12, 24].map(|cells| {
            let found = frequencies(cells, diagonal);
            [0, 1, 2].map(|k| found[k] / FREE_SQUARE[k] - 1.0)
        });
        println!("{diagonal:?}: {errors:.4?}");
    }
}
