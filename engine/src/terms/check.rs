//! Shared by the tests of every term: random ropes, and the properties a force must have.
#![allow(clippy::unwrap_used)]

use super::{Element, Law, Point, Term};
use nalgebra::{DMatrix, DVector, Rotation3};
use num_dual::DualSVec64;
use pliant_linalg::NodeMatrix;
use pliant_math::Vec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

pub const NODES: usize = 6;
const THETA: usize = 10;
const TRIALS: u64 = 20;
const TOLERANCE: f64 = 1e-12;

/// A random rope of [`NODES`] nodes with turning angles that stay clear of a fold, velocities and parameters of order one.
pub struct Sample {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub theta: Vec<f64>,
}

impl Sample {
    pub fn new(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut uniform = |half: f64| rng.random_range(-half..half);
        let q = (0..3 * NODES).map(|k| if k % 3 == 0 { 0.1 * (k / 3) as f64 } else { 0.0 } + uniform(0.04)).collect();
        let v = (0..3 * NODES).map(|_| uniform(2.0)).collect();
        let theta = (0..THETA).map(|_| 0.9 + uniform(0.6)).collect();
        Self { q, v, theta }
    }

    /// A random sheet of 3 × 3 nodes, numbered row by row, with parameters that may stand for a Poisson's ratio too.
    pub fn sheet(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut uniform = |half: f64| rng.random_range(-half..half);
        let flat = |k: usize| [0.1 * (k / 3 / 3) as f64, 0.1 * (k / 3 % 3) as f64, 0.0][k % 3];
        let q = (0..27).map(|k| flat(k) + uniform(0.02)).collect();
        let v = (0..27).map(|_| uniform(2.0)).collect();
        let theta = (0..THETA).map(|_| 0.3 + uniform(0.15)).collect();
        Self { q, v, theta }
    }

    pub fn at(&self) -> Point<'_> {
        Point { q: &self.q, v: &self.v, theta: &self.theta }
    }
}

/// Subject of a property test, by seed.
pub type Make = fn(u64) -> Sample;

/// Elements of `n` nodes with `params` parameters along the rope; the last two are out of order.
pub fn elements(n: usize, params: usize) -> Vec<Element> {
    let element =
        |nodes: Vec<usize>, k: usize| Element { nodes, params: (0..params).collect(), constants: vec![0.1 + 0.01 * k as f64] };
    let mut all: Vec<_> = (0..=NODES - n).map(|k| element((k..k + n).collect(), k)).collect();
    for k in 0..2 {
        all.push(element((k..k + n).rev().collect(), k));
    }
    all
}

/// Force, Jacobians and parameter slopes of a term as dense matrices.
pub struct Dense {
    pub f: DVector<f64>,
    pub dq: DMatrix<f64>,
    pub dv: DMatrix<f64>,
    pub dtheta: DMatrix<f64>,
}

pub fn dense(term: &dyn Term, at: &Point) -> Dense {
    let n = at.q.len();
    let (mut f, mut dq, mut dv) = (vec![0.0; n], NodeMatrix::band(n / 3, n / 3 - 1), NodeMatrix::band(n / 3, n / 3 - 1));
    term.add_jacobian(at, &mut f, &mut dq, &mut dv);
    let mut dtheta = DMatrix::zeros(n, at.theta.len());
    term.visit_theta(at, &mut |row, param, slope| dtheta[(row, param)] += slope);
    let full = |band: &NodeMatrix| DMatrix::from_fn(n, n, |r, c| band.get(r, c));
    Dense { f: DVector::from_vec(f), dq: full(&dq), dv: full(&dv), dtheta }
}

/// −∂f/∂q.
pub struct Stiffness(pub DMatrix<f64>);

impl Stiffness {
    /// Its least eigenvalue.
    pub fn least(&self) -> f64 {
        self.0.symmetric_eigenvalues().min()
    }

    /// Its largest one.
    pub fn most(&self) -> f64 {
        self.0.symmetric_eigenvalues().max()
    }
}

/// The stiffness with these axial forces, and the part of it that resists.
pub fn stiffnesses(term: &dyn Term, at: &Point, axial: &[f64]) -> [Stiffness; 2] {
    let n = at.q.len();
    let of = |stable: bool| {
        let (mut f, mut dq, mut dv) = (vec![0.0; n], NodeMatrix::band(n / 3, n / 3 - 1), NodeMatrix::band(n / 3, n / 3 - 1));
        if stable {
            term.add_stable_jacobian(at, axial, &mut f, &mut dq, &mut dv);
        } else {
            term.add_mixed_jacobian(at, axial, &mut f, &mut dq, &mut dv);
        }
        Stiffness(DMatrix::from_fn(n, n, |r, c| -dq.get(r, c)))
    };
    [of(false), of(true)]
}

