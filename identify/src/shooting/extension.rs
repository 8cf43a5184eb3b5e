//! Values that are known at some nodes of a rope or a sheet, extended to the others.
//!
//! A node without a value takes the mean of its neighbours' along the edges:
//! ```text
//! Σ_j (x_j − x_i) = 0    over the neighbours j of every unknown node i
//! ```
//! Along a rope that is linear from one known node to the next, and constant beyond the last; over a sheet it is the shape of a membrane
//! pinned at the known nodes. Each value is a weighted sum of the known ones, with weights from 0 to 1 that add up to 1.

use nalgebra::{Cholesky, DMatrix};
use pliant_engine::model::Model;
use std::ops::Range;

/// The nodes of a rope or sheet and its edges, by nodes of the model.
pub(super) struct Span {
    pub nodes: Range<usize>,
    pub edges: Vec<Edge>,
    /// Force per strain along it [N]; of a sheet that of a square of its area.
    pub stiffness: f64,
}

/// An edge.
pub(super) struct Edge {
    pub nodes: [usize; 2],
    /// Length at rest \[m\].
    pub rest: f64,
}

/// Every rope, then every sheet.
pub(super) fn spans(model: &Model, theta: &[f64]) -> Vec<Span> {
    let value = |name: &str, key: &str| model.params().find(&format!("{name}.{key}")).map_or(0.0, |k| theta[k]);
    let ropes = model.ropes().iter().map(|rope| {
        let edge = |(e, fraction): (usize, &f64)| Edge { nodes: rope.edge(e), rest: fraction * theta[rope.length] };
        let edges = rope.fractions.iter().enumerate().map(edge).collect();
        Span { nodes: rope.nodes.clone(), edges, stiffness: value(&rope.name, "stretch_stiffness") }
    });
    let sheets = model.cloths().iter().map(|sheet| {
        let (side, first) = (theta[sheet.area].sqrt(), sheet.nodes.start);
        let edge = |(nodes, length): &([usize; 2], f64)| Edge { nodes: nodes.map(|node| first + node), rest: length * side };
        let stiffness = value(&sheet.name, "youngs_modulus") * value(&sheet.name, "thickness") * side;
        Span { nodes: sheet.nodes.clone(), edges: sheet.edges.iter().map(edge).collect(), stiffness }
    });
    ropes.chain(sheets).collect()
}

impl Span {
    /// Of every node the weights of the known nodes, (number in `known`, weight); none of a piece without any.
    pub fn weights(&self, known: &[usize]) -> Vec<Vec<(usize, f64)>> {
        let (first, n) = (self.nodes.start, self.nodes.len());
        let mut out: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n];
        // of two that are one node the first counts
        known.iter().enumerate().rev().for_each(|(k, node)| out[node - first] = vec![(k, 1.0)]);
        let mut reached: Vec<bool> = out.iter().map(|parts| !parts.is_empty()).collect();
        let mut more = true;
        while more {
            more = false;
            for edge in &self.edges {
                let [a, b] = edge.nodes.map(|node| node - first);
                more |= reached[a] != reached[b];
                (reached[a], reached[b]) = (reached[a] || reached[b], reached[a] || reached[b]);
            }
        }
        let sought: Vec<usize> = (0..n).filter(|node| reached[*node] && out[*node].is_empty()).collect();
        let row = |node: usize| sought.binary_search(&node).ok();
        let mut matrix = DMatrix::zeros(sought.len(), sought.len());
        let mut right = DMatrix::zeros(sought.len(), known.len());
        for edge in &self.edges {
            let [a, b] = edge.nodes.map(|node| node - first);
            for (here, there) in [(a, b), (b, a)] {
                let Some(i) = row(here) else { continue };
                matrix[(i, i)] += 1.0;
                match row(there) {
                    Some(j) => matrix[(i, j)] -= 1.0,
                    None => out[there].iter().for_each(|&(k, weight)| right[(i, k)] += weight),
                }
            }
        }
        let Some(factor) = Cholesky::new(matrix) else { return out }; // which is positive: every piece has a known node
        let weights = factor.solve(&right);
        for (i, node) in sought.iter().enumerate() {
            out[*node] = weights.row(i).iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0).collect();
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(nodes: Range<usize>, edges: &[[usize; 2]]) -> Span {
        let edges = edges.iter().map(|&nodes| Edge { nodes, rest: 1.0 }).collect();
        Span { nodes, edges, stiffness: 0.0 }
    }

    #[test]
    fn along_a_rope_it_is_linear_between_known_nodes_and_constant_beyond() {
        let rope = span(3..10, &[[3, 4], [4, 5], [5, 6], [6, 7], [7, 8], [8, 9]]);
        let known = [4, 8];
        let value = |parts: &Vec<(usize, f64)>| parts.iter().map(|(k, weight)| [2.0, 6.0][*k] * weight).sum::<f64>();
        let found: Vec<f64> = rope.weights(&known).iter().map(value).collect();
        for (x, wanted) in found.iter().zip([2.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.0]) {
            assert!((x - wanted).abs() < 1e-12, "{found:?}");
        }
        // a ring goes on over its closing edge
        let ring = span(0..4, &[[0, 1], [1, 2], [2, 3], [3, 0]]);
        let found: Vec<f64> = ring.weights(&[0, 2]).iter().map(value).collect();
        assert!((found[1] - 4.0).abs() < 1e-12 && (found[3] - 4.0).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn weights_add_up_to_one_and_a_piece_without_known_nodes_has_none() {
        // a square of 3 × 3 nodes, and a triangle apart from it
        let across = (0..3).flat_map(|i| (0..2).map(move |j| [3 * i + j, 3 * i + j + 1]));
        let along = (0..2).flat_map(|i| (0..3).map(move |j| [3 * i + j, 3 * i + j + 3]));
        let edges: Vec<[usize; 2]> = across.chain(along).chain([[9, 10], [10, 11], [11, 9]]).collect();
        let weights = span(0..12, &edges).weights(&[0, 2, 6, 8]);
        for parts in &weights[..9] {
            let sum: f64 = parts.iter().map(|(_, weight)| weight).sum();
            assert!((sum - 1.0).abs() < 1e-12 && parts.iter().all(|(_, weight)| *weight > 0.0), "{parts:?}");
        }
        assert!(weights[4].iter().all(|(_, weight)| (weight - 0.25).abs() < 1e-12), "{:?}", weights[4]);
        assert!(weights[9..].iter().all(Vec::is_empty));
    }
}
