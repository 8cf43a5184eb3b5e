//! Pullbacks of x ⊕ δx and b ⊖ a, beside differences and each other.

use crate::common::{Case, scene};
use pliant_engine::step::StepOptions;
use pliant_math::State;

const SCENES: [&str; 7] = ["twisting_rod", "ring", "rod_creep", "arm_free", "arm_plastic", "arm_presliding", "windy"];

/// Numbers without a pattern.
fn numbers(n: usize, seed: usize) -> Vec<f64> {
    (0..n).map(|i| ((i * 37 + seed * 11 + 5) as f64 * 0.61).sin()).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A case and the state its rollout ends with.
fn moved(name: &str) -> (Case, State) {
    let case = Case::new(&scene(name), 20);
    let x = case.run(StepOptions { record: false, ..StepOptions::default() }).states.pop().unwrap();
    (case, x)
}

#[test]
fn the_pullback_of_a_displacement_is_that_of_differences() {
    for name in SCENES {
        let (case, x) = moved(name);
        let (x_bar, dx) = (numbers(case.model.nx(), 1), numbers(case.model.ndx(), 2));
        let along = |eps: f64| {
            let step: Vec<f64> = dx.iter().map(|d| eps * 1e-2 * d).collect();
            dot(&case.model.displaced(&x, &step).to_flat(), &x_bar)
        };
        let difference = |eps: f64| (along(eps) - along(-eps)) / (2e-2 * eps);
        let exact = dot(&case.model.pull_displaced(&x, &x_bar), &dx);
        let [coarse, fine] = [2e-3, 1e-3].map(difference);
        let (extrapolated, scale) = ((4.0 * fine - coarse) / 3.0, dot(&x_bar, &x_bar));
        println!("{name}: {exact:.10} {extrapolated:.10}");
        assert!((exact - extrapolated).abs() < 1e-8 * scale, "{name}: {exact} {extrapolated}");
    }
}

/// D E = 1, hence Eᵀ Dᵀ = 1.
#[test]
fn the_pullback_of_a_difference_is_undone_by_that_of_a_displacement() {
    for name in SCENES {
        let (case, x) = moved(name);
        let dx_bar = numbers(case.model.ndx(), 3);
        let back = case.model.pull_displaced(&x, &case.model.pull_difference(&x, &dx_bar));
        let off = dx_bar.iter().zip(&back).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(off < 1e-12, "{name}: {off:e}");
    }
}

/// Axes that are turned by hand, with the reference twists between them, are a change of the twists.
#[test]
fn the_pullback_of_a_difference_sees_axes_that_turn() {
    let (case, x) = moved("twisting_rod");
    let (model, eps) = (&case.model, 1e-5);
    let (n_edges, dx_bar) = (model.rods().n_twists(), numbers(case.model.ndx(), 4));
    let turned = |k: usize, angle: f64| {
        let mut y = x.clone();
        let axes = &mut y.z[model.ndz()..];
        let ([t, ..], _) = model.rods().edge_axes(k, &x.q, axes);
        let d = nalgebra::Vector3::from_column_slice(&axes[3 * k..3 * k + 3]);
        axes[3 * k..3 * k + 3].copy_from_slice((d * angle.cos() + t.cross(&d) * angle.sin()).as_slice());
        y
    };
    for k in 0..n_edges {
        let change = [eps, -eps].map(|angle| dot(&model.difference(&turned(k, angle), &x), &dx_bar));
        let numbers = [eps, -eps].map(|angle| dot(&turned(k, angle).to_flat(), &model.pull_difference(&x, &dx_bar)));
        let [exact, by_numbers] = [change, numbers].map(|[up, down]| (up - down) / (2.0 * eps));
        assert!((exact - by_numbers).abs() < 1e-8, "edge {k}: {exact} {by_numbers}");
    }
}
