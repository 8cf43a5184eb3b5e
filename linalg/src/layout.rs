//! Where the rows of nodes and twists stand in a matrix.
//!
//! The rows of a nodal system are three per node, node by node, and then one per twist angle. A matrix stores them in *slots* of three
//! rows, or of four if there are twists: a node and the twist of the edge that begins at it, so that an edge's twist is as near to its
//! nodes as they are to each other and elimination makes little fill. A slot without a twist has an empty fourth row. Slots follow
//! the nodes' numbers, or an order of their own (a closed loop is folded, so that its ends meet).

use crate::KktError;

/// No row of the system.
const EMPTY: usize = usize::MAX;

/// Which blocks (i, j) of slots may be nonzero.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Pattern {
    /// |i − j| ≤ half_width.
    Band(usize),
    /// Those of row i are the sorted `columns[starts[i]..starts[i + 1]]`, of which `columns[diagonals[i]]` is i; structurally symmetric.
    Sparse { starts: Vec<usize>, columns: Vec<usize>, diagonals: Vec<usize> },
}

/// Sizes, order and pattern of the matrices of a model; made once and shared.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeLayout {
    n_nodes: usize,
    /// Rows per slot.
    block: usize,
    /// Slot of each node.
    slots: Vec<usize>,
    /// Storage row of each row of the system, if the two differ.
    storage: Option<Vec<usize>>,
    /// Row of the system of each storage row, or [`EMPTY`]; likewise.
    system: Vec<usize>,
    dim: usize,
    pub(crate) pattern: Pattern,
}

impl NodeLayout {
    /// `n_nodes` nodes in their order, blocks (i, j) with |i − j| ≤ `half_width`.
    pub fn band(n_nodes: usize, half_width: usize) -> Self {
        Self::assemble((0..n_nodes).collect(), &[], Pattern::Band(half_width))
    }

    /// A band just wide enough for `stencils`, sets of nodes that act on each other. `twists[k]`: the node whose slot holds twist k.
    /// `order`: the nodes slot by slot; their own order if `None`.
    pub fn banded(n_nodes: usize, twists: &[usize], order: Option<&[usize]>, stencils: &[Vec<usize>]) -> Result<Self, KktError> {
        let slots = slots(n_nodes, order)?;
        check(n_nodes, twists, stencils)?;
        let reach = |nodes: &Vec<usize>| {
            let of = nodes.iter().map(|&n| slots[n]);
            of.clone().max().zip(of.min()).map_or(0, |(a, b)| a - b)
        };
        let half_width = stencils.iter().map(reach).max().unwrap_or(0);
        Ok(Self::assemble(slots, twists, Pattern::Band(half_width)))
    }

    /// As [`NodeLayout::banded`], with room for the blocks between nodes of a stencil alone.
    pub fn sparse(n_nodes: usize, twists: &[usize], order: Option<&[usize]>, stencils: &[Vec<usize>]) -> Result<Self, KktError> {
        let slots = slots(n_nodes, order)?;
        check(n_nodes, twists, stencils)?;
        let mut rows: Vec<Vec<usize>> = (0..n_nodes).map(|i| vec![i]).collect();
        for nodes in stencils {
            for &i in nodes {
                rows[slots[i]].extend(nodes.iter().map(|&j| slots[j]));
            }
        }
        let (mut starts, mut columns) = (vec![0], Vec::new());
        for mut row in rows {
            row.sort_unstable();
            row.dedup();
            columns.extend(row);
            starts.push(columns.len());
        }
        let diagonals = (0..n_nodes).map(|i| starts[i] + columns[starts[i]..starts[i + 1]].partition_point(|&j| j < i)).collect();
        Ok(Self::assemble(slots, twists, Pattern::Sparse { starts, columns, diagonals }))
    }

    fn assemble(slots: Vec<usize>, twists: &[usize], pattern: Pattern) -> Self {
        let (n_nodes, block) = (slots.len(), if twists.is_empty() { 3 } else { 4 });
        let of_nodes = slots.iter().flat_map(|s| (0..3).map(move |a| block * s + a));
        let storage: Vec<usize> = of_nodes.chain(twists.iter().map(|&n| 4 * slots[n] + 3)).collect();
        let dim = storage.len();
        let mut system = vec![EMPTY; block * n_nodes];
        storage.iter().enumerate().for_each(|(row, &at)| system[at] = row);
        let storage = storage.iter().enumerate().any(|(row, &at)| row != at).then_some(storage);
        Self { n_nodes, block, slots, storage, system, dim, pattern }
    }

