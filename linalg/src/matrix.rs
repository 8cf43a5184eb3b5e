//! The storage of every Jacobian of a nodal system.
#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use crate::buffer::Buffer;
use crate::layout::{NodeLayout, Pattern};
use std::sync::{Arc, LazyLock, OnceLock};

/// A square matrix of nodes' and twists' rows in blocks, where a [`NodeLayout`] has room for them; all else is zero.
///
/// Rows of a slot are contiguous, and so are the stored entries of a row, block by block. In a band, blocks that stick out at either
/// end of the matrix are stored and stay zero, so that every row has the same length.
#[derive(Clone, Debug)]
pub struct NodeMatrix {
    layout: Arc<NodeLayout>,
    data: Buffer,
    /// Whether nothing was ever written since all entries were set to zero.
    untouched: bool,
}

impl PartialEq for NodeMatrix {
    fn eq(&self, other: &Self) -> bool {
        self.layout == other.layout && self.data == other.data
    }
}

/// Where a block of a [`NodeMatrix`] starts, and the distance between its rows.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    start: usize,
    down: usize,
}

/// An entry, and the three columns of two nodes in its row.
#[derive(Clone, Copy, Debug)]
pub struct CarriedPlace {
    by: usize,
    nodes: [usize; 2],
}

/// Places of the blocks that a term adds to matrices of one layout, found once.
#[derive(Clone, Debug)]
pub struct Places<P = Place>(OnceLock<(Arc<NodeLayout>, Vec<P>)>);

impl<P> Default for Places<P> {
    fn default() -> Self {
        Self(OnceLock::new())
    }
}

impl<P> Places<P> {
    /// Those for the layout of `matrix`, found by `find` the first time; `None` for another layout than that of the first time.
    #[inline]
    pub fn of(&self, matrix: &NodeMatrix, find: impl FnOnce() -> Vec<P>) -> Option<&[P]> {
        let (layout, places) = self.0.get_or_init(|| (Arc::clone(&matrix.layout), find()));
        Arc::ptr_eq(layout, &matrix.layout).then_some(places.as_slice())
    }
}

impl NodeMatrix {
    /// The zero matrix.
    pub fn zeros(layout: &Arc<NodeLayout>) -> Self {
        Self { layout: Arc::clone(layout), data: Buffer::zeros(layout.len()), untouched: true }
    }

    /// A matrix without rows.
    pub fn empty() -> Self {
        static NOTHING: LazyLock<Arc<NodeLayout>> = LazyLock::new(|| Arc::new(NodeLayout::band(0, 0)));
        Self { layout: Arc::clone(&NOTHING), data: Buffer::default(), untouched: true }
    }

    /// The zero matrix of `n_nodes` nodes with blocks (i, j), |i − j| ≤ `half_width`.
    pub fn band(n_nodes: usize, half_width: usize) -> Self {
        Self::zeros(&Arc::new(NodeLayout::band(n_nodes, half_width)))
    }

    /// Sizes, order and pattern.
    #[inline]
    pub fn layout(&self) -> &Arc<NodeLayout> {
        &self.layout
    }

    /// Number of rows: three per node, one per twist.
    #[inline]
    pub fn dim(&self) -> usize {
        self.layout.dim()
    }

    /// Sets every entry to zero and keeps the memory.
    pub fn clear(&mut self) {
        if !self.untouched {
            self.data.fill(0.0);
            self.untouched = true;
        }
    }

    /// Whether all entries are zero.
    #[inline]
    pub fn is_zero(&self) -> bool {
        self.untouched || self.data.iter().all(|x| *x == 0.0)
    }

    /// All stored entries.
    #[inline]
    pub(crate) fn data(&self) -> &[f64] {
        &self.data
    }

    /// Where block (i, j) of slots starts, and the distance between its rows; the layout was made to have room for it.
    #[inline]
    fn room(&self, i: usize, j: usize) -> (usize, usize) {
        let place = self.layout.place(i, j);
        debug_assert!(place.is_some(), "no room for block ({i}, {j})");
        place.unwrap_or((0, 0))
    }

    /// Entry (r, c); zero where nothing is stored.
    #[inline]
    pub fn get(&self, r: usize, c: usize) -> f64 {
        let place = self.layout.entry(self.layout.storage(r), self.layout.storage(c));
        place.map_or(0.0, |k| self.data[k])
    }

    /// The least entry of the diagonal in the first `rows` rows, and no more than zero.
    pub fn least_diagonal(&self, rows: usize) -> f64 {
        let Pattern::Band(half_width) = self.layout.pattern else {
            return (0..rows).fold(0.0, |least: f64, r| least.min(self.get(r, r)));
        };
        // (an empty row's is zero)
        let b = self.layout.block();
        let (own, row_len) = (b * half_width, b * (2 * half_width + 1));
        let nodes = self.data.chunks_exact(b * row_len);
        nodes.fold(0.0, |least: f64, node| (0..3).fold(least, |least, a| least.min(node[a * (row_len + 1) + own])))
    }

