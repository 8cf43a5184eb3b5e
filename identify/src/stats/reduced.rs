//! Records reduced to a small triangle that holds everything the score tests need.
//!
//! Of a record with whitened residual r (rows), own nuisance J₀ (rows × m₀; the record's initial state, which touches no
//! other record) and global columns G (rows × k; fitted parameters and candidate causes), only
//!
//!   P = I − J₀ J₀⁺,   [G̃ r̃] = P [G r] = Q T,   T upper triangular, (k+1) × (k+1)
//!
//! is kept: every inner product of G̃ and r̃ is one of T's columns (gram = TᵀT), and T of several records is the
//! triangle of the stacked triangles (a "tall skinny QR"), so that precision is that of QR and not of normal equations.
//! Records of 15 000 rows × 100 columns become 16 kB each; the whole matrix never exists.
//!
//! Per time block b the small matrices G̃_bᵀG̃_b, G̃_bᵀr̃_b and r̃_bᵀr̃_b are kept as well, for variances robust to a wrong noise model and
//! for errors on records left out.

use super::basis::Basis;
use super::constants::STATS;
use super::error::{StatsError, check_slice};
use nalgebra::{DMatrix, DVector};

/// One record's whitened rows. Rows are (time, channel) in time order; matrices are row-major.
/// A prior on the record's own nuisance enters as further rows (prior residual over its σ), as a block of its own.
#[derive(Debug, Clone, Copy)]
pub struct RecordRows<'a> {
    /// Whitened residual, measured − simulated (the sign sets the sign of every one-step size).
    pub residual: &'a [f64],
    /// rows × `own_columns`, whitened ∂y/∂x₀: affects this record alone.
    pub own: &'a [f64],
    /// m₀.
    pub own_columns: usize,
    /// rows × `global_columns`, whitened ∂y/∂θ of fitted parameters and candidates.
    pub global: &'a [f64],
    /// k.
    pub global_columns: usize,
    /// First row of each time block, ascending from 0; empty: the record is one block.
    pub block_starts: &'a [usize],
}

/// First rows of blocks of `times_per_block` time steps each; a last block shorter than half joins its neighbour.
pub fn time_blocks(times: usize, channels: usize, times_per_block: usize) -> Vec<usize> {
    let length = times_per_block.max(1);
    let mut starts: Vec<usize> = (0..times).step_by(length).collect();
    if starts.len() > 1 && times - starts[starts.len() - 1] < length.div_ceil(2) {
        starts.pop();
    }
    starts.iter().map(|t| t * channels).collect()
}

/// A time block's share.
#[derive(Debug, Clone)]
pub struct Block {
    /// Number of the record within the whole.
    pub record: usize,
    /// Rows in it.
    pub rows: usize,
    /// G̃_bᵀ G̃_b (k × k).
    pub gram: DMatrix<f64>,
    /// G̃_bᵀ r̃_b (k).
    pub score: DVector<f64>,
    /// r̃_bᵀ r̃_b.
    pub square: f64,
}

/// Sufficient statistics of one record or of many.
#[derive(Debug, Clone)]
pub struct Reduced {
    /// T of [G̃ r̃].
    factor: DMatrix<f64>,
    /// |g_j|² of the columns before the own nuisance was projected out.
    raw_square: Vec<f64>,
    rows: usize,
    own_rank: usize,
    records: usize,
    blocks: Vec<Block>,
    dead_own: Vec<(usize, usize)>,
}

impl Reduced {
    /// Reduces one record.
    ///
    /// # Errors
    /// Lengths that contradict the shapes, numbers that are not finite, block starts out of order.
    pub fn of_record(record: &RecordRows) -> Result<Self, StatsError> {
        let (rows, k) = (record.residual.len(), record.global_columns);
        check_slice("residual", record.residual, rows)?;
        check_slice("own nuisance matrix", record.own, rows * record.own_columns)?;
        check_slice("global matrix", record.global, rows * k)?;
        let starts = checked_starts(record.block_starts, rows)?;

        let mut data = DMatrix::zeros(rows, k + 1);
        for (i, row) in record.global.chunks_exact(k.max(1)).enumerate() {
            row.iter().enumerate().for_each(|(j, x)| data[(i, j)] = *x);
        }
        data.column_mut(k).copy_from_slice(record.residual);
        let raw_square = (0..k).map(|j| data.column(j).norm_squared()).collect();

        let own = DMatrix::from_row_slice(rows, record.own_columns, record.own);
        let norms: Vec<f64> = own.column_iter().map(|c| c.norm()).collect();
        let basis = Basis::new(&own, &norms, STATS.dead);
        basis.project_out(&mut data);

        // QR block by block stays in cache, and gives the blocks' statistics on the way.
        let ends = starts.iter().skip(1).copied().chain([rows]);
        let parts: Vec<(usize, DMatrix<f64>)> = starts
            .iter()
            .zip(ends)
            .map(|(&start, end)| (end - start, data.rows(start, end - start).into_owned().qr().unpack_r().upper_triangle()))
            .collect();
        let blocks = parts.iter().map(|(rows, r)| block(*rows, r)).collect();
        let factor = triangle(stack(parts.iter().map(|p| &p.1), k + 1));
        let dead_own = basis.dead.iter().map(|&c| (0, c)).collect();
        Ok(Self { factor, raw_square, rows, own_rank: basis.rank(), records: 1, blocks, dead_own })
    }

