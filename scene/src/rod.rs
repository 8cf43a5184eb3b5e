//! Where the axes of a rod's edges are at the beginning.

use super::error::{Mistake, SceneError};
use super::file::Scene;
use super::gripper::End;
use super::initial::{rope_points, with_ghosts};
use pliant_math::Vec3;
use pliant_math::transport::{any_normal, carried, normal_part};

/// A rod as the scene begins, edge by edge, ghosts included.
#[derive(Clone, Debug)]
pub struct RodStart {
    /// Reference axes: each follows the one before by the smallest rotation.
    pub references: Vec<Vec3<f64>>,
    /// Twist angles from them to the material axes [rad].
    pub twists: Vec<f64>,
}

impl RodStart {
    /// Reference axes and twists of rope `r`; `None` if it does not twist.
    pub fn new(scene: &Scene, r: usize) -> Result<Option<Self>, SceneError> {
        let rope = &scene.rope[r];
        let Some(twist) = &rope.twist else { return Ok(None) };
        rope_points(scene, r)?;
        let mut points = with_ghosts(scene, r)?;
        if rope.closed {
            points.push(points[0]);
        }
        let tangents: Vec<Vec3<f64>> = points.windows(2).map(|w| (Vec3::from(w[1]) - Vec3::from(w[0])).normalize()).collect();
        let first = match twist.director {
            None => any_normal(&tangents[0]),
            Some(wish) => normal_part(&Vec3::from(wish), &tangents[0])
                .ok_or_else(|| SceneError::at(format!("rope[{r}].twist.director"), Mistake::NoDirection))?,
        };
        let mut references = vec![first];
        for pair in tangents.windows(2) {
            let next = carried(&pair[0], &pair[1], &references[references.len() - 1]);
            references.push(normal_part(&next, &pair[1]).unwrap_or(next));
        }
        // even along the rod: a joint's twist is spread over half of each edge beside it, and a clamped end's over half of the first
        let mut lengths = rope.fractions();
        if scene.clamps_end(rope, End::First) {
            lengths.insert(0, 0.0);
        }
        if scene.clamps_end(rope, End::Last) {
            lengths.push(0.0);
        }
        let mut twists = vec![0.0];
        for pair in lengths.windows(2) {
            twists.push(twists[twists.len() - 1] + 0.5 * (pair[0] + pair[1]));
        }
        // a closed rope's is that of all joints, and the one where it began comes last
        let whole = if rope.closed { 1.0 } else { twists[twists.len() - 1] };
        twists.iter_mut().for_each(|t| *t *= if whole > 0.0 { twist.initial / whole } else { 0.0 });
        Ok(Some(Self { references, twists }))
    }

    /// First material axis of edge `k`.
    pub fn axis(&self, k: usize, tangent: &Vec3<f64>) -> Vec3<f64> {
        let (sin, cos) = self.twists[k].sin_cos();
        self.references[k] * cos + tangent.cross(&self.references[k]) * sin
    }
}
