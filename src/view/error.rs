//! Why a page cannot be made.

/// Errors of making a page: mistake, likely cause and fix.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// There is nothing to show.
    #[error("the run has no states\n  likely cause: it was put together by hand\n  fix: show what `rollout` returns")]
    NoStates,
    /// The page cannot be filled in.
    #[error("the page cannot be filled in: {0}\n  likely cause: a mistake in pliant's own template\n  fix: report this as a bug")]
    Template(#[from] minijinja::Error),
    /// The header cannot be written.
    #[error("the page's header cannot be written: {0}\n  likely cause: a mistake in pliant\n  fix: report this as a bug")]
    Header(#[from] serde_json::Error),
}
