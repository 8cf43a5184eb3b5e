//! Verdict, reason and advice.

use super::constants::DIAGNOSE;
use super::reason;
use super::result::*;
use super::scores::Scores;
use super::selection::{Name, Selection, name};
use crate::number::share;

/// Whether accepted causes leave too much that is significant; of a cause whose size surely varies more is asked.
fn takes_too_little(remainder: &Remainder, varying: bool) -> bool {
    let enough = if varying { DIAGNOSE.enough_though_varying } else { DIAGNOSE.enough };
    remainder.significant && remainder.explained_fraction < enough
}

pub(super) fn set_alternatives(d: &mut Diagnosis, sets: &[Vec<Name>]) {
    d.alternatives = sets.iter().map(|set| set.iter().map(|(name, _)| name.clone()).collect()).collect();
    d.alternative_objects = sets.iter().map(|set| set.iter().map(|(_, object)| object.clone()).collect()).collect();
}

/// Verdict, reason and advice.
pub(super) fn decide(
    d: &mut Diagnosis,
    run: &Selection,
    first: &Scores,
    converged: bool,
    imitated: Option<f64>,
    numerical_part: f64,
) {
    let names: Vec<String> = d.causes.iter().map(Cause::title).collect();
    let titles = d.alternative_titles();
    let little =
        !run.accepted.is_empty() && takes_too_little(&d.remainder, run.varying().is_some_and(|(_, p)| p < DIAGNOSE.surely));
    let open = little && !run.ambiguous.is_empty() && !d.remainder.by_input && imitated.is_none();
    (d.verdict, d.reason) = if !converged {
        (Verdict::Withheld, "the baseline fit did not converge; nothing built on it can be trusted".to_owned())
    } else if open {
        let reason = format!(
            "{} takes {} of what can be explained, but what remains is significant and fits several causes equally well: {}",
            names.join(" with "),
            share(d.remainder.explained_fraction),
            titles.concat().join(", ")
        );
        (Verdict::Ambiguous, reason)
    } else if little {
        let reason = if run.spread.is_some() {
            reason::together(&run.accepted.iter().map(|a| a.cause.title()).collect::<Vec<_>>(), &d.remainder, &d.noise)
        } else {
            format!(
                "{} fits best, but takes {} of what can be explained, and the rest is significant ({}): something outside the library",
                names.join(" with "),
                share(d.remainder.explained_fraction),
                d.remainder.note
            )
        };
        (Verdict::NotInLibrary, reason)
    } else if let Some((set, reason)) = run.only_equivalents() {
        set_alternatives(d, &[set]);
        (Verdict::Ambiguous, reason)
    } else if !run.accepted.is_empty() || (!d.causes.is_empty() && (!d.remainder.significant || numerical_part > DIAGNOSE.enough))
    {
        let margins = run.accepted.iter().filter_map(|a| Some((a.cause.title(), a.margin.as_ref()?)));
        (Verdict::Named, reason::named(&d.causes, margins, &d.gain))
    } else if let (Some(taken), Some(set)) = (imitated, titles.first()) {
        let reason = format!(
            "{} fit equally well, but take {} of what can be explained, and the rest still depends on the inputs, asks for another \
             size in every part of the records, or is far more than noise: something outside the library",
            set.join(", "),
            share(taken)
        );
        (Verdict::NotInLibrary, reason)
    } else if let Some(set) = titles.first() {
        (Verdict::Ambiguous, format!("{} explain the data equally well", set.join(", ")))
    } else if run.rejected || d.remainder.significant {
        (Verdict::NotInLibrary, "something significant is there, and no cause of the library is accepted for it".to_owned())
    } else if let Some(reason) = reason::unlike_noise(&d.noise, &d.remainder) {
        (Verdict::NotInLibrary, reason)
    } else {
        (Verdict::Adequate, reason::adequate(&d.noise, &d.remainder))
    };
    if open && d.verdict == Verdict::Ambiguous {
        let accepted = run.accepted.iter().map(|a| name(&a.cause));
        let set = accepted.chain(run.alternatives().concat()).collect();
        set_alternatives(d, &[set]);
    }
    if d.verdict != Verdict::Named {
        let causes = std::mem::take(&mut d.causes);
        if run.spread.is_some() && d.verdict == Verdict::NotInLibrary {
            d.extension = causes.into_iter().filter(|c| c.name != reason::DISCRETISATION).collect();
        }
    }
    let wanted: Vec<&String> = d.alternatives.iter().flatten().collect();
    d.advice = first
        .causes
        .iter()
        .filter(|c| wanted.iter().any(|w| *w == c.name))
        .map(|c| format!("{}: {}", c.name, c.excitation))
        .collect();
    d.advice.dedup();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_whose_size_varies_has_to_explain_more() {
        let left = |explained_fraction: f64, significant: bool| Remainder {
            significant,
            by_input: false,
            rmse: 1e-3,
            unit: "rad".to_owned(),
            explained_fraction,
            note: String::new(),
        };
        assert!(takes_too_little(&left(0.95, true), true) && !takes_too_little(&left(0.95, true), false));
        assert!(takes_too_little(&left(0.85, true), false) && !takes_too_little(&left(0.999, true), true));
        assert!(!takes_too_little(&left(0.5, false), true));
    }
}
