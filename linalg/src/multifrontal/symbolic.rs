//! Analysis of a sparse pattern: an order of elimination that makes little fill, and slots gathered into dense fronts.
//!
//! Slots that are eliminated one after the other and reach the same later ones are one *front*: a dense square of its own slots (its
//! pivots) and those they reach (its rows). What eliminating the pivots leaves for the rows is handed to the front of the first of
//! these, its parent, so fronts form a forest, and in postorder the updates form a stack (Duff and Reid 1983). The pattern
//! is structurally symmetric, so one analysis serves L and U. Small fronts join their parents where that makes few zeros.

use crate::constants::LINALG;
use crate::layout::NodeLayout;
use crate::multifrontal::dissection::nested;
use crate::multifrontal::order::fill_reducing;
use crate::{KktError, Symmetry};

/// A block of the matrix that belongs to a front.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    /// Where it starts among the matrix's numbers, and the distance between its rows.
    pub place: usize,
    pub down: usize,
    /// Slots within the front.
    pub row: usize,
    pub column: usize,
}

/// Consecutive slots of a child's rows that are consecutive in its parent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    pub from: usize,
    pub to: usize,
    pub len: usize,
}

/// A dense part of the elimination; numbers of slots are positions in the order of elimination.
#[derive(Clone, Debug, Default)]
pub(crate) struct Front {
    /// First pivot.
    pub first: usize,
    /// Number of pivots.
    pub pivots: usize,
    /// Slots beyond the pivots, rising.
    pub rows: Vec<usize>,
    /// Number of children; their updates lie on top of the stack, the last child's uppermost.
    pub children: Vec<usize>,
    /// Where its rows stand in its parent.
    pub spans: Vec<Span>,
    /// Entries of the matrix in it.
    pub entries: Vec<Entry>,
    /// Where its rows of U, and its rows of L beyond the pivots, begin among those of all fronts.
    pub upper: usize,
    pub lower: usize,
}

/// The analysis of a pattern.
#[derive(Clone, Debug)]
pub(crate) struct Symbolic {
    pub symmetry: Symmetry,
    /// Storage slots that are rows and columns of the identity.
    pub absent: Vec<bool>,
    /// Rows of a slot.
    pub block: usize,
    /// Position of each storage slot, and the slot at each position.
    pub position: Vec<usize>,
    slots: Vec<usize>,
    pub fronts: Vec<Front>,
    /// Numbers of U and of L beyond the pivots' squares.
    pub upper_len: usize,
    pub lower_len: usize,
    /// Most numbers on the stack, and most slots of a front.
    pub stack: usize,
    pub widest: usize,
}

impl Symbolic {
    /// Analyses the pattern of `layout`. Of a symmetric matrix the entries between `prescribed` slots and others are left out: those
    /// slots are rows and columns of the identity.
    pub fn new(layout: &NodeLayout, symmetry: Symmetry, prescribed: &[bool]) -> Result<Self, KktError> {
        let absent: Vec<bool> = prescribed.iter().map(|p| *p && symmetry == Symmetry::Symmetric).collect();
        let present = |i: usize, j: usize| i == j || !(absent[i] || absent[j]);
        let n = layout.n_nodes();
        let neighbours: Vec<Vec<usize>> = (0..n).map(|i| layout.row(i).filter(|&j| j != i && present(i, j)).collect()).collect();
        let mut groups = elimination(&neighbours, &fill_reducing(&neighbours)?);
        if n >= LINALG.dissected {
            let other = elimination(&neighbours, &nested(&neighbours));
            if work(&other) < work(&groups) {
                groups = other;
            }
        }
        let mut groups = joined(groups);
        let position = renumber(&mut groups, n);
        let fronts = Self::assemble(groups, position, layout, symmetry, &neighbours);
        Ok(Self { absent, ..fronts })
    }