    /// Number of nodes, which is that of slots.
    pub fn n_nodes(&self) -> usize {
        self.n_nodes
    }

    /// Rows of the system: three per node, one per twist.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Whether there is room for the blocks of stencils alone.
    pub fn is_sparse(&self) -> bool {
        matches!(self.pattern, Pattern::Sparse { .. })
    }

    /// Rows per slot.
    pub(crate) fn block(&self) -> usize {
        self.block
    }

    /// Rows in storage, empty ones included.
    pub(crate) fn stored(&self) -> usize {
        self.block * self.n_nodes
    }

    /// Whether storage rows are the system's.
    #[inline]
    pub(crate) fn is_plain(&self) -> bool {
        self.storage.is_none()
    }

    #[inline]
    pub(crate) fn slot(&self, node: usize) -> usize {
        self.slots[node]
    }

    /// Storage row of a row of the system.
    #[inline]
    pub(crate) fn storage(&self, row: usize) -> usize {
        self.storage.as_ref().map_or(row, |s| s[row])
    }

    /// Row of the system of a storage row; `None` if it is empty.
    #[inline]
    pub(crate) fn system(&self, at: usize) -> Option<usize> {
        Some(self.system[at]).filter(|row| *row != EMPTY)
    }

    /// The same flags slot by slot.
    pub(crate) fn by_slot(&self, of_nodes: &[bool]) -> Vec<bool> {
        let mut out = vec![false; self.n_nodes];
        self.slots.iter().zip(of_nodes).for_each(|(&s, &flag)| out[s] = flag);
        out
    }

    /// Half width of the band in slots; of a sparse pattern, that of the band around it.
    pub fn half_width(&self) -> usize {
        match &self.pattern {
            Pattern::Band(half_width) => *half_width,
            Pattern::Sparse { .. } => (0..self.n_nodes).flat_map(|i| self.row(i).map(move |j| i.abs_diff(j))).max().unwrap_or(0),
        }
    }

    /// Columns of the blocks of row `i` that are stored and inside the matrix, rising.
    pub(crate) fn row(&self, i: usize) -> impl Iterator<Item = usize> {
        let (range, listed) = match &self.pattern {
            Pattern::Band(half_width) => (i.saturating_sub(*half_width)..self.n_nodes.min(i + half_width + 1), None),
            Pattern::Sparse { starts, columns, .. } => (starts[i]..starts[i + 1], Some(columns)),
        };
        range.map(move |k| listed.map_or(k, |columns| columns[k]))
    }

    /// Where block (i, j) of slots starts in a matrix, and the distance between its rows; `None` if there is no room for it.
    #[inline]
    pub(crate) fn place(&self, i: usize, j: usize) -> Option<(usize, usize)> {
        let b = self.block;
        match &self.pattern {
            Pattern::Band(half_width) => {
                let row_len = b * (2 * half_width + 1);
                let k = j + half_width;
                (k >= i && k - i <= 2 * half_width).then(|| (i * b * row_len + b * (k - i), row_len))
            }
            Pattern::Sparse { starts, columns, diagonals } => {
                let row = &columns[starts[i]..starts[i + 1]];
                let k = if i == j { diagonals[i] - starts[i] } else { row.binary_search(&j).ok()? };
                Some((starts[i] * b * b + b * k, b * row.len()))
            }
        }
    }

    /// Place of entry (r, c) of the storage; `None` if there is no room for it.
    #[inline]
    pub(crate) fn entry(&self, r: usize, c: usize) -> Option<usize> {
        let b = self.block;
        self.place(r / b, c / b).map(|(start, down)| start + (r % b) * down + c % b)
    }

