//! The verdict's reasons, in words.

use super::policy::POLICY;
use super::result::{Cause, Estimate, Gain, Noise, Numerics, NumericsKind, RecordSize, Remainder};
use crate::number::{estimate_plain, four_digits, number_plain, quantity_plain, share, unit};

/// The causes with their sizes, what each of them takes, and the gain on records that were not fitted.
pub(super) fn named(causes: &[Cause], gain: &[Gain]) -> String {
    let all: Vec<String> = causes.iter().map(|c| format!("{}: {}", c.title(), sizes(c))).collect();
    let least = number_plain(causes.iter().map(|c| c.statistic).fold(f64::INFINITY, f64::min));
    let proof = if all.len() == 1 {
        format!("without it the likelihood falls by {least} units of −2 log")
    } else {
        format!("without any of them the likelihood falls by {least} units of −2 log or more")
    };
    format!("The data call for {}; {proof}, no other cause comes as near, and {}.", all.join(", and for "), held_out(gain))
}

/// That the law is right and its size differs from record to record.
pub(super) fn varies(causes: &[Cause], varying: &str) -> String {
    let all: Vec<String> = causes.iter().map(|c| format!("{}: {}", c.title(), sizes(c))).collect();
    let of = causes.iter().find(|c| c.title() == varying);
    let (sizes, apart) = of.map_or_else(Default::default, |c| (c.sizes_by_record(), apart(&c.sizes)));
    let alone = apart.map_or_else(String::new, |one| format!("; {} alone is apart from the others", one.record));
    format!(
        "The data call for {}, but the size of {varying} differs between the records: {sizes}{alone}. What it depends on is not in the model",
        all.join(", and for ")
    )
}

/// The record whose size is much farther from every other than all others are from each other, if one is.
fn apart(sizes: &[RecordSize]) -> Option<&RecordSize> {
    let mut sorted: Vec<&RecordSize> = sizes.iter().collect();
    sorted.sort_by(|a, b| a.size.total_cmp(&b.size));
    let (&[first, ref above @ ..], &[ref below @ .., last]) = (&sorted[..], &sorted[..]) else { return None };
    let far = |one: &RecordSize, others: &[&RecordSize]| {
        let ends = others.first().zip(others.last()).filter(|_| others.len() > 1);
        ends.is_some_and(|(low, high)| {
            let nearest = (one.size - low.size).abs().min((one.size - high.size).abs());
            high.size - low.size < POLICY.apart * nearest
        })
    };
    if far(last, below) { Some(last) } else { Some(first).filter(|first| far(first, above)) }
}

/// That several causes fit alike. `accepted`: those that stand whichever of them is right; `by_any`: no data of this kind can tell them;
/// `refitted`: of each model those that it has, and their sizes there.
pub(super) fn ambiguous(set: &[String], accepted: &[String], by_any: bool, refitted: &[(Vec<String>, Vec<Estimate>)]) -> String {
    let together = |titles: &[String]| match titles {
        [first, others @ ..] if !others.is_empty() => format!("{first} with {}", others.join(" and ")),
        one => one.concat(),
    };
    let alone = |(titles, all): &(Vec<String>, Vec<Estimate>)| {
        let sizes: Vec<String> = all.iter().map(in_place).collect();
        (!titles.is_empty() && !sizes.is_empty()).then(|| format!("{} {}", together(titles), sizes.join(", ")))
    };
    let sizes: Vec<String> = refitted.iter().filter_map(alone).collect();
    let mut any: Vec<String> = set.to_vec();
    if refitted.iter().any(|(titles, _)| titles.len() > 1) {
        any.retain(|title| !refitted.iter().any(|(titles, _)| titles.contains(title)));
        any.splice(0..0, refitted.iter().filter(|(titles, _)| !titles.is_empty()).map(|(titles, _)| together(titles)));
    }
    let sizes = if sizes.is_empty() { String::new() } else { format!("; each in place of the others: {}", sizes.join("; ")) };
    let beside = if accepted.is_empty() { String::new() } else { format!(" beside {}", accepted.join(" and ")) };
    if by_any {
        format!(
            "{} explains the data{beside}, and no log of these sensors can tell it from {}: both move the readings in the same way{sizes}",
            any[0],
            any[1..].join(", ")
        )
    } else {
        format!("{} explain the data equally well{beside}{sizes}", any.join(", "))
    }
}

/// That causes were found which carry over to other records, and leave too much to be given names.
pub(super) fn approximated(causes: &[Cause], left: &Remainder) -> String {
    let names: Vec<String> = causes.iter().map(Cause::title).collect();
    let verb = if names.len() == 1 { "takes" } else { "together take" };
    format!(
        "{} {verb} {} of what can be explained, and {}: something else is there, outside the library, that what was found may stand for",
        names.join(", "),
        share(left.explained_fraction),
        left.note
    )
}

