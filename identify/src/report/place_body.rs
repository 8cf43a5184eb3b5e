//! Where estimates of joints, their sensors and inertias stand in a scene.

use super::extended::{Place, set_value};
use crate::diagnose::Estimate;
use crate::log::JointSensor;
use nalgebra::{Matrix3, Vector3};
use pliant_math::inertia::{from_numbers, to_numbers};
use pliant_math::spatial::full;
use serde::Deserialize;
use toml::{Table, Value};

/// Numbers of a body's inertia in θ that come before its spread.
const BEFORE_SPREAD: usize = 4;

/// A quantity of a joint, or of a sensor at one.
pub(super) fn set_joint(scene: &mut Table, object: &str, rest: &str, estimate: &Estimate) -> Option<Place> {
    set_sensor(scene, estimate).or_else(|| {
        let bodies = scene.get_mut("body")?.as_array_mut()?.iter_mut();
        let joints = bodies.filter_map(|body| body.get_mut("joint")?.as_array_mut()).flatten();
        let (number, joint) = joints.enumerate().find(|(_, j)| j.get("name").and_then(Value::as_str) == Some(object))?;
        let rest = rest.replace("limit[", "limits[");
        let joint = joint.as_table_mut()?;
        let key = match rest.strip_prefix("cogging_") {
            Some(part) => {
                set_value(joint.get_mut("cogging")?.as_table_mut()?, part, estimate.estimate)?;
                "cogging".to_owned()
            }
            None => set_value(joint, &rest, estimate.estimate)?,
        };
        Some(Place { table: "body.joint".to_owned(), number, key })
    })
}

fn set_sensor(scene: &mut Table, estimate: &Estimate) -> Option<Place> {
    let sensors = scene.get_mut("experiment")?.get_mut("joint")?.as_array_mut()?;
    let entry = |sensor: &Value| {
        let paths = JointSensor::deserialize(sensor.clone()).ok()?.paths();
        paths.iter().position(|path| *path == estimate.path)
    };
    let (number, which) = sensors.iter().enumerate().find_map(|(k, sensor)| Some((k, entry(sensor)?)))?;
    let key = crate::sensor::JOINT_ENTRIES[which].to_owned();
    sensors[number].as_table_mut()?.insert(key.clone(), Value::Float(estimate.estimate));
    Some(Place { table: "experiment.joint".to_owned(), number, key })
}

/// One of the ten numbers of a body's inertia; mass, centre and moments in the scene follow.
pub(super) fn set_inertia(body: &mut Table, rest: &str, new: f64) -> Option<String> {
    let index = |prefix: &str| rest.strip_prefix(prefix)?.strip_suffix(']')?.parse::<usize>().ok();
    let (entry, key) = match (rest, index("center_of_mass["), index("spread[")) {
        ("mass", ..) => (0, "mass"),
        (_, Some(k), _) => (1 + k, "center_of_mass"),
        (_, _, Some(k)) => (BEFORE_SPREAD + k, "inertia"),
        _ => return None,
    };
    let numbers = |value: Option<&Value>| -> Option<Vec<f64>> {
        value?.as_array()?.iter().map(|x| x.as_float().or_else(|| x.as_integer().map(|i| i as f64))).collect()
    };
    let (mass, c) = (body.get("mass")?.as_float()?, numbers(body.get("center_of_mass")).unwrap_or(vec![0.0; 3]));
    let [xx, yy, zz, xy, xz, yz] = numbers(body.get("inertia"))?.try_into().ok()?;
    let about = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let mut x = to_numbers(mass, Vector3::new(c[0], c[1], c[2]), &about).ok()?;
    *x.get_mut(entry)? = new;
    let centre = [x[1], x[2], x[3]];
    x[1..BEFORE_SPREAD].fill(0.0);
    let j = full(&from_numbers::<f64>(&x).j);
    let list = |all: &[f64]| Value::Array(all.iter().map(|x| Value::Float(*x)).collect());
    body.insert("mass".to_owned(), Value::Float(x[0]));
    body.insert("center_of_mass".to_owned(), list(&centre));
    body.insert("inertia".to_owned(), list(&[j[(0, 0)], j[(1, 1)], j[(2, 2)], j[(0, 1)], j[(0, 2)], j[(1, 2)]]));
    Some(key.to_owned())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn body() -> Table {
        toml::from_str("mass = 2.0\ncenter_of_mass = [0.0, 0.0, -0.1]\ninertia = [0.02, 0.03, 0.025, 0.001, 0.0, 0.002]").unwrap()
    }

    #[test]
    fn a_heavier_body_keeps_its_shape() {
        let mut table = body();
        assert_eq!(set_inertia(&mut table, "mass", 3.0).unwrap(), "mass");
        assert_eq!(table["mass"].as_float(), Some(3.0));
        let moments: Vec<f64> = table["inertia"].as_array().unwrap().iter().map(|x| x.as_float().unwrap()).collect();
        for (new, old) in moments.iter().zip([0.02, 0.03, 0.025, 0.001, 0.0, 0.002]) {
            assert!((new - 1.5 * old).abs() < 1e-12, "{moments:?}");
        }
    }

    #[test]
    fn a_spread_moves_the_moments_alone() {
        let mut table = body();
        assert_eq!(set_inertia(&mut table, "spread[2]", 0.15).unwrap(), "inertia");
        assert_eq!(table["mass"].as_float(), Some(2.0));
        assert_eq!(table["center_of_mass"], body()["center_of_mass"]);
        assert_ne!(table["inertia"], body()["inertia"]);
    }

    #[test]
    fn joints_and_their_sensors_are_found() {
        let text = "[[body]]\n[[body.joint]]\nname = \"a\"\n[[body]]\n[[body.joint]]\nname = \"b\"\ndamping = 0.0\n\
                    cogging = { cycles = 6, sine = 0.0, cosine = 0.0 }\n\
                    [experiment]\n[[experiment.joint]]\njoint = \"b\"\ncolumn = \"q\"\n";
        let mut scene: Table = toml::from_str(text).unwrap();
        let estimate = |path: &str| {
            let (path, unit) = (path.to_owned(), String::new());
            Estimate { path, estimate: 0.5, unit, interval: Some([0.4, 0.6]), scene_value: 0.0 }
        };
        let place = set_joint(&mut scene, "b", "damping", &estimate("b.damping")).unwrap();
        assert_eq!((place.table.as_str(), place.number, place.key.as_str()), ("body.joint", 1, "damping"));
        let place = set_joint(&mut scene, "b", "cogging_cosine", &estimate("b.cogging_cosine")).unwrap();
        assert_eq!((place.table.as_str(), place.number, place.key.as_str()), ("body.joint", 1, "cogging"));
        let cogging = &scene["body"][1]["joint"][0]["cogging"];
        assert_eq!([&cogging["sine"], &cogging["cosine"]].map(Value::as_float), [Some(0.0), Some(0.5)]);
        let place = set_joint(&mut scene, "b", "position_bias", &estimate("b.position_bias")).unwrap();
        assert_eq!((place.table.as_str(), place.number, place.key.as_str()), ("experiment.joint", 0, "bias"));
        assert!(set_joint(&mut scene, "c", "damping", &estimate("c.damping")).is_none());
    }
}
