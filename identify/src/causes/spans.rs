//! Unknowns of every rope and every sheet of cloth, and their typical sizes.

use super::Situation;
use crate::unknown::Unknown;

impl Situation<'_> {
    /// Names of the ropes.
    pub(super) fn ropes(&self) -> Vec<&str> {
        self.plan.model.ropes().iter().map(|r| r.name.as_str()).collect()
    }

    /// One unknown per rope for a quantity of ropes.
    pub(super) fn per_rope(&self, quantity: &str, scale: impl Fn(&str) -> f64) -> Vec<Unknown> {
        self.ropes().iter().filter_map(|rope| self.theta(&format!("{rope}.{quantity}"), scale(rope))).collect()
    }

    /// One unknown per sheet of cloth for a quantity of sheets.
    pub(super) fn per_sheet(&self, quantity: &str, scale: impl Fn(&str) -> f64) -> Vec<Unknown> {
        let sheets = self.plan.model.cloths().iter().map(|sheet| sheet.name.as_str());
        sheets.filter_map(|sheet| self.theta(&format!("{sheet}.{quantity}"), scale(sheet))).collect()
    }

    /// One unknown per rope and per sheet for a quantity that has a name of its own for each, both of a typical size.
    pub(super) fn per_span(&self, [of_rope, of_sheet]: [&str; 2], scale: impl Fn(&str) -> f64) -> Vec<Unknown> {
        let ropes = self.per_rope(of_rope, &scale);
        ropes.into_iter().chain(self.per_sheet(of_sheet, &scale)).collect()
    }

    /// A drag coefficient [kg/(m·s)], of a sheet [kg/(m²·s)], whose force at 1 m/s is a tenth of the weight: a typical size.
    pub(super) fn typical_drag(&self, span: &str) -> f64 {
        // only one of the two is there
        let density = self.value(&format!("{span}.linear_density")) + self.value(&format!("{span}.area_density"));
        0.1 * density * self.value("gravity.magnitude").max(1.0)
    }

    /// A damping of bending that is a hundredth of a second times the stiffness: a typical size.
    pub(super) fn typical_damping(&self, span: &str) -> f64 {
        0.01 * self.value(&format!("{span}.bend_stiffness")).max(1e-8)
    }
}
