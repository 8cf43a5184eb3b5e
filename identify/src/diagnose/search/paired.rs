//! Two fits held against each other on the same records.

use crate::stats::dist::t_two_sided;

/// Errors of the second of two fits against the first, on records that neither was fitted to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Paired {
    /// Part of the first one's squares that the second takes away; negative where it adds.
    pub gain: f64,
    /// One-sided p of the hypothesis that it lessens the error of no typical record: t test of the logarithms of the mean squares.
    pub p: f64,
}

impl Paired {
    /// From mean squares per record.
    pub(super) fn of(before: &[f64], after: &[f64]) -> Self {
        let gain = 1.0 - after.iter().sum::<f64>() / before.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let ratio = |(b, a): (&f64, &f64)| (a.max(f64::MIN_POSITIVE) / b.max(f64::MIN_POSITIVE)).ln();
        let logs: Vec<f64> = before.iter().zip(after).map(ratio).collect();
        let n = logs.len() as f64;
        let mean = logs.iter().sum::<f64>() / n;
        let variance = logs.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0);
        let t = mean / (variance / n).sqrt();
        let p = match t.is_finite() {
            true if t < 0.0 => 0.5 * t_two_sided(t, n - 1.0),
            true => 1.0 - 0.5 * t_two_sided(t, n - 1.0),
            false => 1.0,
        };
        Self { gain: if gain.is_finite() { gain } else { f64::NEG_INFINITY }, p }
    }

    /// In words, with the numbers of records fitted and judged by.
    pub(super) fn words(&self, [fitted, judged]: [usize; 2]) -> String {
        let [size, verb] = if self.gain >= 0.0 { [self.gain, 1.0] } else { [-self.gain, -1.0] };
        let verb = if verb > 0.0 { "takes" } else { "adds" };
        let of = if self.gain >= 0.0 { "of" } else { "to" };
        let size = if size < 10.0 { format!("{:.1} %", 100.0 * size) } else { "more than ten times".to_owned() };
        format!("fitted to {fitted} records it {verb} {size} {of} the squares on {judged} others (p = {:.1e})", self.p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_on_every_record_is_sure_and_one_on_half_of_them_is_not() {
        let before: Vec<f64> = (0..10).map(|k| 1.0 + 0.3 * f64::from(k)).collect();
        let all: Vec<f64> = before.iter().enumerate().map(|(k, b)| b * (0.8 + 0.01 * k as f64)).collect();
        let sure = Paired::of(&before, &all);
        assert!(sure.p < 1e-6 && (0.1..0.2).contains(&sure.gain), "{sure:?}");
        let half: Vec<f64> = before.iter().enumerate().map(|(k, b)| if k % 2 == 0 { 0.5 * b } else { 1.7 * b }).collect();
        assert!(Paired::of(&before, &half).p > 0.2);
        let worse = Paired::of(&all, &before);
        assert!(worse.gain < 0.0 && worse.p > 1.0 - 1e-6, "{worse:?}");
        assert!(worse.words([5, 7]).contains("fitted to 5 records it adds"), "{}", worse.words([5, 7]));
    }

    #[test]
    fn records_that_cannot_be_simulated_are_no_gain() {
        let with = Paired::of(&[1.0, 1.0, 1.0], &[0.5, f64::INFINITY, 0.5]);
        assert!(with.gain < 0.0 && with.p > 0.5, "{with:?}");
        assert_eq!(Paired::of(&[1.0, 1.0], &[1.0, 1.0]).p, 1.0);
    }
}
