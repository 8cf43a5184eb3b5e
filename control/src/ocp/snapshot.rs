//! The matrices of a problem, to see whether the next one has others.

use super::Ocp;

/// All matrices' numbers, one behind the other.
#[derive(Clone, Debug, Default)]
pub(super) struct Snapshot {
    sizes: Vec<usize>,
    numbers: Vec<f64>,
}

impl Snapshot {
    /// Takes the problem's matrices; whether one of them differs from the last problem's.
    pub fn take(&mut self, ocp: &Ocp) -> bool {
        let mut sizes = vec![ocp.nx(), ocp.nu(), ocp.stages.len()];
        sizes.extend((0..=ocp.stages.len()).map(|k| ocp.rows(k).len()));
        let mut changed = sizes != self.sizes;
        self.sizes = sizes;
        let mut at = 0;
        let of_stages = ocp.stages.iter().flat_map(|stage| {
            let rows = &stage.rows;
            [&stage.a, &stage.b, &stage.q, &stage.s, &stage.r, &rows.gx, &rows.gu]
        });
        for matrix in of_stages.chain([&ocp.q_final, &ocp.rows_final.gx]) {
            for j in 0..matrix.ncols() {
                let length = matrix.nrows();
                let column = matrix.col(j);
                let same = match column.try_as_col_major() {
                    Some(column) => !changed && self.numbers[at..at + length] == *column.as_slice(),
                    None => false,
                };
                if !same {
                    changed = true;
                    self.numbers.truncate(at);
                    self.numbers.extend(column.iter());
                }
                at += length;
            }
        }
        changed
    }
}
