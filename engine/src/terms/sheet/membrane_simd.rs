//! Forces of stretched triangles and their slopes, eight triangles at a time in the processor's vectors; formulas as in
//! [`super::membrane`].
#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use super::membrane::{moduli, tension};
use super::triangle::{Face, Sym};
use crate::terms::Point;
use crate::terms::stencil::{Block, add_node};
use pliant_linalg::{NodeMatrix, Place};
use pliant_math::Vec3;
use pliant_math::simd::{LANES, Lanes, Number, Three, Wide};
use pulp::{Arch, Simd, WithSimd};
use std::cell::RefCell;

/// Blocks of nodes 1 and 2: (1, 1), (1, 2), (2, 2).
const OWN: usize = 3;

/// Which stress the geometric part of a slope is made of.
#[derive(Clone, Copy)]
pub(super) enum Geometric<'a> {
    /// That of the positions.
    Here,
    /// A predicted one.
    Predicted(&'a [f64]),
    /// Its tensile part.
    Tension(&'a [f64]),
}

/// Requested results.
pub(super) enum Wanted<'a> {
    Forces(&'a mut [f64]),
    /// With slopes, where there are places for them.
    Slopes(&'a mut [f64], &'a mut NodeMatrix, Geometric<'a>, &'a [Place]),
    /// Stresses at displaced positions, to first order.
    Stresses(&'a [f64], &'a mut [f64]),
    /// Their sum.
    Energy(&'a mut f64),
}

/// Eight triangles, a lane each.
struct Piece {
    /// x₁ − x₀ and x₂ − x₀; the same of displacements.
    edges: [[Lanes; 3]; 2],
    moved: [[Lanes; 3]; 2],
    /// b₁, b₂.
    hats: [[Lanes; 2]; 2],
    /// 1/area, fraction, first and second modulus.
    numbers: [Lanes; 4],
    /// Stress in the geometric part.
    geometric: [Lanes; 3],
    stress: [Lanes; 3],
    f: [[Lanes; 3]; 2],
    blocks: [[Lanes; 9]; OWN],
}

thread_local! {
    /// One a thread, so that evaluations neither allocate nor share.
    static PIECE: RefCell<Box<Piece>> = RefCell::new(Box::new(Piece {
        edges: [[[0.0; LANES]; 3]; 2],
        moved: [[[0.0; LANES]; 3]; 2],
        hats: [[[0.0; LANES]; 2]; 2],
        numbers: [[0.0; LANES]; 4],
        geometric: [[0.0; LANES]; 3],
        stress: [[0.0; LANES]; 3],
        f: [[[0.0; LANES]; 3]; 2],
        blocks: [[[0.0; LANES]; 9]; OWN],
    }));
}

/// Adds or writes what is wanted of all triangles.
pub(super) fn add(faces: &[Face<4>], at: &Point, wanted: Wanted) {
    struct Run<'a>(&'a [Face<4>], &'a Point<'a>, Wanted<'a>, &'a mut Piece);
    impl WithSimd for Run<'_> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            run(simd, self.0, self.1, self.2, self.3);
        }
    }
    PIECE.with_borrow_mut(|piece| Arch::new().dispatch(Run(faces, at, wanted, piece)));
}

#[inline(always)]
fn run<S: Simd>(simd: S, faces: &[Face<4>], at: &Point, mut wanted: Wanted, piece: &mut Piece) {
    for (n, faces) in faces.chunks(LANES).enumerate() {
        let (first, vectors) = (n * LANES, faces.len().div_ceil(S::F64_LANES));
        piece.gather(faces, at);
        match &mut wanted {
            Wanted::Forces(f) => {
                for v in 0..vectors {
                    piece.forces(simd, v);
                }
                piece.scatter_forces(faces, f);
            }
            Wanted::Slopes(f, dq, geometric, places) => {
                for v in 0..vectors {
                    piece.forces(simd, v);
                }
                piece.scatter_forces(faces, f);
                piece.choose(faces.len(), first, *geometric);
                for v in 0..vectors {
                    piece.slopes(simd, v);
                }
                piece.scatter_slopes(faces, &places[9 * first..], dq);
            }
            Wanted::Energy(sum) => {
                for v in 0..vectors {
                    piece.energy(simd, v);
                }
                **sum += piece.stress[0][..faces.len()].iter().sum::<f64>();
            }
            Wanted::Stresses(displacement, axial) => {
                gather_edges(faces, displacement, &mut piece.moved);
                for v in 0..vectors {
                    piece.displaced(simd, v);
                }
                for (lane, (to, face)) in axial[3 * first..].chunks_exact_mut(3).zip(faces).enumerate() {
                    if !is_slack(face, at) {
                        for (to, from) in to.iter_mut().zip(&piece.stress) {
                            *to = from[lane];
                        }
                    }
                }
            }
        }
    }
}

