//! Which features of two colliders may meet in the coming step.

use super::features::{SIDES, TOP, face_side};
use super::overlap::depth;
use super::{ColliderShape, ContactGeometry, Feature, FeaturePair, PlacedCollider, contact_geometry};
use crate::geometry::constants::GEOMETRY;
use pliant_math::Vec3;

/// Whether two forms stand in the order that [`candidates`] wants: the first may be thought of as points and lines.
fn in_order(a: &ColliderShape, b: &ColliderShape) -> bool {
    let rank = |form: &ColliderShape| match form {
        ColliderShape::Ball => 0,
        ColliderShape::Capsule => 1,
        ColliderShape::Cylinder => 2,
        ColliderShape::Block | ColliderShape::Hull(_) => 3,
        ColliderShape::HalfSpace => 4,
    };
    rank(a) <= rank(b)
}

/// Lists the spots of a pair that are nearer than `margin` \[m\]: each with `false`, or with `true` where the colliders change places
/// (the first of the spot is then the second of the pair). Nothing for two half spaces.
///
/// Of two colliders that touch or nearly do, the least gap is their distance; far apart, two corners or a corner and an edge may be nearest,
/// and have no spot.
/// A cylinder's rim is its deepest point over faces to which it leans, eight points on those where it stands, and the circle itself against
/// balls, edges, axes and other rims.
pub fn candidates(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>, margin: f64, found: &mut Vec<(FeaturePair, bool)>) {
    if a.form == ColliderShape::HalfSpace && b.form == ColliderShape::HalfSpace {
        return;
    }
    if in_order(&a.form, &b.form) {
        Pair { a, b, margin, swapped: false, found }.list();
    } else {
        Pair { a: b, b: a, margin, swapped: true, found }.list();
    }
}

pub(super) struct Pair<'a> {
    pub a: &'a PlacedCollider<f64>,
    pub b: &'a PlacedCollider<f64>,
    pub margin: f64,
    pub swapped: bool,
    pub found: &'a mut Vec<(FeaturePair, bool)>,
}

