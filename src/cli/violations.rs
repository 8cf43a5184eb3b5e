//! Violated constraints in summaries.

/// Violations up to this, in the constraint's unit (m or rad), are rounding: a nanometre is the rest gap of contact too.
pub const ROUNDING: f64 = 1e-9;

/// Constraints that are listed in a text.
const LISTED: usize = 5;

/// That all hold, or the largest of (by how much, constraint), which are sorted, and how many there are.
pub fn text<'a>(who: &str, violations: impl ExactSizeIterator<Item = (f64, &'a str)>) -> String {
    let count = violations.len();
    if count == 0 {
        return "all constraints hold".to_owned();
    }
    let mut out = format!("VIOLATED: {who} breaks {count} constraint(s), the largest first:");
    for (by, constraint) in violations.take(LISTED) {
        out += &format!("\n  by {by:.3e}: {constraint}");
    }
    if count > LISTED {
        out += &format!("\n  and {} more", count - LISTED);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_are_listed_and_all_are_counted() {
        let list: Vec<(f64, String)> = (0..7).map(|k| (7.0 - f64::from(k), format!("row {k}"))).collect();
        let said = |n: usize| text("the plan", list[..n].iter().map(|(by, row)| (*by, row.as_str())));
        assert_eq!(said(0), "all constraints hold");
        assert_eq!(said(1), "VIOLATED: the plan breaks 1 constraint(s), the largest first:\n  by 7.000e0: row 0");
        assert!(said(5).ends_with("row 4") && said(7).ends_with("row 4\n  and 2 more"), "{}", said(7));
    }
}
