//! The simulation's own errors, in time and in space, among the candidates.

use super::reason;
use super::result::*;
use crate::causes::{Discretisation, Spacing, TOLERATED};

/// Name of the finding on node spacing; never a cause.
const SPACING: &str = "node_spacing";

/// Adds both to the candidates (the second only where there are ropes), and a step that is too coarse for these data to the causes.
pub(super) fn report(d: &mut Diagnosis, numerics: &Discretisation, edges: Option<Option<&Spacing>>, h: f64) {
    let reason = format!(
        "the simulation's own error at h = {h} s is {:.2e} {}, {:.1} % of the residual",
        numerics.rms,
        d.remainder.unit,
        100.0 * numerics.ratio
    );
    d.candidates.push(candidate(reason::DISCRETISATION, Some((numerics.ratio, numerics.step_needed)), "s", reason));
    let worded = |edges: Option<&Spacing>| match edges {
        Some(e) => format!(
            "halving every edge moves the readings by {:.2e} m, {:.1} % of the residual ({:.1} times the edges would bring their error \
             to a tenth of it); that says what a finer rope would do, not that the data want one",
            e.change,
            100.0 * e.ratio * (1.0 - 0.5f64.powi(e.order)),
            e.edges_needed
        ),
        None => "a rope of edges half as long cannot be simulated at this step".to_owned(),
    };
    if let Some(edges) = edges {
        d.candidates.push(candidate(SPACING, edges.map(|e| (e.ratio, e.edges_needed)), "-", worded(edges)));
    }
    if numerics.ratio > TOLERATED {
        d.causes.push(too_coarse(numerics, h));
    }
}

/// The step length as a cause. Richardson extrapolation gives the length that would do, and no interval of it.
fn too_coarse(numerics: &Discretisation, h: f64) -> Cause {
    Cause {
        name: reason::DISCRETISATION.to_owned(),
        object: None,
        meaning: "the simulation's step is too coarse for these data".to_owned(),
        parameters: vec![Estimate {
            path: "time.step".to_owned(),
            estimate: numerics.step_needed,
            unit: "s".to_owned(),
            interval: None,
            scene_value: h,
        }],
        statistic: numerics.ratio,
        constancy_p: None,
        rivals: Vec::new(),
    }
}

/// `found`: the error as a part of the residual, and the refinement that would bring it to [`TOLERATED`].
fn candidate(name: &str, found: Option<(f64, f64)>, unit: &str, reason: String) -> CandidateReport {
    CandidateReport {
        name: name.to_owned(),
        object: None,
        status: if found.is_some() { Status::Tested } else { Status::Untestable },
        statistic: found.map(|f| f.0),
        dof: 0,
        p_value: None,
        absorbed_fraction: None,
        smallest_detectable: None,
        one_step: found.map(|f| f.1).into_iter().collect(),
        unit: unit.to_owned(),
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_that_would_do_has_no_interval() {
        let cause = too_coarse(&Discretisation { rms: 1e-4, ratio: 0.4, step_needed: 1e-3, order: 2 }, 2e-3);
        let step = &cause.parameters[0];
        assert_eq!((step.estimate, step.scene_value, step.interval), (1e-3, 2e-3, None));
        assert!(serde_json::to_value(step).is_ok_and(|json| json["interval"].is_null()));
    }
}
