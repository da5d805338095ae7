//! Columns of a Cholesky factor, of many blocks of unknowns that do not depend on each other.

use nalgebra::DMatrix;

/// Columns of a Cholesky factor for blocks of as many unknowns each, block after block.
///
/// The rows of a block are its own unknowns, and then those after it that it depends on. Entries above the diagonal are not used.
#[derive(Debug, Clone)]
pub(super) struct BlockColumns {
    /// Number of unknowns of a block.
    size: usize,
    columns: DMatrix<f64>,
}

impl BlockColumns {
    /// `blocks` of zeros, with `below` rows below the unknowns of the block.
    pub fn zeros(size: usize, below: usize, blocks: usize) -> Self {
        Self { size, columns: DMatrix::zeros(size + below, size * blocks) }
    }

    /// The factor's columns of one block, that of a symmetric `matrix`. `None` if it is not positive definite.
    pub fn of_matrix(matrix: DMatrix<f64>) -> Option<Self> {
        let mut only = Self { size: matrix.ncols(), columns: matrix };
        only.factor(0)?;
        Some(only)
    }

    /// Number of blocks.
    pub fn count(&self) -> usize {
        self.columns.ncols() / self.size.max(1)
    }

    /// All columns, block after block.
    pub fn columns(&self) -> &DMatrix<f64> {
        &self.columns
    }

    /// Column `k` of a block.
    #[inline]
    pub fn column(&self, block: usize, k: usize) -> &[f64] {
        let rows = self.columns.nrows();
        &self.columns.as_slice()[(self.size * block + k) * rows..][..rows]
    }

    /// Column `k` of a block, to be filled.
    pub fn column_mut(&mut self, block: usize, k: usize) -> &mut [f64] {
        column_mut(&mut self.columns, self.size * block + k)
    }

    /// Column `k` of a block, below the block's own rows.
    #[inline]
    pub fn below(&self, block: usize, k: usize) -> &[f64] {
        &self.column(block, k)[self.size..]
    }

    /// Turns columns of a symmetric matrix into those of its factor. `None` if the matrix is not positive definite.
    pub fn factor(&mut self, block: usize) -> Option<()> {
        let rows = self.columns.nrows();
        let block = &mut self.columns.as_mut_slice()[self.size * block * rows..][..self.size * rows];
        for k in 0..self.size {
            let (own, later) = block[k * rows..].split_at_mut(rows);
            let own = &mut own[k..];
            if own[0].is_nan() || own[0] <= 0.0 {
                return None;
            }
            let root = libm::sqrt(own[0]);
            own[0] = root;
            scale(&mut own[1..], 1.0 / root);
            for next in 1..self.size - k {
                subtract(&mut later[(next - 1) * rows + k + next..next * rows], own[next], &own[next..]);
            }
        }
        Some(())
    }

    /// The same columns times the inverse of the block's triangle, and that inverse in place of the triangle: below it is by how much each
    /// unknown of the block decreases with those after the block.
    pub fn divided(&self) -> Self {
        let (size, rows) = (self.size, self.columns.nrows());
        let mut divided = Self::zeros(size, rows - size, self.count());
        for block in 0..self.count() {
            for k in (0..size).rev() {
                let column = self.column(block, k);
                let own = (size * block + k) * rows;
                let (own, later) = divided.columns.as_mut_slice()[own..].split_at_mut(rows);
                own[k] = 1.0;
                own[size..].copy_from_slice(&column[size..]);
                for next in 1..size - k {
                    subtract(
                        &mut own[k + 1..],
                        column[k + next],
                        &later[(next - 1) * rows + k + 1..next * rows],
                    );
                }
                scale(&mut own[k..], 1.0 / column[k]);
            }
        }
        divided
    }

    /// Solves with the triangle of a block, in place.
    pub fn solve_forward(&self, block: usize, values: &mut [f64]) {
        for k in 0..values.len() {
            let column = &self.column(block, k)[k..];
            values[k] /= column[0];
            let value = values[k];
            subtract(&mut values[k + 1..], value, &column[1..]);
        }
    }

    /// Solves with the transposed triangle of a block, in place.
    pub fn solve_backward(&self, block: usize, values: &mut [f64]) {
        for k in (0..values.len()).rev() {
            let column = &self.column(block, k)[k..];
            values[k] = (values[k] - dot(&column[1..], &values[k + 1..])) / column[0];
        }
    }

    /// Of divided columns: the variance of unknown `k` of a block where all after the block are known.
    pub fn own_variance(&self, block: usize, k: usize) -> f64 {
        let inverse = &self.column(block, k)[k..self.size];
        dot(inverse, inverse)
    }

    /// Of divided columns: the same for the combination of the block's unknowns that has these `weights`.
    pub fn variance_of(&self, block: usize, weights: impl Fn(usize) -> f64) -> f64 {
        let mut variance = 0.0;
        for row in 0..self.size {
            let of_row: f64 = (0..=row).map(|k| weights(k) * self.column(block, k)[row]).sum();
            variance += of_row * of_row;
        }
        variance
    }

    /// Sum of the logarithms of the diagonal.
    pub fn log_diagonal(&self) -> f64 {
        let diagonal = (0..self.columns.ncols()).map(|column| self.columns[(column % self.size, column)]);
        diagonal.map(libm::log).sum()
    }
}

/// A column of a matrix, to be changed.
#[inline]
pub(super) fn column_mut(matrix: &mut DMatrix<f64>, column: usize) -> &mut [f64] {
    let rows = matrix.nrows();
    &mut matrix.as_mut_slice()[column * rows..][..rows]
}

/// Takes `factor` times `others` from `values`, as far as both go.
#[inline]
pub(super) fn subtract(values: &mut [f64], factor: f64, others: &[f64]) {
    let count = values.len().min(others.len());
    let (values, others) = (&mut values[..count], &others[..count]);
    // By index, which the compiler turns into vectors without a call.
    for place in 0..count {
        values[place] -= factor * others[place];
    }
}

/// Multiplies `values` by `factor`.
fn scale(values: &mut [f64], factor: f64) {
    values.iter_mut().for_each(|value| *value *= factor);
}

/// Sum of the products of two vectors, as far as both go.
#[inline]
pub(super) fn dot(values: &[f64], others: &[f64]) -> f64 {
    let count = values.len().min(others.len());
    let (values, others) = (&values[..count], &others[..count]);
    (0..count).map(|place| values[place] * others[place]).sum()
}
