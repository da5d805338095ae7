//! Cholesky factor of a matrix most of whose rows begin with zeros, as those of a session do: a trial knows nothing of another one but
//! through what they share. The factor has the same zeros (Jennings 1966, A compact storage scheme for the solution of symmetric linear
//! simultaneous equations).

use nalgebra::{DMatrix, DVector};

/// L with L L' = A, where A is a matrix in another order of its rows and columns.
pub struct EnvelopeCholesky {
    /// For each row of L, its index in the matrix.
    order: Vec<usize>,
    /// For each row of L, its first column that may differ from zero.
    first: Vec<usize>,
    /// The rows of L one after the other, each from its first column to the diagonal, and where each begins.
    values: Vec<f64>,
    begin: Vec<usize>,
}

impl EnvelopeCholesky {
    /// The factor of `matrix` with its rows and columns in `order`; `None` if it is not positive definite. What many rows know of comes
    /// best at the end of the order.
    pub fn new(matrix: &DMatrix<f64>, order: Vec<usize>) -> Option<Self> {
        let count = order.len();
        let mut own = Self { order, first: Vec::with_capacity(count), values: Vec::new(), begin: Vec::new() };
        for row in 0..count {
            let at = |column: usize| matrix[(own.order[row], own.order[column])];
            let first = (0..row).find(|column| at(*column) != 0.0).unwrap_or(row);
            let begin = own.values.len();
            own.values.extend((first..=row).map(at));
            own.first.push(first);
            own.begin.push(begin);
            let (above, here) = own.values.split_at_mut(begin);
            for column in first..row {
                let from = first.max(own.first[column]);
                let other = &above[own.begin[column]..][..column + 1 - own.first[column]];
                let known = dot(&here[from - first..column - first], &other[from - own.first[column]..]);
                here[column - first] = (here[column - first] - known) / other[column - own.first[column]];
            }
            let (diagonal, before) = here.split_last_mut()?;
            let pivot = *diagonal - dot(before, before);
            *diagonal = Some(pivot).filter(|pivot| *pivot > 0.0).map(libm::sqrt)?;
        }
        Some(own)
    }

    /// The solution x of A x = `right`.
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut x: Vec<f64> = self.order.iter().map(|index| right[*index]).collect();
        for row in 0..x.len() {
            let (before, diagonal) = self.row(row);
            x[row] = (x[row] - dot(before, &x[self.first[row]..row])) / diagonal;
        }
        for row in (0..x.len()).rev() {
            let (before, diagonal) = self.row(row);
            x[row] /= diagonal;
            let by = x[row];
            x[self.first[row]..row].iter_mut().zip(before).for_each(|(x, own)| *x -= own * by);
        }
        let mut solution = DVector::zeros(x.len());
        self.order.iter().zip(&x).for_each(|(index, x)| solution[*index] = *x);
        solution
    }

    /// A row of L: what comes before the diagonal, and the diagonal.
    fn row(&self, row: usize) -> (&[f64], f64) {
        let before = &self.values[self.begin[row]..][..row - self.first[row]];
        (before, self.values[self.begin[row] + before.len()])
    }
}

/// The scalar product of the first values of two slices, as many as the shorter one has. Four sums side by side, which the processor does
/// not have to wait for.
fn dot(one: &[f64], other: &[f64]) -> f64 {
    let length = one.len().min(other.len());
    let ((ones, one_rest), (others, other_rest)) =
        (one[..length].as_chunks::<4>(), other[..length].as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in ones.iter().zip(others) {
        for lane in 0..4 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = one_rest.iter().zip(other_rest).map(|(a, b)| a * b).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Five blocks of three that know of each other through two last coordinates alone.
    fn arrowhead() -> DMatrix<f64> {
        let mut stream = Stream::new(1, "envelope");
        let mut factor = DMatrix::zeros(17, 17);
        for row in 0..17 {
            for column in 0..=row {
                if row >= 15 || row / 3 == column / 3 {
                    factor[(row, column)] = if row == column { 1.0 } else { 0.4 * stream.normal() };
                }
            }
        }
        &factor * factor.transpose()
    }

    #[test]
    fn solutions_are_those_of_a_dense_factor_in_any_order() {
        let matrix = arrowhead();
        let right = DVector::from_fn(17, |row, _| libm::sin(row as f64));
        let want = matrix.clone().cholesky().unwrap().solve(&right);
        let mixed: Vec<usize> = (0..17).map(|index| index * 5 % 17).collect();
        for order in [(0..17).collect(), (0..17).rev().collect(), mixed] {
            let got = EnvelopeCholesky::new(&matrix, order).unwrap().solve(&right);
            assert!((got - &want).amax() < 1e-10 * want.amax());
        }
    }

    #[test]
    fn rows_of_a_block_hold_nothing_of_the_blocks_before() {
        let factor = EnvelopeCholesky::new(&arrowhead(), (0..17).collect()).unwrap();
        assert_eq!(factor.first[14], 12);
        assert_eq!(factor.values.len(), 5 * 6 + 16 + 17);
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_factor() {
        let mut matrix = arrowhead();
        matrix[(16, 16)] = -1.0;
        assert!(EnvelopeCholesky::new(&matrix, (0..17).collect()).is_none());
        matrix[(16, 16)] = f64::NAN;
        assert!(EnvelopeCholesky::new(&matrix, (0..17).collect()).is_none());
    }
}
