//! SOFA files (AES69) of the convention SimpleFreeFieldHRIR, read through `sofar`'s HDF5 parser without its interpolation, which mixes
//! responses that are not aligned.

use std::collections::HashMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::mpsc::channel;
use std::time::Duration;

use glam::DVec3;
use sha2::{Digest, Sha256};
use sofar::hdf::{DataFormat, DataObject, ParsedHdf, parse_with_children};

use super::{Measured, Meta};
use crate::error::{Error, Result};
use crate::files::read_file;
use crate::internals::sound::geometry::degrees;

/// Sets are far smaller: SADIE II's largest has 36 MB.
const MAX_BYTES: u64 = 1 << 30;

/// Types of HDF5 may hold types, and the parser recurses without a limit, 10 kB a level without optimisation. Real files have some
/// fifty places that look like such a type; a file with more than this is refused.
const DEEPEST: usize = 20_000;
const STACK: usize = 256 << 20;
/// Parts of a file may refer to parts many times, and the parser follows each: a file that takes longer than this, and another second
/// for each million bytes, is given up.
const LIMIT: Duration = Duration::from_secs(20);

pub fn read(path: &Path) -> Result<Measured> {
    let fault = |place: &str, reason: String| {
        let remedy = "give a SOFA file of the convention SimpleFreeFieldHRIR; the file may be damaged";
        Error::data(path, place, reason, remedy)
    };
    let bytes = fs::metadata(path).map(|file| file.len()).unwrap_or(0);
    if bytes > MAX_BYTES {
        return Err(fault("", format!("it has {bytes} bytes, more than {MAX_BYTES}")));
    }
    let bytes = read_file(path).map_err(|e| fault("", format!("cannot be read: {e}")))?;
    let limit = LIMIT + Duration::from_secs(bytes.len() as u64 / 1_000_000);
    let measured = match places_of_nested_types(&bytes) {
        n if n <= DEEPEST => in_time(bytes, limit),
        n => Err(("", format!("its HDF5 types may be nested {n} times, more than {DEEPEST}"))),
    };
    measured.map_err(|(place, reason)| fault(place, reason))
}

