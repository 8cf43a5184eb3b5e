//! Rules for pairs of objects that touch: `[[contact.pair]]` of a scene.

use super::Model;
use pliant_math::params::NON_NEGATIVE;
use pliant_scene::ContactRule;

/// A rule of the scene, with its entries of θ.
pub(super) struct Rule<'a> {
    pub rule: &'a ContactRule,
    pub friction: Option<usize>,
    pub compliance: Option<usize>,
}

/// The rule for two objects; none if the scene says nothing special of them.
pub(super) fn rule_of<'a, 'r>(rules: &'r [Rule<'a>], first: &str, second: &str) -> Option<&'r Rule<'a>> {
    rules.iter().find(|rule| {
        let [x, y] = &rule.rule.between;
        (x == first && y == second) || (x == second && y == first)
    })
}

impl Model {
    /// The rule with its parameters pushed to θ.
    pub(super) fn push_rule<'a>(&mut self, k: usize, rule: &'a ContactRule) -> Rule<'a> {
        let mut entry = |name: &str, unit, value: Option<f64>| {
            value.map(|value| self.params.push(format!("contact.pair[{k}].{name}"), unit, NON_NEGATIVE, value))
        };
        Rule { rule, friction: entry("friction", "-", rule.friction), compliance: entry("compliance", "m/N", rule.compliance) }
    }

    /// Applies the rules to nodes and the planes, spheres and capsules that they touch.
    pub(super) fn apply_rules(&mut self, rules: &[Rule]) {
        if rules.is_empty() {
            return;
        }
        let spans: Vec<_> = self.node_spans().map(|(name, nodes)| (name.to_owned(), nodes)).collect();
        let (mut pairs, shapes) = (std::mem::take(&mut self.pairs), &self.shape_names);
        pairs.retain_mut(|pair| {
            let object = spans.iter().find(|(_, nodes)| nodes.contains(&pair.node));
            let Some(rule) = object.and_then(|(name, _)| rule_of(rules, name, &shapes[pair.shape])) else { return true };
            pair.friction = rule.friction.unwrap_or(pair.friction);
            !rule.rule.ignore
        });
        self.pairs = pairs;
    }
}
