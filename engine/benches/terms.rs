//! Time of each term on a rope of 20 nodes: force alone, force with Jacobians, slopes to the parameters.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use pliant_engine::terms::{
    Automatic, Bend, BendDamping, BendDampingLaw, BendLaw, Drag, Element, Gravity, Point, Stretch, StretchDamping, StretchLaw,
    Term,
};
use pliant_linalg::NodeMatrix;
use std::hint::black_box;

const NODES: usize = 20;
/// gravity magnitude, tilts; length, density; EA, c_s, EI, c_b; drag linear, quadratic; wind.
const THETA: [f64; 14] = [9.81, 0.01, 0.02, 1.0, 0.05, 1e4, 0.1, 1e-3, 1e-5, 0.01, 0.1, 0.1, 0.2, 0.3];

fn elements(n: usize, params: &[usize]) -> Vec<Element> {
    let fraction = 1.0 / (NODES - 1) as f64;
    let at = |i: usize| Element { nodes: (i..i + n).collect(), params: params.to_vec(), constants: vec![fraction] };
    (0..=NODES - n).map(at).collect()
}

fn terms() -> Vec<(&'static str, Vec<Box<dyn Term>>)> {
    let stretch = || elements(2, &[3, 5]);
    let bend = || elements(3, &[3, 7]);
    let bend_damping = || elements(3, &[3, 8]);
    vec![
        ("gravity", vec![Box::new(Gravity::new(elements(1, &[0, 1, 2, 3, 4])))]),
        ("stretch", vec![Box::new(Stretch::new(stretch()))]),
        ("bend", vec![Box::new(Bend::new(bend()))]),
        ("stretch and bend", vec![Box::new(Stretch::new(stretch())), Box::new(Bend::new(bend()))]),
        ("stretch_damping", vec![Box::new(StretchDamping::new(elements(2, &[3, 6])))]),
        ("bend_damping", vec![Box::new(BendDamping::new(bend_damping()))]),
        ("drag", vec![Box::new(Drag::new(elements(1, &[3, 9, 10, 11, 12, 13])))]),
        ("automatic stretch", vec![Box::new(Automatic::new(StretchLaw, stretch()))]),
        ("automatic bend", vec![Box::new(Automatic::new(BendLaw, bend()))]),
        ("automatic bend_damping", vec![Box::new(Automatic::new(BendDampingLaw, bend_damping()))]),
    ]
}

fn bench(c: &mut Criterion) {
    let q: Vec<f64> = (0..NODES)
        .flat_map(|i| {
            let s = i as f64 / (NODES - 1) as f64;
            [s, 0.1 * (5.0 * s).sin(), 0.05 * (7.0 * s).cos()]
        })
        .collect();
    let v: Vec<f64> = (0..3 * NODES).map(|i| (1.7 * i as f64).sin()).collect();
    let at = Point { q: &q, v: &v, theta: &THETA };
    let zeros = || (vec![0.0; 3 * NODES], NodeMatrix::band(NODES, 2), NodeMatrix::band(NODES, 2));
    for (name, terms) in terms() {
        let mut group = c.benchmark_group(name);
        group.bench_function("force", |b| {
            b.iter_batched_ref(
                zeros,
                |(f, _, _)| terms.iter().for_each(|t| t.add_force(black_box(&at), f)),
                BatchSize::SmallInput,
            );
        });
        group.bench_function("jacobian", |b| {
            let all = |(f, dq, dv): &mut (Vec<f64>, NodeMatrix, NodeMatrix)| {
                terms.iter().for_each(|t| t.add_jacobian(black_box(&at), f, dq, dv));
            };
            b.iter_batched_ref(zeros, all, BatchSize::SmallInput);
        });
        group.bench_function("theta", |b| {
            let sum = || {
                let mut sum = 0.0;
                terms.iter().for_each(|t| t.visit_theta(black_box(&at), &mut |_, _, slope| sum += slope));
                sum
            };
            b.iter(sum);
        });
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
