//! Which parts of a cylinder's rims may touch edges, axes and other rims in the coming step.

use super::candidates::Pair;
use super::features::SIDES;
use super::rims::{Circle, Ellipse, RIM_SECTORS, RimContact, distance_of_rims, rim_contact};
use super::{Feature, FeaturePair, PlacedCollider};
use crate::geometry::constants::GEOMETRY;
use pliant_math::Vec3;

impl Pair<'_> {
    /// Rims of the first collider, a cylinder, against lines of the second.
    pub(super) fn rim_lines(&mut self) {
        let rims = SIDES.map(|end| (end, Circle::of(self.a, end)));
        for line in self.near_lines(self.b, self.a) {
            let ((q, e), radius) = (self.b.line(line), self.b.roundness(line));
            for (end, rim) in &rims {
                let from_center = rim.center - q;
                let foot = from_center.dot(&e);
                let reach = rim.radius + radius + self.margin;
                let beyond = foot.abs() - self.b.half_length(line);
                if beyond > reach || from_center.norm_squared() - foot * foot > reach * reach {
                    continue;
                }
                for half in Ellipse::new(rim, &q, &e).halves().into_iter().flatten() {
                    self.push_rim(FeaturePair { first: Feature::RimHalf(*end, half), second: line }, rim, None);
                }
            }
        }
    }

    /// Rims that cross.
    pub(super) fn rim_rims(&mut self) {
        let circles = |s: &PlacedCollider<f64>| SIDES.map(|end| (end, Circle::of(s, end)));
        let (rims, others) = (circles(self.a), circles(self.b));
        for (end, rim) in &rims {
            for (other_end, other) in &others {
                let reach = rim.radius + other.radius + self.margin;
                if (rim.center - other.center).norm_squared() > reach * reach {
                    continue;
                }
                let n = RIM_SECTORS;
                let distance: [f64; RIM_SECTORS as usize] = std::array::from_fn(|k| distance_of_rims(rim, k as u8, other));
                let at = |k: u8| distance[usize::from(k % n)];
                for k in (0..n).filter(|&k| at(k) <= at(k + 1) && at(k) < at(k + n - 1)) {
                    let feature_pair = FeaturePair { first: Feature::RimSector(*end, k), second: Feature::Rim(*other_end) };
                    self.push_rim(feature_pair, rim, Some(other));
                }
            }
        }
    }

    /// Lists a contact of a rim if the line is there and the normal points out of both solids.
    fn push_rim(&mut self, feature_pair: FeaturePair, rim: &Circle<f64>, other: Option<&Circle<f64>>) {
        let Ok(RimContact { geometry, radial, other_radial, along, sine }) = rim_contact(&feature_pair, self.a, self.b) else {
            return;
        };
        let normal = geometry.normal;
        let out = |x: &Vec3<f64>, sign: f64| sign * x.dot(&normal) >= -GEOMETRY.lean;
        let of_rim = out(&radial, -1.0) && out(&rim.outward(), -1.0);
        let of_other = match (other, other_radial) {
            (Some(other), Some(radial)) => out(&radial, 1.0) && out(&other.outward(), 1.0),
            _ => {
                along.abs() <= self.b.half_length(feature_pair.second) * (1.0 + GEOMETRY.sliver)
                    && self.faces_out(&feature_pair, &normal)
            }
        };
        if geometry.gap <= self.margin
            && sine >= GEOMETRY.parallel_lines
            && of_rim
            && of_other
            && self.shared(&feature_pair, &geometry)
        {
            self.found.push((feature_pair, self.swapped));
        }
    }
}
