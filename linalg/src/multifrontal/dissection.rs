//! An order of elimination by nested dissection (George 1973): a set of vertices that cuts the graph in two is eliminated after both
//! halves, and these are cut again.
//!
//! Cuts are found from distances along edges. With a and b at the ends of the graph, and c and e where both are far, d_a − d_b and
//! d_c − d_e are as good as coordinates; of the vertices' medians in a few directions the one with the smallest cut is taken.

use crate::constants::LINALG;

/// Directions, as weights of both coordinates.
const DIRECTIONS: [[i64; 2]; 8] = [[1, 0], [0, 1], [1, 1], [1, -1], [2, 1], [1, 2], [2, -1], [-1, 2]];

const FAR: i64 = i64::MAX;

/// The vertices of a graph by nested dissection.
pub(crate) fn nested(neighbours: &[Vec<usize>]) -> Vec<usize> {
    let n = neighbours.len();
    let mut work = Dissection { neighbours, part: vec![0; n], parts: 1, order: Vec::with_capacity(n) };
    work.cut((0..n).collect());
    work.order
}

struct Dissection<'a> {
    neighbours: &'a [Vec<usize>],
    /// Which part a vertex is in; 0 at first, and [`usize::MAX`] in a cut.
    part: Vec<usize>,
    parts: usize,
    order: Vec<usize>,
}

