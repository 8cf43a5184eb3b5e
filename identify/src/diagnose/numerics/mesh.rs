//! The simulation's own error in space: how far halving every edge of ropes and sheets moves the readings.
//!
//! A statement about the scene, not about the data: fitted stiffnesses may have made up for a coarse mesh already.

use crate::error::IdentifyError;
use crate::log::Record;
use crate::shooting::{MarkerPlace, NodePair, Plan, RecordPlan, ShotWants, initial_guess, shoot};
use crate::unknown::Values;
use pliant_engine::model::{Model, ModelBuilder};
use pliant_scene::{Refined, Scene};
use rayon::prelude::*;
use std::sync::Arc;

/// Readings with edges of vanishing length less those with the scene's, of every record, by Richardson's extrapolation from edges half as
/// long, and the order in the edges' length: 1 where a gripper clamps an edge by its two nodes, or a triangle by its three (half of it
/// should bend and cannot), else 2. Both simulations begin from the same kind of start: rest, or the data's state. `None` where the refined scene cannot
/// be built, or simulated at this step.
pub(super) fn shift(scene: &Scene, plan: &Plan, records: &[RecordPlan], values: &Values) -> Option<(Vec<Vec<f64>>, i32)> {
    let refined = scene.refined();
    let order = if refined.clamps_edges { 1 } else { 2 };
    let extrapolated = 1.0 / (1.0 - 0.5f64.powi(order));
    let (fine, fine_values) = refine_plan(&refined, plan, values).ok()?;
    let one = |rec: &RecordPlan| -> Option<Vec<f64>> {
        let coarse = readings(plan, &rec.record, rec.inputs.clone(), values)?;
        let inputs = rec.inputs.iter().map(|u| refined.input(u)).collect();
        let finer = readings(&fine, &carry(&refined, &rec.record), inputs, &fine_values)?;
        Some(coarse.iter().zip(&finer).map(|(a, b)| extrapolated * (b - a)).collect())
    };
    Some((records.par_iter().map(one).collect::<Option<_>>()?, order))
}

fn readings(plan: &Plan, record: &Record, inputs: Vec<Vec<f64>>, values: &Values) -> Option<Vec<f64>> {
    let start = initial_guess(plan, record).ok()?;
    let past = inputs.first().cloned().into_iter().collect();
    let (others, correction) = (Arc::default(), Arc::default());
    let rec = RecordPlan {
        record: record.clone(),
        inputs,
        past,
        others,
        start,
        sizes: Vec::new(),
        nodes: Vec::new(),
        parent: 0,
        correction,
        weight: 1.0,
    };
    shoot(plan, &rec, values, ShotWants::default()).ok().map(|shot| shot.predicted)
}

fn carry(refined: &Refined, record: &Record) -> Record {
    let phase = refined.inputs.iter().map(|&[a, _]| record.phase[a]).collect();
    Record { inputs: record.inputs.iter().map(|u| refined.input(u)).collect(), phase, ..record.clone() }
}

/// The plan and the values of the refined scene.
fn refine_plan(refined: &Refined, plan: &Plan, values: &Values) -> Result<(Plan, Values), IdentifyError> {
    let model = Arc::new(ModelBuilder::new(&refined.scene)?.build());
    let markers = plan.markers.iter().map(|m| place(&plan.model, &model, m)).collect();
    let mut theta = model.params().values().to_vec();
    for (info, value) in plan.model.params().infos().iter().zip(&values.theta) {
        if let Some(k) = model.params().find(&renamed(&info.path)) {
            theta[k] = *value;
        }
    }
    let fine_values = Values { theta, ..values.clone() };
    let scene_values = fine_values.clone();
    Ok((Plan { model, scene_values, markers, fitted: Vec::new(), held_out: Vec::new(), ..plan.clone() }, fine_values))
}

/// `rope.node[i].mass` becomes `rope.node[2i].mass`; all else stays.
fn renamed(path: &str) -> String {
    let doubled = || {
        let (rope, rest) = path.split_once(".node[")?;
        let (index, quantity) = rest.split_once(']')?;
        Some(format!("{rope}.node[{}]{quantity}", 2 * index.parse::<usize>().ok()?))
    };
    doubled().unwrap_or_else(|| path.to_owned())
}

/// The same point on the refined rope or sheet.
fn place(coarse: &Model, fine: &Model, marker: &MarkerPlace) -> MarkerPlace {
    let MarkerPlace::Nodes(marker) = marker else { return *marker };
    let ropes = coarse.ropes().iter().zip(fine.ropes());
    for (old, new) in ropes {
        if old.nodes.contains(&marker.node) {
            let edge = 2 * (marker.node - old.nodes.start);
            let [node, middle] = new.edge(edge);
            return MarkerPlace::Nodes(match 2.0 * marker.weight {
                0.0 => NodePair { node, next: node, weight: 0.0 },
                w if w <= 1.0 => NodePair { node, next: middle, weight: w },
                w => NodePair { node: middle, next: new.edge(edge + 1)[1], weight: w - 1.0 },
            });
        }
    }
    // nodes of a sheet keep their numbers in it
    let sheets = coarse.cloths().iter().zip(fine.cloths());
    let moved = sheets.filter(|(old, _)| old.nodes.contains(&marker.node));
    let moved = moved.map(|(old, new)| marker.node - old.nodes.start + new.nodes.start).next();
    MarkerPlace::Nodes(moved.map_or(*marker, |node| NodePair { node, next: node, weight: 0.0 }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::log::Setup;

    /// Root mean square shift of a scene whose edges were halved so many times, and its order.
    fn of(scene: &str, halvings: usize) -> (f64, i32) {
        let setup = Setup::read(scene).unwrap();
        let logs = setup.read_logs(&[]).unwrap();
        let (mut plan, mut scene) = (Plan::new(&setup, &logs).unwrap(), setup.scene.clone());
        for _ in 0..halvings {
            let refined = scene.refined();
            let records = plan.fitted.clone();
            plan = refine_plan(&refined, &plan, &plan.scene_values).unwrap().0;
            plan.fitted = records
                .into_iter()
                .map(|rec| RecordPlan {
                    record: carry(&refined, &rec.record),
                    inputs: rec.inputs.iter().map(|u| refined.input(u)).collect(),
                    ..rec
                })
                .collect();
            scene = refined.scene;
        }
        let (shift, order) = shift(&scene, &plan, &plan.fitted, &plan.scene_values).unwrap();
        (plan.rms(&shift), order)
    }

    #[test]
    fn a_rope_clamped_by_two_nodes_converges_at_first_order() {
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/hidden_effect/scene.toml");
        let ((coarse, order), (fine, _)) = (of(scene, 0), of(scene, 1));
        assert_eq!(order, 1);
        assert!((1.5..2.7).contains(&(coarse / fine)), "{coarse} {fine}");
    }
}
