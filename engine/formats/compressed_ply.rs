//! The compressed PLY of PlayCanvas and SuperSplat: 256 Gaussians share a chunk of ranges, each takes four words.

use super::convert::{complete_quaternion, logit_of_byte};
use super::ply_known::{compensation, judge};
use crate::error::{Error, Result};
use crate::files::ply_header::{Element, Header, Scalar};
use crate::files::ply_rows::{Column, Rows};
use crate::scene::{Splats, dc_of_color};
use std::path::Path;

/// Gaussians that share one row of `chunk`.
const CHUNK: usize = 256;
/// Ranges of positions and log scales, always present: minimum x y z, maximum x y z.
const POSITION: [&str; 6] = ["min_x", "min_y", "min_z", "max_x", "max_y", "max_z"];
const SCALE: [&str; 6] = ["min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z"];
/// Ranges of colours; older files have none, their colours span [0, 1].
const COLOR: [&str; 6] = ["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"];
const PACKED: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
const REMEDY: &str = "the file is damaged: export it again";

pub(super) fn is_compressed(header: &Header) -> bool {
    header.element("chunk").is_some()
        && header.element("vertex").is_some_and(|v| Column::find(v, "packed_position").is_some())
}

/// Minimum and maximum of x, y, z of one chunk.
type Range = [f32; 6];

#[derive(Default)]
struct Packed {
    position: Vec<Range>,
    scale: Vec<Range>,
    color: Vec<Range>,
    words: Vec<[u32; 4]>,
    /// Channel-major spherical harmonics beyond degree 0, a byte each.
    rest: Vec<u8>,
}

/// Reads the elements behind the header of a compressed PLY, and notes what it leaves out. Every Gaussian is static.
pub(super) fn read_compressed(path: &Path, header: &Header, mut rows: Rows) -> Result<(Splats, Vec<String>)> {
    let mut notes = Vec::new();
    if let Some(vertex) = header.element("vertex") {
        let read = ["vertex", "chunk", "sh"];
        notes.extend(judge(path, header, vertex, &read, |name| PACKED.contains(&name))?);
    }
    notes.extend(compensation(header));
    let mut packed = Packed::default();
    let mut n_rest = 0;
    for element in &header.elements {
        match element.name.as_str() {
            "chunk" => packed.read_chunks(path, element, &mut rows)?,
            "vertex" => {
                let columns = columns(path, element, PACKED, Scalar::U32)?;
                rows.read(element, |_, row| packed.words.push(columns.map(|c| c.u32(row))))?;
            }
            "sh" => {
                n_rest = element.properties.len();
                let columns = rest_columns(path, element)?;
                rows.read(element, |_, row| packed.rest.extend(columns.iter().map(|c| c.u8(row))))?;
            }
            _ => rows.skip(element)?,
        }
    }
    rows.finish()?;
    let n = packed.words.len();
    for (what, present, expected) in
        [("element `chunk`", packed.position.len(), n.div_ceil(CHUNK)), ("element `sh`", packed.rest.len(), n * n_rest)]
    {
        if present != expected {
            let reason = format!("has {present} entries, {n} Gaussians need {expected}");
            return Err(Error::data(path, what, reason, REMEDY));
        }
    }
    Ok((packed.unpack(n_rest), notes))
}

fn columns<const N: usize>(path: &Path, element: &Element, names: [&str; N], scalar: Scalar) -> Result<[Column; N]> {
    let find = |name: &&str| {
        let found = Column::find(element, name).filter(|column| column.is(scalar) && element.row_size().is_some());
        found.ok_or_else(|| {
            let place = format!("element `{}`, property `{name}`", element.name);
            Error::data(path, place, format!("is missing or not of type {scalar:?}"), REMEDY)
        })
    };
    let found = names.iter().map(find).collect::<Result<Vec<Column>>>()?;
    Ok(std::array::from_fn(|i| found[i]))
}

fn rest_columns(path: &Path, element: &Element) -> Result<Vec<Column>> {
    let n = element.properties.len();
    if ![9, 24, 45].contains(&n) {
        let reason = format!("has {n} properties; degrees 1 to 3 have 9, 24 or 45");
        return Err(Error::data(path, "element `sh`", reason, REMEDY));
    }
    (0..n).map(|i| columns(path, element, [&format!("f_rest_{i}")], Scalar::U8).map(|[c]| c)).collect()
}

impl Packed {
    fn read_chunks(&mut self, path: &Path, element: &Element, rows: &mut Rows) -> Result<()> {
        let position = columns(path, element, POSITION, Scalar::F32)?;
        let scale = columns(path, element, SCALE, Scalar::F32)?;
        let has_colors = Column::find(element, COLOR[0]).is_some();
        let color = has_colors.then(|| columns(path, element, COLOR, Scalar::F32)).transpose()?;
        rows.read(element, |_, row| {
            self.position.push(position.map(|c| c.f32(row)));
            self.scale.push(scale.map(|c| c.f32(row)));
            self.color.push(color.map_or([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], |columns| columns.map(|c| c.f32(row))));
        })
    }

    fn unpack(self, n_rest: usize) -> Splats {
        let per_channel = n_rest / 3;
        let mut splats = Splats::new((per_channel + 1).isqrt() as u32 - 1);
        splats.n_static = self.words.len();
        for (i, &[position, rotation, scale, color]) in self.words.iter().enumerate() {
            let chunk = i / CHUNK;
            splats.source_row.push(i as u32);
            splats.position.push(lerp(self.position[chunk], unpack_11_10_11(position)).map(|v| v as f32));
            splats.scale.push(lerp(self.scale[chunk], unpack_11_10_11(scale)).map(|v| v as f32));
            splats.rotation.push(unpack_rotation(rotation));
            let [r, g, b, alpha] = color.to_be_bytes();
            let color = lerp(self.color[chunk], [r, g, b].map(|byte| f64::from(byte) / 255.0));
            splats.opacity.push(logit_of_byte(alpha));
            splats.sh.push(color.map(dc_of_color));
            let rest = &self.rest[i * n_rest..(i + 1) * n_rest];
            for k in 0..per_channel {
                splats.sh.push(std::array::from_fn(|channel| unpack_sh(rest[channel * per_channel + k])));
            }
        }
        splats
    }
}

fn lerp(range: Range, t: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| {
        let [low, high] = [range[axis], range[axis + 3]].map(f64::from);
        low * (1.0 - t[axis]) + high * t[axis]
    })
}

/// Three fractions in [0, 1] from fields of 11, 10 and 11 bits, the first on top.
fn unpack_11_10_11(word: u32) -> [f64; 3] {
    [fraction(word >> 21, 11), fraction(word >> 11, 10), fraction(word, 11)]
}

fn fraction(word: u32, bits: u32) -> f64 {
    let top = (1_u32 << bits) - 1;
    f64::from(word & top) / f64::from(top)
}

/// Two bits for the index of the largest entry of (w, x, y, z), ten for each of the others within +-1/sqrt(2).
fn unpack_rotation(word: u32) -> [f32; 4] {
    let entry = |shift: u32| (fraction(word >> shift, 10) - 0.5) * std::f64::consts::SQRT_2;
    complete_quaternion([entry(20), entry(10), entry(0)], (word >> 30) as usize).map(|v| v as f32)
}

/// A byte covers [-4, 4]; its two ends stand for the ends, the rest for the middle of their bins.
fn unpack_sh(byte: u8) -> f32 {
    let fraction = match byte {
        0 => 0.0,
        255 => 1.0,
        _ => (f32::from(byte) + 0.5) / 256.0,
    };
    (fraction - 0.5) * 8.0
}