pub fn force(term: &dyn Term, at: &Point) -> DVector<f64> {
    let mut f = vec![0.0; at.q.len()];
    term.add_force(at, &mut f);
    DVector::from_vec(f)
}

fn close(what: &str, a: &DMatrix<f64>, b: &DMatrix<f64>) {
    let (error, scale) = ((a - b).amax(), b.amax());
    assert!(error <= TOLERANCE * scale, "{what}: differs by {error:e} at scale {scale:e}");
}

fn column(x: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(x.len(), 1, x.as_slice())
}

/// Holds a kernel equal to the automatic derivatives of its law: forces, ∂f/∂q, ∂f/∂v, ∂f/∂θ, its contraction, energy, stencils.
pub fn same(kernel: &dyn Term, law: &dyn Term) {
    same_on(Sample::new, kernel, law);
}

/// As [`same`], on samples that `make` makes.
pub fn same_on(make: Make, kernel: &dyn Term, law: &dyn Term) {
    for seed in 0..TRIALS {
        let sample = make(seed);
        let (a, b) = (dense(kernel, &sample.at()), dense(law, &sample.at()));
        close("f", &column(&a.f), &column(&b.f));
        close("add_force", &column(&force(kernel, &sample.at())), &column(&b.f));
        close("automatic add_force", &column(&force(law, &sample.at())), &column(&b.f));
        close("∂f/∂q", &a.dq, &b.dq);
        close("∂f/∂v", &a.dv, &b.dv);
        for k in 0..THETA {
            let of = |m: &DMatrix<f64>| m.columns(k, 1).into_owned();
            close(&format!("∂f/∂θ[{k}]"), &of(&a.dtheta), &of(&b.dtheta));
        }
        let weights: Vec<f64> = (0..sample.q.len()).map(|k| (1.7 * k as f64).sin()).collect();
        let (mut pulled, mut visited, mut size) = (vec![0.0; THETA], vec![0.0; THETA], vec![0.0; THETA]);
        kernel.pull_theta(&sample.at(), &weights, &mut pulled);
        law.visit_theta(&sample.at(), &mut |row, param, df| {
            visited[param] += weights[row] * df;
            size[param] += (weights[row] * df).abs();
        });
        for ((pulled, visited), size) in pulled.iter().zip(&visited).zip(&size) {
            assert!((pulled - visited).abs() <= TOLERANCE * size, "weights · ∂f/∂θ: {pulled} against {visited}");
        }
        let (x, y) = (kernel.energy(&sample.at()), law.energy(&sample.at()));
        assert!((x - y).abs() <= TOLERANCE * y.abs(), "energy: {x} against {y}");
        assert_eq!(stencils(kernel), stencils(law));
        assert_eq!(kernel.symmetric(&sample.theta), law.symmetric(&sample.theta));
    }
}

fn stencils(term: &dyn Term) -> Vec<Vec<usize>> {
    let mut out = Vec::new();
    term.visit_stencils(&mut |nodes| out.push(nodes.to_vec()));
    out
}

/// Holds −∂E/∂q, by dual numbers of the law's energy, equal to its force.
pub fn force_is_energy_slope<L: Law>(law: &L, term: &super::Automatic<L>) {
    force_is_energy_slope_on(Sample::new, law, term);
}

/// As [`force_is_energy_slope`], on samples that `make` makes.
pub fn force_is_energy_slope_on<L: Law>(make: Make, law: &L, term: &super::Automatic<L>) {
    type Dual = DualSVec64<3>;
    for seed in 0..TRIALS {
        let sample = make(seed);
        let mut slope = DVector::zeros(sample.q.len());
        for e in term.elements() {
            let p: Vec<_> = e.params.iter().map(|&k| Dual::from_re(sample.theta[k])).collect();
            for &i in &e.nodes {
                let q: Vec<Vec3<Dual>> = e
                    .nodes
                    .iter()
                    .map(|&j| {
                        let x = sample.at().position(j);
                        Vec3::from_fn(|a, _| if i == j { Dual::from_re(x[a]).derivative(a) } else { Dual::from_re(x[a]) })
                    })
                    .collect();
                let energy = law.energy(&q, &p, &e.constants);
                for a in 0..3 {
                    slope[3 * i + a] -= energy.eps.0.unwrap()[a];
                }
            }
        }
        close("force against energy", &column(&force(term, &sample.at())), &column(&slope));
    }
}

/// Holds the sums of forces and moments zero, and the force equivariant under rotation and translation of rope and velocity.
pub fn invariant(term: &dyn Term) {
    invariant_on(Sample::new, term);
}

