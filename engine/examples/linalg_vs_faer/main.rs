//! Compares the factorizations and solves of [`pliant_linalg`] with faer's on the matrices of given scenes, as a Markdown table:
//! ```text
//! python -m validation.bench.matrices FOLDER
//! cargo run --release -p pliant-engine --example linalg_vs_faer -- FOLDER/*.toml
//! ```
//! The matrix is K of the last stage of a scene's rollout, contacts condensed, as Newton's method factors it. All run in turns on one
//! thread; a ratio is the median over the rounds of faer's time over ours: above 1, ours is faster. faer is given what suits it: scratch
//! memory made once, 32-bit indices, its own storage of the matrix and right-hand sides by columns; and prescribed nodes without
//! their coupling to free ones, which ours includes.

mod matrices;
mod ours;
mod theirs;
mod timing;

use matrices::Case;
use std::error::Error;
use timing::{Comparison, Op, Solver};

fn main() -> Result<(), Box<dyn Error>> {
    println!("| scene | unknowns | solver | refactor | solve | transposed | columns | inverse | kB | residual |");
    println!("|---|---:|---|---:|---:|---:|---:|---:|---:|---:|");
    for file in std::env::args().skip(1) {
        let case = Case::of_scene(&file)?;
        if let Some(bodies) = &case.bodies {
            let mut solvers: Vec<Box<dyn Solver + '_>> = vec![Box::new(ours::Bodies::new(bodies, case.columns)?)];
            solvers.extend(theirs::of_bodies(bodies, case.columns)?);
            compare(&case, solvers);
        }
        if let Some(nodes) = &case.nodes {
            for symbolic in nodes.symbolics()? {
                let ours = || ours::Nodes::new(nodes, &symbolic, case.columns);
                let mut solvers: Vec<Box<dyn Solver + '_>> = vec![Box::new(ours()?), Box::new(ours()?.by_solves())];
                solvers.extend(theirs::of_nodes(nodes, &symbolic, case.columns)?);
                compare(&case, solvers);
            }
        }
    }
    Ok(())
}

/// Prints the times of the first, which is ours, and a row of ratios for each of the others.
fn compare(case: &Case, solvers: Vec<Box<dyn Solver + '_>>) {
    let Some((dim, name)) = solvers.first().map(|ours| (ours.dim(), ours.name())) else { return };
    let found = Comparison::measure(solvers, |op| match op {
        // (derivatives of bodies solve)
        Op::Inverse => name != "dense LU" && dim <= matrices::SMALL,
        Op::Refactor | Op::Solve | Op::SolveTranspose | Op::SolveMany => true,
    });
    let times = found.times.iter().map(|seconds| seconds.map_or("–".into(), |s| format!("{} µs", three_digits(1e6 * s))));
    let columns = format!("{} ({})", times.clone().nth(3).unwrap_or_default(), case.columns);
    let cells: Vec<String> = times.enumerate().map(|(k, cell)| if k == 3 { columns.clone() } else { cell }).collect();
    println!("| {} | {dim} | **{name}** | {} | {:.1} | {:.0e} |", case.name, cells.join(" | "), found.kilobytes, found.residual);
    for other in found.others {
        let cells: Vec<String> = other.ratios.iter().map(|r| r.map_or("–".into(), |r| format!("×{}", three_digits(r)))).collect();
        println!("| | | {} | {} | {:.1} | {:.0e} |", other.name, cells.join(" | "), other.kilobytes, other.residual);
    }
}

fn three_digits(x: f64) -> String {
    let decimals = (2.0 - x.abs().log10().floor()).clamp(0.0, 3.0) as usize;
    format!("{x:.decimals$}")
}
