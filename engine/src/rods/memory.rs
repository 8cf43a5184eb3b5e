//! History variables of rod sections: their values as a step begins, and their update.

use super::joint::{Gradient, TURN};
use super::term::expanded_force;
use super::{RodJoint, RodPoint, RodSection, Rods};
use crate::terms::section::{SectionInput, SectionPoint};
use pliant_math::Input;
use std::ops::Range;

/// The strains of all joints at the beginning of a (sub)step, and how they change there; empty where no section remembers.
#[derive(Clone, Debug, Default)]
pub struct RodPast {
    strains: Vec<[f64; 3]>,
    gradients: Vec<[Gradient; 3]>,
}

impl RodPast {
    /// Of joint `j`.
    #[inline]
    pub(super) fn strain(&self, j: usize) -> Option<[f64; 3]> {
        self.strains.get(j).copied()
    }
}

/// Past state with which sections with history variables are evaluated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Remembered<'a> {
    /// The beginning of the (sub)step.
    pub past: &'a RodPast,
    /// Internal variables there.
    pub z: &'a [f64],
    /// Time since then \[s\].
    pub elapsed: f64,
}

impl RodSection {
    /// Where in z law `k` remembers joint `j`.
    #[inline]
    pub(super) fn place(&self, k: usize, j: usize) -> Range<usize> {
        let (first, n) = self.places[k];
        let begin = first + n * (j - self.joints.start);
        begin..begin + n
    }
}

impl Rods {
    /// Whether a section remembers anything.
    pub(crate) fn remember(&self) -> bool {
        self.sections.iter().any(|section| section.places.iter().any(|(_, n)| *n > 0))
    }

    /// The beginning of a (sub)step at an evaluated configuration.
    pub(crate) fn begin(&self, at: &RodPoint, out: &mut RodPast) {
        out.strains.clear();
        out.gradients.clear();
        for j in 0..self.joints.len() {
            let joint = self.joint(j, at);
            out.strains.push(joint.strain);
            out.gradients.push(joint.gradients());
        }
    }

    /// Calls `visit(row, input, ∂f_row/∂input)` for what sections remember and for the coordinates at the beginning of the (sub)step.
    pub(crate) fn visit_past(&self, at: &RodPoint, theta: &[f64], before: Remembered, visit: &mut dyn FnMut(usize, Input, f64)) {
        self.for_joints(|j, section| {
            let (joint, joints) = (self.joint(j, at), &self.joints[j]);
            let rows = self.rows(joints);
            // what the laws' rates add does not remember
            let point = self.resting_point(j, &joint, theta, before);
            for (k, law) in section.laws.iter().enumerate() {
                let place = section.place(k, j);
                if place.is_empty() {
                    continue;
                }
                let point = SectionPoint { memory: &before.z[place.clone()], ..point };
                law.visit_past(&point, &mut |input, m| {
                    let f = expanded_force(&joint.pull(&m));
                    let mut each = |input, by: f64| rows.iter().zip(&f).for_each(|(row, f)| visit(*row, input, by * f));
                    match input {
                        SectionInput::Memory(n) => each(Input::Z(place.start + n), 1.0),
                        SectionInput::Past(s) => {
                            self.visit_strain(joints, &before.past.gradients[j][s], &mut |row, by| each(Input::Q(row), by));
                        }
                        SectionInput::Strain(_) | SectionInput::Theta(_) => {}
                    }
                });
            }
        });
    }

    /// Appends which branch of its law each section that remembers is on, where laws have kinks between branches.
    pub(crate) fn modes(&self, at: &RodPoint, theta: &[f64], before: Remembered, out: &mut Vec<u8>) {
        self.for_joints(|j, section| {
            let point = self.resting_point(j, &self.joint(j, at), theta, before);
            section.for_laws(&point, before.z, |law, point| out.extend(law.mode(point)));
        });
    }

    /// Moves what sections remember on to the end of a (sub)step, an evaluated configuration.
    pub(crate) fn advance(&self, end: &RodPoint, theta: &[f64], before: Remembered, z: &mut [f64]) {
        self.for_joints(|j, section| {
            let point = self.resting_point(j, &self.joint(j, end), theta, before);
            for (k, law) in section.laws.iter().enumerate() {
                let place = section.place(k, j);
                if !place.is_empty() {
                    let point = SectionPoint { memory: &before.z[place.clone()], ..point };
                    law.advance(&point, &mut z[place]);
                }
            }
        });
    }

    /// Calls `visit(place, input, ∂z⁺_place/∂input)` of [`Rods::advance`].
    pub(crate) fn visit_advance(
        &self,
        end: &RodPoint,
        theta: &[f64],
        before: Remembered,
        visit: &mut dyn FnMut(usize, Input, f64),
    ) {
        self.for_joints(|j, section| {
            let (joint, joints) = (self.joint(j, end), &self.joints[j]);
            let gradients = joint.gradients();
            let point = self.resting_point(j, &joint, theta, before);
            for (k, law) in section.laws.iter().enumerate() {
                let place = section.place(k, j);
                if place.is_empty() {
                    continue;
                }
                let first = place.start;
                let point = SectionPoint { memory: &before.z[place], ..point };
                law.visit_advance(&point, &mut |number, input, slope| {
                    let number = first + number;
                    match input {
                        SectionInput::Theta(p) => visit(number, Input::Theta(p), slope),
                        SectionInput::Memory(n) => visit(number, Input::Z(first + n), slope),
                        SectionInput::Strain(s) => self.visit_strain(joints, &gradients[s], &mut |row, by| {
                            visit(number, Input::QNext(row), slope * by);
                        }),
                        SectionInput::Past(s) => self.visit_strain(joints, &before.past.gradients[j][s], &mut |row, by| {
                            visit(number, Input::Q(row), slope * by);
                        }),
                    }
                });
            }
        });
    }

    /// Calls `visit(row, ∂strain/∂row)` for a gradient by y.
    fn visit_strain(&self, joint: &RodJoint, g: &Gradient, visit: &mut dyn FnMut(usize, f64)) {
        let [n0, n1, n2] = joint.nodes;
        for a in 0..3 {
            visit(3 * n0 + a, -g[a]);
            visit(3 * n1 + a, g[a] - g[3 + a]);
            visit(3 * n2 + a, g[3 + a]);
        }
        (0..2).for_each(|k| visit(self.row(joint.edges[k]), g[TURN[k]]));
    }
}
