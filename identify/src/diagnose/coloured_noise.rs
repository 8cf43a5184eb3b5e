//! A second look where no score is significant, but the residual is more than the sensors' noise.
//!
//! A residual that is mostly one slow cause has that cause's colour, and a noise model fitted to it takes the cause for noise: an
//! encoder's zero off by forty standard deviations was lost so, and the model called adequate. [`crate::stats::colour`] asks whether
//! a cause takes the colour away with it. What passes is refitted and compared as after any other test, by scores without colour.

use super::constants::DIAGNOSE;
use super::scores::{raw, scores};
use super::select::{Round, compare};
use crate::error::IdentifyError;
use crate::fit::{FitOptions, Fitted};
use crate::shooting::Plan;
use crate::stats::ar::ArModel;
use crate::stats::colour::{ColourOptions, RawRows, colour_test};

/// Round that follows the coloured-noise test, with the score test it refers to; `None` where no cause passes.
pub(super) fn coloured_noise(
    plan: &Plan,
    current: &Fitted,
    sensor_sigma: f64,
    options: &FitOptions,
    seed: u64,
    notes: &mut Vec<(usize, String)>,
    progress: &mut dyn FnMut(&str),
) -> Result<Option<(Round, super::scores::Scores)>, IdentifyError> {
    if current.noise.order() == 0 || current.rmse <= DIAGNOSE.coloured_excess * sensor_sigma {
        return Ok(None);
    }
    progress("looking again for what may have been taken for coloured noise");
    let noise = &current.noise;
    let stationary = noise.sigma().iter().map(|s| s * noise.stationary_ratio()).collect();
    let white = Fitted { noise: ArModel::white(stationary)?, ..current.clone() };
    let tested = scores(plan, &white, seed)?;
    let (shots, candidates) = raw(plan, current, &tested, DIAGNOSE.coloured_readings)?;
    let columns = shots.first().map_or(0, |s| s.global.len() / s.residual.len().max(1));
    let rows: Vec<RawRows> = shots
        .iter()
        .map(|s| RawRows {
            residual: &s.residual,
            own: &s.own,
            own_columns: s.own_columns,
            global: &s.global,
            global_columns: columns,
        })
        .collect();
    let nuisance: Vec<usize> = (0..current.unknowns.len()).collect();
    let found = colour_test(&rows, noise, &nuisance, &candidates, &ColourOptions { seed, ..ColourOptions::default() })?;
    let passed: Vec<usize> = found.iter().filter(|f| f.p <= DIAGNOSE.coloured_level).map(|f| f.candidate).collect();
    if passed.is_empty() {
        return Ok(None);
    }
    let tried: Vec<usize> = found.iter().map(|f| f.candidate).collect();
    let mut rejected = Vec::new();
    let round = compare(plan, current, &tested, &tried, options, &mut rejected, progress)?;
    let named: Vec<usize> = match &round {
        Round::Accepted { candidate, .. } => vec![*candidate],
        Round::Ambiguous { set, .. } => set.clone(),
        Round::Rejected | Round::Nothing => return Ok(None),
    };
    if !named.iter().any(|j| passed.contains(j)) {
        return Ok(None);
    }
    for f in found.iter().filter(|f| named.contains(&f.candidate)) {
        notes.push((
            f.candidate,
            format!("its score is lost in the residual's colour; it takes that colour away (p = {:.2e})", f.p),
        ));
    }
    Ok(Some((round, tested)))
}
