//! The gap between two features in closed form, for any scalar.

use super::features::TOP;
use super::rims::rim_contact;
use super::{ColliderShape, Feature, FeaturePair, PlacedCollider, Polyhedron};
use crate::geometry::constants::GEOMETRY;
use pliant_math::{Real, Vec3};

/// Where and how two features meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactGeometry<S> {
    /// Distance of the surfaces \[m\], negative in penetration.
    pub gap: S,
    /// Unit normal, from the second solid to the first.
    pub normal: Vec3<S>,
    /// Middle between the nearest points of the surfaces \[m\], seen from the origin of the evaluation.
    pub point: Vec3<S>,
}

/// Gap, normal and point of two features; the distance \[m\] where it is too small for a normal.
///
/// Point against face, line against line and rims against faces, lines and rims are smooth; distances to whole colliders are C¹ (their curvature jumps
/// from a face to an edge), and continuous only inside a block or cylinder.
pub fn contact_geometry<S: Real>(
    feature_pair: &FeaturePair,
    a: &PlacedCollider<S>,
    b: &PlacedCollider<S>,
) -> Result<ContactGeometry<S>, f64> {
    match (feature_pair.first, feature_pair.second) {
        (Feature::Rim(side), Feature::Face(k)) => rim_face(a, side, b.face(k)),
        (Feature::RimHalf(..) | Feature::RimSector(..), _) => rim_contact(feature_pair, a, b).map(|m| m.geometry),
        (Feature::Axis | Feature::Edge(..), Feature::Axis | Feature::Edge(..)) => line_line(feature_pair, a, b),
        (first, Feature::Face(k)) => Ok(point_face(a.point(first), a.roundness(first), b.face(k))),
        (first, Feature::Side) => point_side(a.point(first), a.roundness(first), b),
        (first, _) => point_whole(a.point(first), a.roundness(first), b),
    }
}

/// The centre of the ball that a spot's first feature is \[m\], if it stays where it is in its solid and the second is a face.
pub(crate) fn point_over_face(feature_pair: &FeaturePair, a: &PlacedCollider<f64>, b: &PlacedCollider<f64>) -> Option<Vec3<f64>> {
    let point = !matches!(
        feature_pair.first,
        Feature::Rim(_) | Feature::RimHalf(..) | Feature::RimSector(..) | Feature::Axis | Feature::Edge(..)
    );
    let face = matches!(feature_pair.second, Feature::Face(..))
        || (feature_pair.second == Feature::Whole && b.form == ColliderShape::HalfSpace);
    (point && face).then(|| a.point(feature_pair.first))
}

/// The middle between the surfaces of a ball of radius `r` at `x` and of what is `gap` beyond it against the normal.
pub(super) fn middle<S: Real>(x: Vec3<S>, r: S, gap: S, normal: Vec3<S>) -> ContactGeometry<S> {
    ContactGeometry { gap, normal, point: x - normal * (r + gap * 0.5) }
}

fn point_face<S: Real>(x: Vec3<S>, r: S, (at, normal): (Vec3<S>, Vec3<S>)) -> ContactGeometry<S> {
    middle(x, r, (x - at).dot(&normal) - r, normal)
}

/// A ball against what is at the distance `d` (a vector to its centre), thick by `thickness`.
pub(super) fn apart<S: Real>(x: Vec3<S>, r: S, d: Vec3<S>, thickness: S) -> Result<ContactGeometry<S>, f64> {
    let distance = d.dot(&d).sqrt();
    if distance.re() < GEOMETRY.min_distance || !distance.re().is_finite() {
        return Err(distance.re());
    }
    Ok(middle(x, r, distance - thickness - r, d * distance.recip()))
}

/// Against the endless side of a cylinder.
fn point_side<S: Real>(x: Vec3<S>, r: S, b: &PlacedCollider<S>) -> Result<ContactGeometry<S>, f64> {
    let (d, axis) = (x - b.position, b.axis(2));
    apart(x, r, d - axis * d.dot(&axis), b.sizes[0])
}

