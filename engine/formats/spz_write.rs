use super::convert::{byte_of_logit, level};
use super::format::{Keeps, Writer, static_rows};
use super::four_dgs::World;
use super::spz::{COLOR_SCALE, HEADER_BYTES_V4, MAGIC, SH_SIGNS};
use crate::error::{Error, Result};
use crate::files::write_atomic;
use crate::scene::Splats;
use flate2::{Compression, write::GzEncoder};
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use std::io::Write;
use std::path::Path;

pub(super) const VERSION_3: Writer = Writer {
    name: "spz",
    ending: Some(".spz"),
    about: "Niantic's, version 3; one moment",
    keeps: Keeps::NOTHING,
    write: |path, splats, clip, _| write_spz(path, splats, SpzVersion::V3, clip.world).map(|()| Vec::new()),
};
pub(super) const VERSION_4: Writer = Writer {
    name: "spz4",
    ending: None,
    about: "Niantic's, version 4; one moment",
    keeps: Keeps::NOTHING,
    write: |path, splats, clip, _| write_spz(path, splats, SpzVersion::V4, clip.world).map(|()| Vec::new()),
};

/// Bits of a position without its sign.
const POSITION_BITS: i32 = 23;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpzVersion {
    /// One gzip stream: what most programs read.
    V3,
    /// A zstd stream for each attribute.
    V4,
}

/// Turns to SPZ's axes (right, up, back) by half a turn about x, or not at all where `world` says that y is up. Largest errors:
/// positions 2^-24 of the largest coordinate's next power of two; log-scales 1/32, within [-10, 5.94]; rotations 0.003 in an
/// entry; opacities 1/510; `f_dc` 1/76.5, within +-3.3; harmonics 1/256, within [-1, 0.99].
pub fn write_spz(path: &Path, splats: &Splats, version: SpzVersion, world: Option<World>) -> Result<()> {
    let rows = static_rows(path, splats, ".spz")?;
    let is_turned = world.is_none_or(|world| !world.is_y_up());
    // The factor of y and z.
    let flip = if is_turned { -1.0_f32 } else { 1.0 };
    let largest = rows.iter().flat_map(|&i| splats.position[i]).fold(0.0_f32, |m, x| m.max(x.abs()));
    // The most fractional bits with which the largest coordinate still fits.
    let fits = |bits: &i32| f64::from(largest) * 2f64.powi(*bits) <= 2f64.powi(POSITION_BITS) - 1.0;
    let Some(fractional_bits) = (0..=POSITION_BITS).rev().find(fits) else {
        let remedy = "scale the scene, or export it as PLY";
        return Err(Error::data(path, "", format!("a coordinate of {largest}; at most 2^23 can be stored"), remedy));
    };
    let unit = 2f64.powi(fractional_bits);
    let k = splats.n_coefficients();
    let place = |&i: &usize| {
        let [x, y, z] = splats.position[i].map(f64::from);
        [x, f64::from(flip) * y, f64::from(flip) * z].map(|v| ((v * unit).round() as i32).to_le_bytes())
    };
    let harmonics = |&i: &usize| {
        let coefficients = splats.sh[i * k + 1..(i + 1) * k].iter().zip(SH_SIGNS);
        coefficients.flat_map(move |(coefficient, sign)| {
            let sign = if is_turned { sign } else { 1.0 };
            coefficient.map(|c| (sign * c * 128.0 + 128.0).round() as u8)
        })
    };
    let attributes: [Vec<u8>; 6] = [
        rows.iter().flat_map(place).flat_map(|[a, b, c, _]| [a, b, c]).collect(),
        rows.iter().map(|&i| byte_of_logit(splats.opacity[i])).collect(),
        rows.iter().flat_map(|&i| splats.sh[i * k].map(|dc| level(0.5 + COLOR_SCALE * f64::from(dc)))).collect(),
        rows.iter().flat_map(|&i| splats.scale[i].map(|s| ((s + 10.0) * 16.0).round() as u8)).collect(),
        rows.iter().flat_map(|&i| smallest_three(splats.rotation[i], flip).to_le_bytes()).collect(),
        rows.iter().flat_map(harmonics).collect(),
    ];
    let header = |number: u32, n_streams: u8| {
        let mut header = MAGIC.to_vec();
        header.extend(number.to_le_bytes());
        header.extend((rows.len() as u32).to_le_bytes());
        header.extend([splats.sh_degree as u8, fractional_bits as u8, 0, n_streams]);
        header
    };
    if version == SpzVersion::V3 {
        return write_atomic(path, |to| {
            let mut encoder = GzEncoder::new(to, Compression::default());
            encoder.write_all(&header(3, 0))?;
            attributes.iter().try_for_each(|bytes| encoder.write_all(bytes))?;
            encoder.finish().map(drop)
        });
    }
    let streams = if splats.sh_degree == 0 { &attributes[..5] } else { &attributes[..] };
    let packed: Vec<Vec<u8>> =
        streams.iter().map(|bytes| compress_to_vec(bytes.as_slice(), CompressionLevel::Fastest)).collect();
    let mut start = header(4, streams.len() as u8);
    start.extend((HEADER_BYTES_V4 as u32).to_le_bytes());
    start.resize(HEADER_BYTES_V4, 0);
    for (packed, bytes) in packed.iter().zip(streams) {
        start.extend((packed.len() as u64).to_le_bytes());
        start.extend((bytes.len() as u64).to_le_bytes());
    }
    write_atomic(path, |to| {
        to.write_all(&start)?;
        packed.iter().try_for_each(|bytes| to.write_all(bytes))
    })
}

/// (w, x, y, z) in PLY's axes, with y and z times `flip`: the index of the largest entry of (x, y, z, w); a sign and nine bits
/// for each other.
fn smallest_three([w, x, y, z]: [f32; 4], flip: f32) -> u32 {
    let stored = [x, flip * y, flip * z, w].map(f64::from);
    let norm = stored.iter().map(|v| v * v).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    let largest = (0..4).fold(0, |best, i| if stored[i].abs() > stored[best].abs() { i } else { best });
    let sign = if stored[largest] < 0.0 { -1.0 } else { 1.0 };
    let rest = (0..4).filter(|i| *i != largest).map(|i| sign * stored[i] / norm);
    rest.fold(largest as u32, |word, v| {
        let magnitude = (v.abs() * std::f64::consts::SQRT_2 * 511.0).round().min(511.0) as u32;
        word << 10 | u32::from(v < 0.0) << 9 | magnitude
    })
}
