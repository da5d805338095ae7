//! A positive definite matrix as a session has it: a trial knows of another one only through what they share. Each trial is a small block
//! on the diagonal, beside a border of what several share, of which it touches a few columns. Time and memory of all that is done here
//! grow with the number of blocks.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::linalg::{cholesky, inverse_of};

/// Where an unknown has its row.
#[derive(Debug, Clone, Copy)]
enum RowPlace {
    /// Row of a block.
    Block { block: usize, row: usize },
    /// Row of the border.
    Border(usize),
}

/// The rows of one block.
#[derive(Debug, Clone)]
struct Block {
    /// Block by block.
    matrix: DMatrix<f64>,
    /// The rows of the border that the block touches.
    touched: Vec<usize>,
    /// Block by touched rows of the border.
    with_border: DMatrix<f64>,
}

/// A symmetric matrix of blocks and a border.
#[derive(Debug, Clone)]
pub struct BorderedMatrix {
    places: Vec<RowPlace>,
    blocks: Vec<Block>,
    border: DMatrix<f64>,
}

/// Its factor: the blocks are eliminated, and the Schur complement of the border is factored.
#[derive(Debug, Clone)]
pub struct BorderedFactor {
    places: Vec<RowPlace>,
    blocks: Vec<EliminatedRows>,
    border: Cholesky<f64, Dyn>,
}

#[derive(Debug, Clone)]
struct EliminatedRows {
    factor: Cholesky<f64, Dyn>,
    touched: Vec<usize>,
    /// The block's inverse times its part of the border.
    per_border: DMatrix<f64>,
}

/// The inverse of a [`BorderedMatrix`], of which single elements are computed where they are asked for.
#[derive(Debug, Clone)]
pub struct BorderedInverse {
    factor: BorderedFactor,
    of_blocks: Vec<DMatrix<f64>>,
    of_border: DMatrix<f64>,
}

impl BorderedMatrix {
    /// Zero, of `count` unknowns. For each block, `blocks` has the indices of its unknowns and of those of the border that it touches; all
    /// other unknowns are the border.
    pub fn zero(count: usize, blocks: &[(Vec<usize>, Vec<usize>)]) -> Self {
        let mut places = vec![None; count];
        for (block, (own, _)) in blocks.iter().enumerate() {
            own.iter()
                .enumerate()
                .for_each(|(row, index)| places[*index] = Some(RowPlace::Block { block, row }));
        }
        let mut rows = 0..;
        let places: Vec<RowPlace> = places
            .into_iter()
            .map(|own| own.or_else(|| rows.next().map(RowPlace::Border)).expect("as many rows as there are"))
            .collect();
        let row_of = |index: &usize| match places[*index] {
            RowPlace::Border(row) => row,
            RowPlace::Block { .. } => panic!("unknown {index} is of two blocks"),
        };
        let block = |(own, touched): &(Vec<usize>, Vec<usize>)| Block {
            matrix: DMatrix::zeros(own.len(), own.len()),
            with_border: DMatrix::zeros(own.len(), touched.len()),
            touched: touched.iter().map(row_of).collect(),
        };
        let size = rows.start;
        Self { blocks: blocks.iter().map(block).collect(), places, border: DMatrix::zeros(size, size) }
    }

