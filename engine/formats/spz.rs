//! Niantic's SPZ, versions 2 and 3 (a gzip stream) and 4 (a zstd stream for each attribute). The `spz` crate (0.0.6) refuses
//! version 4 and brings dozens of crates, hence own code.

use super::convert::{complete_quaternion, logit_of_byte};
use super::format::Reader;
use super::scene::{Scene, compensated, cut_harmonics};
use crate::error::{Error, Result};
use crate::files::read_bytes;
use crate::scene::Splats;
use flate2::bufread::GzDecoder;
use ruzstd::decoding::StreamingDecoder;
use std::io::Read;
use std::path::Path;

pub(super) const MAGIC: [u8; 4] = *b"NGSP";
const GZIP: [u8; 2] = [0x1f, 0x8b];
pub(super) const READER: Reader = Reader {
    what: "an SPZ (version 2 to 4)",
    // Two bytes are weak evidence: the first coordinate of a .splat may begin with them.
    knows: |start| start.bytes == MAGIC || (start.bytes.starts_with(&GZIP) && !start.ends_in("splat")),
    read,
};

/// Degree 4 is cut to 3.
const MOST_DEGREE: u8 = 4;
const HEADER_BYTES: usize = 16;
pub(super) const HEADER_BYTES_V4: usize = 32;
/// Trained with opacity compensation.
const FLAG_ANTIALIASED: u8 = 1;
/// Vendor records follow the attributes, or precede the table of streams.
const FLAG_EXTENSIONS: u8 = 2;
/// Adobe's records: bits of harmonics, limits of a camera's orbit, axes.
const HARMONICS: u32 = 0xADBE_0001;
const ORBIT: u32 = 0xADBE_0002;
const AXES: u32 = 0xADBE_0003;
/// [`AXES`] that mean the format's own: unspecified, and right, up, back.
const OWN_AXES: [u32; 2] = [0, 4];
const MOST_RECORD_BYTES: u64 = 1 << 16;
/// DEFLATE cannot expand a byte to more. Zstandard could, but not Gaussians that differ.
const MAX_RATIO: u64 = 1032;
/// A file of zstd streams may promise this much however small it is: equal Gaussians take few bytes.
const SMALL_BYTES: u64 = 16 << 20;
/// Every zstd decoder must support this window.
const ZSTD_WINDOW: u64 = 8 << 20;
/// The stored colour is `0.5 + 0.15 * f_dc`, wider than [0, 1].
pub(super) const COLOR_SCALE: f64 = 0.15;
const REMEDY: &str = "the file is damaged: copy or export it again";

struct Header {
    version: u32,
    count: usize,
    sh_degree: u32,
    fractional_bits: u32,
    n_streams: usize,
    flags: u8,
}

