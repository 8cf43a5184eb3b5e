//! Why causes are named, in words.

use super::constants::DIAGNOSE;
use super::result::{Cause, Estimate, Gain, Noise, Remainder};
use super::select::Margin;
use crate::number::{estimate_plain, number_plain, quantity_plain, share, unit};

/// Name of the cause that lies in the simulation itself.
pub(super) const DISCRETISATION: &str = "discretisation";

/// The causes with their sizes, their lead over the nearest rival, and their gain on records that were not fitted.
///
/// `margins` belong to the accepted causes that had a rival to beat.
pub(super) fn named<'a>(causes: &[Cause], margins: impl Iterator<Item = (String, &'a Margin)>, gain: &[Gain]) -> String {
    let (numerics, physics): (Vec<&Cause>, Vec<&Cause>) = causes.iter().partition(|c| c.name == DISCRETISATION);
    let mut out = Vec::new();
    if !physics.is_empty() {
        let all: Vec<String> = physics.iter().map(|c| format!("{}: {}", c.title(), sizes(c))).collect();
        let least = number_plain(physics.iter().map(|c| c.statistic).fold(f64::INFINITY, f64::min));
        let proof = if all.len() == 1 {
            format!("its likelihood-ratio statistic is {least}")
        } else {
            format!("taking any of them away costs a likelihood-ratio statistic of {least} or more")
        };
        out.push(format!("The data call for {}; {proof}.", all.join(", and for ")));
    }
    for e in numerics.iter().flat_map(|c| &c.parameters) {
        let [needed, scene] = [e.estimate, e.scene_value].map(number_plain);
        out.push(format!(
            "The simulation's own step of {scene} {0} is too coarse for these data, {needed} {0} would do.",
            e.unit
        ));
    }
    if !physics.is_empty() {
        let nearest = margins.min_by(|(_, a), (_, b)| (a.lead / a.needed).total_cmp(&(b.lead / b.needed)));
        let rival = match nearest {
            Some((name, m)) => format!(
                "The rival nearest to {name}, {}, is beaten by {:.1} standard errors ({:.1} are needed)",
                m.rival, m.lead, m.needed
            ),
            None => "No rival was left to beat after the refits".to_owned(),
        };
        out.push(format!("{rival}, and {}.", held_out(gain)));
    }
    out.join(" ")
}

/// That a residual without a cause is too large and too slow to be noise, if it is.
pub(super) fn unlike_noise(noise: &Noise, left: &Remainder) -> Option<String> {
    let times = left.rmse / noise.sensor_sigma;
    (noise.sensor_sigma > 0.0 && times > DIAGNOSE.no_noise).then(|| {
        format!(
            "no cause of the library was found, but what is left, {}, is {times:.0} times what the readings scatter from one to the next: \
             too much for noise, and slow: something outside the library",
            quantity_plain(left.rmse, &left.unit)
        )
    })
}

/// That causes were found which carry over to other records together, and leave too much to be given names.
pub(super) fn together(names: &[String], left: &Remainder, noise: &Noise) -> String {
    format!(
        "{} together take {} of what can be explained, each of them on records it was not fitted to; what is left, {}, is {:.0} times what \
         the readings scatter: something else is there, outside the library, that one of these may stand for in part",
        names.join(", "),
        share(left.explained_fraction),
        quantity_plain(left.rmse, &left.unit),
        left.rmse / noise.sensor_sigma
    )
}

