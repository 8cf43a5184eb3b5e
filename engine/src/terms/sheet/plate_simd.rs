//! Forces of bent patches and their slopes, eight patches at a time in the processor's vectors.
//!
//! Every patch has three folds here, fold k opposite of the triangle's node k, with its flap's node in slot 3 + k. A flap that is missing
//! is made up in the triangle's plane, and costs nothing: its row and column of K are zero. A fold that two patches share is evaluated in
//! both, each with its own part of the moment. Formulas stand in [`super::fold`].
#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use super::patch::{FLAPS, NODES, Patch};
use crate::terms::Point;
use crate::terms::stencil::{Block, add_node};
use pliant_linalg::{NodeMatrix, Place, Places};
use pliant_math::Vec3;
use pliant_math::simd::{LANES, Lanes, Number, Three, Wide};
use pulp::{Arch, Simd, WithSimd};
use std::borrow::Cow;
use std::cell::RefCell;
use std::sync::OnceLock;

/// Blocks of a symmetric matrix of a patch's nodes: (p, r), p ≤ r, is number r (r + 1)/2 + p.
const TRIANGLE: usize = NODES * (NODES + 1) / 2;

type Matrix<T> = [[T; FLAPS]; FLAPS];
type Blocks = [[Lanes; 9]; TRIANGLE];

/// The nodes of a patch slot by slot.
#[derive(Clone, Copy, Debug)]
struct Slots {
    nodes: [usize; NODES],
    present: [bool; FLAPS],
    /// Stiffness and ν.
    params: [usize; 2],
}

/// K at D = 1 and ψ at rest of eight patches, and the ν that K belongs to.
#[derive(Clone, Debug)]
struct Constants {
    nu: Lanes,
    unit: Matrix<Lanes>,
    rest: [Lanes; FLAPS],
}

/// All patches of a sheet.
#[derive(Clone, Debug)]
pub(super) struct Pieces {
    slots: Vec<Slots>,
    constants: OnceLock<Vec<Constants>>,
    places: Places<[Place; NODES * NODES]>,
}

/// Eight patches, a lane each.
struct Piece {
    x: [[Lanes; 3]; NODES],
    k: Matrix<Lanes>,
    f: [[Lanes; 3]; NODES],
    blocks: Blocks,
}

thread_local! {
    /// One a thread, so that evaluations neither allocate nor share.
    static PIECE: RefCell<Box<Piece>> = RefCell::new(Box::new(Piece {
        x: [[[0.0; LANES]; 3]; NODES],
        k: [[[0.0; LANES]; FLAPS]; FLAPS],
        f: [[[0.0; LANES]; 3]; NODES],
        blocks: [[[0.0; LANES]; 9]; TRIANGLE],
    }));
}

impl Pieces {
    pub fn new(patches: &[Patch]) -> Self {
        let of = |patch: &Patch| {
            let own = patch.flap(0);
            let mut out = Slots { nodes: [own[0]; NODES], present: [false; FLAPS], params: patch.params };
            for i in 0..patch.shape.flaps {
                for (slot, node) in patch.shape.nodes(i).into_iter().zip(patch.flap(i)).take(3) {
                    out.nodes[slot] = node;
                }
                let k = patch.shape.nodes(i)[2];
                (out.nodes[3 + k], out.present[k]) = (patch.flap(i)[3], true);
            }
            out
        };
        Self { slots: patches.iter().map(of).collect(), constants: OnceLock::new(), places: Places::default() }
    }

