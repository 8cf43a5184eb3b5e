//! Records that contradict each other: the simulation makes the same motion of both, and the readings differ.
//!
//! Of two runs that begin alike under the same commands whatever the scene gets wrong is wrong alike: with the readings y, the simulation
//! ŷ and r = y − ŷ (each channel in units of its scatter),
//! ```text
//! |ŷ₁ − ŷ₂| ≤ a |ŷ₁ − mean(ŷ₁)|   ⇒   r₁ ≈ r₂
//! ```
//! whatever the law behind them. Where the residuals differ by more than they are large, something differs between the runs that the scene
//! does not know of. A motion that amplifies small differences does so in the simulation too, and then the two are no such pair. The
//! simulated reading of a sensor of orientation is the turn from the measured one, so runs that differ in it are no such pair either.

use super::super::gain::prepared;
use super::super::policy::POLICY;
use super::super::procedure::Bench;
use super::super::result::AuditFinding;
use crate::fit::{FitOptions, Fitted};
use crate::shooting::{RecordPlan, ShotWants, shoot};
use rayon::prelude::*;

/// A measured record in units of the scatter: rows (time, channel).
struct Seen {
    name: String,
    channels: usize,
    simulated: Vec<f64>,
    residual: Vec<f64>,
}

/// Pairs of records that contradict each other, each record once.
pub(in super::super) fn contradictions(bench: &Bench, fitted: &Fitted) -> Vec<AuditFinding> {
    let records = seen(bench, fitted);
    let mut out = Vec::new();
    for (k, later) in records.iter().enumerate() {
        let apart = records[..k].iter().filter_map(|earlier| Some((earlier, contradiction(earlier, later)?)));
        let worst = apart.max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((earlier, times)) = worst else { continue };
        out.push(AuditFinding {
            severity: "warning".to_owned(),
            record: later.name.clone(),
            place: "Record".to_owned(),
            time_s: None,
            what: format!(
                "contradicts {}: the simulation makes the same motion of both, and their readings differ by {} times the scatter",
                earlier.name,
                times.round()
            ),
            number: times,
            unit: "times the scatter".to_owned(),
            advice: "something differs between the two runs that the scene does not have (a load, a set-up, a temperature), or one log is \
                     of another run: set it aside, or describe the difference"
                .to_owned(),
        });
    }
    out
}

/// By how many times the scatter the readings of two records differ beyond the simulation, if that makes the same motion of both.
fn contradiction(a: &Seen, b: &Seen) -> Option<f64> {
    let rows = a.residual.len().min(b.residual.len());
    let both = |k: &usize| a.residual[*k] != 0.0 && b.residual[*k] != 0.0;
    let shared: Vec<usize> = (0..rows).filter(both).collect();
    let rms =
        |of: &dyn Fn(usize) -> f64| (shared.iter().map(|&k| of(k) * of(k)).sum::<f64>() / shared.len().max(1) as f64).sqrt();
    let mean = means(a, &shared);
    let motion = rms(&|k| a.simulated[k] - mean[k % a.channels]);
    let alike = rms(&|k| a.simulated[k] - b.simulated[k]) <= POLICY.same_motion * motion;
    let differ = rms(&|k| a.residual[k] - b.residual[k]);
    let large = rms(&|k| a.residual[k]).max(rms(&|k| b.residual[k]));
    (alike && differ > std::f64::consts::SQRT_2 * POLICY.no_noise && differ > large).then_some(differ)
}

/// Mean simulated reading of every channel.
fn means(of: &Seen, rows: &[usize]) -> Vec<f64> {
    let one = |c: usize| {
        let own = || rows.iter().filter(|&&k| k % of.channels == c);
        own().map(|&k| of.simulated[k]).sum::<f64>() / own().count().max(1) as f64
    };
    (0..of.channels).map(one).collect()
}

/// All measured records, those held out too, each begun from its lead-in: fitted starts would make up for what contradicts. A record that
/// cannot be followed from there contradicts none.
fn seen(bench: &Bench, fitted: &Fitted) -> Vec<Seen> {
    let (plan, sigma) = (bench.plan, bench.white.sigma());
    let one = |rec: &RecordPlan| -> Option<Seen> {
        let began = prepared(plan, std::slice::from_ref(rec), fitted, &FitOptions::default()).ok()?;
        let shot = shoot(plan, began.first()?, &fitted.values, ShotWants::default()).ok()?;
        let white = |row: &[f64]| row.iter().enumerate().map(|(k, x)| x / sigma[k % sigma.len()]).collect();
        Some(Seen {
            name: rec.record.name.clone(),
            channels: sigma.len(),
            simulated: white(&shot.predicted),
            residual: white(&shot.residual),
        })
    };
    let records: Vec<&RecordPlan> = plan.fitted.iter().chain(&plan.held_out).collect();
    records.par_iter().filter_map(|rec| one(rec)).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::starts::tests::{experiment, pendulum};
    use super::*;
    use crate::fit::fit;
    use crate::stats::ar::ArModel;
    use crate::stats::testing::gaussians;
    use crate::unknown::Unknown;

    const NOISE: f64 = 2e-4;

    /// Pairs that contradict each other among swings of these amplitudes [rad] and angular frequencies [rad/s]; the scene's own is 23.
    fn pairs(swings: &[[f64; 2]]) -> Vec<String> {
        let one = |(k, [amplitude, speed]): (usize, &[f64; 2])| -> Vec<f64> {
            let noise = gaussians(40, 10 + k as u64);
            (0..40).map(|i| amplitude * (speed * 0.01 * f64::from(i)).cos() + NOISE * noise[i as usize]).collect()
        };
        // the last record is held out
        let readings: Vec<Vec<f64>> = swings.iter().chain([&[0.07, 23.0]]).enumerate().map(one).collect();
        let stiff = pendulum("measured").replace("kind = \"revolute\"", "kind = \"revolute\"\nstiffness = 22.9");
        let plan = experiment(&stiff, &readings).0;
        let stiffness = vec![Unknown::of_theta(&plan.model, "pivot.stiffness", 0.1).unwrap()];
        let white = ArModel::white(vec![NOISE]).unwrap();
        let fitted = fit(&plan, &plan.fitted, &plan.scene_values, &stiffness, Some(&white), &POLICY.fine).unwrap();
        let bench = Bench { plan: &plan, declared: stiffness, white };
        let found = contradictions(&bench, &fitted);
        found.into_iter().filter_map(|f| Some(format!("{} {}", f.record, f.what.split_once(':')?.0))).collect()
    }

    #[test]
    fn two_runs_that_begin_alike_and_end_apart_contradict_each_other() {
        let found = pairs(&[[0.1, 22.7], [0.1, 23.3], [0.05, 23.0]]);
        assert_eq!(found, ["run1 contradicts run0"]);
    }

    #[test]
    fn what_the_scene_gets_wrong_alike_is_no_contradiction() {
        // the same error in both, and other starts
        assert!(pairs(&[[0.1, 20.0], [0.1, 20.0], [0.05, 20.0]]).is_empty());
        assert!(pairs(&[[0.1, 20.0], [0.05, 26.0]]).is_empty());
    }
}