    /// Adds `value` at a row and a column. What a block and the border have in common is kept once: it is added by the block's row.
    ///
    /// # Panics
    /// If the two know nothing of each other.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        match (self.places[row], self.places[column]) {
            (RowPlace::Block { block, row }, RowPlace::Block { block: other, row: column }) => {
                assert_eq!(block, other, "two blocks know nothing of each other");
                self.blocks[block].matrix[(row, column)] += value;
            }
            (RowPlace::Block { block, row }, RowPlace::Border(column)) => {
                let own = &mut self.blocks[block];
                let touched = own.touched.iter().position(|touched| *touched == column);
                own.with_border[(row, touched.expect("a row that the block touches"))] += value;
            }
            (RowPlace::Border(_), RowPlace::Block { .. }) => {}
            (RowPlace::Border(row), RowPlace::Border(column)) => self.border[(row, column)] += value,
        }
    }

    /// Makes an unknown independent of all others, with this value on the diagonal.
    pub fn isolate(&mut self, index: usize, diagonal: f64) {
        match self.places[index] {
            RowPlace::Block { block, row } => {
                let Block { matrix, with_border, .. } = &mut self.blocks[block];
                clear(matrix, row, diagonal);
                with_border.row_mut(row).fill(0.0);
            }
            RowPlace::Border(row) => {
                clear(&mut self.border, row, diagonal);
                for own in &mut self.blocks {
                    if let Some(column) = own.touched.iter().position(|touched| *touched == row) {
                        own.with_border.column_mut(column).fill(0.0);
                    }
                }
            }
        }
    }

    /// The factor; `None` if the matrix is not positive definite.
    pub fn factor(&self) -> Option<BorderedFactor> {
        let mut border = self.border.clone();
        let mut blocks = Vec::with_capacity(self.blocks.len());
        for Block { matrix, touched, with_border } in &self.blocks {
            let factor = cholesky(matrix.clone())?;
            let per_border = factor.solve(with_border);
            let known = with_border.tr_mul(&per_border);
            for (i, row) in touched.iter().enumerate() {
                for (j, column) in touched.iter().enumerate() {
                    border[(*row, *column)] -= known[(i, j)];
                }
            }
            blocks.push(EliminatedRows { factor, touched: touched.clone(), per_border });
        }
        Some(BorderedFactor { places: self.places.clone(), blocks, border: cholesky(border)? })
    }
}

/// Makes a row and its column zero but for the diagonal.
fn clear(matrix: &mut DMatrix<f64>, row: usize, diagonal: f64) {
    matrix.row_mut(row).fill(0.0);
    matrix.column_mut(row).fill(0.0);
    matrix[(row, row)] = diagonal;
}

impl BorderedFactor {
    /// The solution x of A x = `right`.
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut of_blocks: Vec<DVector<f64>> =
            self.blocks.iter().map(|own| DVector::zeros(own.per_border.nrows())).collect();
        let mut of_border = DVector::zeros(self.border.l_dirty().nrows());
        for (place, value) in self.places.iter().zip(right.iter()) {
            match place {
                RowPlace::Block { block, row } => of_blocks[*block][*row] = *value,
                RowPlace::Border(row) => of_border[*row] = *value,
            }
        }
        for (EliminatedRows { touched, per_border, .. }, own) in self.blocks.iter().zip(&of_blocks) {
            let known = per_border.tr_mul(own);
            touched.iter().zip(known.iter()).for_each(|(row, known)| of_border[*row] -= known);
        }
        let of_border = self.border.solve(&of_border);
        for (EliminatedRows { factor, touched, per_border }, own) in self.blocks.iter().zip(&mut of_blocks) {
            let near = DVector::from_iterator(touched.len(), touched.iter().map(|row| of_border[*row]));
            *own = factor.solve(own) - per_border * near;
        }
        let at = |place: &RowPlace| match place {
            RowPlace::Block { block, row } => of_blocks[*block][*row],
            RowPlace::Border(row) => of_border[*row],
        };
        DVector::from_iterator(self.places.len(), self.places.iter().map(at))
    }

    /// The inverse of the matrix.
    pub fn inverse(self) -> BorderedInverse {
        let of_blocks = self.blocks.iter().map(|own| inverse_of(&own.factor)).collect();
        BorderedInverse { of_blocks, of_border: inverse_of(&self.border), factor: self }
    }
}

impl BorderedInverse {
    /// Number of unknowns.
    pub fn len(&self) -> usize {
        self.factor.places.len()
    }

