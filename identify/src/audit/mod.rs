//! Step 0 of a diagnosis: the data before any physics.
//!
//! [`audit`] looks at raw records (time stamps, measured points, inputs) and reports data that contradict themselves, their
//! neighbours or the other records: clocks and lost frames, saturation, quantisation, noise, frozen markers, jumps, swaps,
//! lengths that should not change, inputs that jump, records unlike the others. Nothing is repaired here.
//!
//! Thresholds are meant for smooth motion sampled well above its bandwidth, with any kind of motion capture. Comparisons
//! between records need at least five.

mod across;
mod clock;
mod constants;
mod frames;
mod frozen;
mod jumps;
mod lengths;
mod noise;
mod record;
mod report;
mod saturation;
mod series;
mod swaps;

pub(crate) use constants::AUDIT;
pub use record::{AuditError, Layout, RawRecord};
pub use report::{AuditReport, Finding, Place, RecordNoise, Severity};
pub(crate) use series::noise_sigma;

use record::Prepared;

/// Audits all records of one set-up; findings refer to records by their place in the list.
///
/// # Errors
/// Slices whose lengths contradict the layout, or pairs that name a point that does not exist.
pub fn audit(records: &[RawRecord], layout: &Layout) -> Result<AuditReport, AuditError> {
    layout.check()?;
    let mut report = AuditReport::default();
    let mut prepared = Vec::with_capacity(records.len());
    for (index, raw) in records.iter().enumerate() {
        let record = Prepared::new(index, raw, layout, &mut report.findings)?;
        report.noise.push(noise::check(&record, &mut report.findings));
        prepared.push(record);
    }
    for (record, noise) in prepared.iter_mut().zip(&report.noise) {
        record.set_noise(noise);
        let out = &mut report.findings;
        clock::check(record, out);
        record.lost = frames::check(record, out);
        saturation::check(record, out);
        frozen::check(record, out);
        let swapped = swaps::check(record, out);
        jumps::check(record, &swapped, out);
        lengths::check_within(record, out);
    }
    lengths::check_across(&prepared, &mut report.findings);
    across::check(&prepared, &mut report.findings);
    report.sort();
    Ok(report)
}
