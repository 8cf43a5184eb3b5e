//! Verdict, reason and advice.

use super::listing;
use super::policy::POLICY;
use super::procedure::{Found, Hypothesis};
use super::reason;
use super::remainder::stand_ins;
use super::result::*;
use super::scores::Scores;
use crate::causes::{Cause as Candidate, title};
use crate::shooting::Plan;

/// Name of a cause, and the object it is about.
type Name = (String, Option<String>);

fn name(cause: &Candidate) -> Name {
    (cause.name.to_owned(), cause.object.clone())
}

/// A cause with those that no data of this kind can tell from it.
fn with_equivalents(found: &Found, cause: &Candidate) -> Vec<Name> {
    let place = found.best.causes.iter().position(|own| own.title() == cause.title());
    let known = cause.equivalents.iter().map(|other| ((*other).to_owned(), cause.object.clone()));
    let alike = place.and_then(|k| found.alike.get(k)).into_iter().flatten().map(name);
    let mut out = vec![name(cause)];
    for other in known.chain(alike) {
        if !out.contains(&other) {
            out.push(other);
        }
    }
    out
}

/// The causes in which models that cannot be told apart differ, those of the best one first; and each accepted cause with its equivalents.
fn alternatives(found: &Found) -> Vec<Vec<Name>> {
    let all: Vec<&Hypothesis> = std::iter::once(&found.best).chain(&found.tied).collect();
    let everywhere = |title: &str| all.iter().all(|model| model.causes.iter().any(|cause| cause.title() == title));
    let mut set: Vec<Name> = Vec::new();
    for cause in all.iter().flat_map(|model| &model.causes).filter(|cause| !everywhere(&cause.title())) {
        for one in with_equivalents(found, cause) {
            if !set.contains(&one) {
                set.push(one);
            }
        }
    }
    let shared = found.best.causes.iter().filter(|cause| everywhere(&cause.title()));
    let equal = shared.map(|cause| with_equivalents(found, cause)).filter(|set| set.len() > 1);
    let sets = (!found.tied.is_empty() && set.len() > 1).then_some(set);
    sets.into_iter().chain(equal).collect()
}

/// Whether the simulation's own error is part of what is left that counts.
fn counts(n: &&Numerics) -> bool {
    n.gain > POLICY.per_number && n.part > POLICY.tolerated
}

/// Whether the error of the step is larger than all that is left: taken off to first order it leaves errors of its own, which are no physics.
fn swamps(n: &Numerics) -> bool {
    n.kind == NumericsKind::Step && n.part > 1.0
}

/// Whether the simulation's own error may be what is left, though the data are not nearer to a finer simulation at these values: it is larger, and what is
/// fitted does not make up for it.
fn may_be_all(n: &&Numerics) -> bool {
    n.kind != NumericsKind::Inputs && n.part > 1.0 && n.beyond > POLICY.tolerated && !counts(n)
}

/// Whether something outside the library is behind the causes: what is left is significant; or a size differs from record to record, which a law
/// that lacks something does as well, and what is left has a form besides that is not small beside what the cause takes.
fn beyond(d: &Diagnosis) -> bool {
    let form = d.remainder.forms.iter().map(|form| form.taken).fold(0.0, f64::max);
    let mut varying = d.causes.iter().filter(|cause| !cause.sizes.is_empty());
    d.remainder.significant || varying.any(|cause| form > POLICY.varies_for * cause.statistic)
}