    /// Numbers that a matrix holds.
    pub(crate) fn len(&self) -> usize {
        let blocks = match &self.pattern {
            Pattern::Band(half_width) => self.n_nodes * (2 * half_width + 1),
            Pattern::Sparse { columns, .. } => columns.len(),
        };
        self.block * self.block * blocks
    }

    /// Writes the system's vectors `b` (row-major, `columns` of them) into storage order; empty rows are zero.
    pub(crate) fn gather(&self, b: &[f64], out: &mut Vec<f64>, columns: usize) {
        out.clear();
        out.resize(self.stored() * columns, 0.0);
        let Some(storage) = &self.storage else { return };
        if columns == 1 {
            // (copies of slices of one number would be calls)
            b.iter().zip(storage).for_each(|(from, &at)| out[at] = *from);
        } else {
            for (from, &at) in b.chunks_exact(columns.max(1)).zip(storage) {
                out[at * columns..(at + 1) * columns].copy_from_slice(from);
            }
        }
    }

    /// Writes vectors in storage order back.
    pub(crate) fn scatter(&self, stored: &[f64], b: &mut [f64], columns: usize) {
        let Some(storage) = &self.storage else { return };
        if columns == 1 {
            b.iter_mut().zip(storage).for_each(|(to, &at)| *to = stored[at]);
        } else {
            for (to, &at) in b.chunks_exact_mut(columns.max(1)).zip(storage) {
                to.copy_from_slice(&stored[at * columns..(at + 1) * columns]);
            }
        }
    }
}

/// Slot of each node, from the nodes slot by slot.
fn slots(n_nodes: usize, order: Option<&[usize]>) -> Result<Vec<usize>, KktError> {
    let Some(order) = order else { return Ok((0..n_nodes).collect()) };
    let mut slots = vec![EMPTY; n_nodes];
    for (slot, &node) in order.iter().enumerate() {
        match slots.get_mut(node) {
            Some(place) if *place == EMPTY => *place = slot,
            _ => return Err(KktError::Order { node, n_nodes }),
        }
    }
    match slots.iter().position(|s| *s == EMPTY) {
        Some(node) => Err(KktError::Order { node, n_nodes }),
        None => Ok(slots),
    }
}

fn check(n_nodes: usize, twists: &[usize], stencils: &[Vec<usize>]) -> Result<(), KktError> {
    let mut taken = vec![false; n_nodes];
    for &node in twists {
        if node >= n_nodes || std::mem::replace(&mut taken[node], true) {
            return Err(KktError::Order { node, n_nodes });
        }
    }
    match stencils.iter().flatten().find(|node| **node >= n_nodes) {
        Some(&node) => Err(KktError::Order { node, n_nodes }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn twists_stand_beside_the_node_their_edge_begins_at() {
        let layout = NodeLayout::banded(3, &[0, 1], None, &[vec![0, 1, 2]]).unwrap();
        assert_eq!((layout.dim(), layout.stored(), layout.half_width()), (11, 12, 2));
        assert_eq!([0, 3, 9, 10].map(|row| layout.storage(row)), [0, 4, 3, 7]);
        assert_eq!((layout.system(7), layout.system(11)), (Some(10), None));
        let (b, mut stored, mut back) = ((0..22).map(f64::from).collect::<Vec<_>>(), Vec::new(), vec![0.0; 22]);
        layout.gather(&b, &mut stored, 2);
        assert_eq!((stored[6], stored[23]), (18.0, 0.0));
        layout.scatter(&stored, &mut back, 2);
        assert_eq!(back, b);
    }

    #[test]
    fn a_folded_loop_has_a_narrow_band() {
        let neighbours: Vec<_> = (0..8).map(|i| vec![i, (i + 1) % 8]).collect();
        let folded = [0, 7, 1, 6, 2, 5, 3, 4];
        assert_eq!(NodeLayout::banded(8, &[], None, &neighbours).unwrap().half_width(), 7);
        assert_eq!(NodeLayout::banded(8, &[], Some(&folded), &neighbours).unwrap().half_width(), 2);
        assert!(NodeLayout::banded(8, &[], Some(&[0, 1, 1, 2, 3, 4, 5, 6]), &neighbours).is_err());
        assert!(NodeLayout::sparse(8, &[], None, &[vec![3, 8]]).is_err());
    }
}
