//! Gaps between a node of a rope (a sphere of the rope's radius) and fixed shapes: a file per shape.
//!
//! Each file holds the gap once, generic over the scalar, and a kernel that adds the Hessian; tests hold the two equal.
//! Sign: gap < 0 penetrates; the normal n = ∂gap/∂x points out of the shape, towards the node.

use constants::GEOMETRY;
use nalgebra::Matrix3;
use num_dual::DualSVec64;
use pliant_math::Vec3;

pub mod capsule;
pub mod collider;
mod constants;
pub(crate) mod element;
pub mod hull;
pub mod plane;
pub mod sphere;

/// A gap and its slopes with respect to the node's position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Distance between the surfaces \[m\], negative in penetration.
    pub gap: f64,
    /// n = ∂gap/∂x, outward unit normal of the shape [-].
    pub normal: Vec3<f64>,
    /// H = ∂n/∂x, symmetric, H n = 0 [1/m].
    pub hessian: Matrix3<f64>,
}

/// Where a gap has no value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeometryError {
    /// The node's centre is at the sphere's centre or on the capsule's segment (or not finite).
    #[error(
        "shape `{shape}` has no normal at {point:?} m: that is {distance:e} m from its centre, at least {:e} m is needed",
        GEOMETRY.min_distance
    )]
    NoNormal {
        /// Name of the shape.
        shape: String,
        /// Centre of the node \[m\].
        point: [f64; 3],
        /// Its distance to the sphere's centre or the capsule's segment \[m\].
        distance: f64,
    },
    /// A capsule whose ends coincide has no axis, and its gap no slope with respect to them.
    #[error("capsule `{shape}` has length {length:e} m between its ends; use a sphere for a single point")]
    NoAxis {
        /// Name of the shape.
        shape: String,
        /// |b − a| \[m\].
        length: f64,
    },
    /// A plane whose normal cannot be normalised.
    #[error("plane `{shape}` has a normal of length {length:e}")]
    NoPlane {
        /// Name of the shape.
        shape: String,
        /// Length of the given normal.
        length: f64,
    },
}

/// A fixed shape: constants, and indices of its parameters in θ.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Half space; see [`plane::gap`]. Built by [`Shape::plane`], which normalises.
    Plane {
        /// Name in errors.
        name: String,
        /// A point of the plane at height zero \[m\].
        point: Vec3<f64>,
        /// Outward unit normal where the rotation is zero.
        normal: Vec3<f64>,
        /// Index of the height \[m\].
        height: usize,
        /// Indices of the rotation vector that turns the plane about its point \[rad\].
        rotation: [usize; 3],
    },
    /// Sphere; see [`sphere::gap`].
    Sphere {
        /// Name in errors.
        name: String,
        /// Indices of the centre \[m\].
        center: [usize; 3],
        /// Index of the radius \[m\].
        radius: usize,
    },
    /// Capsule; see [`capsule::gap`].
    Capsule {
        /// Name in errors.
        name: String,
        /// Indices of the first end of the axis \[m\].
        a: [usize; 3],
        /// Indices of the second end of the axis \[m\].
        b: [usize; 3],
        /// Index of the radius \[m\].
        radius: usize,
    },
}

impl Shape {
    /// A plane through `point` with a normal of any length.
    ///
    /// # Errors
    /// [`GeometryError::NoPlane`] if the normal is zero or not finite.
    pub fn plane(
        name: impl Into<String>,
        point: Vec3<f64>,
        normal: Vec3<f64>,
        height: usize,
        rotation: [usize; 3],
    ) -> Result<Self, GeometryError> {
        let (name, length) = (name.into(), normal.norm());
        if length > 0.0 && length.is_finite() {
            Ok(Self::Plane { name, point, normal: normal / length, height, rotation })
        } else {
            Err(GeometryError::NoPlane { shape: name, length })
        }
    }

    /// Name of the shape.
    pub fn name(&self) -> &str {
        match self {
            Self::Plane { name, .. } | Self::Sphere { name, .. } | Self::Capsule { name, .. } => name,
        }
    }