/// As [`invariant`], on samples that `make` makes.
pub fn invariant_on(make: Make, term: &dyn Term) {
    for seed in 0..TRIALS {
        let sample = make(seed);
        let f = force(term, &sample.at());
        let nodal = |f: &DVector<f64>, i: usize| Vec3::new(f[3 * i], f[3 * i + 1], f[3 * i + 2]);
        let total: Vec3<f64> = (0..f.len() / 3).map(|i| nodal(&f, i)).sum();
        let moment: Vec3<f64> = (0..f.len() / 3).map(|i| sample.at().position(i).cross(&nodal(&f, i))).sum();
        assert!(total.amax() <= TOLERANCE * f.amax() && moment.amax() <= TOLERANCE * f.amax());

        let turn = Rotation3::from_euler_angles(0.3, -1.1, 2.0);
        let moved = |x: &[f64], shift: f64| -> Vec<f64> {
            x.chunks(3).flat_map(|x| (turn * Vec3::new(x[0], x[1], x[2])).add_scalar(shift).as_slice().to_vec()).collect()
        };
        let (q, v) = (moved(&sample.q, 0.7), moved(&sample.v, -0.4));
        let turned = force(term, &Point { q: &q, v: &v, theta: &sample.theta });
        let expected = DVector::from_vec(moved(f.as_slice(), 0.0));
        let error = (&turned - &expected).amax();
        // Moving by a metre rounds edges of a decimetre.
        assert!(error <= 1e-11 * f.amax(), "rotated and shifted: differs by {error:e} at scale {:e}", f.amax());
    }
}

/// Holds ∂f/∂q and ∂f/∂v symmetric.
pub fn jacobians_symmetric(term: &dyn Term) {
    jacobians_symmetric_on(Sample::new, term);
}

/// As [`jacobians_symmetric`], on samples that `make` makes.
pub fn jacobians_symmetric_on(make: Make, term: &dyn Term) {
    for seed in 0..TRIALS {
        let sample = make(seed);
        let d = dense(term, &sample.at());
        assert!(term.symmetric(&sample.theta));
        close("∂f/∂q against its transpose", &d.dq.transpose(), &d.dq);
        close("∂f/∂v against its transpose", &d.dv.transpose(), &d.dv);
    }
}

/// Holds that a force vanishes, Jacobians and all, with a zero coefficient, and that its slope is still visited.
pub fn zero_coefficient(term: &dyn Term, coefficient: usize) {
    zero_coefficients(term, &[coefficient]);
}

/// As [`zero_coefficient`] for several coefficients that vanish together.
pub fn zero_coefficients(term: &dyn Term, coefficients: &[usize]) {
    zero_coefficients_on(Sample::new, term, coefficients);
}

/// As [`zero_coefficients`], on samples that `make` makes.
pub fn zero_coefficients_on(make: Make, term: &dyn Term, coefficients: &[usize]) {
    let mut sample = make(1);
    for &k in coefficients {
        sample.theta[k] = 0.0;
    }
    let d = dense(term, &sample.at());
    assert_eq!((d.f.amax(), d.dq.amax(), d.dv.amax()), (0.0, 0.0, 0.0));
    assert!(coefficients.iter().all(|&k| d.dtheta.column(k).amax() > 0.0));
    assert!(term.symmetric(&sample.theta));
}

/// Holds the sum of forces zero, and the force unchanged by a translation of the rope and by a common velocity.
pub fn linear_momentum(term: &dyn Term) {
    linear_momentum_on(Sample::new, term);
}

/// As [`linear_momentum`], on samples that `make` makes.
pub fn linear_momentum_on(make: Make, term: &dyn Term) {
    for seed in 0..TRIALS {
        let sample = make(seed);
        let f = force(term, &sample.at());
        let total: Vec3<f64> = f.as_slice().chunks(3).map(|f| Vec3::new(f[0], f[1], f[2])).sum();
        assert!(total.amax() <= TOLERANCE * f.amax());
        let shifted = |x: &[f64], by: f64| -> Vec<f64> { x.iter().map(|x| x + by).collect() };
        let (q, v) = (shifted(&sample.q, 0.7), shifted(&sample.v, -0.4));
        let moved = force(term, &Point { q: &q, v: &v, theta: &sample.theta });
        assert!((&moved - &f).amax() <= 1e-11 * f.amax());
    }
}

/// Holds that a force never gives power: f·v ≤ 0, and that it vanishes with the velocity.
pub fn takes_power(term: &dyn Term) {
    takes_power_on(Sample::new, term);
}

/// As [`takes_power`], on samples that `make` makes.
pub fn takes_power_on(make: Make, term: &dyn Term) {
    for seed in 0..TRIALS {
        let sample = make(seed);
        let power = force(term, &sample.at()).dot(&DVector::from_column_slice(&sample.v));
        assert!(power < 0.0, "{power}");
        let still = vec![0.0; sample.v.len()];
        assert_eq!(force(term, &Point { v: &still, ..sample.at() }).amax(), 0.0);
    }
}