/// A variable or attribute, and what is wrong with it.
type Fault = (&'static str, String);

/// The places of a file that look like a type that holds types (class 6 or 9 in version 1 or 3, below 64 bytes): the parser's depth.
fn places_of_nested_types(bytes: &[u8]) -> usize {
    let is_one = |place: &&[u8]| matches!(place, [0x16 | 0x19 | 0x36 | 0x39, _, _, _, 0..64, 0, 0, 0]);
    bytes.windows(8).filter(is_one).count()
}

/// Reads on a thread with a large stack. One that takes longer than `limit` is left behind: nothing can end it but the process.
fn in_time(bytes: Vec<u8>, limit: Duration) -> std::result::Result<Measured, Fault> {
    let (send, receive) = channel();
    let read = move || {
        // The parser has checked arithmetic and indexing only, so a damaged file can make it panic; that ends here.
        let measured = catch_unwind(AssertUnwindSafe(|| parse(&bytes)));
        // Nobody listens any more where it took too long.
        let _ = send.send(measured.unwrap_or_else(|_| Err(("", "its HDF5 structure is damaged".into()))));
    };
    if let Err(fault) = std::thread::Builder::new().name("sofa".to_owned()).stack_size(STACK).spawn(read) {
        return Err(("", format!("no memory for the depth of its HDF5 types: {fault}")));
    }
    receive.recv_timeout(limit).unwrap_or_else(|_| {
        Err(("", format!("could not be read within {} s: its parts may refer to one another", limit.as_secs())))
    })
}

fn parse(bytes: &[u8]) -> std::result::Result<Measured, Fault> {
    let hdf = parse_with_children(bytes).map_err(|e| ("", format!("it is no HDF5 file that can be read: {e}")))?;
    let stated = attributes(&hdf.root);
    let convention = stated.get("SOFAConventions").map_or("none", String::as_str);
    if convention != "SimpleFreeFieldHRIR" {
        return Err(("SOFAConventions", format!("its convention is {convention}")));
    }
    let find = |name: &'static str| array(&hdf, name).map_err(|reason| (name, reason));
    let need = |name: &'static str| find(name)?.ok_or((name, "it is missing".to_owned()));
    let (ir, rate, at) = (need("Data.IR")?, need("Data.SamplingRate")?, need("SourcePosition")?);
    let (delay, view) = (find("Data.Delay")?, find("ListenerView")?);
    let [n, ears, taps] = ir.dimensions[..] else {
        return Err(("Data.IR", format!("it has {} dimensions, not 3", ir.dimensions.len())));
    };
    if ears != 2 || ir.values.len() != n * ears * taps || n == 0 || taps == 0 {
        let reason = format!("{n} x {ears} x {taps} for {} values; two ears are needed", ir.values.len());
        return Err(("Data.IR", reason));
    }
    if at.values.len() != 3 * n {
        return Err(("SourcePosition", format!("{} values for {n} directions", at.values.len())));
    }
    let is_along_x = |view: &Array| !matches!(view.values[..], [x, y, z] if view.is_cartesian && x <= y.hypot(z));
    if !view.as_ref().is_none_or(is_along_x) {
        return Err(("ListenerView", "the listener does not look along x".into()));
    }
    let place = |row: &[f64]| {
        if at.is_cartesian { DVec3::from_slice(row) } else { degrees(row[0], row[1]) }
    };
    let pair = |row: &[f64]| [row[0], row[1]];
    let delays = match delay.map(|delay| delay.values).unwrap_or_default() {
        none if none.is_empty() => vec![[0.0; 2]; n],
        one if one.len() == 2 => vec![pair(&one); n],
        all if all.len() == 2 * n => all.chunks(2).map(pair).collect(),
        other => return Err(("Data.Delay", format!("{} values for {n} directions", other.len()))),
    };
    let responses: Vec<Vec<f32>> = ir.values.chunks(taps).map(|row| row.iter().map(|v| *v as f32).collect()).collect();
    let irs = responses.chunks(2).map(|ears| [ears[0].clone(), ears[1].clone()]).collect();
    let named = ["Title", "DatabaseName", "ListenerShortName"].map(|name| stated.get(name).cloned());
    let title: Vec<String> = named.into_iter().flatten().filter(|part| !part.is_empty()).collect();
    Ok(Measured {
        fs: rate.values.first().copied().unwrap_or(0.0),
        directions: at.values.chunks(3).map(place).collect(),
        irs,
        delays,
        meta: Meta {
            title: title.join(", "),
            licence: stated.get("License").cloned().unwrap_or_else(|| "not stated".into()),
            sha256: format!("{:x}", Sha256::digest(bytes)),
        },
    })
}

/// Numbers of a variable, row by row.
struct Array {
    dimensions: Vec<usize>,
    values: Vec<f64>,
    is_cartesian: bool,
}

fn attributes(object: &DataObject) -> HashMap<String, String> {
    object.parsed_attributes.iter().filter_map(|a| Some((a.name.clone(), a.value.clone()?))).collect()
}

fn array(hdf: &ParsedHdf<'_>, name: &str) -> std::result::Result<Option<Array>, String> {
    let Some(object) = hdf.get_child(name) else { return Ok(None) };
    let object = object.map_err(|e| format!("it cannot be read: {e}"))?;
    let width = object.dt.size as usize;
    // Class 1 is floating point.
    let is_float =
        object.dt.class_and_version & 0x0f == 1 && matches!(object.dt.data_fmt, Some(DataFormat::Float { .. }));
    let value = |bytes: &[u8]| match bytes.len() {
        8 => bytes.try_into().map(f64::from_le_bytes).ok(),
        4 => bytes.try_into().map(|bytes| f64::from(f32::from_le_bytes(bytes))).ok(),
        _ => None,
    };
    let values: Option<Vec<f64>> =
        if is_float && width > 0 { object.data.chunks(width).map(value).collect() } else { None };
    Ok(Some(Array {
        dimensions: object.ds.dimension_size.iter().map(|size| *size as usize).collect(),
        values: values.ok_or("its values are not floats of 32 or 64 bits")?,
        is_cartesian: attributes(&object).get("Type").is_some_and(|kind| kind == "cartesian"),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An object whose header goes on in another block, four times, and that again, twenty deep: some 10^12 blocks to read.
    fn endless() -> Vec<u8> {
        const DEEP: u64 = 20;
        const REFERENCES: usize = 4;
        // A block: its mark, its references as messages of 16 bytes behind a head of 4, a checksum.
        const BLOCK: u64 = 4 + 20 * REFERENCES as u64 + 4;
        let references = |to: u64, kind: u8| {
            let message = [[kind, 16, 0, 0].as_slice(), &to.to_le_bytes(), &BLOCK.to_le_bytes()].concat();
            message.repeat(REFERENCES)
        };
        let first = 48 + 10 + 20 * REFERENCES as u64 + 4;
        let header =
            [b"OHDR\x02\x02".as_slice(), &(20 * REFERENCES as u32).to_le_bytes(), &references(first, 16), &[0; 4]];
        // The last has messages that say nothing.
        let next = |at: u64| references(first + at * BLOCK, if at < DEEP { 16 } else { 0 });
        let blocks: Vec<u8> = (1..=DEEP).flat_map(|at| [b"OCHK".as_slice(), &next(at), &[0; 4]].concat()).collect();
        let length = first + blocks.len() as u64;
        let addresses = [[0; 8], [0xff; 8], length.to_le_bytes(), 48u64.to_le_bytes()].concat();
        let start = [b"\x89HDF\r\n\x1a\n\x02\x08\x08\x00".as_slice(), &addresses, &[0; 4]].concat();
        [start, header.concat(), blocks].concat()
    }

    #[test]
    fn a_file_that_takes_for_ever_is_given_up() {
        let told = in_time(endless(), Duration::from_secs(1)).err();
        assert!(told.as_ref().is_some_and(|(_, reason)| reason.contains("within 1 s")), "{told:?}");
    }
}
