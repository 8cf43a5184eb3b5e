//! The processor's widest vectors for the dense kernels: the binary is built for any x86-64 or ARM, and asks at run time.

/// Runs `kernel` compiled for the processor at hand. Only what is inlined into it gains, so kernels and what they call are
/// `#[inline(always)]`. The order of operations is the same whatever the width.
#[inline]
pub(crate) fn wide<R>(kernel: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(kernel)
}
