//! Which hard rows contradict each other, where the interior-point method found no point that satisfies them.

use super::Run;
use super::recursion::Recursion;
use crate::constants::OCP;
use crate::ocp::{Ocp, OcpConstraint, OcpError};

/// Minimises the sum of the violations of all hard rows instead of the cost, with a small term of u that makes it strictly convex. Rows
/// that are violated then contradict rows and bounds that hold with a multiplier; nothing if none is.
pub(super) fn contradiction(ocp: &Ocp, recursion: &mut Recursion) -> Option<OcpError> {
    let elastic = elastic(ocp);
    let mut run = Run::new(&elastic, recursion);
    run.solve().ok()?;
    let solution = run.solution();
    let mut found: Vec<(OcpConstraint, f64)> = Vec::new();
    for (stage, violations) in solution.violations.iter().enumerate() {
        for (row, &by) in violations.iter().enumerate() {
            let limit = elastic.rows(stage).limits[row];
            if by > OCP.contradiction * (1.0 + limit.abs()) && elastic.rows(stage).weights[row] > 0.0 {
                found.push((OcpConstraint::Row { stage, row }, by));
            }
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let by = found.first()?.1;
    let mut constraints: Vec<OcpConstraint> = found.into_iter().map(|(constraint, _)| constraint).collect();
    let acts = |multiplier: f64| multiplier.abs() > OCP.acting;
    for (stage, multipliers) in solution.multipliers.iter().enumerate() {
        let held = (0..multipliers.len()).filter(|&row| acts(multipliers[row])).map(|row| OcpConstraint::Row { stage, row });
        let new: Vec<_> = held.filter(|constraint| !constraints.contains(constraint)).collect();
        constraints.extend(new);
    }
    for (stage, bounds) in solution.bounds.iter().enumerate() {
        constraints.extend((0..bounds.len()).filter(|&input| acts(bounds[input])).map(|input| match bounds[input] < 0.0 {
            true => OcpConstraint::Lower { stage, input },
            false => OcpConstraint::Upper { stage, input },
        }));
    }
    Some(OcpError::Infeasible { constraints, by })
}

/// The problem of least violation: every hard row at the price 1, no soft row, no cost but a small one of u.
fn elastic(ocp: &Ocp) -> Ocp {
    let mut elastic = ocp.clone();
    elastic.q_final.fill(0.0);
    elastic.q_final_linear.fill(0.0);
    for stage in &mut elastic.stages {
        stage.q.fill(0.0);
        stage.s.fill(0.0);
        stage.r.fill(0.0);
        stage.r.diagonal_mut().fill(OCP.elastic);
        stage.q_linear.fill(0.0);
        stage.r_linear.fill(0.0);
    }
    let stages = elastic.stages.iter_mut().map(|stage| &mut stage.rows).chain(std::iter::once(&mut elastic.rows_final));
    for weight in stages.flat_map(|rows| &mut rows.weights) {
        *weight = if weight.is_finite() { 0.0 } else { 1.0 };
    }
    elastic
}