    /// Adds the forces, and their slopes if asked for.
    pub fn add(&self, patches: &[Patch], at: &Point, f: &mut [f64], dq: Option<&mut NodeMatrix>) {
        struct Run<'a>(&'a Pieces, &'a [Patch], &'a Point<'a>, &'a mut [f64], Option<&'a mut NodeMatrix>, &'a mut Piece);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self(pieces, patches, at, f, dq, piece) = self;
                pieces.run(simd, patches, at, f, dq, piece);
            }
        }
        PIECE.with_borrow_mut(|piece| Arch::new().dispatch(Run(self, patches, at, f, dq, piece)));
    }

    /// The sum of their energies.
    pub fn energy(&self, patches: &[Patch], at: &Point) -> f64 {
        struct Run<'a>(&'a Pieces, &'a [Patch], &'a Point<'a>, &'a mut Piece);
        impl WithSimd for Run<'_> {
            type Output = f64;
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) -> f64 {
                let Self(pieces, patches, at, piece) = self;
                let mut sum = 0.0;
                for (n, slots) in pieces.slots.chunks(LANES).enumerate() {
                    let constants = pieces.constants(patches, n, at);
                    piece.gather(slots, &constants, at);
                    for v in 0..slots.len().div_ceil(S::F64_LANES) {
                        piece.energy(simd, v, &constants.rest);
                    }
                    sum += piece.f[0][0][..slots.len()].iter().sum::<f64>();
                }
                sum
            }
        }
        PIECE.with_borrow_mut(|piece| Arch::new().dispatch(Run(self, patches, at, piece)))
    }

    #[inline(always)]
    fn run<S: Simd>(
        &self,
        simd: S,
        patches: &[Patch],
        at: &Point,
        f: &mut [f64],
        mut dq: Option<&mut NodeMatrix>,
        piece: &mut Piece,
    ) {
        let found = dq.as_ref().map(|dq| self.places(dq));
        for (n, slots) in self.slots.chunks(LANES).enumerate() {
            let first = n * LANES;
            let constants = self.constants(patches, n, at);
            piece.gather(slots, &constants, at);
            for v in 0..slots.len().div_ceil(S::F64_LANES) {
                piece.evaluate(simd, v, &constants.rest, dq.is_some());
            }
            piece.scatter_forces(slots, f);
            if let (Some(dq), Some(places)) = (&mut dq, &found) {
                piece.scatter_slopes(slots, &places[first..], dq);
            }
        }
    }

    /// Constants of piece `n`: those kept, unless ν is another.
    #[inline(always)]
    fn constants(&self, patches: &[Patch], n: usize, at: &Point) -> Cow<'_, Constants> {
        let kept = self.constants.get_or_init(|| patches.chunks(LANES).map(|p| Constants::new(p, at.theta)).collect());
        let (first, kept) = (n * LANES, &kept[n]);
        let last = patches.len().min(first + LANES);
        let changed = self.slots[first..last].iter().zip(&kept.nu).any(|(s, nu)| at.theta[s.params[1]] != *nu);
        if changed { Cow::Owned(Constants::new(&patches[first..last], at.theta)) } else { Cow::Borrowed(kept) }
    }

    /// Places of all patches' blocks; those of slots without a node are not read.
    fn places(&self, out: &NodeMatrix) -> Cow<'_, [[Place; NODES * NODES]]> {
        let of = |slots: &Slots| {
            std::array::from_fn(|k| {
                let node = |slot: usize| slots.nodes[if slot < 3 || slots.present[slot - 3] { slot } else { 0 }];
                out.block_place(node(k / NODES), node(k % NODES))
            })
        };
        let find = || self.slots.iter().map(of).collect::<Vec<_>>();
        self.places.of(out, find).map_or_else(|| find().into(), Into::into)
    }
}

impl Constants {
    fn new(patches: &[Patch], theta: &[f64]) -> Self {
        let zero = [0.0; LANES];
        let mut out = Self { nu: zero, unit: [[zero; FLAPS]; FLAPS], rest: [zero; FLAPS] };
        for (lane, patch) in patches.iter().enumerate() {
            out.nu[lane] = theta[patch.params[1]];
            let (shape, unit) = (&patch.shape, patch.shape.stiffness(out.nu[lane]));
            for i in 0..shape.flaps {
                let k = shape.nodes(i)[2];
                out.rest[k][lane] = shape.rest[i];
                (0..shape.flaps).for_each(|j| out.unit[k][shape.nodes(j)[2]][lane] = unit[i][j]);
            }
        }
        out
    }
}

/// A fold of a patch with what its derivatives are made of.
struct Fold<T> {
    /// ψ.
    psi: T,
    /// dψ/dθ.
    slope: T,
    /// ∂ψ/∂x of its four nodes.
    gradient: [Three<T>; 4],
    edge: Three<T>,
    /// 1/l².
    by_square: T,
    length: T,
    sides: [Side<T>; 2],
}

/// One triangle of it.
struct Side<T> {
    /// Not of unit length: twice the area.
    normal: Three<T>,
    /// 1/|normal|².
    by_square: T,
    /// From the edge's first node to the triangle's own.
    arm: Three<T>,
    foot: T,
}

