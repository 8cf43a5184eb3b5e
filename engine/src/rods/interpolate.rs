//! Twists nobody has measured: even between the edges that grippers hold.

use super::Rods;
use super::frames::RodPoint;
use std::f64::consts::TAU;
use std::ops::Range;

/// By how much a twist follows another's: (row, leading row, weight).
pub type Following = Vec<(usize, usize, f64)>;

/// The edges of one rod as a chain: rows of their twists, where they stand along the rod, and what they have turned by.
struct Chain {
    rows: Vec<usize>,
    /// Sums of the lengths of the joints before each.
    place: Vec<f64>,
    /// Sums of the twists of the joints before each \[rad\].
    turned: Vec<f64>,
    /// Those that are held, by number in the chain.
    anchors: Vec<usize>,
}

impl Chain {
    /// The held edges on both sides of edge k, with the weights by which it follows them; none where nothing is held.
    fn leaders(&self, k: usize) -> Vec<(usize, f64)> {
        let after = self.anchors.partition_point(|a| *a < k);
        match (after.checked_sub(1).map(|i| self.anchors[i]), self.anchors.get(after)) {
            (_, Some(&b)) if b == k => vec![(k, 1.0)],
            (Some(a), Some(&b)) => {
                let t = (self.place[k] - self.place[a]) / (self.place[b] - self.place[a]);
                vec![(a, 1.0 - t), (b, t)]
            }
            (Some(a), None) => vec![(a, 1.0)],
            (None, Some(&b)) => vec![(b, 1.0)],
            (None, None) => Vec::new(),
        }
    }
}

impl Rods {
    fn chain(&self, joints: Range<usize>, held: &[bool], point: &RodPoint) -> Chain {
        let first = self.joints[joints.start].edges[0];
        let edges = std::iter::once(first).chain(joints.clone().map(|j| self.joints[j].edges[1]));
        let rows: Vec<usize> = edges.map(|k| self.row(k)).collect();
        let sums = |x: &dyn Fn(usize) -> f64| {
            let mut sum = 0.0;
            let rest = joints.clone().map(|j| {
                sum += x(j);
                sum
            });
            std::iter::once(0.0).chain(rest).collect()
        };
        let anchors = (0..rows.len()).filter(|k| held[rows[*k]]).collect();
        Chain { anchors, place: sums(&|j| self.joints[j].fraction), turned: sums(&|j| point.twists[j]), rows }
    }

    fn chains(&self, held: &[bool], q: &[f64], frames: &[f64]) -> Vec<Chain> {
        let mut point = RodPoint::default();
        self.evaluate(q, frames, q, &mut point);
        // a ring keeps the twist that it was joined with
        let open = self.sections.iter().filter(|section| section.seam.is_none());
        let joints = open.map(|section| section.joints.clone()).filter(|joints| !joints.is_empty());
        joints.map(|joints| self.chain(joints, held, &point)).collect()
    }

    /// Turns the edges that nothing holds so that twist is even along the rod between those that are held, and absent beyond them, as in
    /// a straight section at rest. `held`: by rows of q; `frames` belong to `q`. Returns how the turned edges follow the held ones.
    pub(crate) fn spread_twists(&self, held: &[bool], q: &mut [f64], frames: &[f64]) -> Following {
        let mut following = Vec::new();
        for chain in self.chains(held, q, frames) {
            for k in (0..chain.rows.len()).filter(|k| !held[chain.rows[*k]]) {
                let leaders = chain.leaders(k);
                if !leaders.is_empty() {
                    let even: f64 = leaders.iter().map(|(a, w)| w * chain.turned[*a]).sum();
                    q[chain.rows[k]] += even - chain.turned[k];
                }
                following.extend(leaders.iter().map(|(a, w)| (chain.rows[k], chain.rows[*a], *w)));
            }
        }
        following
    }

    /// Takes whole turns out of the twist between neighbouring held edges, which are where they are with any number of them: at most half a
    /// turn is left. What lies between them follows.
    pub(crate) fn take_out_turns(&self, held: &[bool], q: &mut [f64], frames: &[f64]) {
        for chain in self.chains(held, q, frames) {
            let mut turns = vec![0.0; chain.rows.len()];
            for pair in chain.anchors.windows(2) {
                let whole = ((chain.turned[pair[1]] - chain.turned[pair[0]]) / TAU).round();
                turns[pair[1]] = turns[pair[0]] + whole;
            }
            for k in 0..chain.rows.len() {
                q[chain.rows[k]] -= TAU * chain.leaders(k).iter().map(|(a, w)| w * turns[*a]).sum::<f64>();
            }
        }
    }
}
