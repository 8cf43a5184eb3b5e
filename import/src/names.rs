//! Names that a scene accepts, each only once.

use pliant_scene::RESERVED;
use std::collections::BTreeSet;

/// Names given so far.
#[derive(Clone, Debug, Default)]
pub struct Names {
    taken: BTreeSet<String>,
}

impl Names {
    /// A name like `wanted` that can stand in a parameter path and that nothing else has; `kind` (`body`, `joint`, …) and `number`
    /// make one up if there is none.
    pub fn give(&mut self, wanted: &str, kind: &str, number: usize) -> String {
        let base = if wanted.is_empty() { format!("{kind}_{number}") } else { sanitized(wanted, kind) };
        let with_kind = format!("{base}_{kind}");
        let numbered = (2..).map(|k| format!("{base}_{k}"));
        let name = [base.clone(), with_kind].into_iter().chain(numbered).find(|name| self.is_free(name)).unwrap_or(base);
        self.taken.insert(name.clone());
        name
    }

    fn is_free(&self, name: &str) -> bool {
        !self.taken.contains(name) && !RESERVED.contains(&name)
    }
}

/// Letters, digits, `_` and `-`; a letter or `_` first.
fn sanitized(name: &str, kind: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' };
    let name: String = name.chars().map(plain).collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') { name } else { format!("{kind}_{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_usable_and_unique() {
        let mut names = Names::default();
        let mut give = |wanted: &str, kind: &str| names.give(wanted, kind, 3);
        assert_eq!(give("arm", "body"), "arm");
        assert_eq!(give("arm", "joint"), "arm_joint");
        assert_eq!(give("arm", "joint"), "arm_2");
        assert_eq!(give("", "joint"), "joint_3");
        assert_eq!(give("left/knee x", "joint"), "left_knee_x");
        assert_eq!(give("2nd", "body"), "body_2nd");
        assert_eq!(give("gravity", "body"), "gravity_body");
    }
}