impl Header {
    fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let Some(&header) = bytes.first_chunk::<HEADER_BYTES>().filter(|header| header.starts_with(&MAGIC)) else {
            return Err(Error::data(path, "byte 0", "is no SPZ header", "give an SPZ file of version 2, 3 or 4"));
        };
        let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| header[at + i]));
        let [sh_degree, fractional_bits, flags, n_streams] = [12, 13, 14, 15].map(|at: usize| header[at]);
        let (version, count) = (word(4), word(8));
        let unsupported = |byte: usize, reason: String, remedy: &str| {
            Err(Error::data(path, format!("header, byte {byte}"), reason, remedy))
        };
        if !(2..=4).contains(&version) {
            return unsupported(4, format!("version {version}"), "save it as version 2, 3 or 4");
        }
        if sh_degree > MOST_DEGREE {
            return unsupported(12, format!("degree {sh_degree}"), "save it with degree 3 or less");
        }
        if fractional_bits > 23 {
            return unsupported(13, format!("{fractional_bits} fractional bits of 24"), REMEDY);
        }
        if flags & !(FLAG_ANTIALIASED | FLAG_EXTENSIONS) != 0 {
            return unsupported(14, format!("unknown flags {flags:#04x}"), "save it without vendor features");
        }
        let (sh_degree, fractional_bits) = (u32::from(sh_degree), u32::from(fractional_bits));
        Ok(Header { version, count: count as usize, sh_degree, fractional_bits, n_streams: n_streams.into(), flags })
    }

    /// Refuses a count that a file of `n_bytes` cannot hold; a small one may promise `least` bytes.
    fn check_count(&self, path: &Path, n_bytes: usize, least: u64) -> Result<()> {
        let size: usize = self.sizes().iter().sum();
        if size as u64 <= least.max(MAX_RATIO * n_bytes as u64) {
            return Ok(());
        }
        let reason = format!("{} Gaussians need {size} bytes, a file of {n_bytes} cannot hold them", self.count);
        Err(Error::data(path, "header, byte 8", reason, REMEDY))
    }

    fn has_records(&self) -> bool {
        self.flags & FLAG_EXTENSIONS != 0
    }

    fn n_rest(&self) -> usize {
        ((self.sh_degree as usize + 1).pow(2) - 1) * 3
    }

    /// Bytes of position, alpha, colour, scale, rotation, harmonics, in the file's order.
    fn sizes(&self) -> [usize; 6] {
        let rotation = if self.version == 2 { 3 } else { 4 };
        [9, 1, 3, 3, rotation, self.n_rest()].map(|bytes| bytes * self.count)
    }
}

fn read(path: &Path) -> Result<Scene> {
    let (header, payload) = attributes(path)?;
    let mut notes = Vec::new();
    if header.flags & FLAG_ANTIALIASED != 0 {
        notes.push(compensated("flag `antialiased`"));
    }
    let (splats, n_cut) = decode(path, &header, &payload)?;
    if n_cut > 0 {
        notes.push(cut_harmonics(header.sh_degree, n_cut, header.count));
    }
    Ok(Scene { notes, ..splats.into() })
}

/// The header and the attributes, with vendor records behind them in versions 2 and 3.
fn attributes(path: &Path) -> Result<(Header, Vec<u8>)> {
    let mut bytes = read_bytes(path)?;
    if bytes.starts_with(&GZIP) {
        let mut stream = GzDecoder::new(&bytes[..]);
        let mut start = Vec::new();
        // A fault here becomes a missing header.
        let _ = stream.by_ref().take(HEADER_BYTES as u64).read_to_end(&mut start);
        let header = Header::parse(path, &start)?;
        header.check_count(path, bytes.len(), 0)?;
        let size = header.sizes().iter().sum();
        let mut payload = inflate(path, "gzip stream", &mut stream, size, header.has_records())?;
        if header.has_records() {
            let read = stream.take(MOST_RECORD_BYTES).read_to_end(&mut payload);
            read.map_err(|fault| Error::data(path, "gzip stream", format!("does not inflate: {fault}"), REMEDY))?;
        }
        return Ok((header, payload));
    }
    let header = Header::parse(path, &bytes)?;
    let payload =
        if header.version == 4 { inflate_streams(path, &header, &bytes)? } else { bytes.split_off(HEADER_BYTES) };
    Ok((header, payload))
}

/// Exactly `size` bytes of `stream`; with `surplus` more may follow.
fn inflate(path: &Path, place: &str, stream: &mut dyn Read, size: usize, surplus: bool) -> Result<Vec<u8>> {
    let fault = |reason: String| Error::data(path, place, reason, REMEDY);
    let mut bytes = Vec::new();
    // Reading on to the end also lets the decoder verify its checksum.
    let most = size as u64 + u64::from(!surplus);
    stream.take(most).read_to_end(&mut bytes).map_err(|cause| fault(format!("does not inflate: {cause}")))?;
    if bytes.len() != size {
        let found = if bytes.len() > size { format!("more than {size}") } else { bytes.len().to_string() };
        return Err(fault(format!("inflates to {found} bytes, the header's count needs {size}")));
    }
    Ok(bytes)
}

