//! Which features of two colliders may meet in the coming step.

use super::features::{EDGES, SIDES};
use super::{ColliderShape, Feature, FeaturePair, PlacedCollider, contact_geometry};
use crate::geometry::constants::GEOMETRY;

/// Whether two forms stand in the order that [`candidates`] wants: the first may be thought of as points and lines.
fn in_order(a: ColliderShape, b: ColliderShape) -> bool {
    let rank = |form| match form {
        ColliderShape::Ball => 0,
        ColliderShape::Capsule => 1,
        ColliderShape::Cylinder => 2,
        ColliderShape::Block => 3,
        ColliderShape::HalfSpace => 4,
    };
    rank(a) <= rank(b)
}

/// Lists the spots of a pair that are nearer than `margin` \[m\]: each with `false`, or with `true` where the colliders change places
/// (the first of the spot is then the second of the pair). Nothing for two half spaces.
///
/// Of two colliders that touch or nearly do, the least gap is their distance; far apart, two corners or a corner and an edge may be nearest,
/// and have no spot.
/// A cylinder's rim is its deepest point over faces, and an octagon against everything else.
pub fn candidates(a: &PlacedCollider<f64>, b: &PlacedCollider<f64>, margin: f64, found: &mut Vec<(FeaturePair, bool)>) {
    if a.form == ColliderShape::HalfSpace && b.form == ColliderShape::HalfSpace {
        return;
    }
    if in_order(a.form, b.form) {
        Pair { a, b, margin, swapped: false, found }.list();
    } else {
        Pair { a: b, b: a, margin, swapped: true, found }.list();
    }
}

struct Pair<'a> {
    a: &'a PlacedCollider<f64>,
    b: &'a PlacedCollider<f64>,
    margin: f64,
    swapped: bool,
    found: &'a mut Vec<(FeaturePair, bool)>,
}