/// Verdict, reason and advice. `untrusted`: why nothing that was found can be trusted, if so; `before`: a diagnosis with the scene's own
/// simulation, where this one is finer, and how.
pub(super) fn decide(
    d: &mut Diagnosis,
    plan: &Plan,
    found: &Found,
    first: &Scores,
    untrusted: Option<String>,
    before: Option<(String, &Diagnosis)>,
) {
    let sets = alternatives(found);
    d.alternatives = sets.iter().map(|set| set.iter().map(|(name, _)| name.clone()).collect()).collect();
    d.alternative_objects = sets.iter().map(|set| set.iter().map(|(_, object)| object.clone()).collect()).collect();
    let own: Vec<Numerics> = d.numerics.iter().filter(counts).cloned().collect();
    let beyond = beyond(d);
    let approximate = if beyond { Vec::new() } else { set_apart(d) };
    let titles = d.alternative_titles();
    (d.verdict, d.reason) = if let Some(why) = untrusted {
        (Verdict::Withheld, why)
    } else if d.causes.is_empty() {
        without_cause(d, found, &own)
    } else if beyond {
        (Verdict::NotInLibrary, reason::approximated(&d.causes, &d.remainder))
    } else if let Some(set) = titles.first() {
        let accepted: Vec<String> = d.causes.iter().map(Cause::title).filter(|t| !titles.concat().contains(t)).collect();
        let by_any = found.tied.is_empty();
        let refitted = listing::refitted(plan, found, set);
        (Verdict::Ambiguous, reason::ambiguous(set, &accepted, by_any, &refitted))
    } else if let Some(varying) = d.causes.iter().find(|c| !c.sizes.is_empty()) {
        (Verdict::Varies, reason::varies(&d.causes, &varying.title()))
    } else {
        (Verdict::Named, reason::named(&d.causes, &d.gain))
    };
    if !d.causes.is_empty() {
        reason::add(&mut d.reason, &reason::stand_ins(&approximate));
        reason::add(&mut d.reason, &reason::own_error(&own));
    }
    if d.verdict == Verdict::NotInLibrary {
        let coarse: Vec<Numerics> = d.numerics.iter().filter(may_be_all).cloned().collect();
        reason::add(&mut d.reason, &reason::coarse(&coarse));
    }
    if let Some((finer, before)) = &before {
        let told = before.numerics.iter().any(|n| n.gain > POLICY.per_number) || before.verdict != Verdict::Adequate;
        if d.verdict == Verdict::Adequate && told {
            d.verdict = Verdict::Numerics;
        }
        // of the other ways to read inputs that which was taken
        let way = d.refined.as_ref().map(|by| by.interpolation);
        let taken = |n: &&Numerics| n.kind != NumericsKind::Inputs || n.interpolation == way;
        let coarse: Vec<&Numerics> = before.numerics.iter().filter(counts).filter(taken).collect();
        let finer = reason::refined(finer, &coarse, d.verdict == Verdict::NotInLibrary);
        reason::add(&mut d.reason, &finer);
    }
    d.extension = match d.verdict {
        Verdict::Named | Verdict::Varies => approximate,
        Verdict::Ambiguous => {
            // those stay that stand whichever of the alternatives is right
            d.causes.retain(|cause| !titles.concat().contains(&cause.title()));
            approximate
        }
        Verdict::NotInLibrary => std::mem::take(&mut d.causes),
        Verdict::Numerics | Verdict::Adequate | Verdict::Withheld => {
            d.causes.clear();
            Vec::new()
        }
    };
    if d.verdict != Verdict::Ambiguous {
        (d.alternatives, d.alternative_objects) = (Vec::new(), Vec::new());
    }
    let wanted: Vec<String> = d.alternative_titles().concat();
    let all = first.causes.iter().filter(|c| wanted.contains(&title(c.name, c.object.as_deref())));
    d.advice = all.map(|c| format!("{}: {}", c.name, c.excitation)).collect();
    d.advice.dedup();
}

/// Takes out the causes that may stand in for what is left, and the sets of alternatives that are about nothing else.
fn set_apart(d: &mut Diagnosis) -> Vec<Cause> {
    let statistics: Vec<f64> = d.causes.iter().map(|c| c.statistic).collect();
    let mut may = stand_ins(&statistics, &d.remainder.forms).into_iter();
    let (apart, causes): (Vec<Cause>, Vec<Cause>) =
        std::mem::take(&mut d.causes).into_iter().partition(|_| may.next() == Some(true));
    d.causes = causes;
    let about: Vec<bool> = d.alternative_titles().iter().map(|set| d.causes.iter().any(|c| set.contains(&c.title()))).collect();
    let mut own = about.iter();
    d.alternatives.retain(|_| own.next() == Some(&true));
    let mut own = about.iter();
    d.alternative_objects.retain(|_| own.next() == Some(&true));
    apart
}

