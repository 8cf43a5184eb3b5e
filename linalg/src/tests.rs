#![allow(clippy::unwrap_used, clippy::panic)]
use crate::*;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

const METHODS: [Method; 3] = [Method::Band, Method::Dense, Method::Sparse];
const KINDS: [Symmetry; 2] = [Symmetry::General, Symmetry::Symmetric];

/// A generator that is the same everywhere; uniform in (−1, 1).
struct Lcg(u64);
impl Lcg {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    fn vector(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.next()).collect()
    }
}

/// Prescribed: the first two nodes, one in the middle, and the last.
fn some_prescribed(n: usize) -> Vec<bool> {
    (0..n).map(|i| i < 2 || i == n / 2 || i + 1 == n).collect()
}

/// Diagonally dominant, with stiffnesses over four decades; symmetric between free rows, identity in prescribed ones.
fn random_matrix(symmetry: Symmetry, layout: &Arc<NodeLayout>, prescribed: &[bool], rng: &mut Lcg) -> NodeMatrix {
    let mut a = NodeMatrix::zeros(layout);
    let dim = a.dim();
    let scale: Vec<f64> = (0..dim).map(|_| 10f64.powf(2.0 * rng.next())).collect();
    let room = |r: usize, c: usize| layout.entry(layout.storage(r), layout.storage(c)).is_some();
    for r in 0..dim {
        for c in (r..dim).filter(|c| room(r, *c)) {
            let s = (scale[r / 3] * scale[c / 3]).sqrt();
            let value = s * rng.next();
            a.add(r, c, value);
            if r != c {
                a.add(c, r, if symmetry == Symmetry::General { s * rng.next() } else { value });
            }
        }
    }
    let size = (6 * layout.half_width() + 3) as f64;
    for r in 0..dim {
        a.add(r, r, size * 100.0);
        if r < 3 * prescribed.len() && prescribed[r / 3] {
            a.clear_row(r);
            a.add(r, r, 1.0);
        }
    }
    pad(&a)
}

/// As steps make their matrices: empty rows are the identity's.
fn pad(a: &NodeMatrix) -> NodeMatrix {
    let mut out = a.clone();
    out.set_sum(-1.0, a, 0.0, a);
    out
}

fn dense(a: &NodeMatrix) -> DMatrix<f64> {
    DMatrix::from_fn(a.dim(), a.dim(), |r, c| a.get(r, c))
}

fn factor_of(method: Method, symmetry: Symmetry, a: &NodeMatrix, prescribed: &[bool]) -> Result<Factor, KktError> {
    let symbolic = Symbolic::new(method, symmetry, a.layout(), prescribed)?;
    let mut factor = Factor::new(&symbolic);
    factor.refactor(a)?;
    Ok(factor)
}

fn assert_close(x: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    let size = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let error = x.iter().zip(expected).fold(0.0_f64, |m, (x, y)| m.max((x - y).abs()));
    assert!(error <= tolerance * size, "{what}: off by {:e} of {size:e}", error);
}

/// Bands, sizes below and above the dense threshold, widths with and without own code; twists, orders of their own, sparse patterns.
fn layouts() -> Vec<(NodeLayout, &'static str)> {
    let bands = [(1, 0), (1, 2), (2, 2), (7, 1), (20, 2), (11, 3), (50, 2)];
    let mut out: Vec<_> = bands.into_iter().map(|(n, half_width)| (NodeLayout::band(n, half_width), "band")).collect();
    let threes = |n: usize| (0..n - 2).map(|i| (i..i + 3).collect()).collect::<Vec<Vec<usize>>>();
    for n in [3, 12, 40] {
        let twists: Vec<usize> = (0..n - 1).filter(|i| *i != n / 2).collect();
        out.push((NodeLayout::banded(n, &twists, None, &threes(n)).unwrap(), "twists"));
        out.push((NodeLayout::sparse(n, &twists, None, &threes(n)).unwrap(), "sparse, twists"));
    }
    let ring: Vec<Vec<usize>> = (0..10).map(|i| vec![i, (i + 1) % 10]).collect();
    let folded: Vec<usize> = (0..10).map(|k| if k % 2 == 0 { k / 2 } else { 9 - k / 2 }).collect();
    out.push((NodeLayout::banded(10, &[], Some(&folded), &ring).unwrap(), "folded"));
    out.push((NodeLayout::banded(10, &[3, 9], Some(&folded), &ring).unwrap(), "folded, twists"));
    out.push((NodeLayout::sparse(10, &[], Some(&folded), &ring).unwrap(), "sparse ring"));
    out.push((grid(7, 1), "sparse grid"));
    out
}