impl<S: Simd> Fold<Wide<S>> {
    /// ψ = −2 l b·n₁/(|n₁||n₂| + n₁·n₂); `normal`: that of the patch's triangle.
    #[inline(always)]
    fn new(x: [Three<Wide<S>>; 4], normal: Three<Wide<S>>) -> Self {
        let (edge, a, b) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        let beyond = b.cross(edge);
        let (square1, square2, square) = (normal.dot(normal), beyond.dot(beyond), edge.dot(edge));
        let (by_square, length) = (square.under(1.0), square.root());
        let between = ((square1 * square2).root() + normal.dot(beyond)).under(-2.0);
        let psi = length * normal.dot(b) * between;
        let slope = square.same(1.0).plus(psi.by(0.25), psi);
        let (by_square1, by_square2) = (square1.under(1.0), square2.under(1.0));
        let (u, w) = (normal.times(length * slope * by_square1), beyond.times(length * slope * by_square2));
        let (s, t) = (a.dot(edge) * by_square, b.dot(edge) * by_square);
        let second = u.times(s).plus(t, w);
        let sides = [
            Side { normal, by_square: by_square1, arm: a, foot: s },
            Side { normal: beyond, by_square: by_square2, arm: b, foot: t },
        ];
        Self { psi, slope, gradient: [u + w - second, second, -u, -w], edge, by_square, length, sides }
    }

    /// Adds `weight` ∂²θ/∂x² to the blocks of the patch.
    #[inline(always)]
    fn add_hessian<const K: usize>(&self, weight: Wide<S>, out: &mut Blocks, v: usize) {
        let nodes = [(K + 1) % 3, (K + 2) % 3, K, 3 + K];
        let zero = weight.same(0.0);
        let mut own = [[zero; 9]; 3];
        for (k, side) in self.sides.iter().enumerate() {
            // with h = |n|/l, m = n/|n| and c = C/h, C = arm − foot edge, no root of |n|² is needed: m cᵀ/l² = n Cᵀ/(l |n|²),
            // R = edge nᵀ/(l |n|²), Q = (n Cᵀ + C nᵀ) l³/|n|⁴
            let s = side.foot;
            let u = s.same(1.0) - s;
            let c = side.arm.plus(-s, self.edge);
            let m = side.normal.times(weight * side.by_square * self.length * self.by_square);
            let square = self.length * self.length;
            let scaled = c.times(square * square * side.by_square);
            for a in 0..3 {
                for b in 0..3 {
                    let i = 3 * a + b;
                    let one = m.0[a] * c.0[b];
                    let q = (m.0[a] * scaled.0[b]).plus(scaled.0[a], m.0[b]);
                    let (r, turned) = (self.edge.0[a] * m.0[b], m.0[a] * self.edge.0[b]);
                    let both = r + turned;
                    own[0][i] = own[0][i] + one + u * (both.plus(u, q));
                    own[1][i] = own[1][i] + (s * r - u * turned).plus(s * u, q) - one;
                    own[2][i] = own[2][i] + one + s * ((s * q) - both);
                    add(out, v, nodes[2 + k], nodes[0], i, -(u * q) - r);
                    add(out, v, nodes[2 + k], nodes[1], i, r - s * q);
                    add(out, v, nodes[2 + k], nodes[2 + k], i, q);
                }
            }
        }
        for (block, (a, b)) in own.iter().zip([(0, 0), (1, 0), (1, 1)]) {
            for (i, x) in block.iter().enumerate() {
                add(out, v, nodes[a], nodes[b], i, *x);
            }
        }
    }
}

/// Adds to entry `i` of the block of nodes (p, r), or to the transposed entry of (r, p), whichever is kept.
#[inline(always)]
fn add<S: Simd>(out: &mut Blocks, v: usize, p: usize, r: usize, i: usize, x: Wide<S>) {
    let (p, r, i) = if p <= r { (p, r, i) } else { (r, p, 3 * (i % 3) + i / 3) };
    let to = &mut out[r * (r + 1) / 2 + p][i];
    (x.loaded(to, v) + x).store(to, v);
}

/// Fold number `K` of a patch.
#[inline(always)]
fn fold<S: Simd, const K: usize>(x: &[Three<Wide<S>>; NODES], normal: Three<Wide<S>>) -> Fold<Wide<S>> {
    Fold::new([x[(K + 1) % 3], x[(K + 2) % 3], x[K], x[3 + K]], normal)
}

