//! What is known about a system before its numbers: made once per model, shared.

use super::driven::CouplingPattern;
use super::sparse::SparsePattern;
use super::{BlockBand, KktError, Method, Symmetry};
use std::sync::Arc;

/// Method, symmetry, sizes and driven nodes of a system, and the analysis of its pattern. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Symbolic {
    pub(super) shared: Arc<Shared>,
}

#[derive(Debug)]
pub(super) struct Shared {
    pub method: Method,
    pub symmetry: Symmetry,
    pub n_blocks: usize,
    pub half_width: usize,
    pub driven: Vec<bool>,
    /// Blocks of K_fp; empty unless symmetric.
    pub coupling: CouplingPattern,
    /// Only for [`Method::Sparse`].
    pub sparse: Option<SparsePattern>,
}

impl Symbolic {
    /// Analyses systems of `n_blocks` nodes with blocks (i, j), |i − j| ≤ `half_width`.
    ///
    /// `driven[i]`: node i has identity rows. `pattern`: the blocks (i, j) that can be nonzero, for [`Method::Sparse`] (other
    /// methods use the whole band); diagonal blocks are always included, and so is (j, i) with (i, j).
    pub fn new(
        method: Method,
        symmetry: Symmetry,
        n_blocks: usize,
        half_width: usize,
        driven: &[bool],
        pattern: Option<&[(usize, usize)]>,
    ) -> Result<Self, KktError> {
        if driven.len() != n_blocks {
            return Err(KktError::Shape { what: "driven flags", expected: n_blocks, found: driven.len() });
        }
        let blocks = block_pattern(n_blocks, half_width, pattern)?;
        let coupling = match symmetry {
            Symmetry::Symmetric => CouplingPattern::new(&blocks, driven, half_width),
            Symmetry::General => CouplingPattern::default(),
        };
        let sparse = match method {
            Method::Sparse => Some(SparsePattern::new(symmetry, n_blocks, half_width, driven, &blocks)?),
            Method::Band | Method::Dense => None,
        };
        let driven = driven.to_vec();
        Ok(Self { shared: Arc::new(Shared { method, symmetry, n_blocks, half_width, driven, coupling, sparse }) })
    }

    /// How matrices are factored.
    pub fn method(&self) -> Method {
        self.shared.method
    }

    /// What is assumed of them.
    pub fn symmetry(&self) -> Symmetry {
        self.shared.symmetry
    }

    /// Number of nodes.
    pub fn n_blocks(&self) -> usize {
        self.shared.n_blocks
    }

    /// Half width of the band in nodes.
    pub fn half_width(&self) -> usize {
        self.shared.half_width
    }

    /// Number of scalar rows.
    pub fn dim(&self) -> usize {
        3 * self.shared.n_blocks
    }
}

impl Shared {
    pub fn dim(&self) -> usize {
        3 * self.n_blocks
    }

    pub fn check(&self, a: &BlockBand) -> Result<(), KktError> {
        if a.n_blocks() != self.n_blocks {
            return Err(KktError::Shape { what: "nodes of the matrix", expected: self.n_blocks, found: a.n_blocks() });
        }
        if a.half_width() != self.half_width {
            return Err(KktError::Shape { what: "half width of the matrix", expected: self.half_width, found: a.half_width() });
        }
        Ok(())
    }
}

/// Sorted column nodes of every row node.
fn block_pattern(n: usize, half_width: usize, pattern: Option<&[(usize, usize)]>) -> Result<Vec<Vec<usize>>, KktError> {
    let Some(pattern) = pattern else {
        return Ok((0..n).map(|i| (i.saturating_sub(half_width)..n.min(i + half_width + 1)).collect()).collect());
    };
    let mut rows: Vec<Vec<usize>> = (0..n).map(|i| vec![i]).collect();
    for &(i, j) in pattern {
        if i >= n || j >= n || i.abs_diff(j) > half_width {
            return Err(KktError::Pattern { i, j, half_width, n_blocks: n });
        }
        rows[i].push(j);
        rows[j].push(i);
    }
    for row in &mut rows {
        row.sort_unstable();
        row.dedup();
    }
    Ok(rows)
}
