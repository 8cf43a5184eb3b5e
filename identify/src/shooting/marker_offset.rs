//! Markers beside the centreline of a rod that twists.
//!
//! A marker stuck on a cable's skin, or a ball on a stem, is off the centreline by a constant of the section and turns with it:
//! ```text
//! p = x + o₁ d₁ + o₂ d₂
//! ```
//! with d₁, d₂ the material axes of the edge that the marker is on; at a node the mean of those of the edges that meet there (unnormalized:
//! short by half the squared half angle between them). Between two steps the axes are interpolated linearly. A record that starts where
//! the data are starts where the markers less their offsets are: nodes between markers by interpolation, velocities as if there were none.

use super::extension::spans;
use super::observed::{MarkerPlace, NodePair};
use super::plan::Plan;
use crate::unknown::{Target, Unknown, Values};
use nalgebra::Vector3;
use pliant_adjoint::Tangent;
use pliant_engine::model::Model;
use pliant_engine::rods::{Rods, TransportDerivative};
use pliant_math::State;

/// Where markers are that may be beside a rod.
pub(super) struct Beside {
    /// The edges whose axes count, with their weights, by marker.
    edges: Vec<Vec<(usize, f64)>>,
    /// By how much a free node starts off where the data have it: (node, marker, weight).
    starts: Vec<(usize, usize, f64)>,
}

/// An offset at one state: its parts along both axes for 1 m each, and, added up by the offsets' values, the whole and its tangents.
pub(super) struct Offset {
    pub axes: [Vector3<f64>; 2],
    pub whole: Vector3<f64>,
    /// Three rows of as many columns as the state's tangents have; empty without tangents.
    pub rows: Vec<f64>,
}

/// State at which an offset is evaluated, with its tangents and their number of columns where derivatives are wanted.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub model: &'a Model,
    pub x: &'a State,
    pub tangent: Option<(&'a Tangent, usize)>,
}

impl Beside {
    /// None where no marker is beside a rod, and none of the unknowns puts one there.
    pub fn new(plan: &Plan, values: &Values, unknowns: &[Unknown]) -> Option<Self> {
        let sought = unknowns.iter().any(|u| matches!(u.target, Target::Beside(..)));
        if !sought && values.offsets.iter().flatten().all(|o| *o == 0.0) {
            return None;
        }
        let rods = plan.model.rods();
        let edges = plan.markers.iter().map(|m| m.nodes().map_or_else(Vec::new, |pair| edges_of(rods, pair))).collect();
        Some(Self { edges, starts: starts(plan) })
    }

    /// The offset of a marker at a state.
    pub fn offset(&self, marker: usize, values: &Values, at: At) -> Offset {
        let (rods, o) = (at.model.rods(), values.offsets[marker]);
        let columns = at.tangent.map_or(0, |(_, m)| m);
        let mut out = Offset { axes: [Vector3::zeros(); 2], whole: Vector3::zeros(), rows: vec![0.0; 3 * columns] };
        for &(k, weight) in &self.edges[marker] {
            let ([t, d1, d2], length) = rods.edge_axes(k, &at.x.q, &at.x.z[at.model.ndz()..]);
            out.axes[0] += d1 * weight;
            out.axes[1] += d2 * weight;
            let s = (d1 * o[0] + d2 * o[1]) * weight;
            out.whole += s;
            let Some((tangent, m)) = at.tangent else { continue };
            // the axes turn by t × δe/l as they are carried along, and by δα about t
            let ([a, b], about) = (rods.edges[k].nodes, t.cross(&s));
            let row = |r: usize| &tangent.q[r * m..(r + 1) * m];
            let turn = row(rods.row(k));
            for axis in 0..3 {
                let own = &mut out.rows[axis * m..(axis + 1) * m];
                own.iter_mut().zip(turn).for_each(|(r, x)| *r += about[axis] * x);
                for i in 0..3 {
                    let slope = -t[axis] * s[i] / length;
                    let moved = row(3 * b + i).iter().zip(row(3 * a + i));
                    own.iter_mut().zip(moved).for_each(|(r, (to, from))| *r += slope * (to - from));
                }
            }
        }
        out
    }

    /// Moves the start from where the markers are to the centreline, with its tangents.
    pub fn start(&self, values: &Values, unknowns: &[(usize, &Unknown)], at: At, tangent: &mut Tangent) -> State {
        let (model, x) = (at.model, at.x);
        let mut shift = vec![0.0; model.ndx()];
        let mut rows: Vec<(usize, Vec<f64>)> = Vec::new();
        for &(node, marker, weight) in &self.starts {
            let offset = self.offset(marker, values, at);
            (0..3).for_each(|a| shift[3 * node + a] -= weight * offset.whole[a]);
            let Some((_, m)) = at.tangent else { continue };
            let mut own = offset.rows;
            for (column, axes) in directions(unknowns, marker, &offset.axes) {
                (0..3).for_each(|a| own[a * m + column] += axes[a]);
            }
            own.iter_mut().for_each(|r| *r *= -weight);
            rows.push((node, own));
        }
        let moved = model.displaced(x, &shift);
        if let Some((_, m)) = at.tangent {
            let carry = TransportDerivative::between(model.rods(), &x.q, &moved.q);
            carry.add_before(&mut tangent.q, m);
            for (node, own) in rows {
                tangent.q[3 * node * m..3 * (node + 1) * m].iter_mut().zip(&own).for_each(|(t, r)| *t += r);
            }
            carry.add_after(&mut tangent.q, m);
        }
        moved
    }
}

/// (column, slope) of every unknown that moves this marker.
fn directions<'a>(
    unknowns: &'a [(usize, &'a Unknown)],
    marker: usize,
    axes: &'a [Vector3<f64>; 2],
) -> impl Iterator<Item = (usize, Vector3<f64>)> + 'a {
    unknowns.iter().filter_map(move |(column, u)| match &u.target {
        Target::Beside(markers, axis) if markers.contains(&marker) => Some((*column, axes[*axis] * u.scale)),
        _ => None,
    })
}

/// Edges whose axes a marker turns with, and their weights.
fn edges_of(rods: &Rods, pair: &NodePair) -> Vec<(usize, f64)> {
    let of = |k: &usize| match pair.weight {
        0.0 => rods.edges[*k].nodes.contains(&pair.node),
        _ => rods.edges[*k].nodes.contains(&pair.node) && rods.edges[*k].nodes.contains(&pair.next),
    };
    let found: Vec<usize> = (0..rods.edges.len()).filter(of).collect();
    let weight = 1.0 / found.len().max(1) as f64;
    found.into_iter().map(|k| (k, weight)).collect()
}

/// Free nodes that start where markers have them, or between such nodes and held ones.
fn starts(plan: &Plan) -> Vec<(usize, usize, f64)> {
    let model = &plan.model;
    let at = |node: usize| {
        let on = |m: &MarkerPlace| m.nodes().is_some_and(|pair| pair.weight == 0.0 && pair.node == node);
        plan.markers.iter().position(on)
    };
    let mut out = Vec::new();
    for span in spans(model, &plan.scene_values.theta) {
        let held = |node: usize| model.prescribed()[node];
        let known: Vec<usize> = span.nodes.clone().filter(|node| at(*node).is_some() || held(*node)).collect();
        for (node, parts) in span.nodes.clone().zip(span.weights(&known)).filter(|(node, _)| !held(*node)) {
            out.extend(parts.into_iter().filter_map(|(k, weight)| Some((node, at(known[k])?, weight))));
        }
    }
    out
}
