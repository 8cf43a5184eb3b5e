//! Forces of joints and their derivatives, eight joints at a time in the processor's vectors.
#![allow(clippy::needless_range_loop)] // plain loops are inlined; closures over vectors are not always, and then are slow

use super::joint::{Gradient, Hessian, Joint, Stiffness, TURN, VARIABLES};
use super::term::{NODE, ROWS, TWIST};
use super::{Remembered, RodPoint, RodSection, Rods};
use crate::terms::section::{Moments, SectionPoint};
use pliant_linalg::NodeMatrix;
use pliant_math::simd::{LANES, Lanes, Three, Wide};
use pulp::{Arch, Simd, WithSimd};
use std::cell::RefCell;
use std::ops::Range;

/// Numbers of a joint: two tangents, two inverse lengths, the first edge's axes, the twist, sine and cosine of half of it.
const NUMBERS: usize = 17;

/// Eight joints of one section, a lane each.
struct Piece {
    numbers: [Lanes; NUMBERS],
    y: Gradient<Lanes>,
    strain: [Lanes; 3],
    rate: [Lanes; 3],
    m: [Lanes; 3],
    by_strain: Stiffness<Lanes>,
    by_rate: Stiffness<Lanes>,
    pull: Gradient<Lanes>,
    by_position: [[Lanes; ROWS]; ROWS],
    by_velocity: [[Lanes; ROWS]; ROWS],
}

/// Inputs of the force of a rod.
#[derive(Clone, Copy)]
pub(super) struct Evaluation<'a> {
    pub rods: &'a Rods,
    pub at: &'a RodPoint,
    pub v: &'a [f64],
    pub theta: &'a [f64],
    pub before: Remembered<'a>,
}

/// Where it goes: forces, and ∂f/∂q and ∂f/∂v if asked for.
pub(super) struct Sums<'a> {
    pub f: &'a mut [f64],
    pub matrices: Option<[&'a mut NodeMatrix; 2]>,
    /// Whether the matrices are whole, or of ∂f/∂q only gᵀ C g.
    pub whole: bool,
}

