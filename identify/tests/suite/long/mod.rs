//! Whole diagnoses: some seconds to minutes each, left out by `tests/run fast`.

mod diagnose_cloth;
mod diagnose_pendulum;
mod diagnose_rod;
mod diagnose_together;
mod example_diagnosis;
