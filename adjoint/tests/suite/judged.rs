//! One demand on every gradient check.

use crate::common::Case;
use pliant_adjoint::gradcheck::{Report, Verdict, gradcheck};

/// Checks the gradients of a case: none may fail, and at most `inconclusive` blocks may be left unjudged.
pub fn demand(what: &str, case: &Case, inconclusive: usize) -> Report {
    let report = gradcheck(&case.model, &case.theta, &case.x0, &case.u, 7).unwrap();
    let slope = report.taylor_slope.map_or("-".to_owned(), |s| format!("{s:.3}"));
    println!(
        "{what}: worst {:.1e}, slope {slope}, dot {:.1e}, judged {}/{}, retries {}",
        report.worst_relative_error, report.dot_test, report.judged, report.total, report.retries
    );
    for block in report.with(Verdict::Inconclusive) {
        println!("  inconclusive: {}: {}", block.name, block.reason.as_deref().unwrap_or(""));
    }
    let failed: Vec<_> = report.with(Verdict::Fail).collect();
    assert!(failed.is_empty(), "{what}: {failed:#?}");
    let unjudged = report.total - report.judged;
    assert!(unjudged <= inconclusive, "{what}: {unjudged} blocks of {} are inconclusive", report.total);
    report
}