/// Where no cause is accepted.
fn without_cause(d: &Diagnosis, found: &Found, own: &[Numerics]) -> (Verdict, String) {
    let imitated: Vec<String> = found.imitated.iter().map(|(title, _)| title.clone()).collect();
    if d.remainder.significant && !own.iter().any(swamps) {
        (Verdict::NotInLibrary, reason::unexplained(&d.remainder))
    } else if !own.is_empty() || !imitated.is_empty() {
        let kinds: Vec<NumericsKind> = found.imitated.iter().map(|(_, kind)| *kind).collect();
        let behind = d.numerics.iter().filter(|n| own.contains(n) || kinds.contains(&n.kind));
        (Verdict::Numerics, reason::numerics(&behind.collect::<Vec<_>>(), &imitated))
    } else {
        (Verdict::Adequate, reason::adequate(&d.noise, &d.remainder))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    /// A law with another size in every record is the right one only if nothing is left of a form.
    #[test]
    fn a_size_that_varies_over_a_form_is_no_name() {
        let mut d = sample::diagnosis();
        d.remainder.significant = false;
        d.remainder.forms = vec![RemainderForm { taken: 0.01 * d.causes[0].statistic, ..RemainderForm::default() }];
        assert!(!beyond(&d));
        d.causes[0].sizes = vec![RecordSize { record: "run1.csv".into(), size: 0.1 }];
        assert!(beyond(&d));
        d.remainder.forms[0].taken *= 0.1;
        assert!(!beyond(&d));
        d.remainder.forms.clear();
        assert!(!beyond(&d));
        d.remainder.significant = true;
        assert!(beyond(&d));
    }

    /// What is left that is smaller than the error of the step says nothing about physics; what is larger does, as does any beside inputs read otherwise.
    #[test]
    fn an_error_of_the_step_swamps_what_is_smaller() {
        let own = |kind, part| Numerics {
            kind,
            part,
            beyond: part,
            interpolation: None,
            rms: 1e-3,
            unit: "rad".into(),
            gain: 500.0,
            needed: None,
            note: String::new(),
        };
        assert!(swamps(&own(NumericsKind::Step, 2.1)));
        assert!(!swamps(&own(NumericsKind::Step, 0.9)) && !swamps(&own(NumericsKind::Inputs, 2.1)));
    }

    /// Where more than all that is left could be the mesh's, the reader looks there first.
    #[test]
    fn a_mesh_that_may_be_all_that_is_left_is_said() {
        let mesh = |part: f64, beyond: f64, gain: f64| Numerics {
            kind: NumericsKind::Mesh,
            part,
            beyond,
            interpolation: None,
            rms: 0.0138,
            unit: "m".into(),
            gain,
            needed: Some(86.0),
            note: "the length of the edges moves the readings by 13.8 mm".into(),
        };
        assert!(may_be_all(&&mesh(8.6, 0.24, -8.0)));
        assert!(![mesh(0.9, 0.24, -8.0), mesh(8.6, 0.05, -8.0), mesh(8.6, 0.24, 500.0)].iter().any(|n| may_be_all(&n)));
        let said = reason::coarse(&[mesh(8.6, 0.24, -8.0)]);
        assert!(said.contains("13.8 mm") && said.contains("if it is, it falls with edges half as long"), "{said}");
    }

    /// A weak cause that what is left may be behind goes, and what it could be taken for; a strong one and its rivals stay.
    #[test]
    fn weak_causes_are_set_apart_with_their_rivals() {
        let mut d = sample::diagnosis();
        let of = |name: &str, statistic: f64| Cause { name: name.to_owned(), statistic, ..sample::diagnosis().causes[0].clone() };
        d.causes = vec![of("linear_drag", 9e4), of("tip_mass", 200.0)];
        d.remainder.forms = vec![RemainderForm { taken: 80.0, ..RemainderForm::default() }];
        d.alternatives = vec![vec!["tip_mass".into(), "wind".into()], vec!["linear_drag".into(), "quadratic_drag".into()]];
        d.alternative_objects = vec![vec![None; 2]; 2];
        let apart = set_apart(&mut d);
        let names = |causes: &[Cause]| causes.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
        assert_eq!((names(&apart), names(&d.causes)), (vec!["tip_mass".to_owned()], vec!["linear_drag".to_owned()]));
        assert_eq!((d.alternatives.len(), d.alternative_objects.len(), d.alternatives[0][0].as_str()), (1, 1, "linear_drag"));
        d.remainder.forms.clear();
        assert!(set_apart(&mut d).is_empty() && d.causes.len() == 1);
    }
}
