//! Six-vectors of rigid-body motion, in world axes about one fixed point, the *origin* of an evaluation.
//!
//! A motion (ω; v) is the angular velocity and the velocity of the body point that passes the origin; a force (n; f) the moment
//! about the origin and the force. Reference: R. Featherstone (2008), Rigid Body Dynamics Algorithms, chapter 2.

use crate::{Real, Vec3};
use nalgebra::{Matrix3, SMatrix};
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// A velocity, an acceleration, or an axis of motion: angular part [rad/s], linear part at the origin [m/s].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<S> {
    /// Angular part.
    pub w: Vec3<S>,
    /// Linear part at the origin.
    pub v: Vec3<S>,
}

/// A force: moment about the origin [N·m], force \[N\]; also a momentum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Force<S> {
    /// Moment about the origin.
    pub n: Vec3<S>,
    /// Force.
    pub f: Vec3<S>,
}

impl<S: Real> Motion<S> {
    /// No motion.
    #[inline]
    pub fn zero() -> Self {
        let zero = Vec3::repeat(S::zero());
        Self { w: zero, v: zero }
    }

    /// Turning about the axis `a` through the point `p`.
    #[inline]
    pub fn turning(a: Vec3<S>, p: &Vec3<S>) -> Self {
        Self { w: a, v: p.cross(&a) }
    }

    /// `self × m`: the change of `m` carried along by the motion `self`.
    #[inline]
    pub fn cross(&self, m: &Self) -> Self {
        Self { w: self.w.cross(&m.w), v: self.w.cross(&m.v) + self.v.cross(&m.w) }
    }

    /// `self ×* f`: the change of a force carried along by the motion `self`.
    #[inline]
    pub fn cross_force(&self, f: &Force<S>) -> Force<S> {
        Force { n: self.w.cross(&f.n) + self.v.cross(&f.f), f: self.w.cross(&f.f) }
    }

    /// Power.
    #[inline]
    pub fn dot(&self, f: &Force<S>) -> S {
        self.w.dot(&f.n) + self.v.dot(&f.f)
    }

    /// Velocity of the body point at `p`.
    #[inline]
    pub fn at(&self, p: &Vec3<S>) -> Vec3<S> {
        self.v + self.w.cross(p)
    }
}

impl<S: Real> Force<S> {
    /// No force.
    #[inline]
    pub fn zero() -> Self {
        let zero = Vec3::repeat(S::zero());
        Self { n: zero, f: zero }
    }

    /// The force `f` at the point `p`.
    #[inline]
    pub fn at(p: &Vec3<S>, f: Vec3<S>) -> Self {
        Self { n: p.cross(&f), f }
    }
}

macro_rules! linear {
    ($name:ident, $a:ident, $b:ident) => {
        impl<S: Real> Add for $name<S> {
            type Output = Self;
            #[inline]
            fn add(self, o: Self) -> Self {
                Self { $a: self.$a + o.$a, $b: self.$b + o.$b }
            }
        }
        impl<S: Real> Sub for $name<S> {
            type Output = Self;
            #[inline]
            fn sub(self, o: Self) -> Self {
                Self { $a: self.$a - o.$a, $b: self.$b - o.$b }
            }
        }
        impl<S: Real> Neg for $name<S> {
            type Output = Self;
            #[inline]
            fn neg(self) -> Self {
                Self { $a: -self.$a, $b: -self.$b }
            }
        }
        impl<S: Real> AddAssign for $name<S> {
            #[inline]
            fn add_assign(&mut self, o: Self) {
                *self = *self + o;
            }
        }
        impl<S: Real> Mul<S> for $name<S> {
            type Output = Self;
            #[inline]
            fn mul(self, s: S) -> Self {
                Self { $a: self.$a * s, $b: self.$b * s }
            }
        }
    };
}
linear!(Motion, w, v);
linear!(Force, n, f);

/// A rigid body's inertia about the origin: mass m \[kg\], first moment m c [kg·m], and rotational inertia about the origin
/// [kg·m²] as (xx, yy, zz, xy, xz, yz).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia<S> {
    /// Mass.
    pub m: S,
    /// First moment.
    pub h: Vec3<S>,
    /// Rotational inertia about the origin.
    pub j: [S; 6],
}

impl<S: Real> Inertia<S> {
    /// No mass.
    #[inline]
    pub fn zero() -> Self {
        Self { m: S::zero(), h: Vec3::repeat(S::zero()), j: [S::zero(); 6] }
    }

    /// The momentum of a body that moves with `u`.
    #[inline]
    pub fn mul(&self, u: &Motion<S>) -> Force<S> {
        Force { n: symmetric_mul(&self.j, &u.w) + self.h.cross(&u.v), f: u.v * self.m - self.h.cross(&u.w) }
    }