/// That something is there for which no cause is accepted.
pub(super) fn unexplained(left: &Remainder) -> String {
    format!(
        "no cause of the library is accepted, and {}: something outside the library ({})",
        left.note,
        quantity_plain(left.rmse, &left.unit)
    )
}

/// That a cause would only make up for the simulation's own error, or that this error is part of what is left.
pub(super) fn numerics(own: &[&Numerics], imitated: &[String]) -> String {
    let what = own.iter().map(|n| n.with_advice()).collect::<Vec<_>>().join("; ");
    match imitated {
        [] => format!("no cause is accepted, and part of what is left is the simulation's own: {what}"),
        some => format!("{} would only make up for the simulation's own error: {what}", some.join(", ")),
    }
}

/// The reservation that the simulation's own error is, beside causes.
pub(super) fn own_error(own: &[Numerics]) -> String {
    let notes: Vec<String> = own.iter().map(Numerics::with_advice).collect();
    if notes.is_empty() { String::new() } else { format!("the simulation's own error counts as well: {}", notes.join("; ")) }
}

/// That what is left may be the simulation's own error, and how that is seen.
pub(super) fn coarse(own: &[Numerics]) -> String {
    let one = |n: &Numerics| {
        let finer = if n.kind == NumericsKind::Mesh { "edges" } else { "steps" };
        format!("yet what is left may be the simulation's own error: {}; if it is, it falls with {finer} half as long", n.note)
    };
    own.iter().map(one).collect::<Vec<_>>().join("; ")
}

impl Numerics {
    /// The note, and what would do.
    pub(crate) fn with_advice(&self) -> String {
        let note = &self.note;
        match (self.kind, self.needed) {
            (NumericsKind::Step, Some(step)) => format!("{note}; {} s would do", number_plain(step)),
            (NumericsKind::Mesh, Some(factor)) => format!("{note}; {factor:.1} times the edges would do"),
            _ => note.clone(),
        }
    }
}

impl NumericsKind {
    /// The note on a cause whose size is the simulation's own error.
    pub(super) fn imitates(self) -> &'static str {
        match self {
            Self::Step => "its size is what the length of the simulation's steps imitates",
            Self::Mesh => "its size is what the length of the edges imitates",
            Self::Inputs => "its size is what reading the inputs between samples otherwise imitates",
        }
    }
}

/// The reservation that causes are which were accepted beside those that are named, and may stand for something else.
pub(super) fn stand_ins(causes: &[Cause]) -> String {
    let names: Vec<String> = causes.iter().map(Cause::title).collect();
    let [takes, stands] = if names.len() == 1 { ["takes", "is"] } else { ["take", "are"] };
    if names.is_empty() {
        return String::new();
    }
    format!(
        "{} {takes} part of the rest, and {stands} not named, for what is left looks like something else",
        names.join(" and ")
    )
}

/// Adds a clause to a reason that may end as a sentence; nothing if it is empty.
pub(super) fn add(reason: &mut String, clause: &str) {
    if !clause.is_empty() {
        *reason = format!("{}; {clause}", reason.trim_end_matches('.'));
    }
}

/// That the simulation was refined, and why. `coarse`: what counted with the scene's own; what would have done is done, and not said.
/// `missing`: whether something is missing that no name is given to, as which another reading of commands, a small delay, may act.
pub(super) fn refined(finer: &str, coarse: &[&Numerics], missing: bool) -> String {
    let (read, coarse): (Vec<&Numerics>, Vec<&Numerics>) = coarse.iter().partition(|n| n.kind == NumericsKind::Inputs);
    let notes = |of: &[&Numerics]| of.iter().map(|n| n.note.as_str()).collect::<Vec<_>>().join("; ");
    let mut out = String::new();
    if !read.is_empty() {
        out += &format!(
            "the data are nearer to commands that are read in another way than the scene reads them{}: {}; ",
            if missing { ", which what is missing may imitate" } else { "" },
            notes(&read)
        );
    }
    if read.is_empty() || !coarse.is_empty() {
        let because = if coarse.is_empty() { String::new() } else { format!(": {}", notes(&coarse)) };
        out += &format!("the scene's own simulation is too coarse for these data{because}; ");
    }
    format!("{out}all that is said here was found with {finer}")
}

/// That nothing can be built on the baseline.
pub(super) fn not_converged() -> String {
    "the baseline fit did not converge, and nothing built on it can be trusted: start the free parameters nearer to their values, narrow \
     their bounds, or free fewer of them"
        .to_owned()
}

