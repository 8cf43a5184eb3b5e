//! Ropes given by their material: Young's modulus, shear modulus, density and a round section.
//!
//! ```text
//! EA = E π r²,   EI = E π r⁴/4,   GJ = G π r⁴/2,   ρA = ρ π r²,   ρI_p = ρ π r⁴/2,   G = E/(2 (1 + ν))
//! ```
//! A scene that is read has the stiffnesses instead: they are the parameters in θ, and are fitted and written.

use super::error::{Mistake, SceneError};
use super::file::Scene;
use super::rope::Rope;
use super::source::Source;
use super::words::list;
use std::f64::consts::PI;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Moduli \[Pa\] that are plausible: foam to diamond.
const MODULI: [f64; 2] = [1e2, 5e12];
/// Densities [kg/m³] that are plausible: thin foam to osmium.
const DENSITIES: [f64; 2] = [15.0, 3e4];

/// Quantities that a material gives, and the keys that give them instead.
const OF_YOUNG: [(&str, &str); 2] = [("stretch_stiffness", "N"), ("bend_stiffness", "N·m²")];

impl Rope {
    /// G \[Pa\], if the material has it.
    fn shear(&self) -> Option<f64> {
        let from_ratio = || Some(self.youngs_modulus? / (2.0 * (1.0 + self.poisson_ratio?)));
        self.shear_modulus.or_else(from_ratio)
    }

    /// The first key of a material that is still to be [resolved](Rope::resolve_material).
    pub(super) fn material_key(&self) -> Option<&'static str> {
        let given = [
            ("youngs_modulus", self.youngs_modulus),
            ("shear_modulus", self.shear_modulus),
            ("poisson_ratio", self.poisson_ratio),
            ("density", self.density),
        ];
        given.into_iter().find(|(_, value)| value.is_some()).map(|(key, _)| key)
    }

    /// Puts the stiffnesses and the mass that the material makes in the place of the material.
    pub fn resolve_material(&mut self) {
        let area = PI * self.radius * self.radius;
        let second_moment = 0.25 * area * self.radius * self.radius;
        let shear = self.shear();
        if let Some(modulus) = self.youngs_modulus.take() {
            (self.stretch_stiffness, self.bend_stiffness) = (modulus * area, modulus * second_moment);
        }
        if let (Some(shear), Some(twist)) = (shear, &mut self.twist) {
            twist.stiffness = shear * 2.0 * second_moment;
        }
        if let Some(density) = self.density.take() {
            self.linear_density = density * area;
        }
        (self.shear_modulus, self.poisson_ratio) = (None, None);
    }
}

/// Refuses ropes that lack a quantity or have it twice: while the keys that a file gives are still known.
pub(super) fn compare(table: &Spanned<DeTable>, source: &Source) -> Result<(), SceneError> {
    let ropes = table.get_ref().get("rope").and_then(|ropes| ropes.get_ref().as_array());
    for (r, rope) in ropes.into_iter().flatten().enumerate() {
        if let Some(keys) = rope.get_ref().as_table() {
            one_rope(keys).map_err(|(table, mistake)| {
                let start = table.and_then(|key| keys.get(key)).map_or(rope.span().start, |value| value.span().start);
                let field = table.map_or(format!("rope[{r}]"), |key| format!("rope[{r}].{key}"));
                SceneError::new(source.place_at(start, &field), mistake)
            })?;
        }
    }
    Ok(())
}