/// A square of `n` × `n` nodes, of which those act on each other that a square of `reach` cells holds.
fn grid(n: usize, reach: usize) -> NodeLayout {
    let patch = |i: usize, j: usize| (0..=reach).flat_map(|a| (0..=reach).map(move |b| n * (i + a) + j + b)).collect();
    let patches: Vec<Vec<usize>> = (0..n - reach).flat_map(|i| (0..n - reach).map(move |j| patch(i, j))).collect();
    NodeLayout::sparse(n * n, &[], None, &patches).unwrap()
}

/// Inverses equal solves of the identity's columns for every method, and are exactly symmetric where fronts find them.
#[test]
fn inverses_are_those_of_solves() {
    let small: Vec<_> = layouts().into_iter().map(|(layout, what)| (Arc::new(layout), what)).collect();
    let wide = [(Arc::new(grid(12, 2)), "wide"), (Arc::new(grid(24, 3)), "wider")];
    let mut rng = Lcg(23);
    for (layout, what) in small.iter().chain(&wide) {
        let prescribed = some_prescribed(layout.n_nodes());
        for (method, symmetry) in METHODS.into_iter().flat_map(|m| KINDS.map(|s| (m, s))) {
            let a = random_matrix(symmetry, layout, &prescribed, &mut rng);
            let Ok(factor) = factor_of(method, symmetry, &a, &prescribed) else { continue };
            let n = a.dim();
            let (mut inverse, mut columns) = (vec![f64::NAN; 3], vec![0.0; n * n]);
            factor.inverse(&mut inverse);
            (0..n).for_each(|k| columns[k * n + k] = 1.0);
            factor.solve_many(&mut columns, n);
            assert_close(&inverse, &columns, 1e-14, &format!("{what}, {method:?}, {symmetry:?}"));
            let mut both = [vec![f64::NAN; 3], vec![f64::NAN; 3]];
            let [own, transposed] = &mut both;
            factor.inverse_and_transpose(own, transposed);
            assert_close(own, &columns, 1e-14, &format!("{what}, {method:?}, {symmetry:?}, both"));
            assert!((0..n * n).all(|k| own[k] == transposed[k % n * n + k / n]), "{what}, {method:?}, {symmetry:?}");
            let free = |r: usize| r >= 3 * prescribed.len() || !prescribed[r / 3];
            if (method, symmetry) == (Method::Sparse, Symmetry::Symmetric) {
                for (r, c) in (0..n).flat_map(|r| (0..n).map(move |c| (r, c))).filter(|(r, c)| free(*r) && free(*c)) {
                    assert_eq!(inverse[r * n + c], inverse[c * n + r], "{what}, ({r}, {c})");
                }
            }
        }
    }
}

/// Transposed inverses undo transposed products, and the columns they are padded with are zero.
#[test]
fn transposed_inverses_undo_transposed_products() {
    let mut rng = Lcg(29);
    for (layout, what) in layouts() {
        let (layout, prescribed) = (Arc::new(layout.clone()), some_prescribed(layout.n_nodes()));
        for (method, symmetry) in METHODS.into_iter().flat_map(|m| KINDS.map(|s| (m, s))) {
            let a = random_matrix(symmetry, &layout, &prescribed, &mut rng);
            let Ok(factor) = factor_of(method, symmetry, &a, &prescribed) else { continue };
            let n = a.dim();
            let columns = n.next_multiple_of(8);
            let mut inverse = vec![f64::NAN; 3];
            factor.transposed_inverse(columns, &mut inverse);
            let mut left = vec![0.0; n * columns];
            (0..n).for_each(|k| left[k * columns + k] = 1.0);
            a.add_mul_transpose_many(-1.0, &inverse, &mut left, columns);
            let size = inverse.iter().fold(0.0_f64, |m, x| m.max(x.abs())) * a.data().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            assert!(left.iter().all(|x| x.abs() < 1e-14 * size), "{what}, {method:?}, {symmetry:?}");
            assert!(inverse.chunks_exact(columns).all(|row| row[n..].iter().all(|x| *x == 0.0)), "{what}");
        }
    }
}