fn point_whole<S: Real>(x: Vec3<S>, r: S, b: &PlacedCollider<S>) -> Result<ContactGeometry<S>, f64> {
    match &b.form {
        ColliderShape::HalfSpace => Ok(point_face(x, r, b.face(TOP))),
        ColliderShape::Hull(p) => point_hull(x, r, b, p),
        ColliderShape::Ball => apart(x, r, x - b.position, b.sizes[0]),
        ColliderShape::Capsule => {
            let (d, axis) = (x - b.position, b.axis(2));
            let along = clamp(d.dot(&axis), b.sizes[1]);
            apart(x, r, d - axis * along, b.sizes[0])
        }
        ColliderShape::Block => point_block(x, r, b),
        ColliderShape::Cylinder => point_cylinder(x, r, b),
    }
}

/// `y` kept within ±`half`.
fn clamp<S: Real>(y: S, half: S) -> S {
    match y.re() {
        re if re > half.re() => half,
        re if re < -half.re() => -half,
        _ => y,
    }
}

fn point_block<S: Real>(x: Vec3<S>, r: S, b: &PlacedCollider<S>) -> Result<ContactGeometry<S>, f64> {
    let y = b.local(&x);
    let d: Vec3<S> = Vec3::from_fn(|k, _| y[k] - clamp(y[k], b.sizes[k]));
    let mut outside = (0..3).filter(|&k| y[k].re().abs() > b.sizes[k].re());
    let (first, second) = (outside.next(), outside.next());
    if second.is_some() {
        return apart(x, r, b.rotation * d, S::from(0.0));
    }
    // one face: over it, or the nearest from inside
    let depth = |k: &usize| b.sizes[*k].re() - y[*k].re().abs();
    let nearest = || (0..3).min_by(|i, j| depth(i).total_cmp(&depth(j))).unwrap_or(0);
    let k = first.unwrap_or_else(nearest);
    Ok(point_face(x, r, b.face(2 * k as u16 + u16::from(y[k].re() >= 0.0))))
}

/// The nearest face, edge or corner of a polyhedron, in this order.
fn point_hull<S: Real>(x: Vec3<S>, r: S, b: &PlacedCollider<S>, p: &Polyhedron) -> Result<ContactGeometry<S>, f64> {
    let y: Vec3<f64> = b.local(&x).map(|c| c.re());
    let (highest, height) = p.highest(&y);
    let over = |f: &usize| p.height(*f, &y) > 0.0 && p.is_over(*f, &y, 0.0);
    let face = if height <= 0.0 { Some(highest) } else { (0..p.faces.len()).find(over) };
    if let Some(face) = face {
        return Ok(point_face(x, r, b.face(face as u16)));
    }
    let along = |e: usize| (y - p.edges[e].middle).dot(&p.edges[e].direction);
    let distance = |e: usize| {
        let edge = &p.edges[e];
        (y - edge.middle - edge.direction * along(e).clamp(-edge.half_length, edge.half_length)).norm_squared()
    };
    let nearest = (0..p.edges.len()).min_by(|i, j| distance(*i).total_cmp(&distance(*j))).unwrap_or(0);
    let (t, half) = (along(nearest), p.edges[nearest].half_length);
    let (middle, direction) = b.line(Feature::Edge(nearest as u16));
    let d = x - middle;
    let t = if t.abs() < half { d.dot(&direction) } else { S::from(half.copysign(t)) };
    apart(x, r, d - direction * t, S::from(0.0))
}