/// The zstd streams of version 4 in the order of the older versions.
fn inflate_streams(path: &Path, header: &Header, bytes: &[u8]) -> Result<Vec<u8>> {
    let fault = |place: &str, reason: String| Error::data(path, place, reason, REMEDY);
    let sizes = header.sizes();
    let sizes = if header.sh_degree == 0 { &sizes[..5] } else { &sizes[..] };
    if header.n_streams != sizes.len() {
        let reason = format!("{} streams, degree {} has {}", header.n_streams, header.sh_degree, sizes.len());
        return Err(fault("header, byte 15", reason));
    }
    let table = bytes.get(HEADER_BYTES..HEADER_BYTES + 4).and_then(<[u8]>::first_chunk);
    let table = table.map_or(0, |&at| u32::from_le_bytes(at) as usize);
    let entries = bytes.get(table..).and_then(|rest| rest.get(..16 * sizes.len()));
    let Some(entries) = entries.filter(|_| table >= HEADER_BYTES_V4) else {
        return Err(fault("header, byte 16", format!("no table of {} streams at byte {table}", sizes.len())));
    };
    if header.has_records() {
        check_records(path, header, &bytes[HEADER_BYTES_V4..table])?;
    }
    header.check_count(path, bytes.len(), SMALL_BYTES)?;
    let mut payload = Vec::new();
    let mut at = table + entries.len();
    for (index, (entry, &size)) in entries.as_chunks::<16>().0.iter().zip(sizes).enumerate() {
        let place = format!("stream {index} at byte {at}");
        let [packed, unpacked] = [0, 8].map(|k| u64::from_le_bytes(std::array::from_fn(|i| entry[k + i])));
        let stream = usize::try_from(packed).ok().and_then(|n| bytes[at..].get(..n));
        let Some(mut stream) = stream else {
            return Err(fault(&place, format!("{packed} bytes, the file has {} left", bytes.len() - at)));
        };
        if unpacked != size as u64 {
            return Err(fault(&place, format!("inflates to {unpacked} bytes, the header's count needs {size}")));
        }
        at += stream.len();
        let window = ZSTD_WINDOW.max(unpacked);
        let mut decoder = StreamingDecoder::new_with_max_window_size(&mut stream, window)
            .map_err(|cause| fault(&place, format!("does not inflate: {cause}")))?;
        payload.append(&mut inflate(path, &place, &mut decoder, size, false)?);
        if !stream.is_empty() {
            return Err(fault(&place, format!("{} bytes follow its zstd frame", stream.len())));
        }
    }
    if at != bytes.len() {
        return Err(fault(&format!("byte {at}"), "more data than the header declares".to_owned()));
    }
    Ok(payload)
}

/// Refuses vendor records that are not known to leave the attributes' meaning alone.
fn check_records(path: &Path, header: &Header, mut records: &[u8]) -> Result<()> {
    let fault = |reason: String, remedy: &str| Err(Error::data(path, "vendor records", reason, remedy));
    while !records.is_empty() {
        let record = records.split_first_chunk::<4>().and_then(|(kind, after)| {
            let (length, after) = after.split_first_chunk::<4>()?;
            let (content, rest) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
            Some((u32::from_le_bytes(*kind), content, rest))
        });
        let Some((kind, content, rest)) = record else {
            let n = records.len();
            let reason = format!("expected kind, length and content of each, found {n} bytes that are not");
            return fault(reason, "save it without extensions");
        };
        if kind == AXES && !OWN_AXES.iter().any(|own| content == own.to_le_bytes()) {
            let reason = "expected the axes right, up and back, found others".to_owned();
            return fault(reason, "save it in the format's own axes");
        }
        if kind != AXES && kind != ORBIT && !(kind == HARMONICS && header.sh_degree == 0) {
            let reason = format!("expected none that may change how Gaussians are stored, found the kind {kind:#010x}");
            return fault(reason, "save it without extensions");
        }
        records = rest;
    }
    Ok(())
}

