//! Each verdict on functions whose derivative is known.

use super::block::Block;
use super::difference::{Derivative, judge};
use super::{BlockReport, Sample, Verdict};
use crate::AdjointError;
use std::cell::Cell;

/// Along a direction of size 1 whose steps may have any length.
fn free() -> Block {
    Block {
        name: "p".to_owned(),
        size: 1,
        x0: Vec::new(),
        u: Vec::new(),
        theta: Vec::new(),
        even: false,
        scale: 1.0,
        range: (f64::NEG_INFINITY, f64::INFINITY),
    }
}

fn at_bound() -> Block {
    Block { range: (0.0, f64::INFINITY), ..free() }
}

/// The report on `derivative` of `value` at 0, whose branch at ε is `mode`, and how many samples it took.
fn report(block: &Block, derivative: f64, value: impl Fn(f64) -> f64, mode: impl Fn(f64) -> u8) -> (BlockReport, usize) {
    let taken = Cell::new(0);
    let sample = |eps: f64| Sample { value: value(eps), parts: 1.0, modes: vec![mode(eps)] };
    let derivative = Derivative { by_vjp: derivative, by_jvp: derivative, size: derivative.abs(), rounding: 0.0 };
    let report = judge(block, &derivative, &sample(0.0), |eps| {
        assert!(eps > block.range.0 && eps < block.range.1, "{eps} is out of range");
        taken.set(taken.get() + 1);
        Ok(sample(eps))
    });
    (report, taken.get())
}

fn smooth(block: &Block, derivative: f64, value: impl Fn(f64) -> f64) -> BlockReport {
    report(block, derivative, value, |_| 0).0
}

fn reason(report: &BlockReport) -> &str {
    report.reason.as_deref().unwrap_or("")
}

#[test]
fn a_right_gradient_passes_after_six_samples() {
    let (report, samples) = report(&free(), 1.0, |e| e.exp(), |_| 0);
    assert_eq!((report.verdict, reason(&report), samples), (Verdict::Pass, "", 6));
    assert!(report.relative_error < 1e-9 && (report.taylor_slope.unwrap_or(0.0) - 2.0).abs() < 1e-2, "{report:?}");
}

#[test]
fn a_wrong_gradient_fails() {
    for wrong in [1.0 + 1e-6, 0.0, -1.0, f64::NAN, f64::INFINITY] {
        let report = smooth(&free(), wrong, f64::exp);
        assert_eq!(report.verdict, Verdict::Fail, "{report:?}");
        assert!(!wrong.is_finite() || reason(&report).contains("difference disagree by"), "{report:?}");
    }
}

#[test]
fn modes_that_disagree_fail_even_if_no_difference_judges() {
    let sample = |eps: f64| Ok(Sample { value: eps.abs(), parts: 1.0, modes: vec![u8::from(eps > 0.0)] });
    let base = Sample { value: 0.0, parts: 1.0, modes: vec![0] };
    let report = judge(&free(), &Derivative { by_vjp: 1.0, by_jvp: 1.0 + 1e-10, size: 1.0, rounding: 0.0 }, &base, sample);
    assert_eq!(report.verdict, Verdict::Fail);
    assert!(reason(&report).starts_with("jvp and vjp disagree by 1.0e-10"), "{report:?}");
}

/// No derivative of |ε| is right or wrong at 0, neither that of a side nor their mean, which every central difference gives.
#[test]
fn a_kink_at_the_base_point_is_inconclusive() {
    for derivative in [-1.0, 0.0, 1.0] {
        for slope in [0.0, 1.0] {
            let report = smooth(&free(), derivative + slope, |e| e.abs() + slope * e);
            assert_eq!(report.verdict, Verdict::Inconclusive, "{report:?}");
            assert!(reason(&report).contains("agree among themselves to"), "{report:?}");
        }
    }
}

#[test]
fn differences_that_all_switch_are_inconclusive() {
    let (report, samples) = report(&free(), 1.0, |e| e.exp(), |e| u8::from(e > 0.0));
    assert_eq!((report.verdict, report.switches), (Verdict::Inconclusive, 1));
    assert!(report.difference.is_nan() && reason(&report) == "1 switches within the smallest difference, ε = 1e-7", "{report:?}");
    assert_eq!(samples, 2 * 7, "no step wider than the first that switches");
}

