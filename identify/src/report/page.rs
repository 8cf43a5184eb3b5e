//! The page: everything formatted here, placed by the template.

use super::error::ReportError;
use super::reproduce::{InputFile, Provenance, VERSION};
use super::story::{self, estimate, list, longest, place, sentence, titled, words};
use super::{curves, shapes, stages};
use crate::diagnose::{AuditFinding, CandidateReport, Diagnosis, Estimate, Gain, Status};
use crate::number::{estimate_of, number, p_value, percent, quantity, unit};
use minijinja::{Environment, Value, context};
use serde::Serialize;

const TEMPLATE: &str = include_str!("report.html");

/// The text of `report.html`.
pub(super) fn page(d: &Diagnosis, provenance: &Provenance) -> Result<String, ReportError> {
    let mut environment = Environment::new();
    // The name ends in .html, so every text is escaped.
    environment.add_template("report.html", TEMPLATE)?;
    let files: Vec<&InputFile> = provenance.files.iter().collect();
    let context = context! {
        scene => d.scene,
        version => VERSION,
        verdict => story::word(d.verdict),
        verdict_class => d.verdict,
        headline => story::headline(d),
        reason => sentence(&d.reason),
        figures => Key::of(d),
        shapes => shapes::figures(&d.snapshots),
        curves => curves::figures(&d.curves),
        causes => causes(d),
        alternatives => alternatives(d),
        advice => d.advice,
        next => super::story::next(d),
        stage_bars => Value::from_safe_string(stages::bars(&d.stages, d.noise.sigma, &d.remainder.unit)),
        stages => stage_rows(d),
        gain => d.gain.iter().map(gain_row).collect::<Vec<_>>(),
        ceiling => d.ceiling.as_ref().map(|c| sentence(&story::against_ceiling(c))),
        candidates => d.candidates.iter().map(|c| candidate_row(c, d)).collect::<Vec<_>>(),
        remainder => context! {
            significant => d.remainder.significant,
            rmse => quantity(d.remainder.rmse, &d.remainder.unit),
            explained => percent(d.remainder.explained_fraction),
            note => sentence(&d.remainder.note),
        },
        numerics => d.numerics.iter().map(|n| sentence(&n.with_advice())).collect::<Vec<_>>(),
        warnings => d.warnings,
        parts => d.parts.iter().map(|p| format!("{} {} s", p.part, number(p.seconds))).collect::<Vec<_>>().join(", "),
        noise => context! {
            sigma => quantity(d.noise.sigma, &d.remainder.unit),
            sensor => quantity(d.noise.sensor_sigma, &d.remainder.unit),
            ar => d.noise.ar.iter().map(|a| number(*a)).collect::<Vec<_>>().join(", "),
            effective => number(d.noise.effective_samples.round()),
        },
        records => d.records,
        audit => d.audit.iter().map(finding_row).collect::<Vec<_>>(),
        audit_summary => story::audit(d),
        parameters => parameters(d),
        unidentifiable => d.unidentifiable,
        command => provenance.line(),
        seed => provenance.seed,
        threads => provenance.threads,
        files => files,
        example => !provenance.example.is_empty(),
        wall => number(d.wall_s),
    };
    Ok(environment.get_template("report.html")?.render(context)?)
}

/// A number in large type.
#[derive(Serialize)]
struct Key {
    value: String,
    label: String,
}

impl Key {
    fn of(d: &Diagnosis) -> Vec<Self> {
        let mut out = Vec::new();
        for e in d.causes.iter().flat_map(|cause| &cause.parameters).take(3) {
            let interval = estimate_of(e.estimate, e.interval).1;
            let interval = interval.map_or_else(String::new, |[low, high]| format!(" (90 %: {low} to {high})"));
            out.push(Self { value: estimate(e), label: format!("{}{interval}", e.path) });
        }
        if let Some(g) = longest(&d.gain) {
            let value = format!("{} → {}", number(1e3 * g.rmse_before), quantity(g.rmse_after, &g.unit));
            out.push(Self { value, label: format!("error on held-out records over {} s", number(g.horizon_s)) });
        }
        let label = "of the explainable error removed on fitted records".to_owned();
        out.push(Self { value: percent(d.remainder.explained_fraction), label });
        out.push(Self { value: quantity(d.noise.sigma, &d.remainder.unit), label: "noise (standard deviation)".to_owned() });
        out
    }
}

