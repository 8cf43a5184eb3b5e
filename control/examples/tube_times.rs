//! Times of tubes and observers: `cargo run --release -p pliant-control --example tube_times [rope|chain|light]`.
//!
//! Nominal problems are solved by Clarabel, from scratch each time; the columns named "nominal" are its times, not this crate's.
#![allow(clippy::unwrap_used)]

#[path = "tube_times/chain.rs"]
mod chain;
#[path = "tube_times/light.rs"]
mod light;
#[path = "../tests/suite/problems.rs"]
#[allow(dead_code)]
mod problems;
#[path = "../tests/suite/reference.rs"]
#[allow(dead_code)]
mod reference;
#[path = "tube_times/rope.rs"]
mod rope;

use std::time::Instant;

/// Least time of 15 runs \[ms\]: what others do on the machine only adds.
fn least(mut run: impl FnMut()) -> f64 {
    let times = (0..15).map(|_| {
        let started = Instant::now();
        run();
        started.elapsed().as_secs_f64() * 1e3
    });
    times.fold(f64::INFINITY, f64::min)
}

/// Runs on a number of threads.
fn with_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(run),
        Err(error) => {
            eprintln!("{error}; on all threads instead");
            run()
        }
    }
}

fn main() {
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let wanted = |name: &str| asked.is_empty() || asked.iter().any(|asked| asked == name);
    if wanted("rope") {
        rope::run();
    }
    if wanted("chain") {
        chain::run();
    }
    if wanted("light") {
        light::run();
    }
}
