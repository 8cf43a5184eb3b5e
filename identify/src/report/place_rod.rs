//! Where estimates of a rod's section, its joints and its creep stand in a scene.

use super::extended::set_value;
use crate::shooting::SHOOTING;
use crate::unknown::range;
use toml::{Table, Value};

/// Sets a quantity of a rod by the end of its path; returns the table below the rope it stands in, and its key.
pub(super) fn set_rod(rope: &mut Table, path: &str, new: f64) -> Option<(&'static str, String)> {
    if let Some((Law { table, without }, key)) = law(path) {
        let law = rope.entry(table.strip_prefix("rope.")?).or_insert_with(|| Value::Table(Table::new())).as_table_mut()?;
        if law.is_empty() {
            without.iter().for_each(|(key, x)| drop(law.insert((*key).to_owned(), Value::Float(*x))));
        }
        law.insert(key.to_owned(), Value::Float(new));
        return Some((table, key.to_owned()));
    }
    let nodes = node_count(rope);
    if let Some((head, numbers, tail)) = range(path) {
        return numbers.map(|k| set_rod(rope, &format!("{head}[{k}]{tail}"), new)).last()?;
    }
    if let Some(edge) = path.strip_prefix("edge[").and_then(|rest| rest.strip_suffix("].rest_strain")) {
        let edges = usize::try_from(nodes?).ok()? - usize::from(!is_closed(rope));
        let strains = rope.entry("edge_rest_strains").or_insert_with(|| Value::Array(vec![Value::Float(0.0); edges]));
        *strains.as_array_mut()?.get_mut(edge.parse::<usize>().ok()?)? = Value::Float(new);
        return Some(("rope", "edge_rest_strains".to_owned()));
    }
    let twist = rope.get_mut("twist")?.as_table_mut()?;
    if let Some((node, quantity)) = path.strip_prefix("node[").and_then(|rest| rest.split_once("].")) {
        set_joint(twist, node.parse().ok()?, nodes?, quantity, new)?;
        return Some(("rope.twist.joint", String::new()));
    }
    if path == "bend_stiffness_2" {
        twist.insert(path.to_owned(), Value::Float(new));
        return Some(("rope.twist", path.to_owned()));
    }
    let key = set_value(twist, path.strip_prefix("twist_").unwrap_or(path), new)?;
    Some(("rope.twist", key))
}

fn is_closed(rope: &Table) -> bool {
    rope.get("closed").and_then(Value::as_bool) == Some(true)
}

/// A law that a section may be without: its table, and the content of a new one.
struct Law {
    table: &'static str,
    without: &'static [(&'static str, f64)],
}

const CREEP: Law = Law { table: "rope.creep", without: &[("fraction", 0.0), ("time", 1.0)] };
const STIFFENING: Law = Law { table: "rope.stiffening", without: &[("coefficient", 0.0)] };
const FRICTION: Law = Law { table: "rope.bend_friction", without: &[("moment", 0.0), ("curvature", 1.0)] };
const PLASTICITY: Law =
    Law { table: "rope.plasticity", without: &[("yield_curvature", SHOOTING.inactive_limit), ("time", SHOOTING.inactive_time)] };

/// The law that a path is a quantity of, and its key there.
fn law(path: &str) -> Option<(Law, &str)> {
    let of = |law: Law, begin: &str| path.strip_prefix(begin).map(|key| (law, key));
    match path {
        "stiffening" => Some((STIFFENING, "coefficient")),
        "yield_curvature" => Some((PLASTICITY, path)),
        "plastic_time" => Some((PLASTICITY, "time")),
        _ => of(CREEP, "creep_").or_else(|| of(FRICTION, "friction_")),
    }
}

/// Number of a rope's nodes.
pub(super) fn node_count(rope: &Table) -> Option<i64> {
    match rope.get("nodes").and_then(Value::as_integer) {
        Some(nodes) => Some(nodes),
        None => {
            let edges = i64::try_from(rope.get("edge_fractions")?.as_array()?.len()).ok()?;
            Some(edges + i64::from(!is_closed(rope)))
        }
    }
}