/// The folds, ψ − ψ_rest, and w = K (ψ − ψ_rest).
type Bent<S> = ([Fold<Wide<S>>; FLAPS], [Wide<S>; FLAPS], [Wide<S>; FLAPS]);

#[inline(always)]
fn bent<S: Simd>(x: &[Three<Wide<S>>; NODES], k: &Matrix<Wide<S>>, rest: &[Wide<S>; FLAPS]) -> Bent<S> {
    let normal = (x[1] - x[0]).cross(x[2] - x[0]);
    let folds = [fold::<S, 0>(x, normal), fold::<S, 1>(x, normal), fold::<S, 2>(x, normal)];
    let excess = [folds[0].psi - rest[0], folds[1].psi - rest[1], folds[2].psi - rest[2]];
    let mut w = excess;
    for i in 0..FLAPS {
        w[i] = (k[i][0] * excess[0]).plus(k[i][1], excess[1]).plus(k[i][2], excess[2]);
    }
    (folds, excess, w)
}

/// Forces by slots, and −∂f/∂x by blocks if asked for.
#[inline(always)]
fn kernel<S: Simd>(
    x: &[Three<Wide<S>>; NODES],
    k: &Matrix<Wide<S>>,
    rest: &[Wide<S>; FLAPS],
    f: &mut [[Lanes; 3]; NODES],
    blocks: Option<&mut Blocks>,
    v: usize,
) {
    let (folds, _, w) = bent(x, k, rest);
    let zero = w[0].same(0.0);
    // slopes of ψ by the triangle's nodes; each flap's node has its own fold's alone
    let (mut slopes, mut far) = ([[Three([zero; 3]); 3]; FLAPS], [Three([zero; 3]); FLAPS]);
    for i in 0..FLAPS {
        let g = &folds[i].gradient;
        (slopes[i][(i + 1) % 3], slopes[i][(i + 2) % 3], slopes[i][i], far[i]) = (g[0], g[1], g[2], g[3]);
    }
    for p in 0..3 {
        slopes[0][p].times(-w[0]).plus(-w[1], slopes[1][p]).plus(-w[2], slopes[2][p]).store(&mut f[p], v);
        far[p].times(-w[p]).store(&mut f[3 + p], v);
    }
    let Some(out) = blocks else { return };
    let mut k = *k;
    for i in 0..FLAPS {
        // d²ψ/dθ² over (dψ/dθ)²
        k[i][i] = k[i][i].plus(w[i], folds[i].psi * folds[i].slope.under(0.5));
    }
    // K y by the triangle's nodes
    let mut z = slopes;
    for i in 0..FLAPS {
        for p in 0..3 {
            z[i][p] = slopes[0][p].times(k[i][0]).plus(k[i][1], slopes[1][p]).plus(k[i][2], slopes[2][p]);
        }
    }
    for r in 0..3 {
        for p in 0..r + 1 {
            for a in 0..3 {
                for b in 0..3 {
                    let sum = (slopes[0][p].0[a] * z[0][r].0[b]).plus(slopes[1][p].0[a], z[1][r].0[b]);
                    sum.plus(slopes[2][p].0[a], z[2][r].0[b]).store(&mut out[r * (r + 1) / 2 + p][3 * a + b], v);
                }
            }
        }
        let row = (3 + r) * (4 + r) / 2;
        for p in 0..3 + r + 1 {
            let left = if p < 3 { z[r][p] } else { far[p - 3].times(k[r][p - 3]) };
            for a in 0..3 {
                for b in 0..3 {
                    (left.0[a] * far[r].0[b]).store(&mut out[row + p][3 * a + b], v);
                }
            }
        }
    }
    folds[0].add_hessian::<0>(w[0] * folds[0].slope, out, v);
    folds[1].add_hessian::<1>(w[1] * folds[1].slope, out, v);
    folds[2].add_hessian::<2>(w[2] * folds[2].slope, out, v);
}

/// Arguments of [`kernel`].
type Loaded<S> = ([Three<Wide<S>>; NODES], Matrix<Wide<S>>, [Wide<S>; FLAPS]);

