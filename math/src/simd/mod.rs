//! Kernels for several elements at once: numbers that are one `f64`, or as many as the processor's vectors hold.
//!
//! A kernel is written once, generic over [`Number`]. With `f64` tests compare it with the law; with [`Wide`] every number stands
//! for a lane of elements, gathered in [`Lanes`] of eight for any width of the processor's vectors, so that the elements that share a
//! vector do not change the result. Kernels keep to loops and to functions that are always inlined: a closure that the compiler does not
//! inline is compiled without the wide vectors.

pub mod rows;

use pulp::Simd;
use std::ops::{Add, Mul, Neg, Sub};

/// Elements of a piece: the longest vectors of a processor.
pub const LANES: usize = 8;
/// One number of every element of a piece.
pub type Lanes = [f64; LANES];

/// Numbers of a kernel.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self> {
    /// `self · x`.
    fn by(self, x: f64) -> Self;

    /// `self + a b`, in one rounding where the processor can.
    fn plus(self, a: Self, b: Self) -> Self;

    /// `x / self`.
    fn under(self, x: f64) -> Self;

    /// `x` in every lane.
    fn same(self, x: f64) -> Self;

    /// The square root.
    fn root(self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn by(self, x: f64) -> Self {
        self * x
    }

    #[inline(always)]
    fn plus(self, a: Self, b: Self) -> Self {
        self + a * b
    }

    #[inline(always)]
    fn under(self, x: f64) -> Self {
        x / self
    }

    #[inline(always)]
    fn same(self, x: f64) -> Self {
        x
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }
}

/// A vector of the processor.
#[derive(Clone, Copy)]
pub struct Wide<S: Simd> {
    simd: S,
    x: S::f64s,
}

impl<S: Simd> Wide<S> {
    /// Vector number `v` of a piece.
    #[inline(always)]
    pub fn load(simd: S, from: &Lanes, v: usize) -> Self {
        Self { simd, x: S::as_simd_f64s(from).0[v] }
    }

    /// The same with the vectors of this one.
    #[inline(always)]
    pub fn loaded(self, from: &Lanes, v: usize) -> Self {
        Self::load(self.simd, from, v)
    }

    /// Writes it back.
    #[inline(always)]
    pub fn store(self, to: &mut Lanes, v: usize) {
        S::as_mut_simd_f64s(to).0[v] = self.x;
    }
}

impl<S: Simd> Add for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self { x: self.simd.add_f64s(self.x, b.x), ..self }
    }
}

impl<S: Simd> Sub for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self { x: self.simd.sub_f64s(self.x, b.x), ..self }
    }
}

impl<S: Simd> Mul for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self { x: self.simd.mul_f64s(self.x, b.x), ..self }
    }
}

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: self.simd.neg_f64s(self.x), ..self }
    }
}

impl<S: Simd> Number for Wide<S> {
    #[inline(always)]
    fn by(self, x: f64) -> Self {
        self * self.same(x)
    }

    #[inline(always)]
    fn plus(self, a: Self, b: Self) -> Self {
        Self { x: self.simd.mul_add_e_f64s(a.x, b.x, self.x), ..self }
    }

    #[inline(always)]
    fn under(self, x: f64) -> Self {
        Self { x: self.simd.div_f64s(self.simd.splat_f64s(x), self.x), ..self }
    }

    #[inline(always)]
    fn same(self, x: f64) -> Self {
        Self { x: self.simd.splat_f64s(x), ..self }
    }

    #[inline(always)]
    fn root(self) -> Self {
        Self { x: self.simd.sqrt_f64s(self.x), ..self }
    }
}

/// A three-vector of numbers.
#[derive(Clone, Copy, Debug)]
pub struct Three<T>(pub [T; 3]);

impl<T: Number> Three<T> {
    /// `s · self`.
    #[inline(always)]
    pub fn times(self, s: T) -> Self {
        Self([self.0[0] * s, self.0[1] * s, self.0[2] * s])
    }

    /// `self + s · b`.
    #[inline(always)]
    pub fn plus(self, s: T, b: Self) -> Self {
        Self([self.0[0].plus(s, b.0[0]), self.0[1].plus(s, b.0[1]), self.0[2].plus(s, b.0[2])])
    }

    /// `self · b`.
    #[inline(always)]
    pub fn dot(self, b: Self) -> T {
        (self.0[0] * b.0[0]).plus(self.0[1], b.0[1]).plus(self.0[2], b.0[2])
    }

    /// `self × b`.
    #[inline(always)]
    pub fn cross(self, b: Self) -> Self {
        let ([x, y, z], [u, v, w]) = (self.0, b.0);
        Self([y * w - z * v, z * u - x * w, x * v - y * u])
    }
}

impl<T: Number> Add for Three<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self([self.0[0] + b.0[0], self.0[1] + b.0[1], self.0[2] + b.0[2]])
    }
}

impl<T: Number> Sub for Three<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self([self.0[0] - b.0[0], self.0[1] - b.0[1], self.0[2] - b.0[2]])
    }
}

impl<T: Number> Neg for Three<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self([-self.0[0], -self.0[1], -self.0[2]])
    }
}

impl<S: Simd> Three<Wide<S>> {
    /// Vector number `v` of three numbers.
    #[inline(always)]
    pub fn load(simd: S, from: &[Lanes; 3], v: usize) -> Self {
        Self([Wide::load(simd, &from[0], v), Wide::load(simd, &from[1], v), Wide::load(simd, &from[2], v)])
    }

    /// Writes it back.
    #[inline(always)]
    pub fn store(self, to: &mut [Lanes; 3], v: usize) {
        for (x, to) in self.0.iter().zip(to) {
            x.store(to, v);
        }
    }
}
