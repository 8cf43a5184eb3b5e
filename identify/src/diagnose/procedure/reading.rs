//! Whether the data are nearer to inputs that are read in another way between samples.
//!
//! A command that the robot held and the scene reads as straight lines comes half a sample early. A delay or a lag takes that up: with it in the
//! model the right reading is no nearer to the data, and without it it is. What the wrong reading leaves passes for slow noise, under which
//! little counts. So the model is refitted in the other way, without what makes up for it, and both are held against each other under the noise of
//! the one that leaves less.

use super::super::policy::POLICY;
use super::contest::Contest;
use super::hypothesis::Bench;
use super::imitation::makes_up;
use super::search::Found;
use crate::causes::Cause;
use crate::error::IdentifyError;
use crate::fit::Fitted;
use crate::shooting::RecordPlan;
use nalgebra::DVector;

impl Found {
    /// Units of −2 log likelihood by which the data are nearer to inputs read in this of the other ways, `None` where there is nothing that may make
    /// up for it, or that cannot be simulated. `bias`: sizes that make up for it.
    pub fn gain_of_reading(&self, bench: &Bench, way: usize, bias: &DVector<f64>) -> Option<f64> {
        let out = |cause: &Cause| makes_up(bench.plan, &self.fitted, cause, bias);
        let may = bench.over(&self.fitted) > POLICY.larger || self.best.causes.iter().any(out);
        may.then(|| self.read_otherwise(bench, way, &out).ok())?
    }

    fn read_otherwise(&self, bench: &Bench, way: usize, out: &dyn Fn(&Cause) -> bool) -> Result<f64, IdentifyError> {
        let of = |fitted: &Fitted| fitted.records.iter().map(|rec| rec.with_other_inputs(way)).collect::<Vec<RecordPlan>>();
        let mut rest = self.best.clone();
        rest.fitted.records = of(&rest.fitted);
        while let Some(k) = rest.causes.iter().position(out) {
            rest = bench.without(&rest, k)?;
        }
        if rest.causes.len() == self.best.causes.len() {
            rest.fitted = bench.finished(&rest.fitted, &rest.fitted.records)?;
        }
        let scores = Contest::new(bench, &[&self.best, &rest], 2)?.scores;
        Ok(scores[0] - scores[1])
    }
}