    /// The element at a row and a column.
    pub fn at(&self, row: usize, column: usize) -> f64 {
        let through_border = |one: &dyn Fn(usize) -> f64, near: &[usize], column: usize| {
            near.iter().enumerate().map(|(i, row)| one(i) * self.of_border[(*row, column)]).sum::<f64>()
        };
        match (self.factor.places[row], self.factor.places[column]) {
            (RowPlace::Border(row), RowPlace::Border(column)) => self.of_border[(row, column)],
            (RowPlace::Block { block, row }, RowPlace::Border(column))
            | (RowPlace::Border(column), RowPlace::Block { block, row }) => {
                let own = &self.factor.blocks[block];
                -through_border(&|i| own.per_border[(row, i)], &own.touched, column)
            }
            (RowPlace::Block { block, row }, RowPlace::Block { block: other_block, row: other_row }) => {
                let (own, other) = (&self.factor.blocks[block], &self.factor.blocks[other_block]);
                let of_others = other.touched.iter().enumerate().map(|(j, column)| {
                    other.per_border[(other_row, j)]
                        * through_border(&|i| own.per_border[(row, i)], &own.touched, *column)
                });
                let alone = if block == other_block { self.of_blocks[block][(row, other_row)] } else { 0.0 };
                alone + of_others.sum::<f64>()
            }
        }
    }

    /// The part of some rows and columns.
    pub fn of(&self, indices: &[usize]) -> DMatrix<f64> {
        DMatrix::from_fn(indices.len(), indices.len(), |i, j| self.at(indices[i], indices[j]))
    }

    /// The inverse times a vector.
    pub fn times(&self, vector: &DVector<f64>) -> DVector<f64> {
        self.factor.solve(vector)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Five blocks of three and a border of four, of which a block touches two, in a shuffled order of the unknowns; and the same, dense.
    fn bordered() -> (BorderedMatrix, DMatrix<f64>) {
        let index = |unknown: usize| (unknown * 7) % 19;
        let blocks: Vec<(Vec<usize>, Vec<usize>)> = (0..5)
            .map(|block| {
                let own = (0..3).map(|row| index(3 * block + row)).collect();
                (own, vec![index(15), index(16 + block % 3)])
            })
            .collect();
        let mut stream = Stream::new(1, "bordered");
        let mut dense = DMatrix::zeros(19, 19);
        let mut matrix = BorderedMatrix::zero(19, &blocks);
        let mut know = vec![(15..19).map(index).collect::<Vec<_>>()];
        know.extend(blocks.into_iter().map(|(own, touched)| [own, touched].concat()));
        for group in know {
            let factor = DMatrix::from_fn(group.len(), group.len(), |_, _| stream.normal());
            let part = &factor * factor.transpose();
            for (i, row) in group.iter().enumerate() {
                for (j, column) in group.iter().enumerate() {
                    dense[(*row, *column)] += part[(i, j)];
                    matrix.add(*row, *column, part[(i, j)]);
                }
            }
        }
        (matrix, dense)
    }

    fn assert_inverse(matrix: &BorderedMatrix, dense: &DMatrix<f64>) {
        let want = dense.clone().try_inverse().unwrap();
        let right = DVector::from_fn(19, |i, _| (i as f64).cos());
        let inverse = matrix.factor().unwrap().inverse();
        let all: Vec<usize> = (0..inverse.len()).collect();
        assert!((inverse.of(&all) - &want).amax() < 1e-10 * want.amax());
        assert!((inverse.times(&right) - &want * &right).amax() < 1e-10 * want.amax());
    }

    #[test]
    fn solution_and_inverse_are_those_of_the_dense_matrix() {
        let (matrix, dense) = bordered();
        assert_inverse(&matrix, &dense);
    }

    #[test]
    fn an_isolated_unknown_of_block_or_border_knows_of_no_other() {
        let (mut matrix, mut dense) = bordered();
        for index in [7, (15 * 7) % 19] {
            matrix.isolate(index, 3.0);
            clear(&mut dense, index, 3.0);
        }
        assert_inverse(&matrix, &dense);
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_factor() {
        for index in [7, (15 * 7) % 19] {
            for diagonal in [-1.0, f64::NAN] {
                let (mut matrix, _) = bordered();
                matrix.isolate(index, diagonal);
                assert!(matrix.factor().is_none());
            }
        }
    }
}
