//! The verdict in words: one sentence, and a summary for a terminal.

use crate::causes::title;
use crate::diagnose::{Ceiling, Diagnosis, Estimate, Gain, NextExperiment, Verdict};
use crate::number::{estimate_of, estimate_plain, number_plain, quantity_plain, share, unit};
use std::fmt::Write;

/// Probability from which an experiment is worth proposing [-].
const WORTH_A_TRY: f64 = 0.2;

/// The verdict as one sentence.
pub fn headline(d: &Diagnosis) -> String {
    let names: Vec<String> = d.causes.iter().map(|cause| words(&cause.title())).collect();
    match d.verdict {
        Verdict::Named if names.len() == 1 => format!("The simulation lacks one thing: {}.", names[0]),
        Verdict::Named => format!("The simulation lacks {} things, which act together: {}.", names.len(), list(&names, "and")),
        Verdict::Ambiguous => {
            let sets = d.alternative_titles();
            let sets = sets.iter().map(|set| list(&set.iter().map(|n| words(n)).collect::<Vec<_>>(), "or"));
            match sets.collect::<Vec<_>>().join("; and ") {
                sets if sets.is_empty() => "Something is missing, and these data do not tell what.".to_owned(),
                sets => format!("Something is missing, and these data do not tell which: {sets}."),
            }
        }
        Verdict::Varies => {
            format!("The simulation lacks {}, whose size differs from record to record.", list(&names, "and"))
        }
        Verdict::Numerics => "What is left is the simulation's own error, and no cause is named.".to_owned(),
        Verdict::NotInLibrary if !d.extension.is_empty() => {
            let found: Vec<String> = d.extension.iter().map(|cause| words(&cause.title())).collect();
            format!(
                "Something is missing that no name is given to; {} {} part of it.",
                list(&found, "and"),
                if found.len() == 1 { "takes" } else { "take" }
            )
        }
        Verdict::NotInLibrary => "Something significant is missing, and none of the known causes explains it.".to_owned(),
        Verdict::Adequate => "The simulation is adequate: nothing significant is left to explain.".to_owned(),
        Verdict::Withheld => "No verdict: this analysis cannot be trusted.".to_owned(),
    }
}

/// One word for the verdict.
pub(super) fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Named => "named",
        Verdict::Ambiguous => "ambiguous",
        Verdict::Varies => "size varies",
        Verdict::Numerics => "own error",
        Verdict::NotInLibrary => "not in the library",
        Verdict::Adequate => "adequate",
        Verdict::Withheld => "withheld",
    }
}

/// Most numbers of a cause that the summary writes out.
const FEW: usize = 4;

