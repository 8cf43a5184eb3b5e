//! The nearest point of a contact element to a feature.

use crate::geometry::collider::{ColliderShape, Feature, PlacedCollider};
use crate::geometry::constants::GEOMETRY;
use pliant_math::{Real, Vec3};

/// Which part of a contact element is nearest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Region {
    /// Its inside: of the edge, or of the triangle.
    Inside,
    /// Side k of a triangle, opposite to node k.
    Side(u8),
    /// Node k.
    Node(u8),
}

/// A gap, its normal, and the weights of the contact element's nodes in the nearest point; of an edge the third is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nearest<S> {
    /// Distance of the surfaces \[m\], negative in penetration.
    pub gap: S,
    /// Outward unit normal of the shape.
    pub normal: Vec3<S>,
    /// β.
    pub weights: [S; 3],
    pub region: Region,
}

/// Shapes that a contact element may touch, thick by `thickness` \[m\].
#[derive(Clone, Copy, Debug)]
struct Target<S> {
    /// The point, or a point of the line \[m\].
    at: Vec3<S>,
    /// Unit direction of the line; a point without.
    along: Option<Vec3<S>>,
    thickness: S,
    /// A direction that points out of the shape there, for what is sharp: the gap then has a sign at any depth.
    out: Option<Vec3<S>>,
}

/// The nearest point of the contact element with nodes `x` (two or three) and `radius` \[m\] to a feature of a shape; the distance \[m\] where it
/// is too small for a normal.
///
/// Features: [`Feature::Whole`] of a ball, and of a capsule with edges; [`Feature::End`] of a capsule, [`Feature::Corner`] of a block;
/// [`Feature::Edge`] of a block (its endless line) with edges.
pub(crate) fn nearest<S: Real>(x: &[Vec3<S>], radius: S, feature: Feature, shape: &PlacedCollider<S>) -> Result<Nearest<S>, f64> {
    let zero = S::from(0.0);
    let point = |at, thickness| Target { at, along: None, thickness, out: None };
    match feature {
        Feature::Edge(..) => {
            let ((at, along), out) = (shape.line(feature), shape.outward(feature));
            to_line(x, radius, &Target { at, along: Some(along), thickness: zero, out: Some(out) })
        }
        Feature::Corner(_) => {
            let out = Some(shape.outward(feature));
            to_point(x, radius, &Target { out, ..point(shape.point(feature), zero) })
        }
        Feature::Whole if shape.form == ColliderShape::Capsule => {
            let (along, half) = (shape.axis(2), shape.sizes[1]);
            let line = Target { along: Some(along), ..point(shape.position, shape.sizes[0]) };
            let beside = to_line(x, radius, &line)?;
            let t = (combine(&beside.weights, x) - shape.position).dot(&along);
            // a distance between convex sets: where the line's nearest point is beyond an end, that end is nearest
            let end = if t.re() > half.re() { 1 } else { -1 };
            if t.re().abs() <= half.re() {
                return Ok(beside);
            }
            to_point(x, radius, &point(shape.point(Feature::End(end)), shape.sizes[0]))
        }
        _ => to_point(x, radius, &point(shape.point(feature), shape.sizes[0])),
    }
}

/// Σ β_i x_i.
pub(super) fn combine<S: Real>(weights: &[S; 3], x: &[Vec3<S>]) -> Vec3<S> {
    x.iter().zip(weights).fold(Vec3::repeat(S::from(0.0)), |sum, (x, w)| sum + x * *w)
}

/// Where on the segment from `a` to `b` the origin is nearest, as a part of it, not clamped.
pub(super) fn along_segment<S: Real>(a: &Vec3<S>, b: &Vec3<S>) -> S {
    let m = b - a;
    -a.dot(&m) / m.dot(&m)
}

/// Weights of the point of the plane of a triangle that is nearest to the origin.
pub(super) fn along_plane<S: Real>(y: &[Vec3<S>]) -> [S; 3] {
    let (u, v) = (y[1] - y[0], y[2] - y[0]);
    let n = u.cross(&v);
    let nn = n.dot(&n);
    let b = v.cross(&y[0]).dot(&n) / nn;
    let c = y[0].cross(&u).dot(&n) / nn;
    [S::from(1.0) - b - c, b, c]
}