/// The wrong table of the rope, or key of it, and the mistake.
type Wrong = (Option<&'static str>, Mistake);

fn one_rope(rope: &DeTable) -> Result<(), Wrong> {
    let given = |key: &str| rope.contains_key(key);
    let missing = |key: &str, unit: &str| Mistake::MissingKey { key: key.to_owned(), unit: Some(unit.to_owned()) };
    let twice = |material: &'static str, key: &str| (Some(material), Mistake::OneOf { keys: list([key, material]), given: 2 });
    match (given("linear_density"), given("density")) {
        (false, false) => return Err((None, missing("linear_density", "kg/m"))),
        (true, true) => return Err(twice("density", "linear_density")),
        _ => {}
    }
    if !given("youngs_modulus") && !given("stretch_stiffness") {
        return Err((None, missing("stretch_stiffness", "N")));
    }
    if given("youngs_modulus")
        && let Some((key, _)) = OF_YOUNG.iter().find(|(key, _)| given(key))
    {
        return Err(twice("youngs_modulus", key));
    }
    if given("shear_modulus") && given("poisson_ratio") {
        return Err(twice("poisson_ratio", "shear_modulus"));
    }
    if given("poisson_ratio") && !given("youngs_modulus") {
        return Err((Some("poisson_ratio"), missing("youngs_modulus", "Pa")));
    }
    let shear = ["shear_modulus", "poisson_ratio"].into_iter().find(|key| given(key));
    let Some(DeValue::Table(twist)) = rope.get("twist").map(|twist| twist.get_ref()) else {
        // a Poisson ratio alone is said in passing, a shear modulus is meant
        return match shear {
            Some(key @ "shear_modulus") => Err((Some(key), Mistake::NeedsTwist { key })),
            _ => Ok(()),
        };
    };
    match (shear, twist.contains_key("stiffness")) {
        (None, false) => Err((Some("twist"), missing("stiffness", "N·m²"))),
        (Some(key), true) => Err(twice(key, "twist.stiffness")),
        _ if given("youngs_modulus") && twist.contains_key("bend_stiffness_2") => {
            Err(twice("youngs_modulus", "twist.bend_stiffness_2"))
        }
        _ => Ok(()),
    }
}

/// Refuses materials that cannot be, then puts the numbers in their place.
pub(super) fn resolve(scene: &mut Scene) -> Result<(), SceneError> {
    for (r, rope) in scene.rope.iter_mut().enumerate() {
        possible(rope, &|key| format!("rope[{r}].{key}"))?;
        rope.resolve_material();
    }
    Ok(())
}

/// Numbers of a material in SI units, for a section that has a size.
pub(super) fn possible(rope: &Rope, at: &dyn Fn(&str) -> String) -> Result<(), SceneError> {
    let refuse = |key: &str, mistake| Err(SceneError::at(at(key), mistake));
    for (key, value) in [("youngs_modulus", rope.youngs_modulus), ("shear_modulus", rope.shear_modulus)] {
        let Some(value) = value else { continue };
        super::check::positive(&at(key), value, "Pa")?;
        if value < MODULI[0] {
            let (reason, instead) = (", softer than any foam".to_owned(), 1e9 * value);
            return refuse(key, Mistake::Unit { value, unit: "Pa", reason, likely: "GPa", instead });
        }
        if value > MODULI[1] {
            let (reason, instead) = (", stiffer than diamond".to_owned(), 1e-3 * value);
            return refuse(key, Mistake::Unit { value, unit: "Pa", reason, likely: "mPa", instead });
        }
    }
    if let Some(value) = rope.poisson_ratio.filter(|ratio| !(*ratio > -1.0 && *ratio <= 0.5)) {
        return refuse("poisson_ratio", Mistake::Range { value, low: -1.0, high: 0.5 });
    }
    if let Some(value) = rope.density {
        super::check::positive(&at("density"), value, "kg/m³")?;
        if value < DENSITIES[0] {
            let (reason, instead) = (", lighter than any foam".to_owned(), 1e3 * value);
            return refuse("density", Mistake::Unit { value, unit: "kg/m³", reason, likely: "g/cm³", instead });
        }
        if value > DENSITIES[1] {
            let (reason, instead) = (", denser than any metal".to_owned(), 1e-3 * value);
            return refuse("density", Mistake::Unit { value, unit: "kg/m³", reason, likely: "g/m³", instead });
        }
    }
    let made_of = [rope.youngs_modulus, rope.shear_modulus, rope.density].iter().any(Option::is_some);
    if made_of && rope.radius <= 0.0 {
        let mistake = Mistake::MissingKey { key: "radius".to_owned(), unit: Some("m".to_owned()) };
        return Err(SceneError::at(at("").trim_end_matches('.'), mistake));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::{Nothing, parse_scene};
    use approx::assert_relative_eq;

    const STEEL: &str = "schema_version = 1\n[time]\nstep = 0.01\nduration = 0.1\n[[rope]]\nname = \"wire\"\nnodes = 5\nlength = 1.0\n\
        radius = 0.001\nyoungs_modulus = 2e11\npoisson_ratio = 0.3\ndensity = 7800\n\
        initial = { shape = \"straight\", from = [0, 0, 0], direction = [1, 0, 0] }\n[rope.twist]\n";

    fn read(text: &str) -> Result<super::Scene<Nothing>, String> {
        parse_scene::<Nothing>(text, "wire.toml").map_err(|error| error.to_string())
    }

    #[test]
    fn a_material_becomes_stiffnesses_and_mass() {
        let scene = read(STEEL).unwrap();
        let rope = &scene.rope[0];
        assert_relative_eq!(rope.stretch_stiffness, 628_318.530_717_958_6, max_relative = 1e-14);
        assert_relative_eq!(rope.bend_stiffness, 0.157_079_632_679_489_66, max_relative = 1e-14);
        assert_relative_eq!(rope.twist.as_ref().unwrap().stiffness, 0.157_079_632_679_489_66 / 1.3, max_relative = 1e-14);
        assert_relative_eq!(rope.linear_density, 0.024_504_422_698_000_385, max_relative = 1e-14);
        // ρ π r⁴/2
        assert_relative_eq!(rope.twist_inertia().unwrap(), 1.225_221_134_900_019e-8, max_relative = 1e-13);
        assert!(rope.youngs_modulus.is_none() && rope.density.is_none());
        // the scene read and written is read again the same
        let again = read(&toml::to_string(&scene).unwrap()).unwrap();
        assert_eq!(again, scene);
    }

    #[test]
    fn what_is_missing_given_twice_or_in_another_unit_is_named() {
        let refused = |from: &str, to: &str, words: &[&str]| {
            let message = read(&STEEL.replace(from, to)).unwrap_err();
            assert!(words.iter().all(|word| message.contains(word)), "{message}");
        };
        refused("density = 7800", "", &["wire.toml:5: rope[0]", "`linear_density` is missing", "kg/m"]);
        refused(
            "density = 7800",
            "density = 7800\nlinear_density = 0.02",
            &["rope[0].density", "linear_density", "more than one"],
        );
        refused("density = 7800", "density = 7800\nbend_stiffness = 0.02", &["rope[0].youngs_modulus", "bend_stiffness"]);
        refused("density = 7800", "density = 7800\nstretch_stiffness = 9", &["rope[0].youngs_modulus", "stretch_stiffness"]);
        refused("density = 7800", "density = 7800\nshear_modulus = 8e10", &["rope[0].poisson_ratio", "shear_modulus"]);
        refused("youngs_modulus = 2e11\n", "stretch_stiffness = 9\n", &["rope[0].poisson_ratio", "`youngs_modulus` is missing"]);
        refused("youngs_modulus = 2e11\n", "", &["`stretch_stiffness` is missing"]);
        refused("[rope.twist]\n", "[rope.twist]\nstiffness = 0.1\n", &["rope[0].poisson_ratio", "twist.stiffness"]);
        refused("[rope.twist]\n", "[rope.twist]\nbend_stiffness_2 = 0.1\n", &["rope[0].youngs_modulus", "bend_stiffness_2"]);
        refused("poisson_ratio = 0.3\n", "", &["rope[0].twist", "`stiffness` is missing"]);
        refused("poisson_ratio = 0.3\n", "poisson_ratio = 0.7\n", &["rope[0].poisson_ratio", "0.5"]);
        let untwisted = STEEL.replace("[rope.twist]\n", "").replace("poisson_ratio = 0.3", "shear_modulus = 8e10");
        assert!(read(&untwisted).unwrap_err().contains("no `twist`"));
        refused("youngs_modulus = 2e11", "youngs_modulus = 20", &["rope[0].youngs_modulus", "GPa", "2e10"]);
        refused("density = 7800", "density = 7.8", &["rope[0].density", "g/cm³", "7800"]);
        refused("density = 7800", "density = 7800000", &["rope[0].density", "g/m³", "7800"]);
        refused("radius = 0.001", "radius = 1.0", &["rope[0].radius", "thicker than its length"]);
        refused("radius = 0.001\n", "", &["rope[0]", "`radius` is missing"]);
    }
}