/// That no cause was found; and where the residual is slow and larger than the sensors' own noise, that this is all the data say.
pub(super) fn adequate(noise: &Noise, left: &Remainder) -> String {
    if left.rmse <= POLICY.larger * noise.sensor_sigma || noise.sensor_sigma == 0.0 {
        return "nothing beyond the noise was found".to_owned();
    }
    format!(
        "nothing was found that coloured noise could not be: what is left, {}, is {:.1} times what the readings scatter from one to the \
         next, and slow; whether that is noise or something slow outside the library, the same experiment done twice would tell",
        quantity_plain(left.rmse, &left.unit),
        left.rmse / noise.sensor_sigma
    )
}

/// A number of an alternative, in the unit of the scene.
fn in_place(e: &Estimate) -> String {
    let value = format!("{} {}", four_digits(e.estimate), unit(&e.unit));
    format!("{} = {} (scene {})", e.path, value.trim_end(), number_plain(e.scene_value))
}

/// Every parameter with interval and unit.
fn sizes(cause: &Cause) -> String {
    cause.parameters.iter().map(size).collect::<Vec<_>>().join(", ")
}

fn size(e: &Estimate) -> String {
    let (value, interval) = estimate_plain(e.estimate, e.interval);
    let value = format!("{value} {}", unit(&e.unit));
    let interval = interval.map_or_else(String::new, |[low, high]| format!("90 % interval {low} to {high}, "));
    format!("{} = {} ({interval}scene {})", e.path, value.trim_end(), number_plain(e.scene_value))
}

/// Over the longest horizon.
fn held_out(gain: &[Gain]) -> String {
    let Some(g) = gain.iter().max_by(|a, b| a.horizon_s.total_cmp(&b.horizon_s)) else {
        return "no record was held out to check this on".to_owned();
    };
    let moves = if g.rmse_after < g.rmse_before { "falls" } else { "rises" };
    let (before, after) = (number_plain(1e3 * g.rmse_before), quantity_plain(g.rmse_after, &g.unit));
    format!("the error on held-out records {moves} from {before} to {after} (RMSE over {} s)", number_plain(g.horizon_s))
}

#[cfg(test)]
mod tests {
    use super::super::result::NumericsKind;
    use super::*;

    #[test]
    fn a_residual_that_is_slow_is_not_called_noise() {
        let noise = |sensor_sigma| Noise { ar: vec![0.97], sigma: 1e-3, sensor_sigma, effective_samples: 28.0 };
        let left = Remainder { rmse: 1.2e-3, unit: "rad".to_owned(), ..Remainder::default() };
        assert_eq!(adequate(&noise(1e-3), &left), "nothing beyond the noise was found");
        let slow = adequate(&noise(3e-4), &left);
        assert!(slow.contains("1.2 mrad, is 4.0 times") && slow.contains("twice"), "{slow}");
    }

    #[test]
    fn a_record_that_alone_is_apart_is_told() {
        let told = |sizes: &[f64]| {
            let all: Vec<RecordSize> =
                (0..sizes.len()).map(|k| RecordSize { record: format!("run{k}"), size: sizes[k] }).collect();
            apart(&all).map(|one| one.record.clone())
        };
        assert_eq!(told(&[0.9, 1.1, 0.90001]).as_deref(), Some("run1"));
        assert_eq!(told(&[0.9, 0.1, 0.91, 0.905]).as_deref(), Some("run1"));
        assert_eq!((told(&[0.9, 1.1, 1.3]), told(&[0.9, 1.1]), told(&[0.9, 0.9, 1.1, 1.1])), (None, None, None));
        let mut payload = cause("payload", "hand.mass", 0.97, "kg", 1e3);
        payload.sizes =
            [("run1", 0.9), ("run2", 1.1), ("run3", 0.9)].map(|(r, size)| RecordSize { record: r.into(), size }).into();
        let text = varies(&[payload], "payload");
        assert!(text.contains("0.9 in run1, 1.1 in run2, 0.9 in run3; run2 alone is apart from the others. What"), "{text}");
    }

    fn cause(name: &str, path: &str, estimate: f64, unit: &str, statistic: f64) -> Cause {
        let interval = Some([0.9 * estimate, 1.1 * estimate]);
        let parameter = Estimate { path: path.into(), estimate, unit: unit.into(), interval, scene_value: 0.0 };
        Cause {
            name: name.into(),
            object: None,
            meaning: String::new(),
            parameters: vec![parameter],
            statistic,
            foretold: None,
            constancy_p: None,
            sizes: Vec::new(),
            rivals: Vec::new(),
        }
    }

