//! Frames that constraints act on: where they are and how they move.

use crate::bodies::Frames;
use crate::geometry::collider::{Attachment, Pose};
use nalgebra::Matrix3;
use pliant_math::Vec3;
use pliant_math::spatial::Motion;

/// Pose of a frame seen from the origin of the evaluation.
pub(crate) fn pose(attachment: Attachment, q: &[f64], frames: &Frames<f64>) -> Pose<f64> {
    match attachment {
        Attachment::World => pose_of_world(&frames.origin),
        Attachment::Body(body) => {
            let frame = &frames.bodies[body];
            Pose { rotation: frame.rotation, position: frame.position }
        }
        Attachment::Node(node) => {
            let x = Vec3::new(q[3 * node], q[3 * node + 1], q[3 * node + 2]);
            Pose { position: x - frames.origin, ..pose_of_world(&frames.origin) }
        }
    }
}

/// Velocity of a frame about the origin of the evaluation.
pub(crate) fn velocity(attachment: Attachment, v: &[f64], frames: &Frames<f64>) -> Motion<f64> {
    match attachment {
        Attachment::World => Motion::zero(),
        Attachment::Body(body) => frames.bodies[body].velocity,
        Attachment::Node(node) => Motion { w: Vec3::zeros(), v: Vec3::new(v[3 * node], v[3 * node + 1], v[3 * node + 2]) },
    }
}

/// Pose of a frame that does not move.
pub(crate) fn pose_of_world(origin: &Vec3<f64>) -> Pose<f64> {
    Pose { rotation: Matrix3::identity(), position: -origin }
}

/// The node that a frame is, if any.
pub(crate) fn node_of(attachment: Attachment) -> Option<usize> {
    if let Attachment::Node(node) = attachment { Some(node) } else { None }
}
