//! A cylinder's rim against a straight line (an edge, or the axis of a capsule or of another cylinder) and against another rim.
//!
//! The points where the rim may touch are those whose distance to the other curve is least among their neighbours on the rim. With the
//! rim x(φ) = c + R u(φ), its tangent d(φ) = u′, the nearest point y(φ) of the other curve, and Δ = x − y, they are the roots of
//! ```text
//! F(φ) = Δ·d = 0   with   F′ = R − Δ·u − R (d·e)² K > 0,   e: tangent of the other curve at y,
//! K = 1 against a line, R₂/|y's distance from its axis before projection| against a rim of radius R₂
//! ```
//! The root is found in double precision. One step of Newton's method in the scalar at hand then carries its derivatives:
//! φ = φ* − (F − F*)/F′, with F* the value of F without its derivatives.

use super::contact_geometry::{ContactGeometry, apart, middle};
use super::{Feature, FeaturePair, PlacedCollider};
use crate::geometry::constants::GEOMETRY;
use pliant_math::{Real, Vec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Parts of a rim in which crossings with another rim are told apart.
pub(super) const RIM_SECTORS: u8 = 32;

/// How a rim touches a line or another rim.
pub(super) struct RimContact<S> {
    pub geometry: ContactGeometry<S>,
    /// Outward unit vector from the rim's centre to its point.
    pub radial: Vec3<S>,
    /// The same of the other rim.
    pub other_radial: Option<Vec3<S>>,
    /// Where the line's point is, from its middle \[m\].
    pub along: S,
    /// Sine between the two tangents [-].
    pub sine: f64,
}

/// The contact of a [`Feature::RimHalf`] with a line, or of a [`Feature::RimSector`] with a rim; the length or sine that is too small
/// where there is none.
pub(super) fn rim_contact<S: Real>(
    feature_pair: &FeaturePair,
    a: &PlacedCollider<S>,
    b: &PlacedCollider<S>,
) -> Result<RimContact<S>, f64> {
    match (feature_pair.first, feature_pair.second) {
        (Feature::RimHalf(end, half), line) => rim_line(&Circle::of(a, end), half, b, line),
        (Feature::RimSector(end, sector), Feature::Rim(other)) => {
            rim_rim(&Circle::of(a, end), f64::from(sector) * TAU / f64::from(RIM_SECTORS), &Circle::of(b, other))
        }
        _ => Err(f64::NAN),
    }
}

/// The circle round the end of a cylinder.
pub(super) struct Circle<S> {
    pub center: Vec3<S>,
    /// Two directions in its plane, and the cylinder's axis.
    axes: [Vec3<S>; 3],
    /// −1 or 1: the end's outward normal is the axis times this.
    end: f64,
    pub radius: S,
}

impl<S: Real> Circle<S> {
    pub fn of(s: &PlacedCollider<S>, end: i8) -> Self {
        let axes = [0, 1, 2].map(|k| s.axis(k));
        let end = f64::from(end);
        Self { center: s.position + axes[2] * (s.sizes[1] * end), axes, end, radius: s.sizes[0] }
    }

    /// Without derivatives.
    fn re(&self) -> Circle<f64> {
        Circle { center: re(&self.center), axes: self.axes.map(|x| re(&x)), end: self.end, radius: self.radius.re() }
    }

    /// The unit vector from the centre at an angle given by its cosine and sine, and the tangent there.
    fn at(&self, cosine: f64, sine: f64) -> (Vec3<S>, Vec3<S>) {
        let [x, y, _] = &self.axes;
        let (c, s) = (S::from(cosine), S::from(sine));
        (x * c + y * s, y * c - x * s)
    }

    /// The outward normal of the end.
    pub fn outward(&self) -> Vec3<S> {
        self.axes[2] * S::from(self.end)
    }

    /// The unit vector from the centre towards a point, and the point's distance from the axis.
    fn towards(&self, x: &Vec3<S>) -> Result<(Vec3<S>, S), f64> {
        let from_center = x - self.center;
        let across = from_center - self.axes[2] * from_center.dot(&self.axes[2]);
        let length = across.dot(&across).sqrt();
        if length.re() < GEOMETRY.min_distance || !length.re().is_finite() {
            return Err(length.re());
        }
        Ok((across * length.recip(), length))
    }
}

fn re<S: Real>(x: &Vec3<S>) -> Vec3<f64> {
    x.map(|x| x.re())
}

/// The point of a rim at a root, and what is nearest to it on the other curve.
struct Root<S> {
    x: Vec3<S>,
    radial: Vec3<S>,
    tangent: Vec3<S>,
    y: Vec3<S>,
}

impl<S: Real> Root<S> {
    /// From the root without derivatives: cosine and sine of its angle, and F′ \[m\].
    fn new(
        rim: &Circle<S>,
        [c, s]: [f64; 2],
        slope: f64,
        nearest: impl Fn(&Vec3<S>) -> Result<Vec3<S>, f64>,
    ) -> Result<Self, f64> {
        if slope < GEOMETRY.min_distance || !slope.is_finite() {
            return Err(slope);
        }
        let (radial, tangent) = rim.at(c, s);
        let x = rim.center + radial * rim.radius;
        let f = (x - nearest(&x)?).dot(&tangent);
        let turned = (S::from(f.re()) - f) / S::from(slope);
        let (radial, tangent) = (radial + tangent * turned, tangent - radial * turned);
        let x = rim.center + radial * rim.radius;
        Ok(Self { x, radial, tangent, y: nearest(&x)? })
    }

    /// Contact with a sharp curve that has the tangent `e`: along the common perpendicular, out of the rim's solid on the second's side.
    fn sharp(&self, rim: &Circle<S>, e: &Vec3<S>) -> Result<(ContactGeometry<S>, f64), f64> {
        let cross = self.tangent.cross(e);
        let sine = cross.dot(&cross).sqrt();
        if sine.re() < GEOMETRY.min_distance || !sine.re().is_finite() {
            return Err(sine.re());
        }
        let normal = cross * (sine.recip() * self.side(rim, &cross));
        let gap = (self.x - self.y).dot(&normal);
        Ok((ContactGeometry { gap, normal, point: (self.x + self.y) * S::from(0.5) }, sine.re()))
    }

    /// Contact with a curve thick by `radius`.
    fn round(&self, rim: &Circle<S>, radius: S) -> Result<ContactGeometry<S>, f64> {
        let d = self.x - self.y;
        let side = self.side(rim, &d);
        if side > 0.0 {
            return apart(self.x, S::from(0.0), d, radius);
        }
        // the axis itself is within the cylinder
        let apart = apart(self.x, S::from(0.0), d, S::from(0.0))?;
        Ok(middle(self.x, S::from(0.0), -apart.gap - radius, -apart.normal))
    }

    /// 1 or −1: what a vector across the rim must be multiplied by to point into its solid.
    fn side(&self, rim: &Circle<S>, across: &Vec3<S>) -> f64 {
        let out = re(&self.radial) + re(&rim.outward());
        if out.dot(&re(across)) > 0.0 { -1.0 } else { 1.0 }
    }
}

fn rim_line<S: Real>(rim: &Circle<S>, half: i8, b: &PlacedCollider<S>, line: Feature) -> Result<RimContact<S>, f64> {
    let (q, e) = b.line(line);
    let bare = rim.re();
    let radial = Ellipse::new(&bare, &re(&q), &re(&e)).radial(half);
    let to_line = |x: &Vec3<f64>| (x - re(&q)) - re(&e) * (x - re(&q)).dot(&re(&e));
    let tangent = bare.axes[2].cross(&radial);
    let along_tangent = tangent.dot(&re(&e));
    let offset = to_line(&(bare.center + radial * bare.radius));
    let slope = bare.radius * (1.0 - along_tangent * along_tangent) - offset.dot(&radial);
    let angle = [0, 1].map(|k| bare.axes[k].dot(&radial));
    let root = Root::new(rim, angle, slope, |x| Ok(q + e * (x - q).dot(&e)))?;
    let along = (root.y - q).dot(&e);
    let (geometry, sine) = match line {
        Feature::Edge(_) => root.sharp(rim, &e)?,
        _ => (root.round(rim, b.roundness(line))?, 1.0),
    };
    Ok(RimContact { geometry, radial: root.radial, other_radial: None, along, sine })
}

fn rim_rim<S: Real>(rim: &Circle<S>, start: f64, other: &Circle<S>) -> Result<RimContact<S>, f64> {
    let (bare, bare_other) = (rim.re(), other.re());
    let (angle, slope) = crossing_of_rims(&bare, start, &bare_other)?;
    let nearest = |x: &Vec3<S>| other.towards(x).map(|(u, _)| other.center + u * other.radius);
    let root = Root::new(rim, [angle.cos(), angle.sin()], slope, nearest)?;
    let (other_radial, _) = other.towards(&root.x)?;
    let (geometry, sine) = root.sharp(rim, &other.axes[2].cross(&other_radial))?;
    Ok(RimContact { geometry, radial: root.radial, other_radial: Some(other_radial), along: S::from(0.0), sine })
}

/// The square of the distance of a rim's point from another rim \[m²\].
pub(super) fn distance_of_rims(rim: &Circle<f64>, sector: u8, other: &Circle<f64>) -> f64 {
    let angle = f64::from(sector) * TAU / f64::from(RIM_SECTORS);
    let from_center = rim.center + rim.at(angle.cos(), angle.sin()).0 * rim.radius - other.center;
    let height = from_center.dot(&other.axes[2]);
    let beside = (from_center.norm_squared() - height * height).max(0.0).sqrt() - other.radius;
    height * height + beside * beside
}

/// The angle of the root of F that is nearest to a start, and F′ \[m\]: by Newton's method with steps of at most a sector.
fn crossing_of_rims(rim: &Circle<f64>, start: f64, other: &Circle<f64>) -> Result<(f64, f64), f64> {
    let most = TAU / f64::from(RIM_SECTORS);
    let at = |angle: f64| -> Result<(f64, f64), f64> {
        let (radial, tangent) = rim.at(angle.cos(), angle.sin());
        let x = rim.center + radial * rim.radius;
        let (u, length) = other.towards(&x)?;
        let apart = x - other.center - u * other.radius;
        let along = tangent.dot(&other.axes[2].cross(&u));
        let slope = rim.radius - apart.dot(&radial) - rim.radius * other.radius / length * along * along;
        Ok((apart.dot(&tangent), slope))
    };
    let (mut angle, mut last) = (start, false);
    for _ in 0..GEOMETRY.rim_iterations {
        let (f, slope) = at(angle)?;
        let step = if slope > 0.0 { (f / slope).clamp(-most, most) } else { most.copysign(f) };
        angle -= step;
        if last {
            return Ok((angle, at(angle)?.1));
        }
        // the next step is exact to rounding
        last = step.abs() <= GEOMETRY.sliver;
    }
    Err(0.0)
}

/// A rim seen along a line, in radii: an ellipse with half axes 1 and √(1 − s²), s the sine between the line and the rim's axis, and the
/// line a point (x, y). With Y = √(1 − s²) y and the angle φ of a point of the rim, F is
/// ```text
/// F/R = x sin φ − Y cos φ − s² sin φ cos φ
/// ```
/// Of its roots one is the point nearest to the line, on the half to which sign Y points. Where the line is within the ellipse's evolute,
/// x^⅔ + Y^⅔ < s^{4/3}, the other half has a root as well: a line parallel to the end and over it crosses the rim twice, and both
/// crossings carry.
pub(super) struct Ellipse {
    /// Unit vector in the rim's plane across the line, and one along the line's shadow.
    across: Vec3<f64>,
    along: Vec3<f64>,
    x: f64,
    y: f64,
    s2: f64,
}

impl Ellipse {
    pub fn new(rim: &Circle<f64>, q: &Vec3<f64>, e: &Vec3<f64>) -> Self {
        let axis = &rim.axes[2];
        let shadow = e - axis * axis.dot(e);
        // a line along the axis sees a circle, whose directions are all alike
        let along = shadow.try_normalize(GEOMETRY.min_distance).unwrap_or(rim.axes[0]);
        let across = axis.cross(&along);
        let from_center = q - rim.center;
        let d = (from_center - e * from_center.dot(e)) / rim.radius;
        Self { across, along, x: across.dot(&d), y: along.dot(&d), s2: shadow.norm_squared() }
    }

    /// The unit vector from the centre to the root on a half; to the nearest point where that half has none.
    fn radial(&self, half: i8) -> Vec3<f64> {
        let half = f64::from(half);
        match self.crossing() {
            Some(angle) if half != self.near_half() => self.at(angle, half),
            _ => self.at(self.nearest(), if self.y == 0.0 { half } else { self.near_half() }),
        }
    }

    /// The halves to be listed.
    pub fn halves(&self) -> [Option<i8>; 2] {
        if self.s2 < GEOMETRY.halved {
            return [Some(1), None];
        }
        let near = self.near_half() as i8;
        [Some(near), self.crossing().map(|_| -near)]
    }

    /// The half with the nearest point.
    fn near_half(&self) -> f64 {
        1f64.copysign(self.y)
    }

    fn at(&self, angle: f64, half: f64) -> Vec3<f64> {
        self.across * angle.cos().copysign(self.x) + self.along * (half * angle.sin())
    }

    /// The angle of the nearest point in its quadrant: there F rises through its only root.
    fn nearest(&self) -> f64 {
        let (x, y, s2) = (self.x.abs(), self.y.abs(), self.s2);
        let low = if x < s2 { (x / s2).acos() } else { 0.0 };
        root_of(|c, s| x * s - y * c - s2 * s * c, |c, s| x * c + y * s - s2 * (c * c - s * s), low.max(y.atan2(x)), FRAC_PI_2)
    }

    /// The angle of the root on the other half, in the quadrant of the nearest one.
    fn crossing(&self) -> Option<f64> {
        let (x, y, s2) = (self.x.abs(), self.y.abs(), self.s2);
        let (root_x, root_y) = (x.cbrt(), y.cbrt());
        let within = root_x * root_x + root_y * root_y < s2.cbrt().powi(2);
        within.then(|| {
            let high = (x / s2).acos();
            root_of(|c, s| x * s + y * c - s2 * s * c, |c, s| x * c - y * s - s2 * (c * c - s * s), high, root_y.atan2(root_x))
        })
    }
}

/// The root of a rising function of an angle, of which it gets cosine and sine, between a start and another bound: by Newton's method
/// kept between the two.
fn root_of(f: impl Fn(f64, f64) -> f64, slope: impl Fn(f64, f64) -> f64, start: f64, bound: f64) -> f64 {
    let (mut below, mut above) = (start.min(bound), start.max(bound));
    let mut angle = start;
    for _ in 0..GEOMETRY.rim_iterations {
        let (s, c) = angle.sin_cos();
        let value = f(c, s);
        if value > 0.0 {
            above = angle;
        } else {
            below = angle;
        }
        let newton = angle - value / slope(c, s);
        let next = if newton >= below && newton <= above { newton } else { 0.5 * (below + above) };
        let done = (next - angle).abs() <= 2.0 * f64::EPSILON;
        angle = next;
        if done {
            break;
        }
    }
    angle
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::collider::{ColliderShape, Polyhedron, Pose, candidates, contact_geometry};
    use nalgebra::{Matrix3, Rotation3};
    use num_dual::DualSVec64;
    use std::sync::Arc;

    type Dual = DualSVec64<8>;

    /// Uniform in −1 to 1.
    struct Chance(u64);
    impl Chance {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
        fn vector(&mut self) -> Vec3<f64> {
            Vec3::from_fn(|_, _| self.next())
        }
    }

    fn placed(form: ColliderShape, sizes: [f64; 3], position: Vec3<f64>, turn: Vec3<f64>) -> PlacedCollider<f64> {
        PlacedCollider { form, rotation: Rotation3::new(turn).into_inner(), position, sizes }
    }

    /// A collider displaced by a twist, its radius by the seventh entry.
    fn displaced(s: &PlacedCollider<f64>, by: &[f64; 7]) -> PlacedCollider<f64> {
        let turn: Matrix3<f64> = Rotation3::new(Vec3::new(by[0], by[1], by[2])).into_inner();
        let mut sizes = s.sizes;
        sizes[0] += by[6];
        let shift = Vec3::new(by[3], by[4], by[5]);
        PlacedCollider { form: s.form.clone(), rotation: turn * s.rotation, position: turn * s.position + shift, sizes }
    }

    fn seeded(s: &PlacedCollider<f64>, moves: bool) -> PlacedCollider<Dual> {
        let seeds: [Dual; 6] = std::array::from_fn(|k| if moves { Dual::from_re(0.0).derivative(k) } else { Dual::from_re(0.0) });
        let pose = Pose { rotation: s.rotation, position: s.position }.displaced(&seeds);
        let mut sizes = s.sizes.map(Dual::from_re);
        if moves {
            sizes[0] = sizes[0].derivative(6);
        }
        PlacedCollider { form: s.form.clone(), rotation: pose.rotation, position: pose.position, sizes }
    }

    fn stone() -> ColliderShape {
        let at = |k: i32| {
            let (z, angle) = (1.0 - (2.0 * f64::from(k) + 1.0) / 14.0, 2.4 * f64::from(k));
            Vec3::new((1.0 - z * z).sqrt() * angle.cos(), (1.0 - z * z).sqrt() * angle.sin(), z) * 0.2
        };
        ColliderShape::Hull(Arc::new(Polyhedron::new(&(0..14).map(at).collect::<Vec<_>>()).unwrap()))
    }

    /// Gap, normal and point as seven numbers.
    fn numbers<S: Real>(m: &ContactGeometry<S>) -> [S; 7] {
        [m.gap, m.normal[0], m.normal[1], m.normal[2], m.point[0], m.point[1], m.point[2]]
    }

    /// In random poses by displacements of either collider and its radius, against central differences.
    #[test]
    fn derivatives_are_those_of_differences() {
        let mut chance = Chance(7);
        let mut seen = [0; 4];
        for trial in 0..6000 {
            let kind = trial % 4;
            let form = [ColliderShape::Block, ColliderShape::Capsule, ColliderShape::Cylinder, stone()][kind].clone();
            let mut size = || 0.2 + 0.1 * chance.next();
            let sizes = [size(), size(), size()];
            let cylinder = placed(ColliderShape::Cylinder, [size(), size(), 0.0], Vec3::zeros(), chance.vector() * 3.0);
            let other = placed(form, sizes, chance.vector() * 0.5, chance.vector() * 3.0);
            let mut found = Vec::new();
            candidates(&cylinder, &other, 0.02, &mut found);
            for (pair, swapped) in found {
                let (a, b) = if swapped { (&other, &cylinder) } else { (&cylinder, &other) };
                if !matches!(pair.first, Feature::RimHalf(..) | Feature::RimSector(..)) {
                    continue;
                }
                // lines that nearly touch the circle from within have large second derivatives
                if rim_contact(&pair, a, b).unwrap().sine < 0.3 || contact_geometry(&pair, a, b).unwrap().gap < -0.05 {
                    continue;
                }
                seen[kind] += 1;
                for side in 0..2 {
                    let dual = contact_geometry(&pair, &seeded(a, side == 0), &seeded(b, side == 1)).unwrap();
                    for k in 0..7 {
                        let at = |step: f64| {
                            let mut by = [0.0; 7];
                            by[k] = step;
                            let moved = |s: &PlacedCollider<f64>, moves| if moves { displaced(s, &by) } else { s.clone() };
                            numbers(&contact_geometry(&pair, &moved(a, side == 0), &moved(b, side == 1)).unwrap())
                        };
                        let step = 1e-5;
                        let (up, down) = (at(step), at(-step));
                        for (n, by) in numbers(&dual).iter().enumerate() {
                            let slope = by.eps.0.map_or(0.0, |e| e[k]);
                            let difference = (up[n] - down[n]) / (2.0 * step);
                            let error = (slope - difference).abs();
                            assert!(error < 1e-5 * (1.0 + slope.abs()), "{pair:?}, {n} by {k} of {side}: {slope} {difference}");
                        }
                    }
                }
            }
        }
        assert!(seen.iter().all(|n| *n > 50), "{seen:?}");
    }

    /// An edge parallel to the end and over it crosses the rim at two points, whichever way it leans; so does a capsule's axis.
    #[test]
    fn a_line_over_an_end_carries_at_both_crossings() {
        let (radius, half) = (0.034, 0.04);
        let cylinder = placed(ColliderShape::Cylinder, [radius, half, 0.0], Vec3::zeros(), Vec3::new(0.0, 0.0, 0.3));
        for lean in [0.0, 1e-13, -1e-13, 1e-9, -1e-9, 1e-6, -1e-6, 1e-4, -1e-4] {
            let beside = 0.02;
            // its lower edge at x = 0.02 goes along y
            let block = placed(
                ColliderShape::Block,
                [0.05, 0.08, 0.03],
                Vec3::new(beside + 0.05, 0.0, half + 0.03 + 1e-6),
                Vec3::new(lean, 0.0, 0.0),
            );
            let capsule = placed(
                ColliderShape::Capsule,
                [0.01, 0.1, 0.0],
                Vec3::new(beside, 0.0, half + 0.01 + 1e-6),
                Vec3::new(FRAC_PI_2 + lean, 0.0, 0.0),
            );
            for other in [block, capsule] {
                let mut found = Vec::new();
                candidates(&cylinder, &other, 1e-4, &mut found);
                found.retain(|(pair, _)| matches!(pair.first, Feature::RimHalf(..)));
                let crossings: Vec<_> =
                    found.iter().map(|(pair, _)| contact_geometry(pair, &cylinder, &other).unwrap()).collect();
                assert_eq!(crossings.len(), 2, "{lean}, {found:?}");
                let reach = (radius * radius - beside * beside).sqrt();
                for m in crossings {
                    assert!((m.point[0] - beside).abs() < 1e-5 && (m.point[1].abs() - reach).abs() < 1e-5, "{lean}: {m:?}");
                    assert!((m.gap - 1e-6 - lean * m.point[1]).abs() < 1e-8, "{lean}: {m:?}");
                    assert!((m.normal + Vec3::z()).norm() < 2.0 * lean.abs() + 1e-12);
                }
            }
        }
    }

    /// Parallel cylinders side by side touch with the rims of the shorter one; standing on each other beside their axes, where their rims
    /// cross.
    #[test]
    fn parallel_cylinders_touch_along_a_line_and_round_a_lens() {
        let low = placed(ColliderShape::Cylinder, [0.03, 0.05, 0.0], Vec3::zeros(), Vec3::zeros());
        let beside =
            placed(ColliderShape::Cylinder, [0.02, 0.03, 0.0], Vec3::new(0.03, 0.04 + 1e-6, 0.0), Vec3::new(0.0, 0.0, 0.7));
        let mut found = Vec::new();
        candidates(&low, &beside, 1e-4, &mut found);
        assert_eq!(found.len(), 2, "{found:?}");
        for (pair, swapped) in &found {
            let (a, b) = if *swapped { (&beside, &low) } else { (&low, &beside) };
            let m = contact_geometry(pair, a, b).unwrap();
            let distance = (0.03_f64 * 0.03 + (0.04_f64 + 1e-6).powi(2)).sqrt() - 0.05;
            assert!((m.gap - distance).abs() < 1e-12 && (m.point[2].abs() - 0.03).abs() < 1e-12, "{m:?}");
        }
        let upon = placed(ColliderShape::Cylinder, [0.03, 0.05, 0.0], Vec3::new(0.0, 0.02, 0.1 + 1e-6), Vec3::new(0.0, 0.0, 0.7));
        found.clear();
        candidates(&low, &upon, 1e-4, &mut found);
        found.retain(|(pair, _)| matches!(pair.first, Feature::RimSector(..)));
        assert_eq!(found.len(), 2, "{found:?}");
        for (pair, _) in &found {
            let m = contact_geometry(pair, &low, &upon).unwrap();
            assert!((m.gap - 1e-6).abs() < 1e-12 && (m.normal + Vec3::z()).norm() < 1e-12, "{m:?}");
            assert!((m.point[0].abs() - (9e-4_f64 - 1e-4).sqrt()).abs() < 1e-12 && (m.point[1] - 0.01).abs() < 1e-12);
        }
    }
}