impl Pair<'_> {
    fn list(&mut self) {
        let round = matches!(self.a.form, ColliderShape::Ball | ColliderShape::Capsule);
        for k in 0..self.a.form.n_points() {
            let first = self.a.form.point(k);
            if round { self.whole(first) } else { self.sharp(first) }
        }
        match (&self.a.form, &self.b.form) {
            (ColliderShape::Cylinder, ColliderShape::HalfSpace) => self.rims(),
            (ColliderShape::Cylinder, ColliderShape::Block | ColliderShape::Hull(_) | ColliderShape::Cylinder) => {
                self.rims();
                self.lines();
                self.rim_lines();
                if self.b.form == ColliderShape::Cylinder {
                    self.rim_rims();
                }
                self.the_other_way();
            }
            (
                ColliderShape::Capsule,
                ColliderShape::Cylinder | ColliderShape::Block | ColliderShape::Hull(_) | ColliderShape::Capsule,
            )
            | (ColliderShape::Block | ColliderShape::Hull(_), ColliderShape::Block | ColliderShape::Hull(_)) => {
                self.lines();
                self.the_other_way();
            }
            _ => {}
        }
    }

    /// Features of the first collider that points of the second touch.
    fn other_points(&mut self) {
        if self.a.form == ColliderShape::Cylinder && matches!(self.b.form, ColliderShape::Capsule | ColliderShape::Cylinder) {
            self.rim_lines();
        }
        if self.a.form == ColliderShape::Cylinder && self.b.form == ColliderShape::Capsule {
            return;
        }
        let round = matches!(self.a.form, ColliderShape::Ball | ColliderShape::Capsule);
        for k in 0..self.a.form.n_points() {
            let first = self.a.form.point(k);
            match (round, &self.b.form) {
                (true, _) | (_, ColliderShape::Ball | ColliderShape::Capsule) => self.whole(first),
                _ => self.sharp(first),
            }
        }
        if self.a.form == ColliderShape::Cylinder && self.b.form == ColliderShape::Cylinder {
            self.rims();
        }
    }

    fn the_other_way(&mut self) {
        Pair { a: self.b, b: self.a, margin: self.margin, swapped: !self.swapped, found: self.found }.other_points();
    }

    fn push(&mut self, first: Feature, second: Feature) {
        let feature_pair = FeaturePair { first, second };
        if contact_geometry(&feature_pair, self.a, self.b).is_ok_and(|m| m.gap <= self.margin) {
            self.found.push((feature_pair, self.swapped));
        }
    }

    /// A point against all of the second solid.
    fn whole(&mut self, first: Feature) {
        match self.b.form {
            ColliderShape::HalfSpace => self.push(first, Feature::Face(TOP)),
            _ => self.push(first, Feature::Whole),
        }
    }

    /// A sharp point against the face under it.
    fn sharp(&mut self, first: Feature) {
        if self.b.form == ColliderShape::HalfSpace {
            if !self.rolls(first, TOP) {
                self.push(first, Feature::Face(TOP));
            }
            return;
        }
        let y = self.b.local(&self.a.point(first));
        let sizes = self.b.sizes;
        if self.b.form == ColliderShape::Cylinder {
            let radial = y[0].hypot(y[1]);
            let (beside, beyond) = (radial - sizes[0], y[2].abs() - sizes[1]);
            let sliver = GEOMETRY.sliver * sizes[0];
            let end = if y[2] < 0.0 { TOP - 1 } else { TOP };
            if beside >= beyond && beyond <= sliver && radial > 0.0 {
                // a rim touches the side as a circle
                if !matches!(first, Feature::RimPoint(..)) {
                    self.push(first, Feature::Side);
                }
            } else if beyond > beside && beside <= sliver && !self.rolls(first, end) {
                self.push(first, Feature::Face(end));
            }
            return;
        }
        let face = match &self.b.form {
            ColliderShape::Hull(p) => p.highest(&y).0 as u16,
            _ => {
                let beyond = |k: usize| y[k].abs() - sizes[k];
                let k = (0..3).max_by(|i, j| beyond(*i).total_cmp(&beyond(*j))).unwrap_or(2);
                2 * k as u16 + u16::from(y[k] >= 0.0)
            }
        };
        if self.is_over(face, &y, GEOMETRY.sliver) && !self.rolls(first, face) {
            self.push(first, Feature::Face(face));
        }
    }

    /// Whether a rim's fixed point is not wanted on a face because the rim's deepest point says all: the cylinder leans.
    fn rolls(&self, first: Feature, face: u16) -> bool {
        matches!(first, Feature::RimPoint(..)) && self.tilt(face) > GEOMETRY.leaning
    }

    /// Whether a point in the second solid's frame lies over a face of it, or beside it by no more than `sliver`, a part of its size.
    fn is_over(&self, face: u16, y: &Vec3<f64>, sliver: f64) -> bool {
        let [sx, sy, sz] = self.b.sizes;
        match &self.b.form {
            ColliderShape::HalfSpace => true,
            ColliderShape::Cylinder => y[0].hypot(y[1]) <= sx * (1.0 + sliver),
            ColliderShape::Hull(p) => p.is_over(usize::from(face), y, sliver * p.reach),
            _ => (0..3).all(|i| i == face_side(face).0 || y[i].abs() - [sx, sy, sz][i] <= sliver * [sx, sy, sz][i]),
        }
    }

    /// Sine of the angle between the first solid's axis and a face's normal.
    fn tilt(&self, face: u16) -> f64 {
        let (_, normal) = self.b.face(face);
        self.a.axis(2).cross(&normal).norm()
    }

    /// Deepest points of a cylinder's rims over the faces they are above.
    fn rims(&mut self) {
        let faces = match &self.b.form {
            ColliderShape::HalfSpace => TOP..TOP + 1,
            ColliderShape::Cylinder => TOP - 1..TOP + 1,
            polyhedron => 0..polyhedron.counts()[2],
        };
        for face in faces {
            if self.tilt(face) <= GEOMETRY.leaning {
                continue;
            }
            for end in SIDES {
                let feature_pair = FeaturePair { first: Feature::Rim(end), second: Feature::Face(face) };
                let Ok(m) = contact_geometry(&feature_pair, self.a, self.b) else { continue };
                // the rim's lowest point, not that of the far end of a cylinder that passes by
                let over = self.is_over(face, &self.b.local(&m.point), 0.0);
                if over && m.gap <= self.margin && m.gap > -self.depth() && self.shared(&feature_pair, &m) {
                    self.found.push((feature_pair, self.swapped));
                }
            }
        }
    }

    /// How deep a meeting may be before it is one through the whole solid.
    fn depth(&self) -> f64 {
        match &self.b.form {
            ColliderShape::HalfSpace => f64::INFINITY,
            ColliderShape::Hull(p) => p.half_width,
            ColliderShape::Block => self.b.sizes.iter().copied().fold(f64::INFINITY, f64::min),
            _ => self.b.sizes[0].min(self.b.sizes[1]),
        }
    }

    /// Edges and axes that cross.
    fn lines(&mut self) {
        let (first, second) = (self.near_lines(self.a, self.b), self.near_lines(self.b, self.a));
        for &first in &first {
            second.iter().for_each(|&second| self.crossing(first, second));
        }
    }

    /// Lines of a collider; of edges those that reach the ball around the other one.
    pub(super) fn near_lines(&self, of: &PlacedCollider<f64>, other: &PlacedCollider<f64>) -> Vec<Feature> {
        let edges = of.form.counts()[1];
        if edges == 0 {
            return vec![Feature::Axis];
        }
        let near = |edge: &Feature| {
            let distance = (of.line(*edge).0 - other.position).norm();
            distance <= of.half_length(*edge) + other.reach() + self.margin
        };
        (0..edges).map(Feature::Edge).filter(near).collect()
    }

    fn crossing(&mut self, first: Feature, second: Feature) {
        let ((p, d), (q, e)) = (self.a.line(first), self.b.line(second));
        let cross = d.cross(&e);
        if cross.norm() < GEOMETRY.parallel_lines {
            return;
        }
        let (reach_a, reach_b) = (self.a.half_length(first), self.b.half_length(second));
        let between = p - q;
        let square = cross.norm_squared();
        let s = -between.cross(&e).dot(&cross) / square;
        let t = -between.cross(&d).dot(&cross) / square;
        if s.abs() > reach_a * (1.0 + GEOMETRY.sliver) || t.abs() > reach_b * (1.0 + GEOMETRY.sliver) {
            return;
        }
        let feature_pair = FeaturePair { first, second };
        let Ok(m) = contact_geometry(&feature_pair, self.a, self.b) else { return };
        let half_width = |s: &PlacedCollider<f64>| if let ColliderShape::Hull(p) = &s.form { p.half_width } else { s.sizes[0] };
        let depth = half_width(self.a).min(half_width(self.b));
        if m.gap <= self.margin && m.gap > -depth && self.faces_out(&feature_pair, &m.normal) && self.shared(&feature_pair, &m) {
            self.found.push((feature_pair, self.swapped));
        }
    }

    /// Whether a contact that penetrates lies within both solids: otherwise it is one on the far side of a solid that is passed. Edges of
    /// hulls may be acute, and their normals need not point into the hull: they are bounded by its least width.
    pub(super) fn shared(&self, feature_pair: &FeaturePair, m: &ContactGeometry<f64>) -> bool {
        let outside = GEOMETRY.lean * -m.gap + GEOMETRY.sliver * self.a.reach().min(self.b.reach());
        let within = |feature: Feature, s: &PlacedCollider<f64>| match (feature, &s.form) {
            (Feature::Edge(_), ColliderShape::Hull(p)) => m.gap > -p.half_width,
            _ => depth(s, &m.point) >= -outside,
        };
        m.gap >= 0.0 || (within(feature_pair.first, self.a) && within(feature_pair.second, self.b))
    }

    /// Whether the normal lies between those of the two faces at each edge: otherwise other features are nearer.
    pub(super) fn faces_out(&self, feature_pair: &FeaturePair, normal: &Vec3<f64>) -> bool {
        let at = |feature: Feature, collider: &PlacedCollider<f64>, sign: f64| match feature {
            Feature::Edge(edge) => collider.conormals(edge).iter().all(|across| sign * across.dot(normal) >= -GEOMETRY.lean),
            _ => true,
        };
        at(feature_pair.first, self.a, -1.0) && at(feature_pair.second, self.b, 1.0)
    }
}
