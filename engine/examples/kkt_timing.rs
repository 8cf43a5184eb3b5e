//! Times the factorizations and solves of all methods for a rope's matrix: `cargo run --release --example kkt_timing -- 20`.

use pliant_engine::kkt::{Factor, KktError, Method, NodeMatrix, Symbolic, Symmetry};
use std::time::Instant;

const COLUMNS: usize = 120;

/// A chain of springs with mass and bending, stiffness over mass as in a cable.
fn rope(n: usize) -> NodeMatrix {
    let mut k = NodeMatrix::band(n, 2);
    let mut add = |i: usize, j: usize, t: [f64; 3], stiffness: f64, soft: f64| {
        let block = std::array::from_fn(|a| std::array::from_fn(|b| stiffness * t[a] * t[b] + if a == b { soft } else { 0.0 }));
        for (r, c, sign) in [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)] {
            k.add_block(r, c, sign, &block);
        }
    };
    for i in 0..n - 1 {
        let angle = 0.1 * i as f64;
        add(i, i + 1, [angle.cos(), angle.sin(), 0.0], 1e4, 3.0);
        if i + 2 < n {
            add(i, i + 2, [angle.cos(), angle.sin(), 0.0], 1.0, 0.7);
        }
    }
    (0..3 * n).for_each(|r| k.add(r, r, 10.0));
    k
}

/// Shortest of many runs [µs].
fn shortest(mut run: impl FnMut()) -> f64 {
    let start = Instant::now();
    let mut best = f64::INFINITY;
    while start.elapsed().as_secs_f64() < 0.3 {
        let begin = Instant::now();
        (0..10).for_each(|_| run());
        best = best.min(begin.elapsed().as_secs_f64() / 10.0);
    }
    best * 1e6
}

fn main() -> Result<(), KktError> {
    let n = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(20_usize).max(3);
    let k = rope(n);
    println!("{n} nodes; microseconds: factor, clone, solve, transposed, {COLUMNS} columns, {COLUMNS} transposed");
    for method in [Method::Band, Method::Dense, Method::Sparse] {
        for symmetry in [Symmetry::General, Symmetry::Symmetric] {
            let symbolic = Symbolic::new(method, symmetry, k.layout(), &vec![false; n])?;
            let mut factor = Factor::new(&symbolic);
            factor.refactor(&k)?;
            let (mut one, mut many) = (vec![1.0; 3 * n], vec![1.0; 3 * n * COLUMNS]);
            let refactor = shortest(|| factor.refactor(&k).unwrap_or(()));
            let clone = shortest(|| drop(std::hint::black_box(factor.clone())));
            let mut fresh = |run: fn(&Factor, &mut [f64])| {
                shortest(|| {
                    one.fill(1.0);
                    run(&factor, &mut one);
                })
            };
            let (solve, transposed) = (fresh(Factor::solve), fresh(Factor::solve_transpose));
            let mut fresh = |run: fn(&Factor, &mut [f64], usize)| {
                shortest(|| {
                    many.fill(1.0);
                    run(&factor, &mut many, COLUMNS);
                })
            };
            let (all, all_transposed) = (fresh(Factor::solve_many), fresh(Factor::solve_transpose_many));
            println!(
                "{:18} {refactor:8.2} {clone:7.2} {solve:7.2} {transposed:7.2} {all:8.1} {all_transposed:8.1}",
                format!("{method:?} {symmetry:?}")
            );
        }
    }
    Ok(())
}
