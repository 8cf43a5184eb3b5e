//! A triangle with its flaps: the curvature that the folds at its edges show, and what it costs.
//!
//! A triangle takes the fold θ at each of its edges for that of a sheet of constant curvature H = (H_xx, H_yy, H_xy), and its own
//! part of it, by the heights h and h' of the two triangles over the edge, for the slope between its plane and the sheet's at the
//! middle of the edge. With z = ½ X·H X over its own nodes P, Q, R that is, for the edge PQ,
//!
//! θ h/(h + h') = ½ (R − P)·H (R − Q)/h,
//!
//! so the folds at the k edges that have a neighbour are θ = M H, with k rows of M. What they cost is the least that a plate with
//! those folds can have: ½ A H·C H over all H with M H = ψ − ψ_rest,
//!
//! W = ½ (ψ − ψ_rest)ᵀ K (ψ − ψ_rest),   K = A (M C⁻¹ Mᵀ)⁻¹,   H·C H = D [(1 − ν) |H|² + ν tr(H)²].
//!
//! With three neighbours H is what the folds say; where the sheet ends it carries no moment. It is exact for every quadratic
//! surface where neighbours are turned copies of each other (grids whose cells are all cut alike, skewed ones too, and lattices
//! of equal triangles); elsewhere H has an error that depends on the mesh (docs/cloth.md has measurements). M scales with size
//! and A with its square, so K does not depend on the size of the sheet. Cf. Oñate and Zárate 2000, Rotation-free triangular plate
//! and shell elements (BST); Grinspun, Gingold, Reisman and Zorin 2006, Computing discrete shape operators on general meshes.
//!
//! (A quadratic fitted to all six nodes has M exact on every mesh, but lets a sheet whose cells are cut in turn bend by folding its
//! diagonals up and down: a cantilever sagged 2.6 times as far as the elastica.)

use super::fold::{BLOCKS, Fold};
use crate::terms::stencil::{Block, add_node, add_outer, transposed};
use crate::terms::{Element, Point};
use pliant_linalg::{NodeMatrix, Place};
use pliant_math::{Real, Vec3};

/// Most nodes of a patch: the triangle's and one of each neighbour.
pub(super) const NODES: usize = 6;
/// Most flaps.
pub(super) const FLAPS: usize = 3;
/// Constants of each flap: the edge, ψ at rest, the row of M/√A.
pub(super) const PER_FLAP: usize = 5;

/// Numbers that belong to the flaps of a patch; those beyond its last are not read.
pub(super) type Each<S> = [S; FLAPS];

/// Meaning of an element's constants.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// Number of flaps.
    pub flaps: usize,
    /// The edge of each, by the triangle's node that it lies opposite of.
    edges: Each<usize>,
    /// ψ at rest.
    pub rest: Each<f64>,
    /// Rows of M/√A.
    rows: Each<[f64; 3]>,
}

impl Shape {
    /// Reads the constants of an element with `flaps` flaps.
    #[inline]
    pub fn new(flaps: usize, constants: &[f64]) -> Self {
        let mut out = Self { flaps, edges: [0; 3], rest: [0.0; 3], rows: [[0.0; 3]; 3] };
        for (i, c) in constants.chunks_exact(PER_FLAP).enumerate().take(flaps) {
            (out.edges[i], out.rest[i], out.rows[i]) = (c[0] as usize, c[1], [c[2], c[3], c[4]]);
        }
        out
    }

    /// The nodes of flap `i` within the patch: the edge's ends, the triangle's node beside it, the neighbour's.
    #[inline]
    pub fn nodes(&self, i: usize) -> [usize; 4] {
        let e = self.edges[i];
        [(e + 1) % 3, (e + 2) % 3, e, 3 + i]
    }