/// Products of dense matrices with transposed ones are those with the dense transpose.
#[test]
fn transposes_multiply() {
    let mut rng = Lcg(29);
    for (layout, what) in layouts() {
        let layout = Arc::new(layout);
        let a = random_matrix(Symmetry::General, &layout, &some_prescribed(layout.n_nodes()), &mut rng);
        for columns in [1, 5, 64, 75] {
            let x: Vec<f64> = (0..a.dim() * columns).map(|_| rng.next()).collect();
            let mut out = vec![f64::NAN; 2];
            a.transpose_times(&x, &mut out, columns);
            let expected = dense(&a).transpose() * DMatrix::from_row_slice(a.dim(), columns, &x);
            assert_close(&out, expected.transpose().as_slice(), 1e-14, what);
        }
    }
}

/// Three columns of a matrix times a block.
#[test]
fn columns_multiply() {
    let mut rng = Lcg(31);
    let block = [0, 1, 2].map(|_| [rng.next(), rng.next(), rng.next()]);
    for (layout, what) in layouts() {
        let layout = Arc::new(layout);
        let [mut a, b] = [0, 1].map(|_| random_matrix(Symmetry::General, &layout, &vec![false; layout.n_nodes()], &mut rng));
        let node = layout.n_nodes() / 2;
        let mut expected = dense(&a);
        // only nodes' rows: twists have no place in three columns of a node
        for r in 0..3 * layout.n_nodes() {
            for c in 0..3 {
                expected[(r, 3 * node + c)] += 2.0 * (0..3).map(|k| b.get(r, 3 * node + k) * block[k][c]).sum::<f64>();
            }
        }
        a.add_columns_times(&b, node, 2.0, &block);
        let (rows, found) = (3 * layout.n_nodes(), dense(&a));
        assert_close(found.rows(0, rows).into_owned().as_slice(), expected.rows(0, rows).into_owned().as_slice(), 1e-15, what);
    }
}

/// multifrontal::Symbolic so wide that their last rows are changed by products of matrices.
#[test]
fn wide_fronts_solve_too() {
    let layout = Arc::new(grid(24, 3));
    let (n, mut rng) = (layout.n_nodes(), Lcg(17));
    for symmetry in KINDS {
        let prescribed = some_prescribed(n);
        let a = random_matrix(symmetry, &layout, &prescribed, &mut rng);
        let factor = factor_of(Method::Sparse, symmetry, &a, &prescribed).unwrap();
        let x = rng.vector(a.dim());
        let (mut b, mut c) = (vec![0.0; a.dim()], vec![0.0; a.dim()]);
        a.add_mul(1.0, &x, &mut b);
        a.add_mul_transpose(1.0, &x, &mut c);
        factor.solve(&mut b);
        factor.solve_transpose(&mut c);
        assert_close(&b, &x, 1e-12, &format!("{symmetry:?}"));
        assert_close(&c, &x, 1e-12, &format!("{symmetry:?}, transposed"));
    }
}

/// Calls `check` for all kinds of factors and all layouts.
fn for_systems(mut check: impl FnMut(Method, Symmetry, &NodeMatrix, &[bool], &mut Lcg, &str)) {
    let mut rng = Lcg(3);
    for (layout, kind) in layouts() {
        let (n, layout) = (layout.n_nodes(), Arc::new(layout));
        for (symmetry, prescribed) in KINDS.into_iter().flat_map(|s| [(s, vec![false; n]), (s, some_prescribed(n))]) {
            if symmetry == Symmetry::Symmetric && layout.block() == 4 {
                continue;
            }
            let a = random_matrix(symmetry, &layout, &prescribed, &mut rng);
            for method in METHODS {
                if method == Method::Band && matches!(layout.pattern, layout::Pattern::Sparse { .. }) {
                    continue;
                }
                let what = format!("{method:?} {symmetry:?} {kind} n {n} prescribed {}", prescribed[0]);
                check(method, symmetry, &a, &prescribed, &mut rng, &what);
            }
        }
    }
}

