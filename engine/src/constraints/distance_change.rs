//! How the meeting of two colliders changes when they are displaced.

use crate::geometry::collider::{
    Collider, ContactGeometry, FeaturePair, PlacedCollider, Pose, carried, contact_geometry, point_over_face,
};
use nalgebra::{Matrix3x6, RowVector6};
use num_dual::DualSVec64;
use pliant_math::Vec3;

/// How a meeting changes with displacements (angular part first): of the first solid, and of the second.
pub(crate) struct Changes {
    pub gap: [RowVector6<f64>; 2],
    pub normal: [Matrix3x6<f64>; 2],
    pub point: [Matrix3x6<f64>; 2],
}

/// The meeting of two features of two colliders, of which the first is given with its pose too, and its [`Changes`]; the distance where there is no
/// normal.
///
/// A ball over a face, which is what most contacts are, is done by hand: with its centre x, which moves by δx,
/// ```text
/// δgap = n · δx,   δn = 0,   δpoint = δx − n δgap/2
/// ```
pub(crate) fn contact_geometry_changes(
    feature_pair: &FeaturePair,
    [a, b]: [&PlacedCollider<f64>; 2],
    first: (&Collider, &Pose<f64>),
    theta: &[f64],
) -> Result<(ContactGeometry<f64>, Changes), f64> {
    let Some(x) = point_over_face(feature_pair, a, b) else { return automatic_changes(feature_pair, b, first, theta) };
    let geometry = contact_geometry(feature_pair, a, b)?;
    let along = carried(&x, true);
    let gap = geometry.normal.transpose() * along;
    let point = along - geometry.normal * (gap * 0.5);
    Ok((geometry, Changes::of_first(&geometry, gap, Matrix3x6::zeros(), point)))
}

impl Changes {
    /// With those by displacements of the first solid: both displaced alike, everything is carried along.
    fn of_first(geometry: &ContactGeometry<f64>, gap: RowVector6<f64>, normal: Matrix3x6<f64>, point: Matrix3x6<f64>) -> Self {
        Self {
            gap: [gap, -gap],
            normal: [normal, carried(&geometry.normal, false) - normal],
            point: [point, carried(&geometry.point, true) - point],
        }
    }
}

/// [`contact_geometry_changes`] by dual numbers, for any features.
fn automatic_changes(
    feature_pair: &FeaturePair,
    second: &PlacedCollider<f64>,
    (first, pose): (&Collider, &Pose<f64>),
    theta: &[f64],
) -> Result<(ContactGeometry<f64>, Changes), f64> {
    type Dual = DualSVec64<6>;
    let constant = |k: usize| Dual::from_re(theta[k]);
    let seeds: [Dual; 6] = std::array::from_fn(|k| Dual::from_re(0.0).derivative(k));
    let a = first.placed(&pose.displaced(&seeds), constant);
    let b = PlacedCollider {
        form: second.form.clone(),
        rotation: second.rotation.map(Dual::from_re),
        position: second.position.map(Dual::from_re),
        sizes: second.sizes.map(Dual::from_re),
    };
    let m = contact_geometry(feature_pair, &a, &b)?;
    let slope = |x: &Dual| x.eps.0.map_or_else(RowVector6::zeros, |e| e.transpose());
    let rows = |x: &Vec3<Dual>| Matrix3x6::from_rows(&[slope(&x[0]), slope(&x[1]), slope(&x[2])]);
    let geometry = ContactGeometry { gap: m.gap.re, normal: m.normal.map(|x| x.re), point: m.point.map(|x| x.re) };
    let changes = Changes::of_first(&geometry, slope(&m.gap), rows(&m.normal), rows(&m.point));
    Ok((geometry, changes))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::collider::{Attachment, ColliderShape, Feature, Place};
    use approx::assert_relative_eq;
    use pliant_math::rotation::about;

    #[test]
    fn a_ball_over_a_face_changes_as_dual_numbers_say() {
        let theta = [0.3, 0.2, 0.1, -0.4, 0.25, 0.15];
        let collider = |form, place| Collider {
            name: String::new(),
            form,
            attachment: Attachment::World,
            rotation: about(&Vec3::new(0.6, 0.0, 0.8), 0.4),
            turn: None,
            point: Vec3::zeros(),
            place,
            sizes: [0, 1, 2],
            friction: None,
        };
        let pose = |angle, x| Pose { rotation: about(&Vec3::new(0.0, 0.8, 0.6), angle), position: Vec3::new(x, -0.3, 0.7) };
        let (first, second) = (pose(0.7, 0.2), pose(-1.1, -0.5));
        let (of_capsule, of_block) =
            (collider(ColliderShape::Capsule, Place::At(3)), collider(ColliderShape::Block, Place::Origin));
        let (of_ball, of_plane) =
            (collider(ColliderShape::Ball, Place::Origin), collider(ColliderShape::HalfSpace, Place::At(3)));
        let cases = [
            (Feature::End(-1), &of_capsule, Feature::face(1, -1), &of_block),
            (Feature::corner([1, -1, 1]), &of_block, Feature::face(2, 1), &of_plane),
            (Feature::Whole, &of_ball, Feature::Whole, &of_plane),
        ];
        for (a, collider, b, other) in cases {
            let feature_pair = FeaturePair { first: a, second: b };
            let [a, b] = [(collider, &first), (other, &second)].map(|(c, pose)| c.placed(pose, |k| theta[k]));
            let (geometry, by_hand) = contact_geometry_changes(&feature_pair, [&a, &b], (collider, &first), &theta).unwrap();
            let (same, automatic) = automatic_changes(&feature_pair, &b, (collider, &first), &theta).unwrap();
            assert_relative_eq!(geometry.gap, same.gap, epsilon = 1e-15);
            for side in 0..2 {
                assert_relative_eq!(by_hand.gap[side], automatic.gap[side], epsilon = 1e-14);
                assert_relative_eq!(by_hand.normal[side], automatic.normal[side], epsilon = 1e-14);
                assert_relative_eq!(by_hand.point[side], automatic.point[side], epsilon = 1e-14);
            }
        }
    }
}