fn point_cylinder<S: Real>(x: Vec3<S>, r: S, b: &PlacedCollider<S>) -> Result<ContactGeometry<S>, f64> {
    let y = b.local(&x);
    let radial = (y[0].re() * y[0].re() + y[1].re() * y[1].re()).sqrt();
    let (beside, beyond) = (radial - b.sizes[0].re(), y[2].re().abs() - b.sizes[1].re());
    let side = if y[2].re() < 0.0 { -1.0 } else { 1.0 };
    if beside > 0.0 && beyond > 0.0 {
        let across = Vec3::new(y[0], y[1], S::from(0.0));
        let length = across.dot(&across).sqrt();
        let mut d = across * ((length - b.sizes[0]) / length);
        d[2] = y[2] - b.sizes[1] * side;
        return apart(x, r, b.rotation * d, S::from(0.0));
    }
    // over the side or over an end, or the nearest of both from inside
    if beside > 0.0 || (beyond <= 0.0 && beside > beyond) {
        return point_side(x, r, b);
    }
    Ok(point_face(x, r, b.face(if side < 0.0 { TOP - 1 } else { TOP })))
}

/// The deepest point of a rim over a face: n·c − R √(1 − (n·a)²).
fn rim_face<S: Real>(a: &PlacedCollider<S>, side: i8, (at, normal): (Vec3<S>, Vec3<S>)) -> Result<ContactGeometry<S>, f64> {
    let axis = a.axis(2);
    let center = a.position + axis * (a.sizes[1] * f64::from(side));
    let across = axis * axis.dot(&normal) - normal;
    let length = across.dot(&across).sqrt();
    if length.re() < GEOMETRY.min_distance || !length.re().is_finite() {
        return Err(length.re());
    }
    let deepest = center + across * (a.sizes[0] / length);
    Ok(point_face(deepest, S::from(0.0), (at, normal)))
}

/// Two endless lines, each thick by its roundness; the normal is that of their common perpendicular which points from the second
/// solid's middle to the first's side.
fn line_line<S: Real>(
    feature_pair: &FeaturePair,
    a: &PlacedCollider<S>,
    b: &PlacedCollider<S>,
) -> Result<ContactGeometry<S>, f64> {
    let ((p, d), (q, e)) = (a.line(feature_pair.first), b.line(feature_pair.second));
    let cross = d.cross(&e);
    let sine = cross.dot(&cross).sqrt();
    if sine.re() < GEOMETRY.min_distance || !sine.re().is_finite() {
        return Err(sine.re());
    }
    let mut normal = cross * sine.recip();
    let between = p - q;
    if outward(feature_pair, a, b, &normal, &between) < 0.0 {
        normal = -normal;
    }
    // nearest points p + s d, q + t e
    let sine2 = sine * sine;
    let s = -between.cross(&e).dot(&cross) / sine2;
    let t = -between.cross(&d).dot(&cross) / sine2;
    let (ra, rb) = (a.roundness(feature_pair.first), b.roundness(feature_pair.second));
    let (x, y) = (p + d * s, q + e * t);
    let gap = between.dot(&normal) - ra - rb;
    Ok(ContactGeometry { gap, normal, point: (x - normal * ra + y + normal * rb) * S::from(0.5) })
}

/// Positive if `normal` points out of the second solid at its edge (or, for an axis, into the first from its edge); between two axes,
/// from one line to the other.
fn outward<S: Real>(
    feature_pair: &FeaturePair,
    a: &PlacedCollider<S>,
    b: &PlacedCollider<S>,
    normal: &Vec3<S>,
    between: &Vec3<S>,
) -> f64 {
    let corner = |feature: Feature, collider: &PlacedCollider<S>| match (feature, &collider.form) {
        (Feature::Edge(edge), ColliderShape::Hull(p)) => {
            let [a, b] = p.edges[usize::from(edge)].conormals;
            collider.rotation.map(|x| x.re()).tr_mul(&normal.map(|x| x.re())).dot(&(a + b))
        }
        _ => (collider.line(feature).0 - collider.position).dot(normal).re(),
    };
    match (feature_pair.first, feature_pair.second) {
        (_, Feature::Edge(..)) => corner(feature_pair.second, b),
        (Feature::Edge(..), _) => -corner(feature_pair.first, a),
        _ => between.dot(normal).re(),
    }
}
