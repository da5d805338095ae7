//! Arrays of a .mat file, and the tables that they make.

use std::path::Path;

use super::error::ImportError;
use super::source_table::{SourceTable, StatedColumns};

/// A real numeric matrix, column by column.
#[derive(Debug, Clone, PartialEq)]
pub struct MatArray {
    /// Name of the variable; a field of a struct has the names of both, with a point.
    pub name: String,
    /// Number of rows.
    pub rows: usize,
    /// Its values, column by column.
    pub values: Vec<f64>,
}

impl MatArray {
    /// Number of samples: vectors may lie or stand.
    fn samples(&self) -> usize {
        if self.rows == 1 { self.values.len() } else { self.rows }
    }

    fn column(&self, index: usize) -> &[f64] {
        let samples = self.samples();
        // A vector, such as that of time, belongs to all columns of the matrices.
        let count = self.values.len() / samples.max(1);
        let first = if count == 1 { 0 } else { index * samples };
        &self.values[first..first + samples]
    }
}

/// The tables of the arrays of a file: those with the commonest number of samples, one table for each column of its matrices.
pub fn tables(path: &Path, arrays: Vec<MatArray>) -> Result<Vec<SourceTable>, ImportError> {
    let long: Vec<MatArray> = arrays.into_iter().filter(|array| array.samples() > 1).collect();
    let commonest = long
        .iter()
        .map(MatArray::samples)
        .max_by_key(|samples| (long.iter().filter(|other| other.samples() == *samples).count(), *samples));
    let Some(samples) = commonest else {
        let found = "no numeric vector or matrix".to_owned();
        let expected = "variables with a row or a column for each sample";
        return Err(ImportError::Source { path: path.into(), found, expected });
    };
    let own: Vec<&MatArray> = long.iter().filter(|array| array.samples() == samples).collect();
    let trials = own.iter().map(|array| array.values.len() / samples).max().unwrap_or(1);
    let fits = |array: &&MatArray| [1, trials].contains(&(array.values.len() / samples));
    let unusable: Vec<(String, String)> = long
        .iter()
        .filter(|array| array.samples() != samples || !fits(array))
        .map(|array| {
            let (rows, count) = (array.samples(), array.values.len() / array.samples());
            let reason = format!(
                "{rows} samples in {count} columns, where the others have {samples} in 1 or {trials}"
            );
            (array.name.clone(), reason)
        })
        .collect();
    let table = |index: usize| SourceTable {
        name: match trials {
            1 => path.display().to_string(),
            _ => format!("{}, column {}", path.display(), index + 1),
        },
        columns: own
            .iter()
            .filter(|array| fits(array))
            .map(|array| (array.name.clone(), array.column(index).to_vec()))
            .collect(),
        unusable: unusable.clone(),
        stated: StatedColumns::default(),
    };
    Ok((0..trials).map(table).collect())
}