impl Piece {
    #[inline(always)]
    fn gather(&mut self, slots: &[Slots], constants: &Constants, at: &Point) {
        let mut stiffness = [0.0; LANES];
        for (lane, s) in slots.iter().enumerate() {
            stiffness[lane] = at.theta[s.params[0]];
            for slot in 0..NODES {
                let x = if slot < 3 || s.present[slot - 3] { at.position(s.nodes[slot]) } else { mirrored(s, slot - 3, at) };
                for a in 0..3 {
                    self.x[slot][a][lane] = x[a];
                }
            }
        }
        for (row, unit) in self.k.iter_mut().zip(&constants.unit) {
            for (k, unit) in row.iter_mut().zip(unit) {
                for lane in 0..LANES {
                    k[lane] = unit[lane] * stiffness[lane];
                }
            }
        }
    }

    #[inline(always)]
    fn evaluate<S: Simd>(&mut self, simd: S, v: usize, rest: &[Lanes; FLAPS], slopes: bool) {
        let (x, k, at_rest) = self.loaded(simd, v, rest);
        kernel(&x, &k, &at_rest, &mut self.f, if slopes { Some(&mut self.blocks) } else { None }, v);
    }

    /// ½ w·(ψ − ψ_rest), in the place of the first force.
    #[inline(always)]
    fn energy<S: Simd>(&mut self, simd: S, v: usize, rest: &[Lanes; FLAPS]) {
        let (x, k, at_rest) = self.loaded(simd, v, rest);
        let (_, excess, w) = bent(&x, &k, &at_rest);
        (w[0] * excess[0]).plus(w[1], excess[1]).plus(w[2], excess[2]).by(0.5).store(&mut self.f[0][0], v);
    }

    /// Positions, K and ψ at rest.
    #[inline(always)]
    fn loaded<S: Simd>(&self, simd: S, v: usize, rest: &[Lanes; FLAPS]) -> Loaded<S> {
        let zero = Wide::load(simd, &[0.0; LANES], 0);
        let mut x = [Three([zero; 3]); NODES];
        for (x, from) in x.iter_mut().zip(&self.x) {
            *x = Three::load(simd, from, v);
        }
        let (mut k, mut at_rest) = ([[zero; FLAPS]; FLAPS], [zero; FLAPS]);
        for i in 0..FLAPS {
            at_rest[i] = Wide::load(simd, &rest[i], v);
            for j in 0..FLAPS {
                k[i][j] = Wide::load(simd, &self.k[i][j], v);
            }
        }
        (x, k, at_rest)
    }

    #[inline(always)]
    fn scatter_forces(&self, slots: &[Slots], f: &mut [f64]) {
        for (lane, s) in slots.iter().enumerate() {
            for slot in 0..NODES {
                if slot < 3 || s.present[slot - 3] {
                    let [x, y, z] = &self.f[slot];
                    add_node(f, s.nodes[slot], &Vec3::new(x[lane], y[lane], z[lane]));
                }
            }
        }
    }

    #[inline(always)]
    fn scatter_slopes(&self, slots: &[Slots], places: &[[Place; NODES * NODES]], dq: &mut NodeMatrix) {
        for (lane, (s, places)) in slots.iter().zip(places).enumerate() {
            for r in 0..NODES {
                if r >= 3 && !s.present[r - 3] {
                    continue;
                }
                for p in 0..r + 1 {
                    if p >= 3 && !s.present[p - 3] {
                        continue;
                    }
                    let from = &self.blocks[r * (r + 1) / 2 + p];
                    let mut block: Block = [[0.0; 3]; 3];
                    for (i, x) in from.iter().enumerate() {
                        block[i / 3][i % 3] = x[lane];
                    }
                    dq.add_block_at(places[NODES * p + r], -1.0, &block);
                    if p < r {
                        let mut turned = block;
                        for (i, x) in from.iter().enumerate() {
                            turned[i % 3][i / 3] = x[lane];
                        }
                        dq.add_block_at(places[NODES * r + p], -1.0, &turned);
                    }
                }
            }
        }
    }
}

/// Where the node of a missing flap is made up: what makes a parallelogram of the triangle.
#[inline(always)]
fn mirrored(s: &Slots, k: usize, at: &Point) -> Vec3<f64> {
    at.position(s.nodes[(k + 1) % 3]) + at.position(s.nodes[(k + 2) % 3]) - at.position(s.nodes[k])
}