#[test]
fn differences_below_a_switch_judge() {
    let value = |e: f64| if e > 3e-6 { e.exp() + 0.1 * (e - 3e-6) } else { e.exp() };
    let verdict = |derivative: f64| report(&free(), derivative, value, |e| u8::from(e > 3e-6)).0.verdict;
    assert_eq!((verdict(1.0), verdict(1.1)), (Verdict::Pass, Verdict::Fail));
}

/// The same without a mode that would tell: steps wider than the kink's distance disagree.
#[test]
fn differences_below_an_unmarked_kink_judge() {
    let value = |e: f64| e.exp() + 0.1 * (e - 3e-6).max(0.0);
    assert_eq!(smooth(&free(), 1.0, value).verdict, Verdict::Pass);
    assert_eq!(smooth(&free(), 1.1, value).verdict, Verdict::Fail);
}

#[test]
fn noise_is_inconclusive() {
    let noise = |e: f64| 1e-6 * ((e.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11) as f64 / (1u64 << 53) as f64 - 0.5);
    for derivative in [1.0, 1.1] {
        let report = smooth(&free(), derivative, |e| e.exp() + noise(e));
        assert_eq!(report.verdict, Verdict::Inconclusive, "{report:?}");
        assert!(report.floor > 1e-6 && report.floor < 1e-2, "{report:?}");
    }
}

#[test]
fn a_failing_simulation_is_inconclusive() {
    let base = Sample { value: 0.0, parts: 1.0, modes: Vec::new() };
    let report = judge(&free(), &Derivative { by_vjp: 1.0, by_jvp: 1.0, size: 1.0, rounding: 0.0 }, &base, |_| {
        Err(AdjointError::NoRecords)
    });
    assert_eq!(report.verdict, Verdict::Inconclusive);
    assert_eq!(reason(&report), "no difference could be taken");
}

#[test]
fn at_a_bound_only_admissible_values_are_sampled() {
    for scale in [1.0, 0.0] {
        let block = Block { scale, ..at_bound() };
        assert_eq!(smooth(&block, 1.0, |e| e.exp() + 0.2 * e.powf(3.0)).verdict, Verdict::Pass);
        assert_eq!(smooth(&block, 1.001, f64::exp).verdict, Verdict::Fail);
        // √ε has no derivative at 0
        assert_eq!(smooth(&block, 1.0, f64::sqrt).verdict, Verdict::Inconclusive);
    }
}

#[test]
fn an_input_without_influence_has_a_derivative_of_zero() {
    assert_eq!(smooth(&free(), 0.0, |_| 1.0).verdict, Verdict::Pass);
    assert_eq!(smooth(&free(), 1e-14, |_| 1.0).verdict, Verdict::Pass);
    assert_eq!(smooth(&free(), 1e-9, |_| 1.0).verdict, Verdict::Fail);
    assert_eq!(smooth(&free(), 0.0, |e| 1.0 + 1e-9 * e).verdict, Verdict::Fail);
    // a motion of 1e-9 is known to the last digit of 1, hence to 1e-2 of itself: the derivative is compared absolutely
    assert_eq!(smooth(&free(), 1e-9, |e| 1.0 + 1e-9 * e).verdict, Verdict::Pass);
}

/// A damping of size zero, of something that hardly moves: wide differences agree on the slope behind the layer.
#[test]
fn an_input_that_soon_saturates_is_inconclusive() {
    let block = Block { scale: 0.0, ..at_bound() };
    let report = smooth(&block, -2e-7, |e| 0.8 - 2e-13 * (1.0 - (-e / 1e-6).exp()));
    assert_ne!(report.verdict, Verdict::Fail, "{report:?}");
    let report = smooth(&block, -2e-3, |e| 0.8 - 2e-9 * (1.0 - (-e / 1e-6).exp()));
    assert_ne!(report.verdict, Verdict::Fail, "{report:?}");
}

#[test]
fn an_even_function_has_a_derivative_of_zero() {
    let even = Block { even: true, scale: 0.0, ..at_bound() };
    assert_eq!(smooth(&even, 0.0, f64::sqrt).verdict, Verdict::Pass);
    assert_eq!(smooth(&even, 1e-3, f64::sqrt).verdict, Verdict::Fail);
}