impl Pair<'_> {
    fn list(&mut self) {
        let round = matches!(self.a.form, ColliderShape::Ball | ColliderShape::Capsule);
        for &first in self.a.form.points() {
            if round { self.whole(first) } else { self.sharp(first) }
        }
        match (self.a.form, self.b.form) {
            (ColliderShape::Cylinder, ColliderShape::HalfSpace) => self.rims(),
            (ColliderShape::Cylinder, ColliderShape::Block | ColliderShape::Cylinder) => {
                self.rims();
                self.lines();
                self.the_other_way();
            }
            (ColliderShape::Capsule, ColliderShape::Cylinder | ColliderShape::Block | ColliderShape::Capsule)
            | (ColliderShape::Block, ColliderShape::Block) => {
                self.lines();
                self.the_other_way();
            }
            _ => {}
        }
    }

    /// Features of the first collider that points of the second touch.
    fn other_points(&mut self) {
        let round = matches!(self.a.form, ColliderShape::Ball | ColliderShape::Capsule);
        for &first in self.a.form.points() {
            match (round, self.b.form) {
                (true, _) | (_, ColliderShape::Ball | ColliderShape::Capsule) => self.whole(first),
                _ => self.sharp(first),
            }
        }
        if (self.a.form, self.b.form) == (ColliderShape::Cylinder, ColliderShape::Cylinder) {
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
            ColliderShape::HalfSpace => self.push(first, Feature::Face(2, 1)),
            _ => self.push(first, Feature::Whole),
        }
    }

    /// A sharp point against the face under it.
    fn sharp(&mut self, first: Feature) {
        if self.b.form == ColliderShape::HalfSpace {
            if !self.rolls(first, 2, 1) {
                self.push(first, Feature::Face(2, 1));
            }
            return;
        }
        let y = self.b.local(&self.a.point(first));
        let sizes = self.b.sizes;
        if self.b.form == ColliderShape::Cylinder {
            let radial = y[0].hypot(y[1]);
            let (beside, beyond) = (radial - sizes[0], y[2].abs() - sizes[1]);
            let sliver = GEOMETRY.sliver * sizes[0];
            if beside >= beyond && beyond <= sliver && radial > 0.0 {
                self.push(first, Feature::Side);
            } else if beyond > beside && beside <= sliver {
                self.push(first, Feature::Face(2, if y[2] < 0.0 { -1 } else { 1 }));
            }
            return;
        }
        let beyond = |k: usize| y[k].abs() - sizes[k];
        let k = (0..3).max_by(|i, j| beyond(*i).total_cmp(&beyond(*j))).unwrap_or(2);
        let side = if y[k] < 0.0 { -1 } else { 1 };
        let over = (0..3).all(|i| i == k || beyond(i) <= GEOMETRY.sliver * sizes[i]);
        if over && !self.rolls(first, k, side) {
            self.push(first, Feature::Face(k as u8, side));
        }
    }

    /// Whether a rim's fixed point is not wanted on a face because the rim's deepest point says all: the cylinder leans.
    fn rolls(&self, first: Feature, k: usize, side: i8) -> bool {
        matches!(first, Feature::RimPoint(..)) && self.tilt(k, side) > GEOMETRY.leaning
    }

    /// Sine of the angle between the first solid's axis and a face's normal.
    fn tilt(&self, k: usize, side: i8) -> f64 {
        let (_, normal) = self.b.face(k as u8, side);
        self.a.axis(2).cross(&normal).norm()
    }

    /// Deepest points of a cylinder's rims over the faces they are above.
    fn rims(&mut self) {
        let (axes, sides) = match self.b.form {
            ColliderShape::HalfSpace => (2..3, &SIDES[1..]),
            ColliderShape::Cylinder => (2..3, &SIDES[..]),
            _ => (0..3, &SIDES[..]),
        };
        for (k, side) in axes.flat_map(|k| sides.iter().map(move |side| (k, *side))) {
            if self.tilt(k, side) <= GEOMETRY.leaning {
                continue;
            }
            for end in SIDES {
                let feature_pair = FeaturePair { first: Feature::Rim(end), second: Feature::Face(k as u8, side) };
                let Ok(m) = contact_geometry(&feature_pair, self.a, self.b) else { continue };
                // the rim's lowest point, not that of the far end of a cylinder that passes by
                let y = self.b.local(&m.point);
                let [sx, sy, sz] = self.b.sizes;
                let over = match self.b.form {
                    ColliderShape::HalfSpace => true,
                    ColliderShape::Cylinder => y[0].hypot(y[1]) <= sx,
                    _ => (0..3).all(|i| i == k || y[i].abs() <= [sx, sy, sz][i]),
                };
                if over && m.gap <= self.margin && m.gap > -self.depth() {
                    self.found.push((feature_pair, self.swapped));
                }
            }
        }
    }

    /// How deep a meeting may be before it is one through the whole solid.
    fn depth(&self) -> f64 {
        match self.b.form {
            ColliderShape::HalfSpace => f64::INFINITY,
            ColliderShape::Block => self.b.sizes.iter().copied().fold(f64::INFINITY, f64::min),
            _ => self.b.sizes[0].min(self.b.sizes[1]),
        }
    }

    /// Edges and axes that cross.
    fn lines(&mut self) {
        let lines = |form| match form {
            ColliderShape::Block => &EDGES[..],
            _ => &[Feature::Axis],
        };
        for &first in lines(self.a.form) {
            for &second in lines(self.b.form) {
                self.crossing(first, second);
            }
        }
    }

    fn crossing(&mut self, first: Feature, second: Feature) {
        let ((p, d), (q, e)) = (self.a.line(first), self.b.line(second));
        let cross = d.cross(&e);
        if cross.norm() < GEOMETRY.parallel_lines {
            return;
        }
        let feature_pair = FeaturePair { first, second };
        let Ok(m) = contact_geometry(&feature_pair, self.a, self.b) else { return };
        let (reach_a, reach_b) = (self.a.half_length(first), self.b.half_length(second));
        let between = p - q;
        let square = cross.norm_squared();
        let s = -between.cross(&e).dot(&cross) / square;
        let t = -between.cross(&d).dot(&cross) / square;
        let within = s.abs() <= reach_a * (1.0 + GEOMETRY.sliver) && t.abs() <= reach_b * (1.0 + GEOMETRY.sliver);
        let depth = self.a.sizes[0].min(self.b.sizes[0]);
        if within && m.gap <= self.margin && m.gap > -depth && self.faces_out(&feature_pair, &m.normal) {
            self.found.push((feature_pair, self.swapped));
        }
    }

    /// Whether the normal lies between those of the two faces at each edge: otherwise other features are nearer.
    fn faces_out(&self, feature_pair: &FeaturePair, normal: &pliant_math::Vec3<f64>) -> bool {
        let at = |feature: Feature, collider: &PlacedCollider<f64>, sign: f64| match feature {
            Feature::Edge(k, sides) => (0..2).all(|i| {
                let axis = collider.axis((usize::from(k) + 1 + i) % 3);
                sign * f64::from(sides[i]) * axis.dot(normal) >= -GEOMETRY.lean
            }),
            _ => true,
        };
        at(feature_pair.first, self.a, -1.0) && at(feature_pair.second, self.b, 1.0)
    }
}