impl Evaluation<'_> {
    /// Adds everything.
    pub fn add_to(self, sums: Sums) {
        struct Run<'a>(Evaluation<'a>, Sums<'a>, &'a mut Piece);
        impl WithSimd for Run<'_> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                self.0.add(simd, self.1, self.2);
            }
        }
        if !self.rods.joints.is_empty() {
            PIECE.with_borrow_mut(|piece| Arch::new().dispatch(Run(self, sums, piece)));
        }
    }

    #[inline(always)]
    fn add<S: Simd>(self, simd: S, mut sums: Sums, piece: &mut Piece) {
        for section in &self.rods.sections {
            let mut first = section.joints.start;
            while first < section.joints.end {
                let joints = first..section.joints.end.min(first + LANES);
                first = joints.end;
                self.gather(joints.clone(), piece);
                let vectors = joints.len().div_ceil(S::F64_LANES);
                for v in 0..vectors {
                    piece.strains(simd, v);
                }
                let damped = self.moments(joints.clone(), section, piece, sums.matrices.is_some());
                for v in 0..vectors {
                    piece.forces(simd, v);
                    if sums.matrices.is_some() {
                        piece.slopes(simd, v, damped, sums.whole);
                    }
                }
                self.scatter(joints, piece, damped, &mut sums);
            }
        }
    }

    #[inline(always)]
    fn gather(self, joints: Range<usize>, piece: &mut Piece) {
        for (lane, j) in joints.enumerate() {
            let [one, two] = self.rods.joints[j].edges.map(|k| &self.at.edges[k]);
            let twist = self.at.twists[j];
            let (sin, cos) = (0.5 * twist).sin_cos();
            let ([t1, t2], [a1, a2]) = ([one.tangent, two.tangent], one.axes);
            let lengths = [1.0 / one.length, 1.0 / two.length];
            let numbers: [f64; NUMBERS] =
                [t1.x, t1.y, t1.z, t2.x, t2.y, t2.z, lengths[0], lengths[1], a1.x, a1.y, a1.z, a2.x, a2.y, a2.z, twist, sin, cos];
            piece.numbers.iter_mut().zip(numbers).for_each(|(lanes, x)| lanes[lane] = x);
            let y = self.rods.rates(&self.rods.joints[j], self.v);
            piece.y.iter_mut().zip(y).for_each(|(lanes, x)| lanes[lane] = x);
        }
    }

    /// Moments of the section's laws, with their slopes if asked for; whether any of them depends on rates.
    #[inline(always)]
    fn moments(self, joints: Range<usize>, section: &RodSection, piece: &mut Piece, slopes: bool) -> bool {
        let mut damped = false;
        for (lane, j) in joints.enumerate() {
            let of = |lanes: &[Lanes; 3]| lanes.map(|x| x[lane]);
            let (strain, rate, fraction) = (of(&piece.strain), of(&piece.rate), self.rods.joints[j].fraction);
            let past = self.before.past.strain(j).unwrap_or(strain);
            let (theta, elapsed) = (self.theta, self.before.elapsed);
            let point = SectionPoint { joint: j, fraction, strain, rate, theta, past, memory: &[], elapsed };
            if slopes {
                let mut moments = Moments::default();
                section.for_laws(&point, self.before.z, |law, point| law.add(point, &mut moments));
                for r in 0..3 {
                    piece.m[r][lane] = moments.m[r];
                    for c in 0..3 {
                        piece.by_strain[r][c][lane] = moments.by_strain[r][c];
                        piece.by_rate[r][c][lane] = moments.by_rate[r][c];
                        damped |= moments.by_rate[r][c] != 0.0;
                    }
                }
            } else {
                let mut m = [0.0; 3];
                section.for_laws(&point, self.before.z, |law, point| law.add_moment(point, &mut m));
                (0..3).for_each(|r| piece.m[r][lane] = m[r]);
            }
        }
        damped
    }

    #[inline(always)]
    fn scatter(self, joints: Range<usize>, piece: &Piece, damped: bool, sums: &mut Sums) {
        for (lane, j) in joints.enumerate() {
            self.rods.add_joint_force(j, &piece.pull.map(|x| x[lane]), sums.f);
            if let Some([dq, dv]) = &mut sums.matrices {
                let rows = self.rods.rows(&self.rods.joints[j]);
                dq.add_square(&rows, |r, c| piece.by_position[r][c][lane]);
                if damped {
                    dv.add_square(&rows, |r, c| piece.by_velocity[r][c][lane]);
                }
            }
        }
    }
}

thread_local! {
    /// One a thread, so that evaluations neither allocate nor share.
    static PIECE: RefCell<Box<Piece>> = RefCell::new(Box::new(Piece::new()));
}

impl Piece {
    fn new() -> Self {
        let zero = [0.0; LANES];
        Self {
            numbers: [zero; NUMBERS],
            y: [zero; VARIABLES],
            strain: [zero; 3],
            rate: [zero; 3],
            m: [zero; 3],
            by_strain: [[zero; 3]; 3],
            by_rate: [[zero; 3]; 3],
            pull: [zero; VARIABLES],
            by_position: [[zero; ROWS]; ROWS],
            by_velocity: [[zero; ROWS]; ROWS],
        }
    }

    /// The joints in vector `v`.
    #[inline(always)]
    fn joint<S: Simd>(&self, simd: S, v: usize) -> Joint<Wide<S>> {
        let mut n = [Wide::load(simd, &self.numbers[0], v); NUMBERS];
        for (n, lanes) in n.iter_mut().zip(&self.numbers) {
            *n = Wide::load(simd, lanes, v);
        }
        let tangents = [Three([n[0], n[1], n[2]]), Three([n[3], n[4], n[5]])];
        let axes = [Three([n[8], n[9], n[10]]), Three([n[11], n[12], n[13]])];
        Joint::of(tangents, [n[6], n[7]], axes, n[14], [n[15], n[16]])
    }

