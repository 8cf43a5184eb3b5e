//! A sheet is a plate: natural frequencies of a free square one, whose modes twist, saddle and cup.

use nalgebra::DMatrix;
use pliant_engine::model::{Model, ModelBuilder};
use pliant_engine::terms::Point;
use pliant_linalg::NodeMatrix;
use pliant_math::Vec3;
use pliant_math::dihedral::fold;
use pliant_scene::{Cloth, Diagonal, Grid, Nothing, Raw, Scene};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;

/// ω L² √(ρ/D) of the three softest bending modes of a free square plate, ν = 0.3 (Leissa 1973; Gorman 1978).
const FREE_SQUARE: [f64; 3] = [13.468, 19.596, 24.270];

/// A square sheet of `cells` by `cells`, its inner nodes moved aside by up to `jitter` cells.
fn sheet(cells: usize, diagonal: Diagonal, jitter: f64) -> Model {
    let grid = Grid { nodes: [cells + 1; 2], size: [1.0; 2], diagonal };
    let mut sheet = Cloth { grid: Some(grid), area_density: Some(1.0), bend_stiffness: Some(1.0), ..Cloth::default() };
    if jitter > 0.0 {
        let model = build(sheet.clone());
        let mut vertices: Vec<[f64; 3]> = model.initial_positions().chunks(3).map(|x| [x[0], x[1], x[2]]).collect();
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        for x in &mut vertices {
            if x[..2].iter().all(|x| (1e-9..1.0 - 1e-9).contains(x)) {
                (0..2).for_each(|a| x[a] += rng.random_range(-jitter..jitter) / cells as f64);
            }
        }
        let raw = Raw { vertices, faces: model.cloths()[0].triangles.clone(), ..Raw::default() };
        sheet = Cloth { grid: None, mesh: Some("jittered".to_owned()), loaded: Some(Arc::new(raw)), ..sheet };
    }
    build(sheet)
}

fn build(sheet: Cloth) -> Model {
    ModelBuilder::new(&Scene::<Nothing> { cloth: vec![sheet], ..Scene::default() }).unwrap().build()
}

/// ω L² √(ρ/D) of the softest modes of out-of-plane stiffness `k`.
fn frequencies(model: &Model, k: impl Fn(usize, usize) -> f64) -> [f64; 3] {
    let mass = model.masses(model.params().values());
    let n = model.n_nodes();
    let stiffness = DMatrix::from_fn(n, n, |i, j| k(i, j) / (mass[i] * mass[j]).sqrt());
    let mut squares: Vec<f64> = stiffness.symmetric_eigenvalues().iter().copied().collect();
    squares.sort_by(f64::total_cmp);
    assert!(squares[2].abs() < 1e-6 * squares[3], "three rigid motions: {squares:?}");
    [3, 4, 5].map(|k| squares[k].sqrt())
}

/// Stiffness of the sheet's own law.
fn of_plate(model: &Model) -> [f64; 3] {
    of_plate_at(model, 0.3)
}

fn of_plate_at(model: &Model, nu: f64) -> [f64; 3] {
    let (n, v) = (model.n_nodes(), vec![0.0; model.nv()]);
    let mut theta = model.params().values().to_vec();
    theta[model.params().find("sheet.poisson_ratio").unwrap()] = nu;
    let at = Point { q: model.initial_positions(), v: &v, theta: &theta };
    let matrix = || NodeMatrix::band(n, n - 1);
    let (mut f, mut dq, mut dv) = (v.clone(), matrix(), matrix());
    let plate = model.terms().iter().find(|t| t.name() == "plate").unwrap();
    plate.add_jacobian(&at, &mut f, &mut dq, &mut dv);
    frequencies(model, |i, j| -dq.get(3 * i + 2, 3 * j + 2))
}

/// Stiffness of hinges, ½ k ψ² at every edge with k = D |e|²/(A₁ + A₂).
fn of_hinges(model: &Model) -> [f64; 3] {
    let x: Vec<Vec3<f64>> = model.initial_positions().chunks(3).map(Vec3::from_column_slice).collect();
    let triangles = &model.cloths()[0].triangles;
    let area = |t: &[usize; 3]| 0.5 * (x[t[1]] - x[t[0]]).cross(&(x[t[2]] - x[t[0]])).norm();
    let mut stiffness = DMatrix::<f64>::zeros(x.len(), x.len());
    for (t, one) in triangles.iter().enumerate() {
        for two in &triangles[t + 1..] {
            let shared: Vec<usize> = one.iter().copied().filter(|i| two.contains(i)).collect();
            let [p, q] = shared[..] else { continue };
            let third = |t: &[usize; 3]| t.iter().copied().find(|i| *i != p && *i != q).unwrap();
            let nodes = [p, q, third(one), third(two)];
            let slopes = fold(&nodes.map(|i| x[i])).1;
            let k = (x[q] - x[p]).norm_squared() / (area(one) + area(two));
            for (i, g) in nodes.iter().zip(&slopes) {
                for (j, h) in nodes.iter().zip(&slopes) {
                    stiffness[(*i, *j)] += k * g[2] * h[2];
                }
            }
        }
    }
    frequencies(model, |i, j| stiffness[(i, j)])
}