impl Dissection<'_> {
    /// Orders the vertices of a part.
    fn cut(&mut self, vertices: Vec<usize>) {
        let Some((halves, between)) = self.halves(&vertices) else { return self.order_leaf(&vertices) };
        for vertex in &between {
            self.part[*vertex] = usize::MAX;
        }
        for half in halves {
            half.iter().for_each(|vertex| self.part[*vertex] = self.parts);
            self.parts += 1;
            self.cut(half);
        }
        self.order.extend(between);
    }

    /// Two halves and the separator between; `None` if the part is small or cannot be cut.
    fn halves(&self, vertices: &[usize]) -> Option<([Vec<usize>; 2], Vec<usize>)> {
        if vertices.len() <= LINALG.uncut {
            return None;
        }
        let start = self.distances(vertices[0]);
        if vertices.iter().any(|v| start[*v] == FAR) {
            let (reached, rest) = vertices.iter().partition(|v| start[**v] != FAR);
            return Some(([reached, rest], Vec::new()));
        }
        let farthest = |of: &dyn Fn(usize) -> i64| vertices.iter().copied().max_by_key(|v| (of(*v), *v)).unwrap_or(0);
        let a = self.distances(farthest(&|v| start[v]));
        let b = self.distances(farthest(&|v| a[v]));
        let c = self.distances(farthest(&|v| a[v].min(b[v])));
        let e = self.distances(farthest(&|v| c[v]));
        let coordinates = |v: usize| [a[v] - b[v], c[v] - e[v]];
        let mut best: Option<(f64, [Vec<usize>; 2], Vec<usize>)> = None;
        for [x, y] in DIRECTIONS {
            let mut sorted = vertices.to_vec();
            sorted.sort_unstable_by_key(|v| {
                let [p, q] = coordinates(*v);
                (x * p + y * q, if y == 0 { q } else { p }, *v)
            });
            for first in [true, false] {
                let (halves, between) = self.separated(&sorted, vertices[0], first);
                let unequal = halves[0].len().abs_diff(halves[1].len()) as f64 / vertices.len() as f64;
                let cost = between.len() as f64 * (1.0 + LINALG.unequal * unequal);
                if halves.iter().all(|half| !half.is_empty()) && best.as_ref().is_none_or(|(least, ..)| cost < *least) {
                    best = Some((cost, halves, between));
                }
            }
        }
        best.map(|(_, halves, between)| (halves, between))
    }

    /// Halves of the sorted vertices, and those of one half that touch the other, which are in neither.
    fn separated(&self, sorted: &[usize], member: usize, first: bool) -> ([Vec<usize>; 2], Vec<usize>) {
        let (low, high) = sorted.split_at(sorted.len() / 2);
        let (cut, other) = if first { (low, high) } else { (high, low) };
        let mut beyond = vec![false; self.part.len()];
        other.iter().for_each(|v| beyond[*v] = true);
        let part = self.part[member];
        let touches = |v: &usize| self.neighbours[*v].iter().any(|w| beyond[*w] && self.part[*w] == part);
        let (between, left) = cut.iter().partition(|v| touches(v));
        ([left, other.to_vec()], between)
    }

    /// Distances from a vertex within its part.
    fn distances(&self, from: usize) -> Vec<i64> {
        let (mut out, mut queue) = (vec![FAR; self.part.len()], std::collections::VecDeque::from([from]));
        out[from] = 0;
        while let Some(v) = queue.pop_front() {
            for &w in self.neighbours[v].iter().filter(|w| self.part[**w] == self.part[from]) {
                if out[w] == FAR {
                    out[w] = out[v] + 1;
                    queue.push_back(w);
                }
            }
        }
        out
    }

    /// Orders a part by least degree, neighbours beyond it counted, which all come later.
    fn order_leaf(&mut self, vertices: &[usize]) {
        let mut left: Vec<(usize, Vec<usize>)> = vertices.iter().map(|&v| (v, self.neighbours[v].clone())).collect();
        left.sort_unstable();
        left.iter_mut().for_each(|(_, reached)| reached.sort_unstable());
        while let Some(at) = (0..left.len()).min_by_key(|&k| (left[k].1.len(), left[k].0)) {
            let (vertex, reached) = left.remove(at);
            // the vertices it reaches become adjacent
            for (other, own) in left.iter_mut().filter(|(other, _)| reached.binary_search(other).is_ok()) {
                own.extend(&reached);
                own.sort_unstable();
                own.dedup();
                own.retain(|v| v != other && *v != vertex);
            }
            self.order.push(vertex);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square whose vertices know all others up to two columns and rows away.
    fn square(n: usize) -> Vec<Vec<usize>> {
        let near = |i: usize| i.saturating_sub(2)..(i + 3).min(n);
        let of = |i: usize, j: usize| near(i).flat_map(|k| near(j).map(move |l| k * n + l)).filter(|v| *v != i * n + j).collect();
        (0..n * n).map(|v| of(v / n, v % n)).collect()
    }

    #[test]
    fn orders_are_permutations() {
        let path = |n: usize| (0..n).map(|v| (v.saturating_sub(1)..(v + 2).min(n)).filter(|w| *w != v).collect()).collect();
        let full = |n: usize| (0..n).map(|v| (0..n).filter(|w| *w != v).collect()).collect();
        let mut apart = square(9);
        let shifted: Vec<Vec<usize>> = square(12).into_iter().map(|row| row.into_iter().map(|v| v + 81).collect()).collect();
        apart.extend(shifted);
        for graph in [square(3), square(17), path(300), full(90), vec![Vec::new(); 100], apart, Vec::new()] {
            let mut order = nested(&graph);
            order.sort_unstable();
            assert!(order.into_iter().eq(0..graph.len()));
        }
    }

    #[test]
    fn the_first_cut_of_a_square_is_not_much_longer_than_its_side() {
        let (n, graph) = (30, square(30));
        let order = nested(&graph);
        // the vertices eliminated last cut the rest in two
        let work = Dissection { neighbours: &graph, part: vec![0; n * n], parts: 1, order: Vec::new() };
        let (halves, between) = work.halves(&(0..n * n).collect::<Vec<_>>()).unwrap_or_default();
        // (the shortest has 2 n)
        assert!(between.len() <= 3 * n, "{}", between.len());
        let other = |half: usize| &halves[1 - half];
        let touch = |v: usize, half: usize| graph[v].iter().any(|w| other(half).contains(w));
        assert!((0..2).all(|half| halves[half].iter().all(|v| !touch(*v, half))));
        assert!(halves.iter().all(|half| half.len() >= n * n * 2 / 5));
        assert_eq!(order[n * n - between.len()..], between);
    }
}
