//! An order of elimination that makes little fill.

use crate::KktError;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::amd;

/// The vertices of a graph in an order in which eliminating them makes little fill: least degree first (Amestoy, Davis and Duff 1996).
pub(crate) fn fill_reducing(neighbours: &[Vec<usize>]) -> Result<Vec<usize>, KktError> {
    let n = neighbours.len();
    let (mut starts, mut rows) = (vec![0], Vec::new());
    for (i, others) in neighbours.iter().enumerate() {
        let before = rows.len();
        rows.extend(others.iter().copied().chain([i]));
        rows[before..].sort_unstable();
        starts.push(rows.len());
    }
    let entries = rows.len();
    let pattern = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
    let (mut order, mut inverse) = (vec![0; n], vec![0; n]);
    let mut memory = MemBuffer::new(amd::order_scratch::<usize>(n, entries));
    amd::order(&mut order, &mut inverse, pattern.as_ref(), amd::Control::default(), MemStack::new(&mut memory))
        .map_err(|source| KktError::Analysis { dim: n, source })?;
    Ok(order)
}
