//! Tensors as safetensors files (SPEC 9).

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::file::{read_bytes, write_atomic};
use crate::error::{Error, Result};

#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Extent along each axis, the slowest first.
    pub shape: Vec<usize>,
    /// Values in row-major order; as many as the product of `shape`.
    pub data: Vec<f64>,
}

/// Reads every tensor of a safetensors file of F32 and F64 tensors.
pub fn read_tensors(path: &Path) -> Result<BTreeMap<String, Tensor>> {
    let bytes = read_bytes(path)?;
    let file = SafeTensors::deserialize(&bytes);
    let file = file.map_err(|fault| Error::data(path, "header", fault.to_string(), "copy or make the file again"))?;
    let mut tensors = BTreeMap::new();
    for (name, view) in file.iter() {
        let data = match view.dtype() {
            Dtype::F32 => view.data().as_chunks().0.iter().map(|&b| f64::from(f32::from_le_bytes(b))).collect(),
            Dtype::F64 => view.data().as_chunks().0.iter().map(|&b| f64::from_le_bytes(b)).collect(),
            other => {
                let place = format!("tensor `{name}`");
                return Err(Error::data(path, place, format!("has the type {other:?}"), "store it as F32 or F64"));
            }
        };
        tensors.insert(name.to_owned(), Tensor { shape: view.shape().to_vec(), data });
    }
    Ok(tensors)
}

/// Writes f32 tensors, each as (name, shape, row-major values).
pub fn write_tensors(path: &Path, tensors: &[(&str, &[usize], &[f32])]) -> Result<()> {
    let mut views = Vec::new();
    let bytes: Vec<Vec<u8>> = tensors.iter().map(|t| t.2.iter().flat_map(|v| v.to_le_bytes()).collect()).collect();
    for ((name, shape, _), bytes) in tensors.iter().zip(&bytes) {
        let remedy = "this is a fault of the program that made the tensor";
        let view = TensorView::new(Dtype::F32, shape.to_vec(), bytes)
            .map_err(|fault| Error::data(path, format!("tensor `{name}`"), fault.to_string(), remedy))?;
        views.push((*name, view));
    }
    write_atomic(path, |to| to.write_all(&safetensors::serialize(views, None).map_err(io::Error::other)?))
}