    fn assemble(
        groups: Vec<Group>,
        position: Vec<usize>,
        layout: &NodeLayout,
        symmetry: Symmetry,
        neighbours: &[Vec<usize>],
    ) -> Self {
        let (b, upper_only) = (layout.block(), symmetry == Symmetry::Symmetric);
        let mut slot_at = vec![0; position.len()];
        position.iter().enumerate().for_each(|(slot, &at)| slot_at[at] = slot);
        let (mut upper, mut lower, mut first) = (0, 0, 0);
        let mut fronts: Vec<Front> = Vec::with_capacity(groups.len());
        for group in groups {
            let (k, m) = (group.pivots.len(), group.rows.len());
            let (children, rows) = (group.children, group.rows);
            let mut front = Front { first, pivots: k, rows, children, upper, lower, ..Front::default() };
            for (at, &slot) in slot_at.iter().enumerate().skip(first).take(k) {
                let mut push = |i: usize, j: usize, row: usize, column: usize| {
                    if let Some((place, down)) = layout.place(i, j) {
                        front.entries.push(Entry { place, down, row, column });
                    }
                };
                push(slot, slot, at - first, at - first);
                for &other in neighbours[slot].iter().filter(|&&other| position[other] > at) {
                    let there = local(first, k, &front.rows, position[other]);
                    push(slot, other, at - first, there);
                    if !upper_only {
                        push(other, slot, there, at - first);
                    }
                }
            }
            for &child in &front.children {
                fronts[child].spans = spans(first, k, &front.rows, &fronts[child].rows);
            }
            upper += b * k * b * (k + m);
            lower += if upper_only { 0 } else { b * k * b * m };
            first += k;
            fronts.push(front);
        }
        let (mut stack, mut high) = (0_usize, 0);
        for front in &fronts {
            let taken: usize = front.children.iter().map(|&c| (b * fronts[c].rows.len()).pow(2)).sum();
            stack = stack - taken + (b * front.rows.len()).pow(2);
            high = high.max(stack);
        }
        let widest = fronts.iter().map(|f| f.pivots + f.rows.len()).max().unwrap_or(0);
        Self {
            symmetry,
            absent: Vec::new(),
            block: b,
            position,
            slots: slot_at,
            fronts,
            upper_len: upper,
            lower_len: lower,
            stack: high,
            widest,
        }
    }

    /// Rows in storage.
    pub fn dim(&self) -> usize {
        self.block * self.position.len()
    }

    /// The slot at a position.
    #[inline]
    pub fn slot(&self, position: usize) -> usize {
        self.slots[position]
    }

    /// Position of a storage row.
    #[inline]
    pub fn row(&self, at: usize) -> usize {
        self.position[at / self.block] * self.block + at % self.block
    }
}

/// Where a position stands in a front.
fn local(first: usize, pivots: usize, rows: &[usize], position: usize) -> usize {
    if position < first + pivots { position - first } else { pivots + rows.partition_point(|&r| r < position) }
}

fn spans(first: usize, pivots: usize, rows: &[usize], child: &[usize]) -> Vec<Span> {
    let mut out: Vec<Span> = Vec::new();
    for (from, &position) in child.iter().enumerate() {
        let to = local(first, pivots, rows, position);
        match out.last_mut() {
            Some(last) if last.to + last.len == to => last.len += 1,
            _ => out.push(Span { from, to, len: 1 }),
        }
    }
    out
}

/// A front in the making: slots, children by their index.
#[derive(Clone, Debug, Default)]
struct Group {
    pivots: Vec<usize>,
    rows: Vec<usize>,
    children: Vec<usize>,
    /// Entries that are zero but stored.
    zeros: usize,
    /// Joined with its parent.
    gone: bool,
}

