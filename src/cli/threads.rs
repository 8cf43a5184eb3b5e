//! Number of threads.

/// Sets the number of threads if one was given; returns the number in use.
pub fn set(threads: Option<u16>) -> usize {
    if let Some(threads) = threads {
        // Refused only if the pool is running already, which nothing has started before this.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads)).build_global();
    }
    rayon::current_num_threads()
}
