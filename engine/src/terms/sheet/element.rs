//! From rest positions to the constants of a sheet's elements.

use crate::terms::Element;
use nalgebra::{Matrix2, Vector2};
use pliant_math::Vec3;
use pliant_math::dihedral::fold;

/// A triangle laid flat: the first node at the origin, the second one on the x axis, the third one above it.
fn flattened(x: &[Vec3<f64>; 3]) -> [Vector2<f64>; 3] {
    let (e, d) = (x[1] - x[0], x[2] - x[0]);
    let l = e.norm();
    [Vector2::zeros(), Vector2::new(l, 0.0), Vector2::new(e.dot(&d) / l, e.cross(&d).norm() / l)]
}

/// The constants of [`MembraneLaw`](super::MembraneLaw) for a triangle at these rest positions \[m\], in its plane or in space, of a
/// sheet of this area \[m²\]. The triangle must have an area.
pub fn face_constants<const D: usize>(rest: &[[f64; D]; 3], sheet_area: f64) -> Vec<f64> {
    let x = rest.map(|x| Vec3::from_fn(|a, _| x.get(a).copied().unwrap_or(0.0)));
    let [x0, x1, x2] = flattened(&x);
    let edges = Matrix2::from_columns(&[x1 - x0, x2 - x0]);
    let twice = edges.determinant();
    let slopes = Matrix2::new(edges[(1, 1)], -edges[(0, 1)], -edges[(1, 0)], edges[(0, 0)]) * (sheet_area.sqrt() / twice);
    vec![0.5 * twice / sheet_area, slopes[(0, 0)], slopes[(0, 1)], slopes[(1, 0)], slopes[(1, 1)]]
}

/// The element of a triangle's bending, without its parameters: `nodes` of the triangle, `beyond[k]` the third node of the
/// neighbour across the edge opposite of `nodes[k]`, and where nodes are at rest \[m\]. `None` if it has no neighbour.
///
/// Constants: of every neighbour the edge, ψ at rest, and the row of M/√A (see the module `patch`).
pub fn bend_element(nodes: [usize; 3], beyond: [Option<usize>; 3], rest: &dyn Fn(usize) -> Vec3<f64>) -> Option<Element> {
    let x = nodes.map(rest);
    let flat = flattened(&x);
    let area = 0.5 * flat[1][0] * flat[2][1];
    let mut out = Element { nodes: nodes.to_vec(), params: Vec::new(), constants: Vec::new() };
    for (edge, node) in beyond.iter().enumerate().filter_map(|(edge, node)| Some((edge, (*node)?))) {
        let (p, q, far) = ((edge + 1) % 3, (edge + 2) % 3, rest(node));
        let beside = (x[q] - x[p]).cross(&(far - x[p])).norm() / (x[q] - x[p]).norm();
        let row = row(flat[p], flat[q], flat[edge], beside).map(|m| m / area.sqrt());
        out.nodes.push(node);
        out.constants.extend([edge as f64, fold(&[x[p], x[q], x[edge], far]).0, row[0], row[1], row[2]]);
    }
    (out.nodes.len() > 3).then_some(out)
}

/// How the fold at the edge pq follows from the triangle's curvature (H_xx, H_yy, H_xy), up to a sign that all edges share;
/// `own` is its third node, `beside` the neighbour's height over the edge \[m\].
fn row(p: Vector2<f64>, q: Vector2<f64>, own: Vector2<f64>, beside: f64) -> [f64; 3] {
    let (e, a, b) = (q - p, own - p, own - q);
    let height = (e[0] * a[1] - e[1] * a[0]).abs() / e.norm();
    let scale = 0.5 * (height + beside) / (height * height);
    [scale * a[0] * b[0], scale * a[1] * b[1], scale * (a[0] * b[1] + a[1] * b[0])]
}