    #[test]
    fn one_cause_comes_with_size_and_gain() {
        let gain = |horizon_s: f64, rmse_after: f64| Gain {
            horizon_s,
            rmse_before: 4e-3,
            rmse_after,
            unit: "m".into(),
            interval: Some([1.0, 2.0]),
            explained_fraction: 0.9,
            mean_abs: [0.0; 2],
        };
        let text =
            named(&[cause("internal_damping", "cable.bend_damping", 5e-5, "N·m²·s", 1e4)], &[gain(0.1, 3e-3), gain(4.0, 1e-3)]);
        assert_eq!(
            text,
            "The data call for internal_damping: cable.bend_damping = 5e-5 N·m²·s (90 % interval 4.5e-5 to 5.5e-5, scene 0); \
             without it the likelihood falls by 10000 units of −2 log, no other cause comes as near, and the error on held-out records \
             falls from 4 to 1 mm (RMSE over 4 s)."
        );
    }

    #[test]
    fn alternatives_come_with_their_sizes() {
        let of = |name: &str, size| (vec![name.to_owned()], cause(name, "sensor.time_offset", size, "s", 1.0).parameters);
        let set = ["sensor_delay", "actuator_delay", "actuator_lag"].map(str::to_owned);
        let said = ambiguous(&set, &[], false, &[of("sensor_delay", 5e-4), (Vec::new(), Vec::new())]);
        assert_eq!(
            said,
            "sensor_delay, actuator_delay, actuator_lag explain the data equally well; each in place of the others: \
             sensor_delay sensor.time_offset = 5e-4 s (scene 0)"
        );
        assert!(!ambiguous(&set, &[], false, &[]).contains("place of"));
        // two that only together are as near stand together
        let mut both = of("actuator_delay", 1e-3);
        both.0.push("actuator_lag".to_owned());
        let said = ambiguous(&set, &[], false, &[of("sensor_delay", 5e-4), both]);
        assert!(said.starts_with("sensor_delay, actuator_delay with actuator_lag explain the data equally well; each"), "{said}");
    }

    #[test]
    fn a_reservation_follows_a_sentence() {
        let mut reason = "The data call for wind.".to_owned();
        add(&mut reason, "");
        assert_eq!(reason, "The data call for wind.");
        add(&mut reason, "the step is too coarse");
        assert_eq!(reason, "The data call for wind; the step is too coarse");
    }

    #[test]
    fn causes_that_are_not_named_are_said_besides() {
        let one = cause("quadratic_damping", "spring.quadratic_damping", 0.1, "N·s²/m²", 1193.0);
        assert_eq!(stand_ins(&[]), "");
        let said = stand_ins(&[one]);
        assert!(said.starts_with("quadratic_damping takes part of the rest, and is not named"), "{said}");
    }

    #[test]
    fn several_causes_tell_the_least() {
        let causes = [
            cause("sensor_scale", "sensor.scale", 1.02, "-", 300.0),
            cause("internal_damping", "cable.bend_damping", 5e-5, "N·m²·s", 200.0),
        ];
        let text = named(&causes, &[]);
        for part in [
            "The data call for sensor_scale: ",
            ", and for internal_damping: ",
            "without any of them the likelihood falls by 200 ",
            "and no record was held out to check this on.",
        ] {
            assert!(text.contains(part), "{text}");
        }
    }

    /// What a finer simulation was made for is said, and not the step that would have done.
    #[test]
    fn a_finer_pass_says_why() {
        let note = "the step of 0.01 s moves the readings by 1 mrad, 50 % of what is left";
        let coarse = Numerics {
            kind: NumericsKind::Step,
            interpolation: None,
            rms: 1e-3,
            unit: "rad".into(),
            part: 0.5,
            beyond: 0.5,
            gain: 30.0,
            needed: Some(4e-3),
            note: note.into(),
        };
        assert_eq!(
            own_error(std::slice::from_ref(&coarse)),
            format!("the simulation's own error counts as well: {note}; 0.004 s would do")
        );
        let said = refined("a step of 0.0025 s", &[&coarse], true);
        assert!(said.contains("1 mrad, 50 % of what is left; all that is said here was found with a step of 0.0025 s"), "{said}");
        // commands that are read otherwise are not coarse
        let held = Numerics { kind: NumericsKind::Inputs, needed: None, note: "held".into(), ..coarse.clone() };
        let [alone, both] = [vec![&held], vec![&coarse, &held]].map(|all| refined("this", &all, false));
        let nearer = "the data are nearer to commands that are read in another way than the scene reads them: held; ";
        assert_eq!(alone, format!("{nearer}all that is said here was found with this"));
        let missing = refined("this", &[&held], true);
        assert!(
            missing.starts_with(
                "the data are nearer to commands that are read in another way than the scene reads them, which what"
            ),
            "{missing}"
        );
        assert!(both.starts_with(nearer) && both.contains("too coarse for these data: the step of 0.01 s"), "{both}");
    }
}
