//! Which states of a run are shown.

/// Frames per simulated second \[1/s\].
const RATE: f64 = 60.0;
/// Runs of so many states are not thinned: slow motion of something short lives on every step.
const FEW: usize = 300;
/// Frames of a page, whatever the run's length.
const MOST: usize = 3600;
/// Numbers of a page: four bytes each, which base64 makes 16/3, so that the page stays below 20 MB.
const MOST_NUMBERS: usize = 3_500_000;

/// Indices of the states to show: equally far apart, the first and the last one always among them.
///
/// `h` is the step \[s\], `per_frame` how many numbers a frame takes.
pub(super) fn chosen(states: usize, h: f64, per_frame: usize) -> Vec<usize> {
    let last = states.saturating_sub(1);
    let by_rate = if states <= FEW { 1 } else { (1.0 / (RATE * h) - 1e-6).ceil().max(1.0) as usize };
    let most = MOST.min(MOST_NUMBERS / per_frame.max(1)).max(2);
    let stride = by_rate.max(last.div_ceil(most - 1)).max(1);
    (0..last).step_by(stride).chain(std::iter::once(last)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_runs_are_whole_and_long_ones_thinned() {
        assert_eq!(chosen(1, 0.01, 10), [0]);
        assert_eq!(chosen(4, 1e-4, 10), [0, 1, 2, 3]);
        assert_eq!(chosen(2401, 1.0 / 240.0, 10).len(), 601, "60 frames a second, both ends among them");
        assert_eq!(chosen(1001, 1.0 / 60.0, 10).len(), 1001, "no more steps than frames");
        let odd = chosen(1002, 1.0 / 240.0, 10);
        assert_eq!(odd[odd.len() - 2..], [1000, 1001]);
    }

    #[test]
    fn a_page_has_an_end() {
        assert!(chosen(1_000_000, 1.0 / 60.0, 10).len() <= MOST);
        let many_nodes = 30_000;
        assert!(chosen(2401, 1.0 / 240.0, many_nodes).len() * many_nodes <= MOST_NUMBERS);
        assert_eq!(chosen(500, 0.01, 10 * MOST_NUMBERS), [0, 499]);
    }
}