/// A short summary for a terminal: verdict, causes, gain, remainder, audit.
pub fn summary(d: &Diagnosis) -> String {
    let mut out = headline(d);
    if !d.reason.is_empty() {
        let _ = write!(out, "\n  {}", sentence(&d.reason)); // a String takes everything
    }
    for cause in &d.causes {
        let _ = write!(out, "\n\n{}: {}", words(&cause.title()), sentence(&cause.meaning));
        for e in &cause.parameters {
            let _ = write!(out, "\n  {}", plain(e));
        }
        for size in &cause.sizes {
            let _ = write!(out, "\n    {}: {}", size.record, number_plain(size.size));
        }
        if let Some(rival) = cause.rivals.first() {
            let _ =
                write!(out, "\n  most similar: {} (cosine {:.2})", titled(&rival.name, rival.object.as_deref()), rival.cosine);
        }
    }
    if !d.extension.is_empty() {
        out += "\n\nthe model is extended by:";
        for cause in &d.extension {
            let _ = write!(out, "\n  {}: {}", words(&cause.title()), sentence(&cause.meaning));
            match cause.parameters.as_slice() {
                few if few.len() <= FEW => few.iter().for_each(|e| out += &format!("\n    {}", plain(e))),
                many => {
                    let _ = write!(out, "\n    {} numbers, in the report and the extended scene", many.len());
                }
            }
        }
    }
    if d.stages.len() > 1 && !d.extension.is_empty() {
        let several = d.records.held_out > 1;
        out += "\n\nmean |error| per coordinate on held-out records";
        out += if several { " (median record; without the worst):" } else { ":" };
        for stage in &d.stages {
            if let Some(e) = stage.held_out.iter().max_by(|a, b| a.horizon_s.total_cmp(&b.horizon_s)) {
                let [mean, median, others] =
                    [e.mean_abs, e.median_record, e.without_worst].map(|x| quantity_plain(x, &d.remainder.unit));
                let of_each = if several { format!(" ({median}; {others})") } else { String::new() };
                let _ = write!(out, "\n  {}: {mean}{of_each}", words(&stage.name));
            }
        }
    }
    out.push('\n');
    for line in &d.unidentifiable {
        let _ = write!(out, "\nnot determined by these data: {line}");
    }
    for line in &d.warnings {
        let _ = write!(out, "\nwarning: {line}");
    }
    for next in next(d) {
        let _ = write!(out, "\nnext experiment: {next}");
    }
    for advice in &d.advice {
        let _ = write!(out, "\nto tell them apart: {advice}");
    }
    match longest(&d.gain) {
        Some(g) => {
            let factor = match g.interval {
                Some([low, high]) => gained(low, high),
                None => "interval unknown: one short record".to_owned(),
            };
            let _ = write!(
                out,
                "\nheld-out error over {} s{}: {} -> {}, {factor}, {} of what can be explained",
                number_plain(g.horizon_s),
                if d.causes.iter().chain(&d.extension).any(|c| !c.sizes.is_empty()) {
                    ", with sizes of each record's own"
                } else {
                    ""
                },
                quantity_plain(g.rmse_before, &g.unit),
                quantity_plain(g.rmse_after, &g.unit),
                share(g.explained_fraction)
            );
        }
        None => out += "\nnothing was held out, so there is no independent check",
    }
    if let Some(c) = &d.ceiling {
        let _ = write!(out, "\n{}", against_ceiling(c));
    }
    let r = &d.remainder;
    let _ = write!(
        out,
        "\nremainder: {} on fitted records, {}; noise {}",
        quantity_plain(r.rmse, &r.unit),
        if r.significant { "more than noise" } else { "no more than noise" },
        quantity_plain(d.noise.sigma, &r.unit)
    );
    if !r.note.is_empty() {
        let _ = write!(out, " ({})", r.note);
    }
    let _ = write!(out, "\naudit of the data: {}", audit(d));
    for finding in d.audit.iter().filter(|f| f.severity != "info").take(5) {
        let place = if finding.place == "Record" { String::new() } else { place(&finding.place) };
        let at: Vec<&str> = [finding.record.as_str(), &place].into_iter().filter(|part| !part.is_empty()).collect();
        let what = [at.join(", "), finding.what.clone()].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>();
        let _ = write!(out, "\n  {}; {}", what.join(": "), finding.advice);
    }
    out
}

/// By what factor errors fall, with 90 % certainty, from the logarithms of its ends.
pub(super) fn gained(low: f64, high: f64) -> String {
    let [least, most] = [low, high].map(|x| number_plain(x.exp()));
    match (low > 0.0, high < 0.0) {
        (true, _) => format!("smaller by a factor of {least} to {most} (90 %)"),
        (_, true) => format!("larger by a factor of {} to {} (90 %)", number_plain((-high).exp()), number_plain((-low).exp())),
        _ => format!("smaller or larger, which these records do not tell (a factor of {least} to {most}, 90 %)"),
    }
}