#[derive(Serialize)]
struct EstimateRow {
    path: String,
    value: String,
    interval: String,
    scene: String,
    unit: String,
}

fn estimate_row(e: &Estimate) -> EstimateRow {
    let (value, interval) = estimate_of(e.estimate, e.interval);
    EstimateRow {
        path: e.path.clone(),
        value,
        interval: interval.map_or_else(|| "–".to_owned(), |[low, high]| format!("{low} to {high}")),
        scene: number(e.scene_value),
        unit: unit(&e.unit).to_owned(),
    }
}

fn causes(d: &Diagnosis) -> Vec<Value> {
    let row = |cause: &crate::diagnose::Cause| {
        let rivals = cause.rivals.iter().map(|r| format!("{} (cosine {:.2})", titled(&r.name, r.object.as_deref()), r.cosine));
        context! {
            name => titled(&cause.name, cause.object.as_deref()),
            meaning => sentence(&cause.meaning),
            statistic => number(cause.statistic),
            foretold => cause.foretold.map(percent),
            sizes => cause.sizes.iter().map(|s| format!("{}: {}", s.record, number(s.size))).collect::<Vec<_>>().join(", "),
            parameters => cause.parameters.iter().map(estimate_row).collect::<Vec<_>>(),
            rivals => rivals.collect::<Vec<_>>().join(", "),
        }
    };
    let found =
        [("What the simulation lacks", &d.causes), ("What the model is extended by, without a name being given", &d.extension)];
    let told = found.into_iter().filter(|(_, causes)| !causes.is_empty());
    told.map(|(title, causes)| context! { title, causes => causes.iter().map(row).collect::<Vec<_>>() }).collect()
}

fn alternatives(d: &Diagnosis) -> Vec<String> {
    d.alternative_titles().iter().map(|set| list(&set.iter().map(|name| words(name)).collect::<Vec<_>>(), "or")).collect()
}

/// All parameters of the last stage, or of the baseline.
fn parameters(d: &Diagnosis) -> Vec<EstimateRow> {
    let last = d.stages.last().map(|stage| &stage.parameters).filter(|parameters| !parameters.is_empty());
    last.unwrap_or(&d.baseline).iter().map(estimate_row).collect()
}

fn stage_rows(d: &Diagnosis) -> Vec<Value> {
    let row = |stage: &crate::diagnose::Stage| {
        context! {
            name => words(&stage.name),
            fit => quantity(stage.rmse_fit, &d.remainder.unit),
            held_out => quantity(stage.rmse_held_out, &d.remainder.unit),
            mean_abs => quantity(stage.mean_abs_held_out, &d.remainder.unit),
            parameters => stage.parameters.iter().map(|e| format!("{} = {}", e.path, estimate(e))).collect::<Vec<_>>(),
        }
    };
    d.stages.iter().map(row).collect()
}

fn gain_row(g: &Gain) -> Value {
    context! {
        horizon => number(g.horizon_s),
        before => quantity(g.rmse_before, &g.unit),
        after => quantity(g.rmse_after, &g.unit),
        factor => match g.interval {
            Some([low, high]) => format!("{} to {}", number(low.exp()), number(high.exp())),
            None => "unknown: one short record".to_owned(),
        },
        explained => percent(g.explained_fraction),
        mean_abs => format!("{} → {}", quantity(g.mean_abs[0], &g.unit), quantity(g.mean_abs[1], &g.unit)),
    }
}

fn candidate_row(c: &CandidateReport, d: &Diagnosis) -> Value {
    let accepted = d.causes.iter().chain(&d.extension).any(|cause| cause.name == c.name && cause.object == c.object);
    let (status, class) = match c.status {
        Status::Tested => ("tested", "tested"),
        Status::Absorbed => ("hidden", "absorbed"),
        Status::Untestable => ("not testable", "untestable"),
    };
    let dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
    context! {
        name => titled(&c.name, c.object.as_deref()),
        status => if accepted { "accepted" } else { status },
        class => if accepted { "accepted" } else { class },
        statistic => dash(c.statistic.map(number)),
        dof => c.dof,
        p => dash(c.p_value.map(p_value)),
        absorbed => dash(c.absorbed_fraction.map(percent)),
        detectable => dash(c.smallest_detectable.map(|x| format!("{} {}", number(x), unit(&c.unit)))),
        reason => c.reason,
    }
}

