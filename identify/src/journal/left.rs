//! How long it may still take, as far as that is known.
//!
//! Nobody knows how many causes will be accepted, and a round takes longer the more causes there are. Checks after the search took from 0.05 to
//! 4 times as long as all before them (84 diagnoses), so nothing is said of these. What is known: how many fits of the present step are
//! left and how long those before took, how many rounds there may still be, and what the last one took.

use std::time::Instant;

/// Things that are done side by side.
pub(super) struct Counted {
    pub what: &'static str,
    pub of: usize,
    /// How many at a time.
    pub beside: usize,
    pub done: usize,
    pub began: Instant,
}

/// Seconds for those left, if they take as long as those that are done did in `seconds`. None before as many are done as are done at a time: the
/// others began with the first, and are nearly done.
fn rest(done: usize, of: usize, beside: usize, seconds: f64) -> Option<f64> {
    (done >= beside.max(1)).then(|| seconds * of.saturating_sub(done) as f64 / done as f64)
}

/// A sentence about a round (number, most), the seconds of the last one, and what is counted, with its seconds so far.
pub(super) fn sentence(round: Option<(usize, usize)>, last: Option<f64>, counted: Option<(&Counted, f64)>) -> String {
    let round = round.map(|(number, most)| {
        let took = last.map_or_else(String::new, |last| format!(", the last took {}", duration(last)));
        format!("round {number} of at most {most}{took}")
    });
    let counted = counted.map(|(counted, seconds)| {
        let Counted { what, of, beside, done, .. } = counted;
        let about = rest(*done, *of, *beside, seconds).map_or_else(String::new, |left| format!(", {}", duration(left)));
        format!("{} of {of} {what} to go{about}", of - done.min(of))
    });
    round.into_iter().chain(counted).collect::<Vec<_>>().join("; ")
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => "less than 1 s".to_owned(),
        s if s < 120.0 => format!("about {s:.0} s"),
        s if s < 7200.0 => format!("about {:.0} min", s / 60.0),
        s => format!("about {:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_takes_as_long_as_the_part_that_is_done() {
        assert_eq!([rest(0, 30, 4, 5.0), rest(3, 30, 4, 5.0), rest(0, 0, 0, 5.0)], [None; 3]);
        assert_eq!(rest(10, 30, 4, 5.0), Some(10.0));
        assert_eq!([rest(30, 30, 4, 5.0), rest(31, 30, 4, 5.0)], [Some(0.0); 2]);
    }

    #[test]
    fn a_sentence_says_what_is_known() {
        let counted = |done| Counted { what: "causes", of: 30, beside: 4, done, began: Instant::now() };
        assert_eq!(sentence(None, None, None), "");
        assert_eq!(sentence(Some((1, 6)), None, None), "round 1 of at most 6");
        assert_eq!(sentence(Some((1, 6)), None, Some((&counted(0), 3.0))), "round 1 of at most 6; 30 of 30 causes to go");
        assert_eq!(
            sentence(Some((2, 6)), Some(41.3), Some((&counted(20), 24.0))),
            "round 2 of at most 6, the last took about 41 s; 10 of 30 causes to go, about 12 s"
        );
        assert_eq!(sentence(None, None, Some((&counted(30), 5.0))), "0 of 30 causes to go, less than 1 s");
        assert_eq!([duration(119.4), duration(121.0), duration(9000.0)], ["about 119 s", "about 2 min", "about 2.5 h"]);
    }
}