/// Records to repeat with a change, and what each would tell; that none would, if so.
pub(super) fn next(d: &Diagnosis) -> Vec<String> {
    let told = |n: &NextExperiment| format!("{}: {}", n.what, tells(n));
    match d.next.first() {
        Some(best) if best.chance < WORTH_A_TRY => {
            vec!["no repetition of these records with other commands or another start would tell them apart".to_owned()]
        }
        _ => d.next.iter().filter(|n| n.chance >= WORTH_A_TRY).map(told).collect(),
    }
}

/// What an experiment tells: each pair with its probability, as far as that is worth a try.
fn tells(n: &NextExperiment) -> String {
    match n.pairs.as_slice() {
        [] => format!("tells two of them apart with a probability of {}", share(n.chance)),
        [a, .., z] if share(a.chance) == share(z.chance) => {
            format!("tells any two of them apart with a probability of {}", share(z.chance))
        }
        all => {
            let named = |title: &str| if title.is_empty() { "none of the others".to_owned() } else { words(title) };
            let told = all.iter().filter(|pair| pair.chance >= WORTH_A_TRY);
            let said: Vec<String> =
                told.map(|p| format!("{} from {} ({})", named(&p.of[0]), named(&p.of[1]), share(p.chance))).collect();
            let hardly: Vec<String> = all
                .iter()
                .filter(|p| p.chance < WORTH_A_TRY)
                .map(|p| format!("{} from {}", named(&p.of[0]), named(&p.of[1])))
                .collect();
            let but = if hardly.is_empty() { String::new() } else { format!(", and hardly {}", hardly.join(", ")) };
            format!("tells {}{but}", said.join(", "))
        }
    }
}

/// The error taken by the causes, beside that taken by statistics alone.
pub(super) fn against_ceiling(c: &Ceiling) -> String {
    let found = match c.share {
        Some(share) if share > 2.0 => "; what was found takes many times what it takes".to_owned(),
        Some(share) if share > 0.0 => format!("; what was found takes {:.0} % of what it takes", 100.0 * share),
        Some(_) => String::new(),
        None => "; it does not carry over".to_owned(),
    };
    format!(
        "a regression of the error on motion and inputs, without physics, leaves {}{found}; on top of the final model it leaves {}",
        quantity_plain(c.rmse, &c.unit),
        quantity_plain(c.rmse_on_top, &c.unit)
    )
}

/// The gain over the longest horizon.
pub(super) fn longest(gain: &[Gain]) -> Option<&Gain> {
    gain.iter().max_by(|a, b| a.horizon_s.total_cmp(&b.horizon_s))
}

/// Numbers of findings by severity.
pub(super) fn audit(d: &Diagnosis) -> String {
    let count = |severity: &str| d.audit.iter().filter(|f| f.severity == severity).count();
    let (faulty, warning, info) = (count("faulty"), count("warning"), count("info"));
    if d.audit.is_empty() {
        return "nothing found".to_owned();
    }
    let kinds = [(faulty, "faulty"), (warning, "to watch"), (info, "to know")];
    kinds.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect::<Vec<_>>().join(", ")
}

/// `Coordinate(2, 1)` as people write it.
pub(super) fn place(place: &str) -> String {
    let (kind, rest) = place.split_once('(').unwrap_or((place, ""));
    let numbers: Vec<&str> = rest.trim_end_matches(')').split(", ").collect();
    match (kind, numbers.as_slice()) {
        ("Record", _) => "whole record".to_owned(),
        ("Clock", _) => "clock".to_owned(),
        ("Point", [point]) => format!("marker {point}"),
        ("Coordinate", [point, axis]) => {
            let axis = axis.parse().ok().and_then(|axis: usize| ["x", "y", "z"].get(axis)).unwrap_or(&"?");
            format!("marker {point}, {axis}")
        }
        ("Pair", [a, b]) => format!("markers {a} and {b}"),
        _ => place.to_owned(),
    }
}