    /// Gap \[m\], normal and Hessian for a node at `x` \[m\] of a rope with `radius` \[m\].
    ///
    /// # Errors
    /// [`GeometryError::NoNormal`] within 1e-12 m of a sphere's centre or a capsule's segment,
    /// [`GeometryError::NoAxis`] for a capsule without length.
    #[inline]
    pub fn eval(&self, x: &Vec3<f64>, radius: f64, theta: &[f64]) -> Result<Gap, GeometryError> {
        let found = match self {
            Self::Plane { point, normal, height, rotation, .. } => {
                Ok(plane::eval(x, radius, plane_params(*height, rotation).map(|k| theta[k]), point, normal))
            }
            Self::Sphere { center, radius: own, .. } => sphere::eval(x, radius, sphere_params(center, *own).map(|k| theta[k])),
            Self::Capsule { name, a, b, radius: own } => {
                let p = capsule_params(a, b, *own).map(|k| theta[k]);
                let length = Vec3::new(p[3] - p[0], p[4] - p[1], p[5] - p[2]).norm();
                if usable(length).is_err() {
                    return Err(GeometryError::NoAxis { shape: name.clone(), length });
                }
                capsule::eval(x, radius, p)
            }
        };
        found.map_err(|distance| GeometryError::NoNormal { shape: self.name().to_owned(), point: [x[0], x[1], x[2]], distance })
    }

    /// Calls `visit(parameter, ∂gap/∂θ, ∂n/∂θ)` for the rope's radius (index `radius`) and every parameter of the shape, at
    /// constant x. Units: gap \[m\] and n [-] per unit of the parameter.
    ///
    /// # Errors
    /// As [`Shape::eval`].
    pub fn visit_theta(
        &self,
        x: &Vec3<f64>,
        radius: usize,
        theta: &[f64],
        visit: &mut dyn FnMut(usize, f64, &Vec3<f64>),
    ) -> Result<(), GeometryError> {
        let r = theta[radius];
        self.eval(x, r, theta)?;
        visit(radius, -1.0, &Vec3::zeros());
        match self {
            Self::Plane { point, normal, height, rotation, .. } => {
                let of = |p: &[_; 4]| plane::gap(&x.map(DualSVec64::from_re), DualSVec64::from_re(r), p, point, normal);
                visit_params(plane_params(*height, rotation), theta, of, visit);
            }
            Self::Sphere { center, radius, .. } => {
                let of = |p: &[_; 4]| sphere::gap(&x.map(DualSVec64::from_re), DualSVec64::from_re(r), p);
                visit_params(sphere_params(center, *radius), theta, of, visit);
            }
            Self::Capsule { a, b, radius, .. } => {
                let of = |p: &[_; 7]| capsule::gap(&x.map(DualSVec64::from_re), DualSVec64::from_re(r), p);
                visit_params(capsule_params(a, b, *radius), theta, of, visit);
            }
        }
        Ok(())
    }
}

fn usable(distance: f64) -> Result<f64, f64> {
    if distance >= GEOMETRY.min_distance { Ok(distance) } else { Err(distance) }
}

fn plane_params(height: usize, r: &[usize; 3]) -> [usize; 4] {
    [height, r[0], r[1], r[2]]
}

fn sphere_params(c: &[usize; 3], radius: usize) -> [usize; 4] {
    [c[0], c[1], c[2], radius]
}

fn capsule_params(a: &[usize; 3], b: &[usize; 3], radius: usize) -> [usize; 7] {
    [a[0], a[1], a[2], b[0], b[1], b[2], radius]
}

/// Visits the slopes of a gap with respect to its P parameters, in one pass of dual numbers.
fn visit_params<const P: usize>(
    params: [usize; P],
    theta: &[f64],
    gap: impl Fn(&[DualSVec64<P>; P]) -> (DualSVec64<P>, Vec3<DualSVec64<P>>),
    visit: &mut dyn FnMut(usize, f64, &Vec3<f64>),
) {
    let (gap, normal) = gap(&std::array::from_fn(|k| DualSVec64::from_re(theta[params[k]]).derivative(k)));
    let slope = |x: &DualSVec64<P>, k: usize| x.eps.0.map_or(0.0, |eps| eps[k]);
    for (k, &param) in params.iter().enumerate() {
        visit(param, slope(&gap, k), &normal.map(|component| slope(&component, k)));
    }
}

#[cfg(test)]
mod tests;
