//! Shared by the membrane's laws: the deformation gradient of a triangle, elements without indirection, adding their blocks.

use crate::terms::stencil::{Block, add_node, add_outer};
use crate::terms::{Element, Point};
use nalgebra::{Vector2, Vector3};
use pliant_linalg::{NodeMatrix, Place};
use pliant_math::{Real, Vec3};

/// A symmetric 2 × 2 tensor in the triangle's rest plane: xx, yy, xy.
pub(super) type Sym<S> = Vector3<S>;
/// A vector in the triangle's rest plane.
pub(super) type Vec2<S> = Vector2<S>;

/// Number of an element's constants: the fraction of the area, and b₁, b₂.
pub(super) const CONSTANTS: usize = 5;

/// Slopes of the hat functions of the three nodes, times √area: b₀ = −b₁ − b₂, bᵢ·(xⱼ − x₀)/√area = δᵢⱼ in the rest plane.
#[inline]
pub(super) fn hats(constants: &[f64]) -> [Vec2<f64>; 3] {
    let (b1, b2) = (Vec2::new(constants[1], constants[2]), Vec2::new(constants[3], constants[4]));
    [-b1 - b2, b1, b2]
}

/// The columns of F̂ = Σ xᵢ bᵢᵀ = √area F, F the deformation gradient [-]; or of its rate, from velocities.
#[inline]
pub(super) fn gradient<S: Real>(x: &[Vec3<S>], b: &[Vec2<f64>; 3]) -> [Vec3<S>; 2] {
    let (e1, e2) = (x[1] - x[0], x[2] - x[0]);
    [e1 * S::from(b[1][0]) + e2 * S::from(b[2][0]), e1 * S::from(b[1][1]) + e2 * S::from(b[2][1])]
}

/// F̂ S b for S with a symmetric tensor.
#[inline]
pub(super) fn pulled<S: Real>(f: &[Vec3<S>; 2], s: &Sym<S>, b: &Vec2<f64>) -> Vec3<S> {
    let (b0, b1) = (S::from(b[0]), S::from(b[1]));
    f[0] * (s[0] * b0 + s[2] * b1) + f[1] * (s[2] * b0 + s[1] * b1)
}

/// a·S c.
#[inline]
pub(super) fn between(a: &Vec2<f64>, s: &Sym<f64>, c: &Vec2<f64>) -> f64 {
    a[0] * (s[0] * c[0] + s[2] * c[1]) + a[1] * (s[2] * c[0] + s[1] * c[1])
}

/// F̂ b.
#[inline]
pub(super) fn along(f: &[Vec3<f64>; 2], b: &Vec2<f64>) -> Vec3<f64> {
    f[0] * b[0] + f[1] * b[1]
}

/// F̂ F̂ᵀ, or F̂ V̂ᵀ.
#[inline]
pub(super) fn product(f: &[Vec3<f64>; 2], v: &[Vec3<f64>; 2]) -> Block {
    let mut out = [[0.0; 3]; 3];
    add_outer(&mut out, &f[0], &v[0]);
    add_outer(&mut out, &f[1], &v[1]);
    out
}

/// An [`Element`] of a triangle without indirection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face<const P: usize> {
    pub nodes: [usize; 3],
    pub params: [usize; P],
    /// Part of the sheet's area.
    pub fraction: f64,
    pub hats: [Vec2<f64>; 3],
}

impl<const P: usize> Face<P> {
    /// Copies the elements.
    ///
    /// # Panics
    /// If an element has another number of nodes, parameters or constants than the law: a mistake where elements are built.
    pub fn all(law: &str, elements: &[Element]) -> Vec<Self> {
        let copied = |e: &Element| {
            let found = (e.nodes.len(), e.params.len(), e.constants.len());
            assert!(found == (3, P, CONSTANTS), "{law}: an element has (nodes, parameters, constants) {found:?}");
            Self {
                nodes: std::array::from_fn(|k| e.nodes[k]),
                params: std::array::from_fn(|k| e.params[k]),
                fraction: e.constants[0],
                hats: hats(&e.constants),
            }
        };
        elements.iter().map(copied).collect()
    }

    /// Values of the element's parameters.
    #[inline]
    pub fn values(&self, theta: &[f64]) -> [f64; P] {
        self.params.map(|k| theta[k])
    }

    /// Positions of its nodes \[m\].
    #[inline]
    pub fn positions(&self, at: &Point) -> [Vec3<f64>; 3] {
        self.nodes.map(|i| at.position(i))
    }

    /// Velocities of its nodes [m/s].
    #[inline]
    pub fn velocities(&self, at: &Point) -> [Vec3<f64>; 3] {
        self.nodes.map(|i| at.velocity(i))
    }

    /// Adds the forces −fraction F̂ S bᵢ of the stress S \[N/m\] on the nodes.
    #[inline]
    pub fn add_force(&self, f: &mut [f64], gradient: &[Vec3<f64>; 2], stress: &Sym<f64>) {
        let [f1, f2] = [1, 2].map(|i| pulled(gradient, stress, &self.hats[i]) * -self.fraction);
        add_node(f, self.nodes[0], &-(f1 + f2));
        add_node(f, self.nodes[1], &f1);
        add_node(f, self.nodes[2], &f2);
    }

    /// Adds the blocks `block(i, j)` of nodes 1 and 2, and those of node 0, with which every row and column sums to zero.
    #[inline]
    pub fn add_blocks(&self, out: &mut NodeMatrix, places: Option<&[Place]>, block: impl Fn(usize, usize) -> Block) {
        let mut all = [[[[0.0; 3]; 3]; 3]; 3];
        for i in 1..3 {
            for j in 1..3 {
                let own = block(i, j);
                for a in 0..3 {
                    for b in 0..3 {
                        let x = own[a][b];
                        all[i][j][a][b] = x;
                        all[0][j][a][b] -= x;
                        all[i][0][a][b] -= x;
                        all[0][0][a][b] += x;
                    }
                }
            }
        }
        for (i, row) in all.iter().enumerate() {
            for (j, block) in row.iter().enumerate() {
                match places {
                    Some(places) => out.add_block_at(places[3 * i + j], 1.0, block),
                    None => out.add_block(self.nodes[i], self.nodes[j], 1.0, block),
                }
            }
        }
    }

    /// Places of all faces' blocks, nine a face.
    pub fn find_places(faces: &[Self], out: &NodeMatrix) -> Vec<Place> {
        let of = |face: &Self| {
            let nodes = face.nodes;
            nodes.map(|i| nodes.map(|j| out.block_place(i, j)))
        };
        faces.iter().flat_map(of).flatten().collect()
    }

    /// Visits the slope of the forces by a parameter: they are −fraction F̂ S bᵢ with this S.
    #[inline]
    pub fn visit(
        &self,
        param: usize,
        gradient: &[Vec3<f64>; 2],
        stress: &Sym<f64>,
        visit: &mut (impl FnMut(usize, usize, f64) + ?Sized),
    ) {
        let [f1, f2] = [1, 2].map(|i| pulled(gradient, stress, &self.hats[i]) * -self.fraction);
        for (node, force) in self.nodes.iter().zip([-(f1 + f2), f1, f2]) {
            (0..3).for_each(|a| visit(3 * node + a, param, force[a]));
        }
    }
}
