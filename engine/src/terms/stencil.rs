//! Shared by hand-written kernels: compact elements, edges and corners of a rope, and adding their blocks to a band.
//!
//! A two-node stencil has the edge e = x₁ − x₀ and the tension vector τ, forces (τ, −τ). A three-node stencil has the edges
//! e₁ = x₁ − x₀, e₂ = x₂ − x₁ and the edge forces τ₁, τ₂ (gradients with respect to e₁, e₂), forces (τ₁, τ₂ − τ₁, −τ₂).

use super::{Element, Point};
use pliant_linalg::NodeMatrix;
use pliant_math::{Real, Vec3};

/// A 3 × 3 block by rows.
pub(super) type Block = [[f64; 3]; 3];

/// `u vᵀ` added to `m`.
#[inline]
pub(super) fn add_outer(m: &mut Block, u: &Vec3<f64>, v: &Vec3<f64>) {
    for (a, row) in m.iter_mut().enumerate() {
        for (b, entry) in row.iter_mut().enumerate() {
            *entry += u[a] * v[b];
        }
    }
}

/// `s · I`.
#[inline]
pub(super) fn diagonal(s: f64) -> Block {
    [[s, 0.0, 0.0], [0.0, s, 0.0], [0.0, 0.0, s]]
}

/// `a + sign · b`.
#[inline]
pub(super) fn combine(a: &Block, sign: f64, b: &Block) -> Block {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + sign * b[i][j]))
}

/// `s · m`.
#[inline]
pub(super) fn scaled(s: f64, m: &Block) -> Block {
    m.map(|row| row.map(|x| s * x))
}

/// The transposed block.
#[inline]
pub(super) fn transposed(m: &Block) -> Block {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// An [`Element`] of known size with one constant, without indirection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Compact<const N: usize, const P: usize> {
    pub nodes: [usize; N],
    pub params: [usize; P],
    pub constant: f64,
}

impl<const N: usize, const P: usize> Compact<N, P> {
    /// Copies the elements.
    ///
    /// # Panics
    /// If an element has another number of nodes, parameters or constants than the law: a mistake where elements are built.
    pub fn all(law: &str, elements: &[Element]) -> Vec<Self> {
        elements
            .iter()
            .map(|e| {
                let found = (e.nodes.len(), e.params.len(), e.constants.len());
                assert!(
                    found == (N, P, 1),
                    "{law}: an element has (nodes, parameters, constants) {found:?}, not {:?}",
                    (N, P, 1)
                );
                Self {
                    nodes: std::array::from_fn(|k| e.nodes[k]),
                    params: std::array::from_fn(|k| e.params[k]),
                    constant: e.constants[0],
                }
            })
            .collect()
    }

    /// Values of the element's parameters.
    #[inline]
    pub fn values(&self, theta: &[f64]) -> [f64; P] {
        std::array::from_fn(|k| theta[self.params[k]])
    }

    /// Positions of the element's nodes \[m\].
    #[inline]
    pub fn positions(&self, at: &Point) -> [Vec3<f64>; N] {
        std::array::from_fn(|k| at.position(self.nodes[k]))
    }

    /// Velocities of the element's nodes [m/s].
    #[inline]
    pub fn velocities(&self, at: &Point) -> [Vec3<f64>; N] {
        std::array::from_fn(|k| at.velocity(self.nodes[k]))
    }
}

/// An edge e: its unit tangent t = e/|e| and length |e| \[m\]. Not finite where |e| = 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge<S> {
    pub tangent: Vec3<S>,
    pub length: S,
}

impl<S: Real> Edge<S> {
    #[inline]
    pub fn new(from: &Vec3<S>, to: &Vec3<S>) -> Self {
        let e = to - from;
        let length = e.dot(&e).sqrt();
        Self { tangent: e * length.recip(), length }
    }
}

/// Two edges that meet: d = t₂ − t₁, 1 − c = ½|d|² and p = 1/(1 + c) with c = t₁·t₂; where the rope folds back (c = −1) p is too large for what
/// resists bending.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner<S> {
    pub one: Edge<S>,
    pub two: Edge<S>,
    pub turn: Vec3<S>,
    pub one_minus_c: S,
    pub p: S,
}

impl<S: Real> Corner<S> {
    #[inline]
    pub fn new(x: &[Vec3<S>]) -> Self {
        let (one, two) = (Edge::new(&x[0], &x[1]), Edge::new(&x[1], &x[2]));
        let turn = two.tangent - one.tangent;
        // ½|t₂ − t₁|² keeps the relative precision of a nearly straight rope, where 1 − t₁·t₂ cancels.
        let one_minus_c = turn.dot(&turn) * 0.5;
        // likewise ½|t₁ + t₂|² that of a fold; a rope that does not resist bending may fold completely, and 0 · p has to be 0 there
        let along = one.tangent + two.tangent;
        let p = (along.dot(&along) * 0.5 + f64::MIN_POSITIVE).recip();
        Self { one, two, turn, one_minus_c, p }
    }