    /// Adds `value` to entry (r, c), for which there must be room.
    #[inline]
    pub fn add(&mut self, r: usize, c: usize, value: f64) {
        self.untouched = false;
        let place = self.layout.entry(self.layout.storage(r), self.layout.storage(c));
        debug_assert!(place.is_some(), "no room for entry ({r}, {c})");
        if let Some(k) = place {
            self.data[k] += value;
        }
    }

    /// Adds `scale · block` to the block of nodes (i, j), for which there must be room. `block[a][b]` is row a, column b.
    #[inline]
    pub fn add_block(&mut self, i: usize, j: usize, scale: f64, block: &[[f64; 3]; 3]) {
        self.untouched = false;
        let (start, down) = self.room(self.layout.slot(i), self.layout.slot(j));
        for (a, block_row) in block.iter().enumerate() {
            let row = &mut self.data[start + a * down..][..3];
            for (entry, b) in row.iter_mut().zip(block_row) {
                *entry += scale * b;
            }
        }
    }

    /// Where the block of nodes (i, j) is, for [`NodeMatrix::add_block_at`].
    #[inline]
    pub fn block_place(&self, i: usize, j: usize) -> Place {
        let (start, down) = self.room(self.layout.slot(i), self.layout.slot(j));
        Place { start, down }
    }

    /// As [`NodeMatrix::add_block`] at a place of this layout.
    #[inline]
    pub fn add_block_at(&mut self, place: Place, scale: f64, block: &[[f64; 3]; 3]) {
        self.untouched = false;
        for (a, block_row) in block.iter().enumerate() {
            let row = &mut self.data[place.start + a * place.down..][..3];
            for (entry, b) in row.iter_mut().zip(block_row) {
                *entry += scale * b;
            }
        }
    }

    /// Adds to row `a` of node `i` the `values`, three at each of `nodes`.
    #[inline(always)]
    pub fn add_row<const N: usize, const M: usize>(&mut self, i: usize, a: usize, nodes: [usize; N], values: [f64; M]) {
        self.untouched = false;
        if let (Pattern::Band(half_width), true) = (&self.layout.pattern, self.layout.is_plain())
            && (1..N).all(|k| nodes[k] == nodes[0] + k)
        {
            let row_len = 3 * (2 * half_width + 1);
            let start = (3 * i + a) * row_len + 3 * (nodes[0] + half_width - i);
            for (entry, x) in self.data[start..start + M].iter_mut().zip(values) {
                *entry += x;
            }
        } else {
            for (&j, part) in nodes.iter().zip(values.chunks(3)) {
                let (start, down) = self.room(self.layout.slot(i), self.layout.slot(j));
                for (entry, x) in self.data[start + a * down..][..3].iter_mut().zip(part) {
                    *entry += x;
                }
            }
        }
    }

    /// Adds `of(r, c)` to the entries of these rows and columns, for which there must be room.
    #[inline(always)]
    pub fn add_square<const N: usize>(&mut self, rows: &[usize; N], of: impl Fn(usize, usize) -> f64) {
        self.untouched = false;
        let stored = rows.map(|row| self.layout.storage(row));
        let contiguous = (1..N).all(|k| stored[k] == stored[0] + k);
        if let (Pattern::Band(half_width), true) = (&self.layout.pattern, contiguous) {
            let b = self.layout.block();
            let row_len = b * (2 * half_width + 1);
            for (r, at) in stored.iter().enumerate() {
                // the row's first entry is half_width slots before its own
                let start = at * row_len + b * half_width + stored[0] - b * (at / b);
                for (c, entry) in self.data[start..start + N].iter_mut().enumerate() {
                    *entry += of(r, c);
                }
            }
            return;
        }
        for (r, at) in stored.iter().enumerate() {
            for (c, column) in stored.iter().enumerate() {
                let place = self.layout.entry(*at, *column);
                debug_assert!(place.is_some(), "no room for entry ({at}, {column})");
                if let Some(k) = place {
                    self.data[k] += of(r, c);
                }
            }
        }
    }

    /// Where [`NodeMatrix::add_carried`] finds the entries of `rows` in `column`, and the three columns of two nodes in the same rows; rows
    /// that have no room for the first are left out.
    pub fn carried_places(&self, rows: &[usize], column: usize, nodes: [usize; 2]) -> Vec<CarriedPlace> {
        let (b, column) = (self.layout.block(), self.layout.storage(column));
        let place = |at: usize| {
            let by = self.layout.entry(at, column)?;
            let nodes = nodes.map(|node| {
                let (start, down) = self.room(at / b, self.layout.slot(node));
                start + (at % b) * down
            });
            Some(CarriedPlace { by, nodes })
        };
        rows.iter().filter_map(|row| place(self.layout.storage(*row))).collect()
    }

    /// Adds, in the three columns of each of two nodes, `by` times the entry that `from`, of the same layout, has in the same row.
    #[inline]
    pub fn add_carried(&mut self, from: &Self, places: &[CarriedPlace], by: [[f64; 3]; 2]) {
        self.untouched = false;
        for place in places {
            let factor = from.data[place.by];
            for (start, by) in place.nodes.iter().zip(&by) {
                let row = &mut self.data[*start..start + 3];
                row.iter_mut().zip(by).for_each(|(x, by)| *x += factor * by);
            }
        }
    }