    /// The same body seen from world axes about another point: `rotation` takes its axes to the world's, and `p` is where its
    /// old origin lies.
    #[inline]
    pub fn placed(&self, rotation: &Matrix3<S>, p: &Vec3<S>) -> Self {
        let h = rotation * self.h;
        let turned = rotation * full(&self.j) * rotation.transpose();
        // J about the new origin = R J Rᵀ + (2 p·h) 1 − (p hᵀ + h pᵀ) + m (p·p 1 − p pᵀ)
        let (ph, pp) = (p.dot(&h), p.dot(p));
        let diagonal = ph * 2.0 + self.m * pp;
        let entry = |a: usize, b: usize| turned[(a, b)] - (p[a] * h[b] + h[a] * p[b]) - self.m * p[a] * p[b];
        let j = [entry(0, 0) + diagonal, entry(1, 1) + diagonal, entry(2, 2) + diagonal, entry(0, 1), entry(0, 2), entry(1, 2)];
        Self { m: self.m, h: h + p * self.m, j }
    }
}

impl<S: Real> AddAssign for Inertia<S> {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        self.m += o.m;
        self.h += o.h;
        for (a, b) in self.j.iter_mut().zip(o.j) {
            *a += b;
        }
    }
}

/// A symmetric matrix, stored as (xx, yy, zz, xy, xz, yz), times a vector.
#[inline]
pub fn symmetric_mul<S: Real>(j: &[S; 6], x: &Vec3<S>) -> Vec3<S> {
    Vec3::new(
        j[0] * x[0] + j[3] * x[1] + j[4] * x[2],
        j[3] * x[0] + j[1] * x[1] + j[5] * x[2],
        j[4] * x[0] + j[5] * x[1] + j[2] * x[2],
    )
}

/// All entries of a symmetric matrix stored as (xx, yy, zz, xy, xz, yz).
#[inline]
pub fn full<S: Real>(j: &[S; 6]) -> Matrix3<S> {
    Matrix3::new(j[0], j[3], j[4], j[3], j[1], j[5], j[4], j[5], j[2])
}

/// The matrix of `x ↦ a × x`.
#[inline]
pub fn hat(a: &Vec3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a[2], a[1], a[2], 0.0, -a[0], -a[1], a[0], 0.0)
}

/// Derivative of a body's force of inertia by its velocity, with the change of acceleration that follows from it:
/// ```text
/// B δV = δV ×* (I V) + V ×* (I δV) − I (V × δV) = (T δω; −2 f × δω)
/// ```
/// with the linear momentum f and T = 2 ω̂ J − tr(J) ω̂ − 2 ĥ v̂ (hats are cross-product matrices; J, h of the inertia).
#[derive(Clone, Copy, Debug)]
pub struct VelocityPartial {
    /// T.
    pub top: Matrix3<f64>,
    /// f.
    pub momentum: Vec3<f64>,
}

impl VelocityPartial {
    /// Of a body of this inertia that moves with `u`.
    #[inline]
    pub fn new(inertia: &Inertia<f64>, u: &Motion<f64>) -> Self {
        let j = &inertia.j;
        let w = hat(&u.w);
        let (h, v) = (&inertia.h, &u.v);
        // ĥ v̂ = v hᵀ − (h·v) 1
        let hv = v * h.transpose() - Matrix3::from_diagonal_element(h.dot(v));
        let top = (w * full(j) - hv) * 2.0 - w * (j[0] + j[1] + j[2]);
        Self { top, momentum: u.v * inertia.m - h.cross(&u.w) }
    }

    /// B δV.
    #[inline]
    pub fn mul(&self, dw: &Vec3<f64>) -> Force<f64> {
        Force { n: self.top * dw, f: self.momentum.cross(dw) * -2.0 }
    }

    /// The angular part of Bᵀ S; its linear part is zero.
    #[inline]
    pub fn tr_mul(&self, s: &Motion<f64>) -> Vec3<f64> {
        self.top.tr_mul(&s.w) + self.momentum.cross(&s.v) * 2.0
    }
}

impl AddAssign for VelocityPartial {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        self.top += o.top;
        self.momentum += o.momentum;
    }
}

/// As one column, angular part first.
#[inline]
pub fn column(m: &Motion<f64>) -> nalgebra::Vector6<f64> {
    nalgebra::Vector6::new(m.w[0], m.w[1], m.w[2], m.v[0], m.v[1], m.v[2])
}

/// a b, all loops unrolled: the library's product is made for larger matrices.
#[inline]
pub fn product<const R: usize, const K: usize, const C: usize>(
    a: &SMatrix<f64, R, K>,
    b: &SMatrix<f64, K, C>,
) -> SMatrix<f64, R, C> {
    let mut out = SMatrix::<f64, R, C>::zeros();
    for c in 0..C {
        for k in 0..K {
            let factor = b[(k, c)];
            for r in 0..R {
                out[(r, c)] += a[(r, k)] * factor;
            }
        }
    }
    out
}

/// aᵀ b.
#[inline]
pub fn transposed_product<const R: usize, const K: usize, const C: usize>(
    a: &SMatrix<f64, K, R>,
    b: &SMatrix<f64, K, C>,
) -> SMatrix<f64, R, C> {
    let mut out = SMatrix::<f64, R, C>::zeros();
    for c in 0..C {
        for r in 0..R {
            for k in 0..K {
                out[(r, c)] += a[(k, r)] * b[(k, c)];
            }
        }
    }
    out
}