    /// ∂c/∂e₁ = (t₂ − c t₁)/|e₁| and ∂c/∂e₂ = (t₁ − c t₂)/|e₂|  [1/m].
    #[inline]
    pub fn cosine_gradients(&self) -> (Vec3<S>, Vec3<S>) {
        let u1 = (self.turn + self.one.tangent * self.one_minus_c) * self.one.length.recip();
        let u2 = (self.two.tangent * self.one_minus_c - self.turn) * self.two.length.recip();
        (u1, u2)
    }
}

/// Adds `x` to the three entries of node `i`.
#[inline]
pub(super) fn add_node(f: &mut [f64], i: usize, x: &Vec3<f64>) {
    let entry = &mut f[3 * i..3 * i + 3];
    entry[0] += x[0];
    entry[1] += x[1];
    entry[2] += x[2];
}

/// Adds the forces (τ, −τ).
#[inline]
pub(super) fn add_edge_force(f: &mut [f64], nodes: [usize; 2], tau: &Vec3<f64>) {
    add_node(f, nodes[0], tau);
    add_node(f, nodes[1], &-tau);
}

/// Adds the forces (τ₁, τ₂ − τ₁, −τ₂).
#[inline]
pub(super) fn add_corner_force(f: &mut [f64], nodes: [usize; 3], tau1: &Vec3<f64>, tau2: &Vec3<f64>) {
    add_node(f, nodes[0], tau1);
    add_node(f, nodes[1], &(tau2 - tau1));
    add_node(f, nodes[2], &-tau2);
}

/// Adds ∂f/∂x of a two-node stencil, `k` = ∂τ/∂e.
#[inline]
pub(super) fn add_edge_blocks(out: &mut NodeMatrix, nodes: [usize; 2], k: &Block) {
    for (a, [x, y, z]) in k.iter().enumerate() {
        out.add_row(nodes[0], a, nodes, [-x, -y, -z, *x, *y, *z]);
        out.add_row(nodes[1], a, nodes, [*x, *y, *z, -x, -y, -z]);
    }
}

/// Adds ∂f/∂x of a three-node stencil, `t[a][b]` = ∂τ_a/∂e_b.
#[inline]
pub(super) fn add_corner_blocks(out: &mut NodeMatrix, nodes: [usize; 3], t: &[[Block; 2]; 2]) {
    let [[t11, t12], [t21, t22]] = t;
    for a in 0..3 {
        // Row a of the three forces, to (x₀, x₁, x₂).
        let mut rows = [[0.0; 9]; 3];
        for b in 0..3 {
            let (x11, x12, x21, x22) = (t11[a][b], t12[a][b], t21[a][b], t22[a][b]);
            (rows[0][b], rows[0][3 + b], rows[0][6 + b]) = (-x11, x11 - x12, x12);
            (rows[1][b], rows[1][3 + b], rows[1][6 + b]) = (x11 - x21, (x21 - x11) + (x12 - x22), x22 - x12);
            (rows[2][b], rows[2][3 + b], rows[2][6 + b]) = (x21, x22 - x21, -x22);
        }
        for (row, i) in rows.into_iter().zip(nodes) {
            out.add_row(i, a, nodes, row);
        }
    }
}

/// Visits ∂f/∂θ of a two-node stencil, `tau` = ∂τ/∂θ.
pub(super) fn visit_edge(nodes: [usize; 2], param: usize, tau: &Vec3<f64>, visit: &mut dyn FnMut(usize, usize, f64)) {
    for a in 0..3 {
        visit(3 * nodes[0] + a, param, tau[a]);
        visit(3 * nodes[1] + a, param, -tau[a]);
    }
}

/// Visits ∂f/∂θ of a three-node stencil, `tau` = (∂τ₁/∂θ, ∂τ₂/∂θ).
pub(super) fn visit_corner(nodes: [usize; 3], param: usize, tau: &[Vec3<f64>; 2], visit: &mut dyn FnMut(usize, usize, f64)) {
    let [tau1, tau2] = tau;
    for (a, (x1, x2)) in tau1.iter().zip(tau2).enumerate() {
        visit(3 * nodes[0] + a, param, *x1);
        visit(3 * nodes[1] + a, param, x2 - x1);
        visit(3 * nodes[2] + a, param, -x2);
    }
}