    #[inline(always)]
    fn load<S: Simd, const N: usize>(simd: S, v: usize, from: &[Lanes; N]) -> [Wide<S>; N] {
        let mut out = [Wide::load(simd, &from[0], v); N];
        for (x, lanes) in out.iter_mut().zip(from) {
            *x = Wide::load(simd, lanes, v);
        }
        out
    }

    #[inline(always)]
    fn load_square<S: Simd>(simd: S, v: usize, from: &Stiffness<Lanes>) -> Stiffness<Wide<S>> {
        [Self::load(simd, v, &from[0]), Self::load(simd, v, &from[1]), Self::load(simd, v, &from[2])]
    }

    #[inline(always)]
    fn strains<S: Simd>(&mut self, simd: S, v: usize) {
        let joint = self.joint(simd, v);
        let rates = joint.rates(&Self::load(simd, v, &self.y));
        for s in 0..3 {
            joint.strain[s].store(&mut self.strain[s], v);
            rates[s].store(&mut self.rate[s], v);
        }
    }

    #[inline(always)]
    fn forces<S: Simd>(&mut self, simd: S, v: usize) {
        let pull = self.joint(simd, v).pull(&Self::load(simd, v, &self.m));
        for (x, to) in pull.iter().zip(&mut self.pull) {
            x.store(to, v);
        }
    }

    #[inline(always)]
    fn slopes<S: Simd>(&mut self, simd: S, v: usize, damped: bool, whole: bool) {
        let joint = self.joint(simd, v);
        // without moments the gradients do not change
        let m = if whole { Self::load(simd, v, &self.m) } else { [joint.zero(); 3] };
        let gradients = joint.gradients();
        let by_strain = Self::load_square(simd, v, &self.by_strain);
        let mut hessian = joint.hessian(&m, &by_strain, &gradients);
        if damped {
            let by_rate = Self::load_square(simd, v, &self.by_rate);
            let [more, by_velocity] = joint.damped(&by_rate, &gradients, &Self::load(simd, v, &self.y));
            if whole {
                for (row, more) in hessian.iter_mut().zip(&more) {
                    for (x, more) in row.iter_mut().zip(more) {
                        *x = *x + *more;
                    }
                }
            }
            store_expanded(&by_velocity, &mut self.by_velocity, v);
        }
        store_expanded(&hessian, &mut self.by_position, v);
    }
}

/// ∂f/∂(nodes, twists) from how the gradient changes with y.
#[inline(always)]
fn store_expanded<S: Simd>(h: &Hessian<Wide<S>>, out: &mut [[Lanes; ROWS]; ROWS], v: usize) {
    for a in 0..3 {
        let (one, two) = (&h[a], &h[3 + a]);
        let (mut between, mut beyond) = (*one, *two);
        for (c, (x, y)) in between.iter_mut().zip(&mut beyond).enumerate() {
            (*x, *y) = (two[c] - one[c], -two[c]);
        }
        store_row(one, &mut out[NODE[0] + a], v);
        store_row(&between, &mut out[NODE[1] + a], v);
        store_row(&beyond, &mut out[NODE[2] + a], v);
    }
    for k in 0..2 {
        let mut row = h[TURN[k]];
        for x in &mut row {
            *x = -*x;
        }
        store_row(&row, &mut out[TWIST[k]], v);
    }
}

#[inline(always)]
fn store_row<S: Simd>(row: &Gradient<Wide<S>>, out: &mut [Lanes; ROWS], v: usize) {
    for a in 0..3 {
        (-row[a]).store(&mut out[NODE[0] + a], v);
        (row[a] - row[3 + a]).store(&mut out[NODE[1] + a], v);
        row[3 + a].store(&mut out[NODE[2] + a], v);
    }
    for k in 0..2 {
        row[TURN[k]].store(&mut out[TWIST[k]], v);
    }
}