#[cfg(test)]
pub(in crate::terms) mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::terms::sheet::Plate;
    use crate::terms::{Point, Term};

    const UP: [[usize; 3]; 2] = [[0, 2, 3], [0, 3, 1]];
    const DOWN: [[usize; 3]; 2] = [[0, 2, 1], [1, 2, 3]];

    /// Triangles of a grid of nodes, numbered by (i, j) = i · nv + j, with the diagonals of a cell given by `up(i, j)`.
    fn grid(nu: usize, nv: usize, up: &dyn Fn(usize, usize) -> bool) -> Vec<[usize; 3]> {
        let cells = (0..nu - 1).flat_map(|i| (0..nv - 1).map(move |j| (i, j)));
        let corners = |(i, j): (usize, usize)| [i * nv + j, i * nv + j + 1, (i + 1) * nv + j, (i + 1) * nv + j + 1];
        let of = |cell: (usize, usize)| {
            let c = corners(cell);
            (if up(cell.0, cell.1) { UP } else { DOWN }).map(|t| t.map(|k| c[k]))
        };
        cells.flat_map(of).collect()
    }

    fn beyond(triangles: &[[usize; 3]], t: usize) -> [Option<usize>; 3] {
        [0, 1, 2].map(|k| {
            let edge = [triangles[t][(k + 1) % 3], triangles[t][(k + 2) % 3]];
            let others = triangles.iter().enumerate().filter(|(other, _)| *other != t);
            others
                .filter(|(_, o)| edge.iter().all(|n| o.contains(n)))
                .find_map(|(_, o)| o.iter().find(|n| !edge.contains(n)).copied())
        })
    }

    /// Rest positions of the sample's sheet, a little deformed.
    fn rest(k: usize) -> Vec3<f64> {
        let (i, j) = ((k / 3) as f64, (k % 3) as f64);
        Vec3::new(0.1 * i + 0.004 * j * j, 0.1 * j - 0.003 * i, 0.01 * (i * j).sin())
    }

    /// Triangles of a 3 × 3 sheet, with the first `params` entries of θ, the last two out of order.
    pub fn faces(params: usize) -> Vec<Element> {
        let mut triangles = grid(3, 3, &|i, j| (i + j) % 2 == 0);
        triangles.extend([[8, 0, 4], [5, 7, 1]]);
        let element = |t: [usize; 3]| {
            let constants = face_constants(&t.map(|k| rest(k).into()), 0.04);
            Element { nodes: t.to_vec(), params: (0..params).collect(), constants }
        };
        let thin = |e: &Element| e.constants[0] > 1e-3;
        triangles.into_iter().map(element).filter(thin).collect()
    }

    /// Patches of the same sheet: with one, two and three flaps.
    pub fn patches() -> Vec<Element> {
        let triangles = grid(3, 3, &|_, _| true);
        let of = |t: usize| bend_element(triangles[t], beyond(&triangles, t), &rest).map(|e| Element { params: vec![0, 1], ..e });
        let all: Vec<_> = (0..triangles.len()).filter_map(of).collect();
        let with = |flaps: usize| all.iter().any(|e| e.nodes.len() == 3 + flaps);
        assert!(with(1) && with(2) && with(3));
        all
    }

    /// Bending energy of a large sheet over that of a plate, both per area, in the quadratic shape z = (p x² + 2 q xy + r y²)/2.
    fn ratio(up: &dyn Fn(usize, usize) -> bool, shape: [f64; 3], nu: f64, skew: f64) -> f64 {
        let n = 8;
        let triangles = grid(n, n, up);
        let at = |k: usize| Vec3::new((k / n) as f64 + skew * (k % n) as f64, (k % n) as f64, 0.0);
        // only patches with all neighbours: what the edges of the sheet do is tested by itself
        let whole = |t: usize| Some(beyond(&triangles, t)).filter(|b| b.iter().all(Option::is_some));
        let element = |t: usize| bend_element(triangles[t], whole(t)?, &at).map(|e| Element { params: vec![0, 1], ..e });
        let elements: Vec<_> = (0..triangles.len()).filter_map(element).collect();
        let area = 0.5 * elements.len() as f64;
        let [p, q, r] = shape.map(|x| 1e-5 * x);
        let bent = |k: usize| {
            let x = at(k);
            [x[0], x[1], 0.5 * (p * x[0] * x[0] + 2.0 * q * x[0] * x[1] + r * x[1] * x[1])]
        };
        let q_all: Vec<f64> = (0..n * n).flat_map(bent).collect();
        let point = Point { q: &q_all, v: &vec![0.0; q_all.len()], theta: &[1.0, nu] };
        let plate = 0.5 * ((1.0 - nu) * (p * p + r * r + 2.0 * q * q) + nu * (p + r) * (p + r));
        Plate::new(elements).energy(&point) / (area * plate)
    }

    #[test]
    fn every_quadratic_shape_costs_what_it_costs_a_plate_if_all_cells_are_cut_alike() {
        let shapes = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.5, 0.5], [0.5, -0.5, 0.5], [0.0, 1.0, 0.0], [1.0, 0.3, -0.4]];
        for up in [true, false] {
            for (shape, nu, skew) in shapes.iter().flat_map(|s| [(*s, 0.0, 0.0), (*s, 0.3, 0.0), (*s, 0.3, 0.4)]) {
                let ratio = ratio(&|_, _| up, shape, nu, skew);
                assert!((ratio - 1.0).abs() < 1e-6, "{up} {shape:?} ν {nu} skew {skew}: {ratio}");
            }
        }
    }

    /// Cells cut in turn: right along the axes, twice as stiff in twist. The table in docs/cloth.md.
    #[test]
    fn cells_cut_in_turn_resist_twist_twice() {
        let ratio = |shape| ratio(&|i, j| (i + j) % 2 == 0, shape, 0.0, 0.0);
        for (shape, expected) in [([1.0, 0.0, 0.0], 1.0), ([0.0, 0.0, 1.0], 1.0), ([0.5, 0.5, 0.5], 1.5), ([0.0, 1.0, 0.0], 2.0)]
        {
            assert!((ratio(shape) - expected).abs() < 0.05, "{shape:?}: {}", ratio(shape));
        }
    }

    /// A strip one cell wide, all of whose triangles lie at the free edge: cylindrical bending costs D/2 κ² (1 − ν²) per area, for
    /// the strip may curl across.
    #[test]
    fn a_free_edge_carries_no_moment() {
        let n = 12;
        for (up, nu) in [(true, 0.0), (false, 0.3), (true, 0.3)] {
            let triangles = grid(n, 2, &|_, _| up);
            let at = |k: usize| Vec3::new((k / 2) as f64, (k % 2) as f64, 0.0);
            let element = |t: usize| bend_element(triangles[t], beyond(&triangles, t), &at);
            let elements = (0..triangles.len()).filter_map(element).map(|e| Element { params: vec![0, 1], ..e }).collect();
            let kappa = 1e-5;
            let q: Vec<f64> = (0..2 * n).flat_map(|k| [at(k)[0], at(k)[1], 0.5 * kappa * at(k)[0].powi(2)]).collect();
            let energy = Plate::new(elements).energy(&Point { q: &q, v: &vec![0.0; q.len()], theta: &[1.0, nu] });
            // a fold at each of the n − 2 inner lines
            let expected = 0.5 * kappa * kappa * (1.0 - nu * nu) * (n - 2) as f64;
            assert!((energy / expected - 1.0).abs() < 1e-6, "{up} {nu}: {}", energy / expected);
        }
    }

    /// As `ratio` at ν = 0, for hinges: ½ k ψ² at every edge, k = D |e|²/(A₁ + A₂). Half of each edge belongs to a triangle.
    fn hinge_ratio(up: bool, [p, q, r]: [f64; 3]) -> f64 {
        let n = 8;
        let triangles = grid(n, n, &|_, _| up);
        let bent = |k: usize| {
            let (x, y) = ((k / n) as f64, (k % n) as f64);
            Vec3::new(x, y, 0.5e-5 * (p * x * x + 2.0 * q * x * y + r * y * y))
        };
        let (mut energy, mut area) = (0.0, 0.0);
        for (t, nodes) in triangles.iter().enumerate() {
            let beyond = beyond(&triangles, t);
            if beyond.iter().all(Option::is_some) {
                area += 0.5;
                for (k, far) in beyond.into_iter().flatten().enumerate() {
                    let x = [nodes[(k + 1) % 3], nodes[(k + 2) % 3], nodes[k], far].map(bent);
                    energy += 0.25 * (x[1] - x[0]).norm_squared() * fold(&x).0.powi(2);
                }
            }
        }
        energy / (0.5e-10 * (p * p + r * r + 2.0 * q * q) * area)
    }

    /// Why bending is not a hinge at every edge: the table in docs/cloth.md.
    #[test]
    fn hinges_depend_on_the_mesh() {
        let cases = [([1.0, 0.0, 0.0], 1.0, 1.0), ([0.0, 0.0, 1.0], 1.0, 1.0), ([0.5; 3], 3.0, 1.0), ([0.0, 1.0, 0.0], 3.0, 3.0)];
        for (shape, up, down) in cases {
            let found = [hinge_ratio(true, shape), hinge_ratio(false, shape)];
            assert!((found[0] - up).abs() < 1e-6 && (found[1] - down).abs() < 1e-6, "{shape:?}: {found:?}");
        }
    }
}