    /// M C⁻¹ Mᵀ D/A and its derivative by ν.
    #[inline]
    fn compliance<S: Real>(&self, nu: S) -> Each<Each<[S; 2]>> {
        let complement = (-nu * nu + 1.0).recip();
        let rest = (-nu + 1.0).recip() * 0.5;
        let (by_one, by_two) = (nu * complement * complement * 2.0, (nu * nu + 1.0) * complement * complement);
        let mut out = [[[S::zero(); 2]; FLAPS]; FLAPS];
        for (i, row) in out.iter_mut().enumerate().take(self.flaps) {
            for (j, entry) in row.iter_mut().enumerate().take(self.flaps) {
                let (m, n) = (&self.rows[i], &self.rows[j]);
                let (own, cross) = (S::from(m[0] * n[0] + m[1] * n[1]), S::from(m[0] * n[1] + m[1] * n[0]));
                let twist = S::from(m[2] * n[2]) * rest;
                *entry = [(own - nu * cross) * complement + twist, own * by_one - cross * by_two + twist * rest * 2.0];
            }
        }
        out
    }

    /// K at D = 1.
    #[inline]
    pub fn stiffness<S: Real>(&self, nu: S) -> Each<Each<S>> {
        inverse(self.flaps, &self.compliance(nu).map(|row| row.map(|x| x[0])))
    }

    /// ∂K⁻¹/∂ν at D = 1.
    pub fn compliance_slope(&self, nu: f64) -> Each<Each<f64>> {
        self.compliance(nu).map(|row| row.map(|x| x[1]))
    }

    /// ∂K/∂ν at D = 1: −K (∂K⁻¹/∂ν) K.
    pub fn stiffness_slope(&self, nu: f64) -> Each<Each<f64>> {
        let compliance = self.compliance(nu);
        let k = inverse(self.flaps, &compliance.map(|row| row.map(|x| x[0])));
        let n = self.flaps;
        let inner = |i: usize, j: usize| -> f64 {
            (0..n).flat_map(|a| (0..n).map(move |b| (a, b))).map(|(a, b)| k[i][a] * compliance[a][b][1] * k[b][j]).sum()
        };
        std::array::from_fn(|i| std::array::from_fn(|j| if i < n && j < n { -inner(i, j) } else { 0.0 }))
    }
}

/// The inverse of a symmetric positive matrix of `n` rows, written out.
#[inline]
fn inverse<S: Real>(n: usize, a: &Each<Each<S>>) -> Each<Each<S>> {
    let zero = [[S::zero(); FLAPS]; FLAPS];
    match n {
        0 => zero,
        1 => {
            let mut out = zero;
            out[0][0] = a[0][0].recip();
            out
        }
        2 => {
            let scale = (a[0][0] * a[1][1] - a[0][1] * a[0][1]).recip();
            let (d, o) = ([a[1][1] * scale, a[0][0] * scale], -a[0][1] * scale);
            [[d[0], o, zero[0][0]], [o, d[1], zero[0][0]], zero[0]]
        }
        _ => {
            let minor = |i: usize, j: usize| {
                let (r, s) = ((i + 1) % 3, (i + 2) % 3);
                let (c, d) = ((j + 1) % 3, (j + 2) % 3);
                a[r][c] * a[s][d] - a[r][d] * a[s][c]
            };
            let scale = (a[0][0] * minor(0, 0) + a[0][1] * minor(0, 1) + a[0][2] * minor(0, 2)).recip();
            std::array::from_fn(|i| std::array::from_fn(|j| minor(j, i) * scale))
        }
    }
}

/// K x.
#[inline]
pub(super) fn times<S: Real>(n: usize, k: &Each<Each<S>>, x: &Each<S>) -> Each<S> {
    let mut out = [S::zero(); FLAPS];
    for i in 0..n {
        for j in 0..n {
            out[i] += k[i][j] * x[j];
        }
    }
    out
}

/// A patch of the sheet, without indirection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    nodes: [usize; NODES],
    /// Stiffness or coefficient, and ν.
    pub params: [usize; 2],
    pub shape: Shape,
}