/// That no cause was found; and where the residual is slow and larger than the sensors' own noise, that this is all the data say.
pub(super) fn adequate(noise: &Noise, left: &Remainder) -> String {
    if left.rmse <= DIAGNOSE.larger * noise.sensor_sigma || noise.sensor_sigma == 0.0 {
        return "nothing beyond the noise was found".to_owned();
    }
    format!(
        "nothing was found that coloured noise could not be: what is left, {}, is {:.1} times what the readings scatter from one to the \
         next, and slow; whether that is noise or something slow outside the library, the same experiment done twice would tell",
        quantity_plain(left.rmse, &left.unit),
        left.rmse / noise.sensor_sigma
    )
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
    use super::*;

    #[test]
    fn a_residual_that_is_slow_and_large_is_not_called_noise() {
        let noise = |sensor_sigma| Noise { ar: vec![0.97], sigma: 1e-3, sensor_sigma, effective_samples: 28.0 };
        let left = Remainder { rmse: 1.2e-3, unit: "rad".to_owned(), ..Remainder::default() };
        assert_eq!(adequate(&noise(1e-3), &left), "nothing beyond the noise was found");
        let slow = adequate(&noise(3e-4), &left);
        assert!(slow.contains("1.2 10⁻³ rad, is 4.0 times") && slow.contains("twice"), "{slow}");
        assert_eq!(unlike_noise(&noise(3e-4), &left), None);
        let large = unlike_noise(&noise(1e-4), &left).unwrap_or_default();
        assert!(large.contains("is 12 times") && large.ends_with("something outside the library"), "{large}");
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
            constancy_p: None,
            rivals: Vec::new(),
        }
    }

    fn margin(rival: &str, lead: f64) -> Margin {
        Margin { rival: rival.into(), lead, needed: 2.5 }
    }

    #[test]
    fn one_cause_comes_with_size_rival_and_gain() {
        let gain = |horizon_s: f64, rmse_after: f64| Gain {
            horizon_s,
            rmse_before: 4e-3,
            rmse_after,
            unit: "m".into(),
            interval: Some([1.0, 2.0]),
            explained_fraction: 0.9,
            mean_abs: [0.0; 2],
        };
        let (damping, drag) = (cause("internal_damping", "cable.bend_damping", 5e-5, "N·m²·s", 1e4), margin("linear_drag", 41.0));
        let text = named(&[damping], [("internal_damping".to_owned(), &drag)].into_iter(), &[gain(0.1, 3e-3), gain(4.0, 1e-3)]);
        assert_eq!(
            text,
            "The data call for internal_damping: cable.bend_damping = 5e-5 N·m²·s (90 % interval 4.5e-5 to 5.5e-5, scene 0); \
             its likelihood-ratio statistic is 10000. The rival nearest to internal_damping, linear_drag, is beaten by 41.0 \
             standard errors (2.5 are needed), and the error on held-out records falls from 4 to 1 mm (RMSE over 4 s)."
        );
    }

    #[test]
    fn several_causes_tell_the_closest_decision() {
        let causes = [
            cause("sensor_scale", "sensor.scale", 1.02, "-", 300.0),
            cause("internal_damping", "cable.bend_damping", 5e-5, "N·m²·s", 200.0),
            cause(DISCRETISATION, "time.step", 0.002, "s", 0.5),
        ];
        let (near, far) = (margin("gravity_tilt", 3.0), margin("linear_drag", 30.0));
        let text = named(&causes, [("sensor_scale".to_owned(), &far), ("internal_damping".to_owned(), &near)].into_iter(), &[]);
        assert!(text.starts_with("The data call for sensor_scale: sensor.scale = 1.02 (90 %"), "{text}");
        for part in [
            ", and for internal_damping: cable.bend_damping = 5e-5",
            "costs a likelihood-ratio statistic of 200 or more. The simulation's own step of 0 s is too coarse",
            ", 0.002 s would do. The rival nearest to internal_damping, gravity_tilt, is beaten by 3.0 ",
            "and no record was held out to check this on.",
        ] {
            assert!(text.contains(part), "{text}");
        }
    }

    #[test]
    fn a_step_too_coarse_has_no_rival() {
        let text = named(&[cause(DISCRETISATION, "time.step", 0.002, "s", 0.5)], [].into_iter(), &[]);
        assert_eq!(text, "The simulation's own step of 0 s is too coarse for these data, 0.002 s would do.");
    }
}