fn finding_row(f: &AuditFinding) -> Value {
    let severity = match f.severity.as_str() {
        "info" => "to know",
        "warning" => "to watch",
        other => other,
    };
    let time = f.time_s.map_or(String::new(), |t| format!("{} s", number(t)));
    let (record, what) = (&f.record, &f.what);
    context! { severity, class => f.severity, record, place => place(&f.place), time, what, advice => f.advice }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::sample;
    use super::*;
    use crate::diagnose::Verdict;

    fn render(d: &Diagnosis) -> String {
        let command = vec!["pliant".to_owned(), "diagnose".to_owned(), "<scene>".to_owned()];
        page(d, &Provenance { command, ..Provenance::default() }).unwrap()
    }

    #[test]
    fn the_page_stands_alone_and_escapes_every_text() {
        let text = render(&sample::diagnosis());
        for part in ["http://", "https://", "<script", "@import", "url("] {
            assert!(!text.contains(part), "{part}");
        }
        for part in
            ["lacks one thing: internal damping", "&lt;script&gt;", "&lt;scene&gt;", "1.5×10⁻⁴ N·m²·s", "run3.csv, marker"]
        {
            assert!(text.contains(part), "{part:?}");
        }
    }

    #[test]
    fn what_is_not_determined_is_said() {
        let mut d = sample::diagnosis();
        assert!(!render(&d).contains("do not determine"));
        d.unidentifiable = vec!["+0.71·cable.length -0.71·sensor.scale".into()];
        assert!(render(&d).contains("These data do not determine") && render(&d).contains("-0.71·sensor.scale"));
    }

    #[test]
    fn causes_of_one_name_are_told_apart() {
        let mut d = sample::diagnosis();
        for (k, gripper) in ["left", "right"].into_iter().enumerate() {
            (d.candidates[k].name, d.candidates[k].object) = ("gripper_offset".into(), Some(gripper.into()));
        }
        (d.causes[0].name, d.causes[0].object) = ("gripper_offset".into(), Some("left".into()));
        let text = render(&d);
        assert!(text.contains("gripper offset (left)") && text.contains("gripper offset (right)"));
        assert_eq!(text.matches("<tr class=\"accepted\">").count(), 1);
        (d.verdict, d.alternatives) = (Verdict::Ambiguous, vec![vec!["gripper_offset".into(); 2]]);
        d.alternative_objects = vec![vec![Some("left".into()), Some("right".into())]];
        assert!(story::headline(&d).ends_with("which: gripper offset (left) or gripper offset (right)."));
    }

    #[test]
    fn what_extends_the_model_is_shown_as_that() {
        let mut d = sample::diagnosis();
        (d.verdict, d.extension) = (Verdict::NotInLibrary, std::mem::take(&mut d.causes));
        let text = render(&d);
        assert!(text.contains("What the model is extended by, without a name being given") && text.contains("internal damping"));
        assert!(!text.contains("What the simulation lacks"));
        (d.verdict, d.causes) = (Verdict::Named, d.extension.clone());
        let text = render(&d);
        assert!(text.contains("What the simulation lacks") && text.contains("What the model is extended by"));
    }

    #[test]
    fn an_estimate_without_an_interval_claims_none() {
        let mut d = sample::diagnosis();
        d.causes[0].parameters[0].interval = None;
        (d.stages, d.baseline) = (vec![], vec![]);
        assert!(render(&sample::diagnosis()).contains("(90 %: "));
        let text = render(&d);
        assert!(text.contains("<td class=\"n\">–</td>") && !text.contains("(90 %: "), "{text}");
    }

    #[test]
    fn every_verdict_makes_a_page() {
        let full = sample::diagnosis();
        for verdict in [Verdict::Ambiguous, Verdict::NotInLibrary, Verdict::Adequate, Verdict::Withheld] {
            let mut d = Diagnosis { verdict, ..full.clone() };
            assert!(render(&d).contains(&story::headline(&d)));
            (d.causes, d.stages, d.curves, d.snapshots) = (vec![], vec![], vec![], vec![]);
            (d.candidates, d.gain, d.audit, d.baseline) = (vec![], vec![], vec![], vec![]);
            d.noise.sigma = f64::NAN;
            assert!(render(&d).contains("<h1>"));
        }
    }
}