/// Whether a triangle resists nothing.
#[inline(always)]
fn is_slack(face: &Face<4>, at: &Point) -> bool {
    at.theta[face.params[1]] == 0.0 || at.theta[face.params[3]] == 0.0
}

/// Differences of the nodes' vectors from the first node's.
#[inline(always)]
fn gather_edges(faces: &[Face<4>], x: &[f64], out: &mut [[Lanes; 3]; 2]) {
    for (lane, face) in faces.iter().enumerate() {
        let [n0, n1, n2] = face.nodes;
        for a in 0..3 {
            out[0][a][lane] = x[3 * n1 + a] - x[3 * n0 + a];
            out[1][a][lane] = x[3 * n2 + a] - x[3 * n0 + a];
        }
    }
}

/// A triangle's numbers: the columns of F̂ and its hats.
struct Triangle<T> {
    f: [Three<T>; 2],
    b: [[T; 2]; 2],
    by_area: T,
    fraction: T,
    moduli: [T; 2],
}

/// S of a strain.
#[inline(always)]
fn stress<T: Number>(g: [T; 3], [first, second]: [T; 2]) -> [T; 3] {
    let trace = (g[0] + g[1]) * second;
    [trace.plus(g[0], first), trace.plus(g[1], first), g[2] * first]
}

/// Columns of F̂, or of its change.
#[inline(always)]
fn columns<T: Number>(e: [Three<T>; 2], b: &[[T; 2]; 2]) -> [Three<T>; 2] {
    [e[0].times(b[0][0]).plus(b[1][0], e[1]), e[0].times(b[0][1]).plus(b[1][1], e[1])]
}

impl<T: Number> Triangle<T> {
    #[inline(always)]
    fn strain(&self) -> [T; 3] {
        let (half, [x, y]) = (self.by_area.by(0.5), self.f);
        let rest = half.same(0.5);
        [x.dot(x) * half - rest, y.dot(y) * half - rest, x.dot(y) * half]
    }

    #[inline(always)]
    fn stress(&self) -> [T; 3] {
        stress(self.strain(), self.moduli)
    }

    /// S bᵢ.
    #[inline(always)]
    fn traction(&self, s: &[T; 3], i: usize) -> [T; 2] {
        let [x, y] = self.b[i];
        [(s[0] * x).plus(s[2], y), (s[2] * x).plus(s[1], y)]
    }
}

impl Piece {
    #[inline(always)]
    fn gather(&mut self, faces: &[Face<4>], at: &Point) {
        gather_edges(faces, at.q, &mut self.edges);
        let (mut params, mut shared) = ([usize::MAX; 4], [0.0; 3]);
        for (lane, face) in faces.iter().enumerate() {
            for i in 0..2 {
                (self.hats[i][0][lane], self.hats[i][1][lane]) = (face.hats[i + 1][0], face.hats[i + 1][1]);
            }
            // mostly the same for all
            if face.params != params {
                let p = face.values(at.theta);
                let [first, second] = if is_slack(face, at) { [0.0; 2] } else { moduli(p) };
                (params, shared) = (face.params, [1.0 / p[0], first, second]);
            }
            let numbers = [shared[0], face.fraction, shared[1], shared[2]];
            for (to, x) in self.numbers.iter_mut().zip(numbers) {
                to[lane] = x;
            }
        }
    }

    #[inline(always)]
    fn triangle<S: Simd>(&self, simd: S, v: usize) -> Triangle<Wide<S>> {
        let load = [Three::load(simd, &self.edges[0], v), Three::load(simd, &self.edges[1], v)];
        let b = [
            [Wide::load(simd, &self.hats[0][0], v), Wide::load(simd, &self.hats[0][1], v)],
            [Wide::load(simd, &self.hats[1][0], v), Wide::load(simd, &self.hats[1][1], v)],
        ];
        let n = &self.numbers;
        Triangle {
            f: columns(load, &b),
            b,
            by_area: Wide::load(simd, &n[0], v),
            fraction: Wide::load(simd, &n[1], v),
            moduli: [Wide::load(simd, &n[2], v), Wide::load(simd, &n[3], v)],
        }
    }

    /// fᵢ = −fraction F̂ S bᵢ of nodes 1 and 2, and S.
    #[inline(always)]
    fn forces<S: Simd>(&mut self, simd: S, v: usize) {
        let t = self.triangle(simd, v);
        let s = t.stress();
        for i in 0..2 {
            let [x, y] = t.traction(&s, i);
            t.f[0].times(x).plus(y, t.f[1]).times(-t.fraction).store(&mut self.f[i], v);
        }
        for k in 0..3 {
            s[k].store(&mut self.stress[k], v);
        }
    }