#[test]
fn all_kinds_solve_as_a_dense_reference() {
    for_systems(|method, symmetry, a, prescribed, rng, what| {
        let factor = factor_of(method, symmetry, a, prescribed).unwrap();
        let b = rng.vector(a.dim());
        let reference = dense(a).lu();
        let expected = reference.solve(&DVector::from_vec(b.clone())).unwrap();
        let mut x = b.clone();
        factor.solve(&mut x);
        assert_close(&x, expected.as_slice(), 1e-13, what);
        let expected = dense(a).transpose().lu().solve(&DVector::from_vec(b.clone())).unwrap();
        let mut x = b;
        factor.clone().solve_transpose(&mut x);
        assert_close(&x, expected.as_slice(), 1e-13, &format!("{what}, transposed"));
    });
}

#[test]
fn many_right_hand_sides_are_single_ones_side_by_side() {
    for_systems(|method, symmetry, a, prescribed, rng, what| {
        let factor = factor_of(method, symmetry, a, prescribed).unwrap();
        for columns in [1, 3, 8, 21] {
            let b = rng.vector(a.dim() * columns);
            for transpose in [false, true] {
                let mut many = b.clone();
                match transpose {
                    false => factor.solve_many(&mut many, columns),
                    true => factor.solve_transpose_many(&mut many, columns),
                }
                for k in 0..columns {
                    let mut one: Vec<f64> = b.iter().skip(k).step_by(columns).copied().collect();
                    if transpose {
                        factor.solve_transpose(&mut one)
                    } else {
                        factor.solve(&mut one)
                    }
                    let column: Vec<f64> = many.iter().skip(k).step_by(columns).copied().collect();
                    assert_close(&column, &one, 1e-14, what);
                }
            }
        }
        factor.solve_many(&mut [], 0);
    });
}

#[test]
fn refinement_recovers_a_factor_of_another_matrix() {
    for_systems(|method, symmetry, a, prescribed, rng, what| {
        let factor = factor_of(method, symmetry, a, prescribed).unwrap();
        // the same up to 1e-4, like a regularized factor
        let mut exact = a.clone();
        for r in (0..a.dim()).filter(|r| !prescribed.get(r / 3).is_some_and(|d| *d)) {
            exact.add(r, r, 1e-4 * a.get(r, r));
        }
        let (b, mut x, mut scratch, mut back) = (rng.vector(a.dim()), vec![0.0; a.dim()], Vec::new(), vec![0.0; a.dim()]);
        let left = factor.solve_refined(&exact, &b, &mut x, &mut scratch, 4);
        assert!(left < 1e-14, "{what}: {left:e}");
        exact.add_mul(1.0, &x, &mut back);
        assert_close(&back, &b, 1e-13, what);
        factor.solve_transpose_refined(&exact, &b, &mut x, &mut scratch, 4);
        back.fill(0.0);
        exact.add_mul_transpose(1.0, &x, &mut back);
        assert_close(&back, &b, 1e-13, what);

        let columns = 5;
        let (b, mut x) = (rng.vector(a.dim() * columns), vec![0.0; a.dim() * columns]);
        factor.solve_many_refined(&exact, &b, &mut x, &mut scratch, 4, columns);
        let mut back = vec![0.0; a.dim() * columns];
        exact.add_mul_many(1.0, &x, &mut back, columns);
        assert_close(&back, &b, 1e-13, what);
    });
}

#[test]
fn layouts_that_do_not_serve_are_refused() {
    let three = [vec![0, 1, 2]];
    let new = |method, symmetry, layout: NodeLayout| Symbolic::new(method, symmetry, &Arc::new(layout), &[false; 3]).map(|_| ());
    let twisted = || NodeLayout::banded(3, &[0], None, &three).unwrap();
    assert_eq!(new(Method::Band, Symmetry::Symmetric, twisted()), Err(KktError::Twists));
    let sparse = NodeLayout::sparse(3, &[], None, &three).unwrap();
    assert_eq!(new(Method::Band, Symmetry::General, sparse), Err(KktError::NoBand));
    assert_eq!(NodeLayout::banded(3, &[0, 0], None, &three).unwrap_err(), KktError::Order { node: 0, n_nodes: 3 });
}

