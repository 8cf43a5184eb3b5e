//! Numbers that decide in linear algebra: sound pivots, which method factors, how fronts are formed. Units and reasons; where no source is
//! named, a value is our own choice, those of methods by measured times. Sizes that a kernel's registers or caches ask for stand at the kernel.

/// See the module; one value, [`LINALG`].
pub(crate) struct LinalgConstants {
    // pivots
    /// A pivot below this part of its row's size is rounding noise [-].
    pub pivot_floor: f64,
    /// Largest growth of a factorization without row exchanges [-]: a larger one leaves too few digits for refinement to start from.
    pub growth_limit: f64,
    // choice of method
    /// Rows of a dense matrix from which on faer's blocked factorizations are faster.
    pub blocked: usize,
    /// Pivots eliminated before the rest of a wide front is changed, as a product of matrices.
    pub strip: usize,
    /// Rows of a front from which on that is faster.
    pub wide_front: usize,
    // multifrontal analysis
    /// Fronts of up to this many slots join their parents at this part of zeros [slots, -].
    pub small_front: (usize, f64),
    /// The same of larger ones.
    pub medium_front: (usize, f64),
    /// Part of zeros at which still larger fronts join their parents [-].
    pub large_front: f64,
    /// Slots from which on dissection is tried beside least degree, and taken where it is less work.
    pub dissected: usize,
    /// Parts of up to this many vertices are not cut any more.
    pub uncut: usize,
    /// Weight of halves of different size, relative to the length of the cut [-].
    pub unequal: f64,
    // memory
    /// Shorter buffers are left to the allocator \[numbers\].
    pub least_kept: usize,
    /// Numbers kept at most, in all: 64 MiB.
    pub most_kept: usize,
}

/// The values in use.
pub(crate) const LINALG: LinalgConstants = LinalgConstants {
    pivot_floor: 16.0 * f64::EPSILON,
    growth_limit: 1e8,
    blocked: 128,
    strip: 64,
    wide_front: 192,
    small_front: (6, 0.6),
    medium_front: (16, 0.25),
    large_front: 0.05,
    dissected: 1000,
    uncut: 60,
    unequal: 2.0,
    least_kept: 4096,
    most_kept: 1 << 23,
};