    /// Adds the statistics of further records, numbered after those already here. Merging in the same order gives the same bits.
    ///
    /// # Errors
    /// Another number of global columns.
    pub fn merge(&mut self, other: &Self) -> Result<(), StatsError> {
        if other.columns() != self.columns() {
            return Err(StatsError::Length { what: "global columns", found: other.columns(), expected: self.columns() });
        }
        self.factor = triangle(stack([&self.factor, &other.factor].into_iter(), self.columns() + 1));
        self.raw_square.iter_mut().zip(&other.raw_square).for_each(|(a, b)| *a += b);
        self.blocks.extend(other.blocks.iter().map(|b| Block { record: b.record + self.records, ..b.clone() }));
        self.dead_own.extend(other.dead_own.iter().map(|(r, c)| (r + self.records, *c)));
        self.rows += other.rows;
        self.own_rank += other.own_rank;
        self.records += other.records;
        Ok(())
    }

    /// Adds further rows of the last record here: a piece of the same measurement with a nuisance of its own.
    ///
    /// # Errors
    /// Another number of global columns.
    pub fn append(&mut self, piece: &Self) -> Result<(), StatsError> {
        let (records, first) = (self.records, self.blocks.len());
        self.merge(piece)?;
        self.records = records;
        self.blocks[first..].iter_mut().for_each(|b| b.record = records - 1);
        Ok(())
    }

    /// The statistics with the first `k` global columns alone.
    pub fn first(&self, k: usize) -> Self {
        let kept: Vec<usize> = (0..k).chain([self.columns()]).collect();
        let one = |b: &Block| Block {
            gram: b.gram.view((0, 0), (k, k)).into_owned(),
            score: b.score.rows(0, k).into_owned(),
            ..b.clone()
        };
        Self {
            factor: triangle(self.factor.select_columns(&kept)),
            raw_square: self.raw_square[..k].to_vec(),
            blocks: self.blocks.iter().map(one).collect(),
            ..self.clone()
        }
    }

    /// Merges records in the order given.
    ///
    /// # Errors
    /// No record, or different numbers of global columns.
    pub fn merge_all(parts: &[Self]) -> Result<Self, StatsError> {
        let (first, rest) = parts.split_first().ok_or(StatsError::TooFew { what: "records", found: 0, needed: 1 })?;
        let mut whole = first.clone();
        for part in rest {
            whole.merge(part)?;
        }
        Ok(whole)
    }

    /// k.
    pub fn columns(&self) -> usize {
        self.raw_square.len()
    }

    /// Rows of all records.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of records.
    pub fn records(&self) -> usize {
        self.records
    }

    /// Directions that the records' own nuisance took out, in sum.
    pub fn own_rank(&self) -> usize {
        self.own_rank
    }

    /// (record, column) of own nuisance columns without an effect of their own.
    pub fn dead_own(&self) -> &[(usize, usize)] {
        &self.dead_own
    }

    /// Time blocks of all records.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// G̃ᵀG̃ (k × k): the Gauss–Newton matrix with the initial states eliminated.
    pub fn gram(&self) -> DMatrix<f64> {
        let g = self.factor.columns(0, self.columns()).into_owned();
        g.transpose() * g
    }

    /// G̃ᵀr̃ (k).
    pub fn score(&self) -> DVector<f64> {
        self.factor.columns(0, self.columns()).transpose() * self.factor.column(self.columns())
    }

    /// r̃ᵀr̃.
    pub fn rss(&self) -> f64 {
        self.factor.column(self.columns()).norm_squared()
    }

    /// |g_j| before any projection.
    pub fn raw_norm(&self, column: usize) -> f64 {
        self.raw_square[column].sqrt()
    }

    pub(crate) fn factor(&self) -> &DMatrix<f64> {
        &self.factor
    }
}

fn checked_starts(starts: &[usize], rows: usize) -> Result<Vec<usize>, StatsError> {
    if starts.is_empty() {
        return Ok(vec![0]);
    }
    let ascending = starts[0] == 0 && starts.windows(2).all(|w| w[0] < w[1]) && starts[starts.len() - 1] < rows.max(1);
    if ascending {
        Ok(starts.to_vec())
    } else {
        let value = starts.iter().find(|s| **s >= rows).or(starts.first()).map_or(f64::NAN, |s| *s as f64);
        Err(StatsError::OutOfRange { what: "block start", value, range: "ascending from 0, below the number of rows" })
    }
}

/// A block's statistics from the triangle of its own [G̃_b r̃_b].
fn block(rows: usize, r: &DMatrix<f64>) -> Block {
    let k = r.ncols() - 1;
    let g = r.columns(0, k).into_owned();
    let products = g.transpose() * r;
    let square = r.column(k).norm_squared();
    Block { record: 0, rows, gram: products.columns(0, k).into_owned(), score: products.column(k).into_owned(), square }
}

fn stack<'a>(parts: impl Iterator<Item = &'a DMatrix<f64>> + Clone, columns: usize) -> DMatrix<f64> {
    let rows = parts.clone().map(DMatrix::nrows).sum();
    let mut stacked = DMatrix::zeros(rows, columns);
    let mut next = 0;
    for part in parts {
        stacked.rows_mut(next, part.nrows()).copy_from(part);
        next += part.nrows();
    }
    stacked
}

/// The upper triangle of a QR, always columns × columns (padded with zero rows).
fn triangle(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.ncols();
    let r = matrix.qr().unpack_r();
    let mut square = DMatrix::zeros(n, n);
    square.rows_mut(0, r.nrows()).copy_from(&r.upper_triangle());
    square
}