#[test]
fn singular_matrices_name_a_row() {
    let (n, half_width, bad) = (20, 2, 34);
    for symmetry in KINDS {
        let prescribed = some_prescribed(n);
        let mut a = random_matrix(symmetry, &Arc::new(NodeLayout::band(n, half_width)), &prescribed, &mut Lcg(9));
        for c in 0..3 * n {
            if a.get(bad, c) != 0.0 || a.get(c, bad) != 0.0 {
                let (rc, cr) = (a.get(bad, c), a.get(c, bad));
                a.add(bad, c, -rc);
                if c != bad {
                    a.add(c, bad, -cr);
                }
            }
        }
        for method in METHODS {
            let error = factor_of(method, symmetry, &a, &prescribed).unwrap_err();
            let (KktError::Singular { row, dim, .. } | KktError::NotPositiveDefinite { row, dim, .. }) = error else {
                panic!("{method:?} {symmetry:?}: {error}");
            };
            assert_eq!(dim, 3 * n);
            assert_eq!(row, bad, "{method:?} {symmetry:?}: {error}");
        }
    }
}

#[test]
fn rigid_translation_without_mass_is_found_singular() {
    // a free chain of springs: rows add up to zero, the last pivots are rounding noise
    let n = 12;
    let mut a = NodeMatrix::band(n, 1);
    for i in 0..n - 1 {
        let k = [[3.0, 0.1, 0.0], [0.1, 2.0, 0.3], [0.0, 0.3, 1.0 / 3.0]];
        for (r, c, s) in [(i, i, 1.0), (i + 1, i + 1, 1.0), (i, i + 1, -1.0), (i + 1, i, -1.0)] {
            a.add_block(r, c, s, &k);
        }
    }
    for method in METHODS {
        for symmetry in KINDS {
            let error = factor_of(method, symmetry, &a, &[false; 12]);
            assert!(error.is_err(), "{method:?} {symmetry:?}");
        }
    }
}

#[test]
fn indefinite_and_undefined_matrices_are_refused() {
    let (n, half_width) = (10, 2);
    let prescribed = vec![false; n];
    let good = random_matrix(Symmetry::Symmetric, &Arc::new(NodeLayout::band(n, half_width)), &prescribed, &mut Lcg(13));
    for method in METHODS {
        let mut a = good.clone();
        a.add(17, 17, -2.0 * a.get(17, 17));
        let error = factor_of(method, Symmetry::Symmetric, &a, &prescribed).unwrap_err();
        assert!(matches!(error, KktError::NotPositiveDefinite { row: 17, dim: 30, .. }), "{method:?}: {error}");
        factor_of(method, Symmetry::General, &a, &prescribed).unwrap();
        for symmetry in KINDS {
            for bad in [f64::NAN, f64::INFINITY] {
                let mut a = good.clone();
                a.add(5, 5, bad);
                let error = factor_of(method, symmetry, &a, &prescribed).unwrap_err();
                assert!(matches!(error, KktError::NotFinite { row: 5, .. }), "{method:?} {symmetry:?} {bad}: {error}");
            }
        }
    }
}

#[test]
fn growth_without_pivoting_is_refused() {
    let mut a = NodeMatrix::band(2, 1);
    for r in 0..6 {
        a.add(r, r, 1.0);
    }
    a.add(0, 0, 1e-12 - 1.0);
    a.add(0, 1, 0.1);
    a.add(1, 0, 0.1);
    let error = factor_of(Method::Band, Symmetry::General, &a, &[false; 2]).unwrap_err();
    assert!(matches!(error, KktError::Growth { row: 0 | 1, .. }), "{error}");
    factor_of(Method::Dense, Symmetry::General, &a, &[false; 2]).unwrap();
}

#[test]
fn shapes_are_checked_and_unfactored_solves_are_nan() {
    let layout = Arc::new(NodeLayout::band(4, 2));
    let symbolic = Symbolic::new(Method::Band, Symmetry::General, &layout, &[false; 4]).unwrap();
    let mut factor = Factor::new(&symbolic);
    let error = factor.refactor(&NodeMatrix::band(5, 2)).unwrap_err();
    assert_eq!(error, KktError::Shape { what: "rows of the matrix (or their pattern)", expected: 12, found: 15 });
    let error = factor.refactor(&NodeMatrix::band(4, 1)).unwrap_err();
    assert_eq!(error, KktError::Shape { what: "rows of the matrix (or their pattern)", expected: 12, found: 12 });
    let mut b = vec![1.0; 12];
    factor.solve(&mut b);
    assert!(b.iter().all(|x| x.is_nan()));
    let error = Symbolic::new(Method::Band, Symmetry::General, &layout, &[false; 3]).unwrap_err();
    assert_eq!(error.to_string(), "prescribed flags: expected 4, got 3");
}