    /// The block of nodes (i, j), for which there must be room.
    pub fn block(&self, i: usize, j: usize) -> [[f64; 3]; 3] {
        let (start, down) = self.room(self.layout.slot(i), self.layout.slot(j));
        std::array::from_fn(|a| std::array::from_fn(|b| self.data[start + a * down + b]))
    }

    /// Replaces the block of nodes (i, j), for which there must be room.
    pub fn set_block(&mut self, i: usize, j: usize, block: &[[f64; 3]; 3]) {
        self.untouched = false;
        let (start, down) = self.room(self.layout.slot(i), self.layout.slot(j));
        for (a, row) in block.iter().enumerate() {
            self.data[start + a * down..][..3].copy_from_slice(row);
        }
    }

    /// Sets row `r` to zero.
    #[inline]
    pub fn clear_row(&mut self, r: usize) {
        if self.untouched {
            return;
        }
        let range = self.stored_row(self.layout.storage(r)).1;
        self.data[range].fill(0.0);
    }

    /// `self = −(a·x + b·y)`, entry by entry, of matrices of the same layout; empty rows become the identity's.
    pub fn set_sum(&mut self, a: f64, x: &Self, b: f64, y: &Self) {
        self.untouched = false;
        if y.untouched {
            // (the same bits: zeros change but the sign of zeros)
            self.data.iter_mut().zip(x.data.iter()).for_each(|(k, x)| *k = -(a * x + 0.0));
        } else {
            for (k, (x, y)) in self.data.iter_mut().zip(x.data.iter().zip(y.data.iter())) {
                *k = -(a * x + b * y);
            }
        }
        for at in (0..self.layout.stored()).filter(|at| self.layout.system(*at).is_none()) {
            if let Some(k) = self.layout.entry(at, at) {
                self.data[k] = 1.0;
            }
        }
    }

    /// As [`Self::set_sum`] in column `c` alone.
    pub fn set_sum_in_column(&mut self, c: usize, a: f64, x: &Self, b: f64, y: &Self) {
        self.untouched = false;
        let (size, c) = (self.layout.block(), self.layout.storage(c));
        for i in self.layout.row(c / size) {
            let Some((start, down)) = self.layout.place(i, c / size) else { continue };
            for k in (0..size).map(|r| start + r * down + c % size) {
                self.data[k] = -(a * x.data[k] + b * y.data[k]);
            }
        }
    }

    /// Slots of the columns that a storage row begins with (before the first one, in a band), and where its entries are.
    #[inline]
    pub(crate) fn stored_row(&self, at: usize) -> (isize, std::ops::Range<usize>) {
        let b = self.layout.block();
        let (i, a) = (at / b, at % b);
        match &self.layout.pattern {
            Pattern::Band(half_width) => {
                let len = b * (2 * half_width + 1);
                (i as isize - *half_width as isize, at * len..(at + 1) * len)
            }
            Pattern::Sparse { starts, .. } => {
                let len = b * (starts[i + 1] - starts[i]);
                let start = starts[i] * b * b + a * len;
                (0, start..start + len)
            }
        }
    }

    /// The stored entries of a storage row.
    pub(crate) fn row(&self, at: usize) -> &[f64] {
        &self.data[self.stored_row(at).1]
    }

    /// Calls `visit(column, place)` for every entry inside the matrix of a storage row, columns rising in storage order.
    #[inline(always)]
    pub(crate) fn for_row(&self, at: usize, mut visit: impl FnMut(usize, usize)) {
        let b = self.layout.block();
        let (first, range) = self.stored_row(at);
        match &self.layout.pattern {
            Pattern::Band(_) => {
                let skip = (-first).max(0) as usize;
                let column = first.max(0) as usize * b;
                let end = range.end.min((self.layout.stored() as isize - b as isize * first) as usize + range.start);
                for (k, place) in (range.start + skip * b..end).enumerate() {
                    visit(column + k, place);
                }
            }
            Pattern::Sparse { starts, columns, .. } => {
                let row = &columns[starts[at / b]..starts[at / b + 1]];
                for (block, &j) in row.iter().enumerate() {
                    for c in 0..b {
                        visit(b * j + c, range.start + b * block + c);
                    }
                }
            }
        }
    }

    /// Adds to the three columns of node `j` `scale` times those of `from`, of the same layout, times `block`.
    pub fn add_columns_times(&mut self, from: &Self, j: usize, scale: f64, block: &[[f64; 3]; 3]) {
        self.untouched = false;
        let layout = Arc::clone(&self.layout);
        let slot = layout.slot(j);
        // (patterns are symmetric)
        for (start, down) in layout.row(slot).filter_map(|i| layout.place(i, slot)) {
            for at in (0..3).map(|a| start + a * down) {
                for c in 0..3 {
                    let sum: f64 = (0..3).map(|b| from.data[at + b] * block[b][c]).sum();
                    self.data[at + c] += scale * sum;
                }
            }
        }
    }
}
