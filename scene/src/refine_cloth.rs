//! A sheet of cloth with every edge halved: each triangle becomes four alike. Nodes keep their numbers; those that halve edges follow.

use super::cloth::Cloth;
use super::cloth_initial::cloth_points;
use super::mesh::Raw;
use super::vector::{V3, add, scale};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Edges of a sheet, by nodes with the smaller number first, and the nodes that halve them; triangles.
pub(super) struct Halves {
    middles: BTreeMap<[usize; 2], usize>,
    faces: Vec<[usize; 3]>,
}

impl Halves {
    /// None of a sheet that cannot be read.
    pub(super) fn of(cloth: &Cloth) -> Option<Self> {
        let raw = cloth.raw("cloth").ok()?;
        let mut middles: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        for [a, b, c] in &raw.faces {
            for [i, j] in [[a, b], [b, c], [c, a]] {
                middles.insert([*i.min(j), *i.max(j)], 0);
            }
        }
        let first = raw.vertices.len();
        middles.values_mut().zip(first..).for_each(|(middle, node)| *middle = node);
        Some(Self { middles, faces: raw.faces.clone() })
    }

    /// The node that halves the edge between two; none if there is no such edge.
    pub(super) fn between(&self, a: usize, b: usize) -> Option<usize> {
        self.middles.get(&[a.min(b), a.max(b)]).copied()
    }

    /// Whether all nodes of a triangle are among these: then that triangle cannot turn.
    pub(super) fn clamps(&self, held: &[usize]) -> bool {
        self.faces.iter().any(|face| face.iter().all(|node| held.contains(node)))
    }

    /// The points, and behind them those halfway along every edge.
    fn points(&self, of: &[V3]) -> Vec<V3> {
        let middles = self.middles.keys().map(|&[a, b]| scale(add(of[a], of[b]), 0.5));
        of.iter().copied().chain(middles).collect()
    }

    /// The sheet with every edge halved; `c` is its number in the scene.
    pub(super) fn refined(&self, cloth: &Cloth, c: usize) -> Option<Cloth> {
        let (raw, start) = (cloth.raw("cloth").ok()?, cloth_points(cloth, c).ok()?);
        let quarters = |&[a, b, c]: &[usize; 3]| {
            let [ab, bc, ca] = [self.between(a, b)?, self.between(b, c)?, self.between(c, a)?];
            Some([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]])
        };
        let faces = raw.faces.iter().map(quarters).collect::<Option<Vec<_>>>()?.concat();
        let refined = Raw { vertices: self.points(&raw.vertices), faces, ..Raw::default() };
        // as from a file that has been read: its shape at rest is not that of a grid with these numbers of nodes
        let mesh = Some(format!("{}, refined", cloth.name));
        let (points, loaded) = (Some(self.points(&start)), Some(Arc::new(refined)));
        Some(Cloth { grid: None, mesh, loaded, points, u_axis: None, v_axis: None, ..cloth.clone() })
    }
}
