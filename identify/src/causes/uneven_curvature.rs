//! A rod that is curved by nature, otherwise from place to place: kinks, the memory of a coil, a cable that was laid badly.
//!
//! The even part of it is a cause of its own (`intrinsic_curvature`), which this one contains: it is looked at once that one is free, as
//! what differs from the joint in the middle. A search for causes that act together looks at all joints at once: with a number for every
//! joint a fit finds its way from a straight rod where two numbers for all of them end somewhere on the way.

use super::{Cause, Situation};

pub(super) fn causes(at: &Situation) -> Vec<Cause> {
    at.per_rod(|rod| {
        let even = at.free.iter().any(|free| free.path == format!("{rod}.rest_curvature[0]"));
        let of_axis = |a: usize| {
            let mut numbers = at.along(&at.joints_of(rod, &format!("rest_curvature[{a}]")), at.typical_curvature(rod));
            if even && !numbers.is_empty() {
                numbers.remove(numbers.len() / 2);
            }
            numbers
        };
        let testable = even || at.together;
        Cause {
            meaning: "the rod is curved by nature, in another way from place to place (kinks, the memory of a coil)",
            unknowns: if testable { (0..2).flat_map(of_axis).collect() } else { Vec::new() },
            untestable: (!testable).then(|| "first its even part, `intrinsic_curvature`, is looked at".to_owned()),
            excitation: "turn both ends about the rod's own direction by the same angle, with the rod slack and with it stretched",
            companions: if even { Vec::new() } else { at.unmeasured_of(rod) },
            above: even.then_some("intrinsic_curvature"),
            becomes: (!even).then_some("intrinsic_curvature"),
            ..Cause::default()
        }
    })
}
