//! Mass, centre and inertia of meshes, as MuJoCo has them.
//!
//! A closed surface is cut into pyramids with the triangles as bases and one apex: V = Σ V_k, with V_k = n_k·(c_k − a) A_k/3 of a triangle
//! of centroid c_k, area A_k and normal n_k. The centre is Σ V_k (¾ c_k + ¼ a)/V for the surface's own centre a; the second moments are
//! Σ V_k/20 (s sᵀ + Σ x xᵀ) over the corners x from the centre of mass, with s their sum. `legacy` takes |V_k|, which counts parts of
//! bodies that are not convex twice.

use super::{Mesh, MeshMistake};
use crate::inertia::Mass;
use nalgebra::Matrix3;
use pliant_math::Vec3;
use std::collections::HashMap;

/// How the mass of a mesh fills it: MuJoCo's `inertia`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filling {
    /// Its convex hull, of uniform density.
    Convex,
    /// The mesh, of uniform density; it must be closed.
    Exact,
    /// As `Exact` for bodies that are convex; parts of others count more than once.
    Legacy,
    /// Its surface, of uniform density [kg/m²].
    Shell,
}

impl Mesh {
    /// Volume [m³] (of a shell the area [m²]), and the mass of density 1 in the mesh's axes.
    pub fn mass(&self, filling: Filling) -> Result<Mass, MeshMistake> {
        let mass = match filling {
            Filling::Convex => {
                self.hull().map(|hull| Self { vertices: hull.corners, triangles: hull.triangles }.filled(false))?
            }
            Filling::Exact => self.check_closed().map(|()| self.filled(false))?,
            Filling::Legacy => self.filled(true),
            Filling::Shell => return Ok(self.shell()),
        };
        let size = self.extents().into_iter().fold(0.0, f64::max);
        // rounding of a volume of that size
        if mass.mass > 1e-12 * size.powi(3) { Ok(mass) } else { Err(MeshMistake::Flat(self.extents())) }
    }

    /// Corners, centroids and area vectors of the triangles.
    fn pieces(&self, from: Vec3<f64>) -> impl Iterator<Item = ([Vec3<f64>; 3], Vec3<f64>, Vec3<f64>)> + '_ {
        self.triangles.iter().map(move |t| {
            let x = t.map(|k| self.vertices[k] - from);
            (x, (x[0] + x[1] + x[2]) / 3.0, (x[1] - x[0]).cross(&(x[2] - x[0])) * 0.5)
        })
    }

    /// Area and centre of the surface.
    fn surface(&self) -> (f64, Vec3<f64>) {
        let sum = |(area, moment), (_, c, a): (_, Vec3<f64>, Vec3<f64>)| (area + a.norm(), moment + c * a.norm());
        let (area, moment) = self.pieces(Vec3::zeros()).fold((0.0, Vec3::zeros()), sum);
        (area, moment / area)
    }

    fn filled(&self, legacy: bool) -> Mass {
        let signed = |v: f64| if legacy { v.abs() } else { v };
        let apex = self.surface().1;
        let (mut volume, mut moment) = (0.0, Vec3::zeros());
        for (_, c, area) in self.pieces(apex) {
            let v = signed(c.dot(&area) / 3.0);
            volume += v;
            moment += c * (0.75 * v);
        }
        let center = apex + moment / volume;
        let (mut volume, mut second) = (0.0, Matrix3::zeros());
        for (x, c, area) in self.pieces(center) {
            let v = signed(c.dot(&area) / 3.0);
            volume += v;
            second += moments(&x) * (v / 20.0);
        }
        Mass { mass: volume, center, inertia: Matrix3::from_diagonal_element(second.trace()) - second }
    }

    fn shell(&self) -> Mass {
        let (area, center) = self.surface();
        let second = self.pieces(center).fold(Matrix3::zeros(), |sum, (x, _, a)| sum + moments(&x) * (a.norm() / 12.0));
        Mass { mass: area, center, inertia: Matrix3::from_diagonal_element(second.trace()) - second }
    }

    /// Every edge must have one triangle on each side, which run along it in opposite directions.
    fn check_closed(&self) -> Result<(), MeshMistake> {
        let mut runs: HashMap<[usize; 2], i32> = HashMap::new();
        for [a, b, c] in &self.triangles {
            [[*a, *b], [*b, *c], [*c, *a]].into_iter().for_each(|run| *runs.entry(run).or_default() += 1);
        }
        let open = runs.iter().filter(|([i, j], n)| **n != 1 || runs.get(&[*j, *i]) != Some(&1)).map(|(run, _)| *run);
        let open: Vec<[usize; 2]> = open.collect();
        let Some([i, j]) = open.iter().min() else { return Ok(()) };
        let (from, to) = (self.vertices[*i].into(), self.vertices[*j].into());
        Err(MeshMistake::Open { edges: open.len(), from, to })
    }
}

/// s sᵀ + Σ x xᵀ with the sum s of the corners.
fn moments(x: &[Vec3<f64>; 3]) -> Matrix3<f64> {
    let s = x[0] + x[1] + x[2];
    x.iter().fold(s * s.transpose(), |sum, x| sum + x * x.transpose())
}