/// `internal_damping` as people write it; the object in brackets keeps its name.
pub(super) fn words(title: &str) -> String {
    match title.split_once(" (") {
        Some((name, object)) => format!("{} ({object}", name.replace('_', " ")),
        None => title.replace('_', " "),
    }
}

/// The same with the object it is about: `gripper offset (left)`.
pub(super) fn titled(name: &str, object: Option<&str>) -> String {
    words(&title(name, object))
}

/// A fragment as a sentence: a capital first letter, but for a name such as `sensor_delay`, and a full stop.
pub(super) fn sentence(text: &str) -> String {
    let text = text.trim();
    let mut letters = text.chars();
    let Some(first) = letters.next() else { return String::new() };
    let end = if text.ends_with(['.', '!', '?']) { "" } else { "." };
    if text.split(' ').next().is_some_and(|word| word.contains('_')) {
        return text.to_owned() + end;
    }
    first.to_uppercase().chain(letters).collect::<String>() + end
}

/// `a, b or c`.
pub(super) fn list(items: &[String], last: &str) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [head @ .., tail] => format!("{} {last} {tail}", head.join(", ")),
    }
}

/// Estimate, interval and unit.
pub(super) fn estimate(e: &Estimate) -> String {
    let (value, _) = estimate_of(e.estimate, e.interval);
    format!("{value} {}", unit(&e.unit))
}

