//! Numbers of matrices and factors, whose memory is kept for the next when they are dropped.
//!
//! A rollout's records are some hundred kilobytes a step in sheets. Given back to the system and taken anew for every rollout, such memory costs
//! as much as a step: each of its pages is cleared when it is first written. (A gradient of 60 steps of a sheet of 10 × 10 nodes on a floor
//! takes 0.7 of the time with memory that is kept.)

use crate::constants::LINALG;
use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, MutexGuard};

/// Spare buffers by capacity.
static SPARE: Mutex<Spare> = Mutex::new(Spare { shelves: BTreeMap::new(), kept: 0 });

struct Spare {
    shelves: BTreeMap<usize, Vec<Vec<f64>>>,
    kept: usize,
}

impl Spare {
    /// A vector with room for `len` numbers and not for many more, with any content.
    fn take(&mut self, len: usize) -> Option<Vec<f64>> {
        let (&capacity, shelf) = self.shelves.range_mut(len..=len + len / 4).next()?;
        let found = shelf.pop();
        if shelf.is_empty() {
            self.shelves.remove(&capacity);
        }
        self.kept -= capacity;
        found
    }

    fn keep(&mut self, numbers: Vec<f64>) {
        let capacity = numbers.capacity();
        if self.kept + capacity <= LINALG.most_kept {
            self.kept += capacity;
            self.shelves.entry(capacity).or_default().push(numbers);
        }
    }
}

/// A vector whose length stays.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Buffer(Vec<f64>);

impl Buffer {
    pub fn zeros(len: usize) -> Self {
        let mut numbers = with_room(len);
        numbers.clear();
        numbers.resize(len, 0.0);
        Self(numbers)
    }

    /// With any numbers in it, for buffers that are written before they are read.
    pub fn any(len: usize) -> Self {
        let mut numbers = with_room(len);
        numbers.resize(len, 0.0);
        Self(numbers)
    }
}

/// The spare buffers, unless another thread holds them: then the allocator serves as well. (After a fork the lock may stay held for ever.)
fn spares() -> Option<MutexGuard<'static, Spare>> {
    SPARE.try_lock().ok()
}

fn with_room(len: usize) -> Vec<f64> {
    let spare = if len < LINALG.least_kept { None } else { spares().and_then(|mut spares| spares.take(len)) };
    spare.unwrap_or_else(|| Vec::with_capacity(len))
}

impl Clone for Buffer {
    fn clone(&self) -> Self {
        let mut numbers = with_room(self.0.len());
        numbers.clear();
        numbers.extend_from_slice(&self.0);
        Self(numbers)
    }

    fn clone_from(&mut self, other: &Self) {
        if self.0.len() == other.0.len() {
            self.0.copy_from_slice(&other.0);
        } else {
            *self = other.clone();
        }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if self.0.capacity() >= LINALG.least_kept
            && let Some(mut spares) = spares()
        {
            spares.keep(std::mem::take(&mut self.0));
        }
    }
}

impl Deref for Buffer {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.0
    }
}

impl DerefMut for Buffer {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spares_serve_their_own_size_and_are_bounded() {
        let mut spare = Spare { shelves: BTreeMap::new(), kept: 0 };
        spare.keep(Vec::with_capacity(5000));
        assert!(spare.take(5001).is_none() && spare.take(3900).is_none(), "of another size");
        let found = spare.take(4500).map(|v| (v.capacity(), v.len()));
        assert_eq!((found, spare.kept, spare.shelves.len()), (Some((5000, 0)), 0, 0));
        for _ in 0..3 {
            spare.keep(Vec::with_capacity(LINALG.most_kept / 2));
        }
        assert_eq!(spare.kept, LINALG.most_kept, "the third is given back");
    }

    #[test]
    fn copies_are_independent_and_zeros_are_zero() {
        let mut first = Buffer::zeros(2 * LINALG.least_kept);
        first.fill(1.0);
        let copy = first.clone();
        first[0] = 2.0;
        drop(first);
        assert_eq!((copy[0], copy.len()), (1.0, 2 * LINALG.least_kept));
        assert!(Buffer::zeros(2 * LINALG.least_kept).iter().all(|x| *x == 0.0), "whatever was in the memory");
    }
}