/// Relative errors of the three frequencies.
fn errors(found: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| found[k] / FREE_SQUARE[k] - 1.0)
}

#[test]
fn a_free_square_sheet_has_the_frequencies_of_a_plate() {
    for diagonal in [Diagonal::Up, Diagonal::Down] {
        let [coarse, middle, fine] = [6, 12, 24].map(|cells| errors(of_plate(&sheet(cells, diagonal, 0.0))));
        println!("{diagonal:?}: {coarse:.4?} {middle:.4?} {fine:.4?}");
        for k in 0..3 {
            let fall = middle[k] / fine[k];
            assert!(fine[k].abs() < 0.01 && (3.5..4.5).contains(&fall), "second order: {middle:?} {fine:?}");
        }
    }
}

/// Cells cut in turn resist twist twice as much as a plate, cells of changing shape a little more: what docs/cloth.md says.
#[test]
fn other_meshes_are_stiffer_in_twist_and_never_soft() {
    let alternate = errors(of_plate(&sheet(24, Diagonal::Alternating, 0.0)));
    let jittered = [12, 24].map(|cells| errors(of_plate(&sheet(cells, Diagonal::Up, 0.2))));
    println!("alternate {alternate:.4?}, jittered {jittered:.4?}");
    assert!((0.4..0.5).contains(&alternate[0]) && alternate[2].abs() < 0.01);
    assert!(jittered[1].iter().all(|e| (-0.02..0.1).contains(e)), "{jittered:?}");
}

/// Why bending is not a hinge at every edge: against the sheet's own law at ν = 0 (hinges know no ν), frequencies are off whatever the
/// mesh's fineness.
#[test]
fn hinges_stay_too_stiff() {
    for diagonal in [Diagonal::Up, Diagonal::Alternating] {
        let plate = of_plate_at(&sheet(24, Diagonal::Up, 0.0), 0.0);
        let found = of_hinges(&sheet(24, diagonal, 0.0));
        let off = [0, 1, 2].map(|k| found[k] / plate[k] - 1.0);
        println!("hinges {diagonal:?}: {off:.3?}");
        assert!(off.iter().any(|off| off.abs() > 0.1), "{off:?}");
    }
}

/// A wide sheet is factored sparsely unless the scene says otherwise, and moves the same.
#[test]
fn a_wide_sheet_takes_the_sparse_factors() {
    use pliant_engine::rollout::rollout;
    use pliant_engine::step::StepOptions;
    use pliant_scene::{LinearSolver, Nothing, control_rows, parse_scene};
    let text = "
        schema_version = 1
        [time]
        step = 0.005
        [[cloth]]
        name = \"sheet\"
        grid = { nodes = [18, 18], size = [0.2, 0.2] }
        thickness = 1.0e-3
        density = 300.0
        youngs_modulus = 1.0e5
        [[gripper]]
        name = \"hand\"
        cloth = \"sheet\"
        nodes = [0, 17, 18, 35]
    ";
    let run = |linear: LinearSolver| {
        let mut scene = parse_scene::<Nothing>(text, "sheet.toml").unwrap();
        scene.solver.linear = linear;
        let model = std::sync::Arc::new(pliant_engine::model::ModelBuilder::new(&scene).unwrap().build());
        let (theta, u) = (model.params().values().to_vec(), control_rows(&scene, 4).unwrap());
        let options = StepOptions { record: false, ..StepOptions::default() };
        rollout(&model, &theta, &model.initial_state(), &u, options).unwrap().states[4].q.clone()
    };
    let [auto, sparse, band] = [LinearSolver::Auto, LinearSolver::Sparse, LinearSolver::Band].map(run);
    assert_eq!(auto, sparse);
    let apart = sparse.iter().zip(&band).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-11 && auto != band, "{apart:e}");
}
