//! The `.splat` format of antimatter15's viewer: 32 bytes a Gaussian, no header, no view dependence.

use super::convert::{byte_of_logit, level, logit_of_byte};
use super::format::{Keeps, Reader, Writer, static_rows};
use super::scene::Scene;
use crate::error::{Error, Result};
use crate::files::{read_bytes, write_atomic};
use crate::scene::{SH_C0, Splats, dc_of_color};
use std::path::Path;

/// Position and scale as f32 each, RGBA and the quaternion (w, x, y, z) as bytes.
const ROW_BYTES: usize = 32;

fn read(path: &Path) -> Result<Scene> {
    let bytes = read_bytes(path)?;
    let (rows, rest) = bytes.as_chunks::<ROW_BYTES>();
    if rows.is_empty() || !rest.is_empty() {
        let reason = format!("{} bytes are no whole number of rows of {ROW_BYTES}", bytes.len());
        return Err(Error::data(path, format!("row {}", rows.len()), reason, "copy or export the file again"));
    }
    if u32::try_from(rows.len()).is_err() {
        let reason = format!("{} rows, at most {} are supported", rows.len(), u32::MAX);
        return Err(Error::data(path, "", reason, "split the scene"));
    }
    let mut splats = Splats::new(0);
    splats.n_static = rows.len();
    for (i, row) in rows.iter().enumerate() {
        let number = |k: usize| f32::from_le_bytes(std::array::from_fn(|b| row[4 * k + b]));
        splats.source_row.push(i as u32);
        splats.position.push(std::array::from_fn(number));
        splats.scale.push(std::array::from_fn(|axis| number(3 + axis).ln()));
        splats.sh.push(std::array::from_fn(|c| dc_of_color(f64::from(row[24 + c]) / 255.0)));
        splats.opacity.push(logit_of_byte(row[27]));
        splats.rotation.push(std::array::from_fn(|k| (f32::from(row[28 + k]) - 128.0) / 128.0));
    }
    Ok(splats.into())
}

pub(super) const READER: Reader = Reader { what: "a .splat", knows: |start| start.ends_in("splat"), read };

pub(super) const WRITER: Writer = Writer {
    name: "splat",
    ending: Some(".splat"),
    about: "antimatter15's, without view dependence; one moment",
    keeps: Keeps::NOTHING,
    write: |path, splats, _, _| write_splat(path, splats).map(|()| Vec::new()),
};

/// Largest errors: colours and opacities 1/510, within [0, 1]; rotations 1/128 in an entry of the unit quaternion.
pub fn write_splat(path: &Path, splats: &Splats) -> Result<()> {
    let rows = static_rows(path, splats, ".splat")?;
    let k = splats.n_coefficients();
    write_atomic(path, |to| {
        for &i in &rows {
            let scale = splats.scale[i].map(f32::exp);
            splats.position[i].iter().chain(&scale).try_for_each(|x| to.write_all(&x.to_le_bytes()))?;
            let [r, g, b] = splats.sh[i * k].map(|dc| level(0.5 + SH_C0 * f64::from(dc)));
            to.write_all(&[r, g, b, byte_of_logit(splats.opacity[i])])?;
            let norm = splats.rotation[i].iter().map(|v| v * v).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
            to.write_all(&splats.rotation[i].map(|v| (v / norm * 128.0 + 128.0).round() as u8))?;
        }
        Ok(())
    })
}