/// Sets the section of the joint at a node.
fn set_joint(twist: &mut Table, node: i64, nodes: i64, quantity: &str, new: f64) -> Option<()> {
    let list = twist.entry("joint").or_insert_with(|| Value::Array(Vec::new())).as_array_mut()?;
    let same = |item: &Value| item.get("node").and_then(Value::as_integer).is_some_and(|k| k.rem_euclid(nodes) == node);
    let place = list.iter().position(same).unwrap_or_else(|| {
        let curvature = Value::Array(vec![Value::Float(0.0); 2]);
        let entries = [("node", Value::Integer(node)), ("rest_curvature", curvature), ("bend_factor", Value::Float(1.0))];
        list.push(Value::Table(entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()));
        list.len() - 1
    });
    set_value(list.get_mut(place)?.as_table_mut()?, quantity, new).map(drop)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn quantities_of_a_rod_find_their_tables() {
        let mut rope: Table = toml::from_str("nodes = 5\n[twist]\nstiffness = 1.0\nrest_curvature = [0.0, 0.0]").unwrap();
        let mut set = |path: &str, x: f64| set_rod(&mut rope, path, x).unwrap();
        assert_eq!(set("twist_stiffness", 2.0), ("rope.twist", "stiffness".to_owned()));
        assert_eq!(set("rest_curvature[1]", 3.0), ("rope.twist", "rest_curvature".to_owned()));
        assert_eq!(set("bend_stiffness_2", 4.0), ("rope.twist", "bend_stiffness_2".to_owned()));
        assert_eq!(set("creep_fraction", 0.2), ("rope.creep", "fraction".to_owned()));
        assert_eq!(set("stiffening", 0.03), ("rope.stiffening", "coefficient".to_owned()));
        assert_eq!(set("friction_moment", 0.01), ("rope.bend_friction", "moment".to_owned()));
        assert_eq!(set("friction_curvature", 0.7), ("rope.bend_friction", "curvature".to_owned()));
        assert_eq!(set("node[3].rest_curvature[0]", 5.0).0, "rope.twist.joint");
        assert_eq!(set("node[3].bend_factor", 0.5).0, "rope.twist.joint");
        assert_eq!(set("edge[3].rest_strain", 0.02), ("rope", "edge_rest_strains".to_owned()));
        assert_eq!(set("node[1..2].bend_factor", 0.7).0, "rope.twist.joint");
        assert_eq!(set("edge[0..1].rest_strain", 0.01), ("rope", "edge_rest_strains".to_owned()));
        assert_eq!(set("plastic_time", 0.5), ("rope.plasticity", "time".to_owned()));
        let strains: Vec<f64> = rope["edge_rest_strains"].as_array().unwrap().iter().filter_map(Value::as_float).collect();
        assert_eq!((strains, rope["plasticity"]["time"].as_float()), (vec![0.01, 0.01, 0.0, 0.02], Some(0.5)));
        let of = |table: &str, key: &str| rope[table][key].as_float().unwrap();
        assert_eq!((of("stiffening", "coefficient"), of("bend_friction", "moment")), (0.03, 0.01));
        assert_eq!((of("bend_friction", "curvature"), of("creep", "time")), (0.7, 1.0));
        let twist = rope["twist"].as_table().unwrap();
        assert_eq!((twist["stiffness"].as_float(), twist["rest_curvature"][1].as_float()), (Some(2.0), Some(3.0)));
        let joint = &twist["joint"].as_array().unwrap()[..];
        assert_eq!((joint.len(), joint[0]["rest_curvature"][0].as_float()), (3, Some(5.0)));
        assert_eq!((joint[2]["node"].as_integer(), joint[2]["bend_factor"].as_float()), (Some(2), Some(0.7)));
        assert_eq!((joint[0]["bend_factor"].as_float(), rope["creep"]["fraction"].as_float()), (Some(0.5), Some(0.2)));
        assert_eq!(set_rod(&mut rope, "no_such_key", 1.0), None);
    }
}
