//! Reads the numeric arrays of a .mat file of version 7.3, which is an HDF5 file.

use std::path::Path;

use hdf5_pure::{DType, File, Group};

use super::error::ImportError;
use super::mat_array::MatArray;

/// Whether the bytes are those of an HDF5 file.
pub fn is_hdf5(bytes: &[u8]) -> bool {
    hdf5_pure::is_hdf5_bytes(bytes)
}

/// Reads the real numeric arrays, and those in the fields of structs; `path` is for messages.
pub fn read(bytes: Vec<u8>, path: &Path) -> Result<Vec<MatArray>, ImportError> {
    let broken = |error: hdf5_pure::Error| ImportError::Source {
        path: path.into(),
        found: format!("a .mat file of version 7.3 that cannot be read ({error})"),
        expected: "an HDF5 file as MATLAB writes it; or write it again with: save('file.mat', '-v7')",
    };
    let file = File::from_bytes(bytes).map_err(broken)?;
    let root = file.root();
    let mut arrays = Vec::new();
    collect(&root, "", &mut arrays).map_err(broken)?;
    for name in root.groups().map_err(broken)? {
        // MATLAB keeps the contents of cells there.
        if !name.starts_with('#') {
            collect(&root.group(&name).map_err(broken)?, &format!("{name}."), &mut arrays).map_err(broken)?;
        }
    }
    Ok(arrays)
}

fn collect(group: &Group, prefix: &str, arrays: &mut Vec<MatArray>) -> Result<(), hdf5_pure::Error> {
    for name in group.datasets()? {
        let dataset = group.dataset(&name)?;
        let shape = dataset.shape()?;
        // The dimensions of an HDF5 array run the other way: the last is MATLAB's first.
        let Some(rows) = shape.last().map(|rows| *rows as usize) else { continue };
        let numbers = |values: Vec<i64>| values.into_iter().map(|value| value as f64).collect();
        let values: Vec<f64> = match dataset.dtype()? {
            DType::F64 => dataset.read_f64()?,
            DType::F32 => dataset.read_f32()?.into_iter().map(f64::from).collect(),
            DType::I8 => dataset.read_i8()?.into_iter().map(f64::from).collect(),
            DType::I16 => dataset.read_i16()?.into_iter().map(f64::from).collect(),
            DType::I32 => dataset.read_i32()?.into_iter().map(f64::from).collect(),
            DType::I64 => numbers(dataset.read_i64()?),
            DType::U8 => dataset.read_u8()?.into_iter().map(f64::from).collect(),
            DType::U16 => dataset.read_u16()?.into_iter().map(f64::from).collect(),
            DType::U32 => dataset.read_u32()?.into_iter().map(f64::from).collect(),
            _ => continue,
        };
        arrays.push(MatArray { name: format!("{prefix}{name}"), rows, values });
    }
    Ok(())
}
