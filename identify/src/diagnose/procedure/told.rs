//! Messages of a search while it runs.

use super::hypothesis::{Bench, Hypothesis};
use super::round::Evidence;
use crate::causes::Cause;
use crate::journal::{CauseSoFar, NumberSoFar};
use crate::unknown::Unknown;

/// The causes of the best model so far. `evidence`: of all of them, or of the last.
pub(super) fn accepted(bench: &Bench, best: &Hypothesis, evidence: &[Evidence]) {
    let number = |u: &Unknown| {
        let (path, unit) = (u.path.clone(), u.unit.clone());
        NumberSoFar { path, estimate: u.value(&best.fitted.values), unit }
    };
    let others = best.causes.len().saturating_sub(evidence.len());
    let one = |before: &[CauseSoFar], k: usize, cause: &Cause| {
        let (name, object) = (cause.name.to_owned(), cause.object.clone());
        let known = before.iter().find(|b| b.name == name && b.object == object).and_then(|b| b.statistic);
        let own = k.checked_sub(others).and_then(|k| evidence.get(k)).map(|evidence| evidence.statistic);
        CauseSoFar { name, object, statistic: own.or(known), sizes: cause.unknowns.iter().map(number).collect() }
    };
    bench.plan.journal.causes(|before| best.causes.iter().enumerate().map(|(k, cause)| one(before, k, cause)).collect());
}

/// Those that are left once a cause was taken out again.
pub(super) fn taken_out(bench: &Bench, best: &Hypothesis) {
    let still = |cause: &&CauseSoFar| best.causes.iter().any(|own| own.name == cause.name && own.object == cause.object);
    bench.plan.journal.causes(|before| before.iter().filter(still).cloned().collect());
}