    /// The stress of the strain's first-order change.
    #[inline(always)]
    fn displaced<S: Simd>(&mut self, simd: S, v: usize) {
        let t = self.triangle(simd, v);
        let d = columns([Three::load(simd, &self.moved[0], v), Three::load(simd, &self.moved[1], v)], &t.b);
        let both = t.f[0].dot(d[1]) + t.f[1].dot(d[0]);
        let change = [t.f[0].dot(d[0]) * t.by_area, t.f[1].dot(d[1]) * t.by_area, both.by(0.5) * t.by_area];
        let (here, more) = (t.stress(), stress(change, t.moduli));
        for k in 0..3 {
            (here[k] + more[k]).store(&mut self.stress[k], v);
        }
    }

    /// W = fraction · area · ½ (G : S), in the first stress's place.
    #[inline(always)]
    fn energy<S: Simd>(&mut self, simd: S, v: usize) {
        let t = self.triangle(simd, v);
        let (s, g) = (t.stress(), t.strain());
        let product = (g[0] * s[0]).plus(g[1], s[1]).plus(g[2].by(2.0), s[2]);
        (product * t.fraction * t.by_area.under(0.5)).store(&mut self.stress[0], v);
    }

    #[inline(always)]
    fn choose(&mut self, count: usize, first: usize, geometric: Geometric) {
        for lane in 0..count {
            let given = |axial: &[f64]| Sym::from_column_slice(&axial[3 * (first + lane)..][..3]);
            let s = match geometric {
                Geometric::Here => Sym::new(self.stress[0][lane], self.stress[1][lane], self.stress[2][lane]),
                Geometric::Predicted(axial) => given(axial),
                Geometric::Tension(axial) => tension(&given(axial)),
            };
            for k in 0..3 {
                self.geometric[k][lane] = s[k];
            }
        }
    }

    /// ∂fᵢ/∂xⱼ of nodes 1 and 2, which are symmetric.
    #[inline(always)]
    fn slopes<S: Simd>(&mut self, simd: S, v: usize) {
        let t = self.triangle(simd, v);
        let s = [
            Wide::load(simd, &self.geometric[0], v),
            Wide::load(simd, &self.geometric[1], v),
            Wide::load(simd, &self.geometric[2], v),
        ];
        let [x, y] = t.f;
        let scale = -t.fraction * t.by_area;
        let (half, second) = (scale.by(0.5) * t.moduli[0], scale * t.moduli[1]);
        let pulled = [x.times(t.b[0][0]).plus(t.b[0][1], y), x.times(t.b[1][0]).plus(t.b[1][1], y)];
        for (n, (i, j)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            let [along, across] = t.traction(&s, j);
            let diagonal = -t.fraction * (t.b[i][0] * along).plus(t.b[i][1], across);
            let own = half * (t.b[i][0] * t.b[j][0]).plus(t.b[i][1], t.b[j][1]);
            let (by_x, by_y) = (x.times(own), y.times(own));
            let (by_first, by_second) = (pulled[j].times(half), pulled[i].times(second));
            for a in 0..3 {
                for b in 0..3 {
                    let whole = (by_x.0[a] * x.0[b]).plus(by_y.0[a], y.0[b]);
                    let sum = whole.plus(by_first.0[a], pulled[i].0[b]).plus(by_second.0[a], pulled[j].0[b]);
                    let sum = if a == b { sum + diagonal } else { sum };
                    sum.store(&mut self.blocks[n][3 * a + b], v);
                }
            }
        }
    }

    #[inline(always)]
    fn scatter_forces(&self, faces: &[Face<4>], f: &mut [f64]) {
        for (lane, face) in faces.iter().enumerate() {
            let [f1, f2] = [&self.f[0], &self.f[1]].map(|f| Vec3::new(f[0][lane], f[1][lane], f[2][lane]));
            add_node(f, face.nodes[0], &-(f1 + f2));
            add_node(f, face.nodes[1], &f1);
            add_node(f, face.nodes[2], &f2);
        }
    }

    #[inline(always)]
    fn scatter_slopes(&self, faces: &[Face<4>], places: &[Place], dq: &mut NodeMatrix) {
        for (lane, places) in places.chunks_exact(9).enumerate().take(faces.len()) {
            let mut all: [[Block; 3]; 3] = [[[[0.0; 3]; 3]; 3]; 3];
            for a in 0..3 {
                for b in 0..3 {
                    let [own, cross, other] = [0, 1, 2].map(|n: usize| self.blocks[n][3 * a + b][lane]);
                    let turned = self.blocks[1][3 * b + a][lane];
                    (all[1][1][a][b], all[1][2][a][b], all[2][1][a][b], all[2][2][a][b]) = (own, cross, turned, other);
                    (all[0][1][a][b], all[0][2][a][b]) = (-(own + turned), -(cross + other));
                    (all[1][0][a][b], all[2][0][a][b]) = (-(own + cross), -(turned + other));
                    all[0][0][a][b] = (own + turned) + (cross + other);
                }
            }
            for (k, place) in places.iter().enumerate() {
                dq.add_block_at(*place, 1.0, &all[k / 3][k % 3]);
            }
        }
    }
}