/// One group per position: which later positions its elimination reaches, and its children.
fn elimination(neighbours: &[Vec<usize>], order: &[usize]) -> Vec<Group> {
    let n = order.len();
    let mut position = vec![0; n];
    order.iter().enumerate().for_each(|(at, &slot)| position[slot] = at);
    let mut groups: Vec<Group> = vec![Group::default(); n];
    let mut seen = vec![usize::MAX; n];
    for at in 0..n {
        seen[at] = at;
        let mut rows = Vec::new();
        let children = groups[at].children.clone();
        let reached = children.iter().flat_map(|&c| groups[c].rows.iter().copied());
        for row in reached.chain(neighbours[order[at]].iter().map(|&slot| position[slot])) {
            if row > at && seen[row] != at {
                seen[row] = at;
                rows.push(row);
            }
        }
        rows.sort_unstable();
        if let Some(&parent) = rows.first() {
            groups[parent].children.push(at);
        }
        groups[at].pivots = vec![at];
        groups[at].rows = rows;
    }
    for group in &mut groups {
        group.pivots.iter_mut().for_each(|at| *at = order[*at]);
    }
    // rows stay positions until all groups are renumbered
    for group in &mut groups {
        group.rows.iter_mut().for_each(|at| *at = order[*at]);
    }
    groups
}

/// Multiplications of a factorization, in blocks.
fn work(groups: &[Group]) -> usize {
    groups.iter().map(|group| (group.rows.len() + 1) * (group.rows.len() + 2) / 2).sum()
}

/// Joins groups with their parents where that stores few zeros.
fn joined(mut groups: Vec<Group>) -> Vec<Group> {
    for parent in 0..groups.len() {
        let mut kept = Vec::new();
        let mut waiting = std::mem::take(&mut groups[parent].children);
        // those that lose least first
        waiting.sort_by_key(|&child| std::cmp::Reverse(groups[child].rows.len()));
        for child in waiting {
            let (k, m) = (groups[parent].pivots.len(), groups[parent].rows.len());
            let (own, reach) = (groups[child].pivots.len(), groups[child].rows.len());
            let zeros = groups[parent].zeros + groups[child].zeros + own * (k + m - reach);
            let size = (k + own) * (k + own + 1) / 2 + (k + own) * m;
            let part = zeros as f64 / size as f64;
            let allowed = match k + own {
                all if all <= LINALG.small_front.0 => LINALG.small_front.1,
                all if all <= LINALG.medium_front.0 => LINALG.medium_front.1,
                _ => LINALG.large_front,
            };
            if part <= allowed {
                let taken = std::mem::take(&mut groups[child]);
                groups[child].gone = true;
                let mut pivots = taken.pivots;
                pivots.extend(&groups[parent].pivots);
                groups[parent].pivots = pivots;
                groups[parent].zeros = zeros;
                kept.extend(taken.children);
            } else {
                kept.push(child);
            }
        }
        groups[parent].children = kept;
    }
    groups
}

/// Puts groups into postorder, and their rows and children in terms of it; returns the position of every slot.
fn renumber(groups: &mut Vec<Group>, n: usize) -> Vec<usize> {
    let mut is_child = vec![false; n];
    groups.iter().flat_map(|g| &g.children).for_each(|&c| is_child[c] = true);
    let (mut post, mut stack) = (Vec::new(), Vec::new());
    for root in (0..n).filter(|&g| !groups[g].gone && !is_child[g]) {
        stack.push((root, 0));
        while let Some((group, next)) = stack.pop() {
            match groups[group].children.get(next) {
                Some(&child) => stack.extend([(group, next + 1), (child, 0)]),
                None => post.push(group),
            }
        }
    }
    let mut number = vec![0; n];
    post.iter().enumerate().for_each(|(k, &group)| number[group] = k);
    let mut out: Vec<Group> = post.iter().map(|&group| std::mem::take(&mut groups[group])).collect();
    let mut position = vec![0; n];
    for (at, &slot) in out.iter().flat_map(|g| &g.pivots).enumerate() {
        position[slot] = at;
    }
    for group in &mut out {
        group.rows.iter_mut().for_each(|slot| *slot = position[*slot]);
        group.rows.sort_unstable();
        group.children.iter_mut().for_each(|child| *child = number[*child]);
    }
    *groups = out;
    position
}