fn plain(e: &Estimate) -> String {
    let (value, interval) = estimate_plain(e.estimate, e.interval);
    let interval = interval.map_or_else(String::new, |[low, high]| format!("90 %: {low} to {high}; "));
    format!("{} = {value} {} ({interval}scene {})", e.path, unit(&e.unit), number_plain(e.scene_value))
}

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;
    use crate::diagnose::ToldPair;

    #[test]
    fn every_verdict_has_its_sentence() {
        let mut d = sample::diagnosis();
        assert_eq!(headline(&d), "The simulation lacks one thing: internal damping.");
        d.verdict = Verdict::Ambiguous;
        d.alternatives = vec![vec!["linear_drag".into(), "wind".into(), "tip_mass".into()]];
        assert!(headline(&d).ends_with("which: linear drag, wind or tip mass."));
        assert_eq!(words("gripper_offset (left_arm)"), "gripper offset (left_arm)");
        let rest = [Verdict::NotInLibrary, Verdict::Adequate, Verdict::Withheld];
        assert!(rest.into_iter().all(|verdict| headline(&Diagnosis { verdict, ..d.clone() }).ends_with('.')));
    }

    #[test]
    fn what_extends_the_model_without_a_name_is_told() {
        let mut d = sample::diagnosis();
        (d.verdict, d.extension) = (Verdict::NotInLibrary, std::mem::take(&mut d.causes));
        assert_eq!(headline(&d), "Something is missing that no name is given to; internal damping takes part of it.");
        let alone = summary(&d);
        assert!(alone.contains("on held-out records:\n  baseline: 4.5 mm\n"), "{alone}");
        d.records.held_out = 3;
        let text = summary(&d);
        for part in [
            "the model is extended by:\n  internal damping: The cable",
            "    cable.bend_damping = 1.5e-4",
            "baseline: 4.5 mm (3.6 mm; 4.05 mm)",
        ] {
            assert!(text.contains(part), "{part:?} is not in {text}");
        }
        d.extension[0].parameters = vec![sample::estimate("cable.node[1].rest_curvature[0]", 2.0); 5];
        assert!(summary(&d).contains("5 numbers, in the report and the extended scene"));
    }

    #[test]
    fn fragments_become_sentences() {
        assert_eq!(sentence("sensor_delay explains it"), "sensor_delay explains it.");
        assert_eq!(gained(2f64.ln(), 4f64.ln()), "smaller by a factor of 2 to 4 (90 %)");
        assert_eq!(gained(-(4f64.ln()), -(2f64.ln())), "larger by a factor of 2 to 4 (90 %)");
        let open = gained(-(2f64.ln()), 4f64.ln());
        assert!(open.starts_with("smaller or larger") && open.contains("0.5 to 4"), "{open}");
        assert_eq!((sentence("a rope"), sentence("A rope."), sentence(" ")), ("A rope.".into(), "A rope.".into(), String::new()));
    }

    /// An experiment says which of the alternatives it would tell from each other, and which it hardly would.
    #[test]
    fn the_next_experiment_says_what_it_tells() {
        let of = |pairs: &[(&str, &str, f64)]| {
            let pairs: Vec<ToldPair> =
                pairs.iter().map(|(a, b, chance)| ToldPair { of: [(*a).into(), (*b).into()], chance: *chance }).collect();
            let chance = pairs.iter().map(|p| p.chance).sum::<f64>() / pairs.len() as f64;
            let (record, what) = ("run1".to_owned(), "run1 once more".to_owned());
            let one = NextExperiment { record, what, commands: 1.0, pace: 1.0, start: 1.0, separation: 1.0, chance, pairs };
            next(&Diagnosis { next: vec![one], ..sample::diagnosis() })
        };
        assert_eq!(of(&[("wind", "tip_mass", 0.97)]), ["run1 once more: tells wind from tip mass (97 %)"]);
        let all = of(&[("wind", "tip_mass", 0.99), ("wind", "", 0.5), ("tip_mass", "", 0.1)]);
        assert_eq!(
            all,
            [
                "run1 once more: tells wind from tip mass (99 %), wind from none of the others (50 %), and hardly tip mass from none of the others"
            ]
        );
        let even = of(&[("wind", "tip_mass", 0.9), ("wind", "drag", 0.9)]);
        assert_eq!(even, ["run1 once more: tells any two of them apart with a probability of 90 %"]);
        assert!(of(&[("wind", "tip_mass", 0.1)])[0].starts_with("no repetition"));
    }

    #[test]
    fn places_are_in_words() {
        assert_eq!((place("Coordinate(2, 1)"), place("Record")), ("marker 2, y".into(), "whole record".into()));
        assert_eq!((place("Pair(0, 3)"), place("elsewhere (x)")), ("markers 0 and 3".into(), "elsewhere (x)".into()));
        let mut d = sample::diagnosis();
        (d.audit[0].record, d.audit[0].place) = ("run1.csv".into(), "motor_elbow".into());
        assert!(summary(&d).contains("\n  run1.csv, motor_elbow: "), "{}", summary(&d));
    }

    #[test]
    fn the_summary_says_what_counts() {
        let text = summary(&sample::diagnosis());
        for part in
            ["cable.bend_damping = 1.5e-4 N·m²·s (90 %: 1.2e-4 to 1.8e-4; scene 0)", "10 mm -> 2 mm", "1 to watch", "frozen"]
        {
            assert!(text.contains(part), "{part:?} is not in {text}");
        }
        assert!(text.contains("smaller by a factor of 3.32 to 6.69 (90 %), 93 % of what can"), "{text}");
        let mut varies = sample::diagnosis();
        varies.causes[0].sizes = vec![crate::diagnose::RecordSize { record: "run1.csv".into(), size: 1e-4 }];
        assert!(!text.contains("each record's own") && summary(&varies).contains(" s, with sizes of each record's own: 10 mm"));
        let mut short = sample::diagnosis();
        (short.gain[1].interval, short.gain[1].explained_fraction) = (None, -0.15);
        assert!(summary(&short).contains("interval unknown: one short record, nothing of what can"), "{}", summary(&short));
        assert!(text.lines().count() < 15 && !text.contains("not determined"));
        let unidentifiable = vec!["+1.00·cable.length".into()];
        let text = summary(&Diagnosis { unidentifiable, ..sample::diagnosis() });
        assert!(text.contains("\nnot determined by these data: +1.00·cable.length"), "{text}");
    }
}