impl Patch {
    /// Copies the elements.
    ///
    /// # Panics
    /// If an element has another number of nodes, parameters or constants than the law: a mistake where elements are built.
    pub fn all(law: &str, elements: &[Element]) -> Vec<Self> {
        let copied = |e: &Element| {
            let n = e.nodes.len();
            let fits = (4..=NODES).contains(&n) && e.params.len() == 2 && e.constants.len() == PER_FLAP * (n - 3);
            assert!(fits, "{law}: an element has {n} nodes, {} parameters, {} constants", e.params.len(), e.constants.len());
            let nodes = std::array::from_fn(|k| e.nodes.get(k).copied().unwrap_or(e.nodes[0]));
            Self { nodes, params: [e.params[0], e.params[1]], shape: Shape::new(n - 3, &e.constants) }
        };
        elements.iter().map(copied).collect()
    }

    /// Nodes of the patch.
    #[inline]
    pub fn n_nodes(&self) -> usize {
        3 + self.shape.flaps
    }

    /// The nodes of flap `i`.
    #[inline]
    pub fn flap(&self, i: usize) -> [usize; 4] {
        self.shape.nodes(i).map(|k| self.nodes[k])
    }

    /// The folds; the last one repeated where there are fewer than three.
    #[inline]
    pub fn folds(&self, at: &Point) -> Each<Fold> {
        let fold = |i: usize| Fold::new(&self.flap(i).map(|n| at.position(n)));
        let first = fold(0);
        let second = if self.shape.flaps > 1 { fold(1) } else { first };
        [first, second, if self.shape.flaps > 2 { fold(2) } else { second }]
    }

    /// Velocities of the nodes of flap `i`.
    #[inline]
    pub fn velocities(&self, at: &Point, i: usize) -> [Vec3<f64>; 4] {
        self.flap(i).map(|n| at.velocity(n))
    }

    /// (∂ψᵢ/∂x)·weights; zero where there is no flap.
    #[inline]
    pub fn pulled(&self, folds: &Each<Fold>, weights: &[f64]) -> Each<f64> {
        let mut out = [0.0; FLAPS];
        for (i, out) in out.iter_mut().enumerate().take(self.shape.flaps) {
            for (node, g) in self.flap(i).into_iter().zip(&folds[i].gradient) {
                *out += (0..3).map(|a| g[a] * weights[3 * node + a]).sum::<f64>();
            }
        }
        out
    }

    /// Slopes of ψ by the patch's nodes.
    #[inline]
    pub fn spread(&self, per_flap: impl Fn(usize) -> [Vec3<f64>; 4]) -> Spread {
        let mut out = [[Vec3::zeros(); NODES]; FLAPS];
        for (i, out) in out.iter_mut().enumerate().take(self.shape.flaps) {
            for (k, g) in self.shape.nodes(i).into_iter().zip(per_flap(i)) {
                out[k] = g;
            }
        }
        out
    }

    /// Adds the forces −Σ wᵢ ∂ψᵢ/∂x.
    #[inline]
    pub fn add_force(&self, f: &mut [f64], folds: &Each<Fold>, w: &Each<f64>) {
        for i in 0..self.shape.flaps {
            for (node, g) in self.flap(i).into_iter().zip(&folds[i].gradient) {
                add_node(f, node, &(g * -w[i]));
            }
        }
    }

    /// Visits ∂f/∂θ, which are forces with these w.
    #[inline]
    pub fn visit(&self, param: usize, folds: &Each<Fold>, w: &Each<f64>, visit: &mut (impl FnMut(usize, usize, f64) + ?Sized)) {
        for i in 0..self.shape.flaps {
            for (node, g) in self.flap(i).into_iter().zip(&folds[i].gradient) {
                (0..3).for_each(|a| visit(3 * node + a, param, -w[i] * g[a]));
            }
        }
    }