/// The Gaussians, and how many had numbers in harmonics that are cut.
fn decode(path: &Path, header: &Header, payload: &[u8]) -> Result<(Splats, usize)> {
    let sizes = header.sizes();
    let size: usize = sizes.iter().sum();
    if payload.len() < size || (payload.len() > size && !header.has_records()) {
        let reason = format!("{} bytes, the header's count needs {size}", payload.len());
        return Err(Error::data(path, "data", reason, REMEDY));
    }
    check_records(path, header, &payload[size..])?;
    let mut rest = payload;
    let [position, alpha, color, scale, rotation, sh] = sizes.map(|n| {
        let (attribute, after) = rest.split_at(n);
        rest = after;
        attribute
    });
    let mut splats = Splats::new(header.sh_degree.min(3));
    splats.n_static = header.count;
    splats.source_row = (0..header.count as u32).collect();
    let unit = 1.0 / f64::from(1_u32 << header.fractional_bits);
    let coordinate = |b: &[u8]| f64::from(i32::from_le_bytes([0, b[0], b[1], b[2]]) >> 8) * unit;
    splats.position = position
        .chunks_exact(9)
        .map(|b| [coordinate(b) as f32, -coordinate(&b[3..]) as f32, -coordinate(&b[6..]) as f32])
        .collect();
    splats.opacity = alpha.iter().map(|&byte| logit_of_byte(byte)).collect();
    splats.scale = scale.as_chunks().0.iter().map(|b: &[u8; 3]| b.map(|byte| f32::from(byte) / 16.0 - 10.0)).collect();
    splats.rotation = if header.version == 2 {
        rotation.as_chunks().0.iter().map(|&b| first_three(b)).collect()
    } else {
        rotation.as_chunks().0.iter().map(|&b| smallest_three(u32::from_le_bytes(b))).collect()
    };
    let dc = |byte: u8| ((f64::from(byte) / 255.0 - 0.5) / COLOR_SCALE) as f32;
    let (n_rest, mut n_cut) = (header.n_rest(), 0);
    for i in 0..header.count {
        splats.sh.push(std::array::from_fn(|channel| dc(color[3 * i + channel])));
        let coefficients = sh[i * n_rest..(i + 1) * n_rest].as_chunks::<3>().0;
        for (bytes, sign) in coefficients.iter().zip(SH_SIGNS) {
            splats.sh.push(bytes.map(|byte| sign * (f32::from(byte) - 128.0) / 128.0));
        }
        n_cut += usize::from(coefficients.iter().skip(SH_SIGNS.len()).flatten().any(|byte| *byte != 128));
    }
    Ok((splats, n_cut))
}

/// Signs of the coefficients 1 to 15 under y -> -y, z -> -z: that of y^a z^b is (-1)^(a + b).
/// Basis: y, z, x; xy, yz, 2zz-xx-yy, xz, xx-yy; y(3xx-yy), xyz, y(4zz-..), z(2zz-..), x(4zz-..), z(xx-yy), x(xx-3yy).
pub(super) const SH_SIGNS: [f32; 15] =
    [-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0];

/// From SPZ's axes (x, y, z, w) to PLY's (w, x, y, z): half a turn about x.
fn turn([x, y, z, w]: [f64; 4]) -> [f32; 4] {
    [w, x, -y, -z].map(|v| v as f32)
}

/// Version 2: x, y and z over [-1, 1], w not negative.
fn first_three(bytes: [u8; 3]) -> [f32; 4] {
    turn(complete_quaternion(bytes.map(|byte| f64::from(byte) / 127.5 - 1.0), 3))
}

/// Versions 3 and 4: two bits for the index of the largest of (x, y, z, w), a sign and nine bits for each of the others.
fn smallest_three(word: u32) -> [f32; 4] {
    let entry = |shift: u32| {
        let magnitude = f64::from(word >> shift & 0x1ff) / 511.0 * std::f64::consts::FRAC_1_SQRT_2;
        if word >> shift & 0x200 == 0 { magnitude } else { -magnitude }
    };
    turn(complete_quaternion([entry(20), entry(10), entry(0)], (word >> 30) as usize))
}
