//! What differs from place to place along a rope: a number for every node or edge, or for every few neighbours where there are many.
//!
//! Data are read at some places along a rope, and how finely it is simulated in between is another matter: with a number for every node of a
//! fine rope a fit would follow the noise. Neighbours share one, so that there are at most [`MOST`].

use super::Situation;
use crate::unknown::Unknown;

/// Most numbers along a rope.
const MOST: usize = 14;

impl Situation<'_> {
    /// Unknowns for what these paths set, each of the form `rope.node[k].quantity` and in the order of k, with a typical size.
    pub(super) fn along(&self, paths: &[String], scale: f64) -> Vec<Unknown> {
        pieces(paths).iter().filter_map(|path| self.theta(path, scale)).collect()
    }
}

/// The paths, or patterns such as `rope.node[3..4].quantity` that each stand for as many neighbours.
fn pieces(paths: &[String]) -> Vec<String> {
    let size = paths.len().div_ceil(MOST).max(1);
    let mut out: Vec<(&str, [usize; 2], &str)> = Vec::new();
    for path in paths {
        let Some((head, k, tail)) = numbered(path) else { continue };
        match out.last_mut() {
            Some((_, [first, last], _)) if *last + 1 == k && k - *first < size => *last = k,
            _ => out.push((head, [k, k], tail)),
        }
    }
    let text = |(head, [first, last], tail): &(&str, [usize; 2], &str)| match first == last {
        true => format!("{head}[{first}]{tail}"),
        false => format!("{head}[{first}..{last}]{tail}"),
    };
    out.iter().map(text).collect()
}

fn numbered(path: &str) -> Option<(&str, usize, &str)> {
    let (head, rest) = path.split_once('[')?;
    let (number, tail) = rest.split_once(']')?;
    Some((head, number.parse().ok()?, tail))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn masses(nodes: impl Iterator<Item = usize>) -> Vec<String> {
        nodes.map(|k| format!("cable.node[{k}].mass")).collect()
    }

    #[test]
    fn few_have_a_number_each_and_many_share() {
        assert_eq!(pieces(&masses(1..13)), masses(1..13));
        let of_many = pieces(&masses(1..24));
        assert_eq!(of_many.len(), 12);
        assert_eq!((of_many[0].as_str(), of_many[11].as_str()), ("cable.node[1..2].mass", "cable.node[23].mass"));
        assert!(pieces(&masses(1..1000)).len() <= MOST);
    }

    #[test]
    fn what_is_held_in_between_is_no_neighbour() {
        let found = pieces(&masses((1..10).chain(11..20)));
        assert_eq!(found[4..6], ["cable.node[9].mass".to_owned(), "cable.node[11..12].mass".to_owned()]);
    }
}