    /// Adds −Σᵢⱼ Kᵢⱼ yᵢ yⱼᵀ − Σ wᵢ Hᵢ to `out`; `z` is K y, `curved` has (wᵢ, Hᵢ) by the blocks of [`Fold::angle_hessian`], if any.
    #[inline]
    pub fn add_symmetric(&self, out: &mut NodeMatrix, places: Option<&[Place]>, y: &Spread, z: &Spread, curved: &Curved) {
        // local[r][p] with p ≤ r: the block of nodes (p, r)
        let mut local = [[[[0.0; 3]; 3]; NODES]; NODES];
        for (r, row) in local.iter_mut().enumerate().take(self.n_nodes()) {
            for (p, block) in row.iter_mut().enumerate().take(r + 1) {
                if r < 3 {
                    (0..self.shape.flaps).for_each(|i| add_outer(block, &y[i][p], &z[i][r]));
                } else {
                    // a neighbour's node is in its own flap alone
                    add_outer(block, &z[r - 3][p], &y[r - 3][r]);
                }
            }
        }
        for (i, (w, hessian)) in curved.iter().enumerate().filter_map(|(i, c)| Some((i, c.as_ref()?))) {
            let nodes = self.shape.nodes(i);
            for (&(a, b), block) in BLOCKS.iter().zip(hessian) {
                let (p, r) = (nodes[a], nodes[b]);
                if p <= r {
                    add_scaled(&mut local[r][p], *w, block);
                } else {
                    add_scaled(&mut local[p][r], *w, &transposed(block));
                }
            }
        }
        let mut add = |p: usize, r: usize, block: &Block| match places {
            Some(places) => out.add_block_at(places[NODES * p + r], -1.0, block),
            None => out.add_block(self.nodes[p], self.nodes[r], -1.0, block),
        };
        for (r, row) in local.iter().enumerate().take(self.n_nodes()) {
            for (p, block) in row.iter().enumerate().take(r) {
                add(p, r, block);
                add(r, p, &transposed(block));
            }
            add(r, r, &row[r]);
        }
    }

    /// Places of all patches' blocks, as many a patch as a whole one has.
    pub fn find_places(patches: &[Self], out: &NodeMatrix) -> Vec<Place> {
        // nodes that are missing are the first one again
        patches.iter().flat_map(|p| p.nodes.map(|i| p.nodes.map(|j| out.block_place(i, j)))).flatten().collect()
    }

    /// Adds −Σ yᵢ zᵢᵀ − Σ wᵢ Hᵢ to `out`.
    #[inline]
    pub fn add_general(&self, out: &mut NodeMatrix, y: &Spread, z: &Spread, w: &Each<f64>, hessians: &Each<[Block; 9]>) {
        let mut local = [[[[0.0; 3]; 3]; NODES]; NODES];
        for (p, row) in local.iter_mut().enumerate().take(self.n_nodes()) {
            let flaps = if p < 3 { 0..self.shape.flaps } else { p - 3..p - 2 };
            for i in flaps {
                row.iter_mut().zip(&z[i]).for_each(|(block, z)| add_outer(block, &y[i][p], z));
            }
        }
        self.for_blocks(w, hessians, |p, r, scale, block| {
            add_scaled(&mut local[p][r], scale, block);
            if p != r {
                add_scaled(&mut local[r][p], scale, &transposed(block));
            }
        });
        for (row, &p) in local.iter().zip(&self.nodes).take(self.n_nodes()) {
            for (block, &r) in row.iter().zip(&self.nodes).take(self.n_nodes()) {
                out.add_block(p, r, -1.0, block);
            }
        }
    }

    /// Calls `add(p, r, wᵢ, block)` for the blocks of all Hᵢ, by the patch's nodes.
    #[inline]
    fn for_blocks(&self, w: &Each<f64>, hessians: &Each<[Block; 9]>, mut add: impl FnMut(usize, usize, f64, &Block)) {
        for i in 0..self.shape.flaps {
            let nodes = self.shape.nodes(i);
            for (&(a, b), block) in BLOCKS.iter().zip(&hessians[i]) {
                add(nodes[a], nodes[b], w[i], block);
            }
        }
    }
}

/// Factors and Hessians of the folds' angles, where they belong to a matrix.
pub(super) type Curved = Each<Option<(f64, [Block; 9])>>;

/// Slopes of each fold by the patch's nodes.
pub(super) type Spread = Each<[Vec3<f64>; NODES]>;

#[inline]
fn add_scaled(out: &mut Block, scale: f64, block: &Block) {
    for (row, add) in out.iter_mut().zip(block) {
        row.iter_mut().zip(add).for_each(|(x, b)| *x += scale * b);
    }
}