/// The gap at the distance vector `d` from the target, which is not zero.
fn apart<S: Real>(d: Vec3<S>, radius: S, target: &Target<S>, weights: [S; 3], region: Region) -> Result<Nearest<S>, f64> {
    let distance = d.dot(&d).sqrt();
    if distance.re() < GEOMETRY.min_distance || !distance.re().is_finite() {
        return Err(distance.re());
    }
    let sign = if target.out.is_some_and(|out| d.dot(&out).re() < 0.0) { -1.0 } else { 1.0 };
    let normal = d * (distance.recip() * sign);
    Ok(Nearest { gap: distance * sign - target.thickness - radius, normal, weights, region })
}

/// With the normal `n`, of any length, of the plane that holds the contact element (and the line): smooth through a distance of zero.
fn across<S: Real>(n: Vec3<S>, y: &Vec3<S>, radius: S, target: &Target<S>, weights: [S; 3]) -> Result<Nearest<S>, f64> {
    let length = n.dot(&n).sqrt();
    let outward = target.out.map_or(n.dot(y), |out| n.dot(&out)).re();
    let sign = if outward < 0.0 { -1.0 } else { 1.0 };
    let normal = n * (length.recip() * sign);
    let gap = normal.dot(y) - target.thickness - radius;
    if gap.re().is_finite() { Ok(Nearest { gap, normal, weights, region: Region::Inside }) } else { Err(length.re()) }
}

fn to_point<S: Real>(x: &[Vec3<S>], radius: S, target: &Target<S>) -> Result<Nearest<S>, f64> {
    let (one, zero) = (S::from(1.0), S::from(0.0));
    let y: [Vec3<S>; 3] = std::array::from_fn(|k| x[k.min(x.len() - 1)] - target.at);
    if x.len() == 3 {
        let weights = along_plane(&y);
        if weights.iter().all(|w| w.re() >= 0.0) {
            return across((y[1] - y[0]).cross(&(y[2] - y[0])), &y[0], radius, target, weights);
        }
    }
    // the nearest side; an edge is the one opposite to the third node
    let side_distance = |k: usize| {
        let (a, b) = (y[(k + 1) % 3].map(|c| c.re()), y[(k + 2) % 3].map(|c| c.re()));
        (a + (b - a) * along_segment(&a, &b).clamp(0.0, 1.0)).norm()
    };
    let side = if x.len() == 2 { 2 } else { (0..3).min_by(|i, j| side_distance(*i).total_cmp(&side_distance(*j))).unwrap_or(2) };
    let (i, j) = ((side + 1) % 3, (side + 2) % 3);
    let s = along_segment(&y[i], &y[j]);
    let mut weights = [zero; 3];
    let region = match s.re() {
        re if re > 0.0 && re < 1.0 => {
            (weights[i], weights[j]) = (one - s, s);
            if x.len() == 2 { Region::Inside } else { Region::Side(side as u8) }
        }
        re => {
            let node = if re >= 1.0 { j } else { i };
            weights[node] = one;
            Region::Node(node as u8)
        }
    };
    apart(combine(&weights, &y), radius, target, weights, region)
}

/// An edge against a line: a segment against a point in the plane across the line.
fn to_line<S: Real>(x: &[Vec3<S>], radius: S, target: &Target<S>) -> Result<Nearest<S>, f64> {
    let (one, zero) = (S::from(1.0), S::from(0.0));
    let Some(e) = target.along else { return to_point(x, radius, target) };
    let flat = |x: &Vec3<S>| {
        let y = x - target.at;
        y - e * y.dot(&e)
    };
    let (a, b) = (flat(&x[0]), flat(&x[1]));
    let m = b - a;
    let edge = x[1] - x[0];
    let crossing = m.dot(&m).re() > GEOMETRY.endless * GEOMETRY.endless * edge.dot(&edge).re();
    let s = if crossing { along_segment(&a, &b) } else { zero };
    match s.re() {
        re if re > 0.0 && re < 1.0 => across(e.cross(&m), &a, radius, target, [one - s, s, zero]),
        re if re >= 1.0 => apart(b, radius, target, [zero, one, zero], Region::Node(1)),
        _ => apart(a, radius, target, [one, zero, zero], Region::Node(0)),
    }
}
