//! COLMAP's database, to say why pictures were not placed: the features of each, and how many they share. COLMAP has no command for this,
//! so the rows of three tables are read from SQLite's format: their key and first column.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::pictures::Pictures;
use crate::error::Error;
use crate::words::count;

/// Pairs are numbered with this factor: COLMAP's `kMaxNumImages`.
const MAX_IMAGES: u64 = 2_147_483_647;
/// Deeper trees than any real one are broken.
const MAX_DEPTH: u32 = 24;
const INNER: u8 = 0x05;
const LEAF: u8 = 0x0d;
/// The header of the file stands before the first page's.
const HEADER: usize = 100;

#[derive(Debug, Default, PartialEq)]
struct Shared {
    features: BTreeMap<String, u64>,
    /// Pairs of pictures that see the same, and the number of features that they share.
    pairs: Vec<(String, String, u64)>,
}

impl Shared {
    fn words(&self) -> String {
        let Shared { features, pairs } = self;
        let n = features.len();
        let (least, most) = (features.values().min().unwrap_or(&0), features.values().max().unwrap_or(&0));
        let mean = features.values().sum::<u64>() / (n as u64).max(1);
        let mut text = format!(
            "{} with {mean} features in the mean ({least} to {most}), and {} of {} share some",
            count(n, "picture"),
            pairs.len(),
            count(n * n.saturating_sub(1) / 2, "pair")
        );
        if n > NAMED {
            return text;
        }
        let mut of: BTreeMap<&str, Vec<(u64, &str)>> =
            features.keys().map(|name| (name.as_str(), Vec::new())).collect();
        for (a, b, n) in pairs {
            for (one, other) in [(a, b), (b, a)] {
                of.entry(one).or_default().push((*n, stem(other)));
            }
        }
        for (name, mut others) in of {
            others.sort_by(|a, b| b.cmp(a));
            let others: Vec<String> = others.iter().take(3).map(|(n, other)| format!("{n} with {other}")).collect();
            text +=
                &format!("; {} {}", stem(name), if others.is_empty() { "none".to_owned() } else { others.join(", ") });
        }
        text
    }
}

/// Up to so many pictures, each is named with what it shares.
const NAMED: usize = 12;

/// The error of pictures that hang together too little, from the database of the attempt.
pub(super) fn unplaced(source: &Path, pictures: &Pictures, database: &Path) -> Error {
    let what = if matches!(pictures, Pictures::Videos(_)) { "cameras" } else { "pictures" };
    let found = read(database).map_or_else(String::new, |shared| format!(": {}", shared.words()));
    let reason = format!("holds {what} that COLMAP cannot place, since too little of each is in others{found}");
    let remedy = match pictures {
        Pictures::Videos(_) => {
            "try another moment (--frames 100: with --force), larger pictures, or photographs of the place taken from between the cameras \
             (--static PHOTOS); or calibrate the cameras with caliscope or Pose2Sim, or with RealityScan and its export for COLMAP, and \
             give that"
        }
        _ => {
            "take more pictures with much overlap, sharp and large, of a scene with texture, from different places; or give the poses of \
             another program as a COLMAP model or transforms.json"
        }
    };
    Error::data(source, "", reason, remedy)
}

/// A picture's name without ending: of a video, that of its camera.
fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// Reads a database; nothing where it is not understood.
fn read(path: &Path) -> Option<Shared> {
    let mut database = Database::open(path)?;
    let mut roots = BTreeMap::new();
    // Kind, name, table, root page.
    for (_, columns) in database.rows(1, 4)? {
        if let [_, Value::Text(name), _, Value::Number(root)] = columns.as_slice() {
            roots.insert(name.clone(), u32::try_from(*root).ok()?);
        }
    }
    let mut table = |name: &str| database.rows(*roots.get(name)?, 2);
    let names = table("images")?.into_iter().filter_map(|(id, columns)| match columns.into_iter().nth(1) {
        Some(Value::Text(name)) => Some((id, name)),
        _ => None,
    });
    let names: BTreeMap<u64, String> = names.collect();
    let number = |columns: &[Value]| match columns.get(1) {
        Some(Value::Number(number)) => *number,
        _ => 0,
    };
    let mut shared = Shared::default();
    shared.features.extend(names.values().map(|name| (name.clone(), 0)));
    for (id, columns) in table("keypoints")? {
        if let Some(name) = names.get(&id) {
            shared.features.insert(name.clone(), number(&columns));
        }
    }
    for (pair, columns) in table("two_view_geometries")? {
        let [a, b] = [pair / MAX_IMAGES, pair % MAX_IMAGES].map(|id| names.get(&id).cloned());
        if let (Some(a), Some(b), n @ 1..) = (a, b, number(&columns)) {
            shared.pairs.push((a, b, n));
        }
    }
    Some(shared)
}

enum Value {
    Number(u64),
    Text(String),
    Other,
}

struct Database {
    file: File,
    page: usize,
    /// Pages that are not read yet: each is in one tree.
    left: u64,
}

impl Database {
    fn open(path: &Path) -> Option<Self> {
        let mut file = File::open(path).ok()?;
        let mut header = [0; HEADER];
        file.read_exact(&mut header).ok()?;
        let page = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 65_536,
            page => usize::from(page),
        };
        let n_bytes = file.metadata().ok()?.len();
        (header.starts_with(b"SQLite format 3\0") && page >= 512).then(|| Database {
            file,
            page,
            left: n_bytes / page as u64,
        })
    }

    /// The rows of a table: the key and the first `n` columns of each. The key's own column is empty.
    fn rows(&mut self, root: u32, n: usize) -> Option<Vec<(u64, Vec<Value>)>> {
        let mut rows = Vec::new();
        self.gather(root, n, 0, &mut rows)?;
        Some(rows)
    }

    fn gather(&mut self, page: u32, n: usize, depth: u32, rows: &mut Vec<(u64, Vec<Value>)>) -> Option<()> {
        self.left = self.left.checked_sub(1).filter(|_| depth < MAX_DEPTH)?;
        let start = u64::from(page).checked_sub(1)? * self.page as u64;
        let mut bytes = vec![0; self.page];
        self.file.seek(SeekFrom::Start(start)).ok()?;
        self.file.read_exact(&mut bytes).ok()?;
        let header = bytes.get(if page == 1 { HEADER } else { 0 }..)?;
        let kind = *header.first()?;
        let cells = usize::from(be16(header.get(3..)?)?);
        let pointers = header.get(if kind == INNER { 12 } else { 8 }..)?;
        for cell in 0..cells {
            let cell = bytes.get(usize::from(be16(pointers.get(2 * cell..)?)?)..)?;
            match kind {
                INNER => self.gather(be32(cell)?, n, depth + 1, rows)?,
                LEAF => {
                    let (_, rest) = varint(cell)?;
                    let (key, record) = varint(rest)?;
                    rows.push((key, columns(record, n)?));
                }
                _ => return None,
            }
        }
        if kind == INNER { self.gather(be32(header.get(8..)?)?, n, depth + 1, rows) } else { Some(()) }
    }
}

/// The first columns of a record.
fn columns(record: &[u8], n: usize) -> Option<Vec<Value>> {
    let (n_header, mut kinds) = varint(record)?;
    let mut body = record.get(usize::try_from(n_header).ok()?..)?;
    let mut values = Vec::new();
    for _ in 0..n {
        let (kind, rest) = varint(kinds)?;
        kinds = rest;
        let length = match kind {
            0 | 8 | 9 => 0,
            1..=4 => kind,
            5 => 6,
            6 | 7 => 8,
            _ => kind.checked_sub(12)? / 2,
        };
        let bytes = body.get(..usize::try_from(length).ok()?)?;
        body = &body[bytes.len()..];
        values.push(match kind {
            1..=6 => Value::Number(bytes.iter().fold(0, |number, byte| number << 8 | u64::from(*byte))),
            8 | 9 => Value::Number(kind - 8),
            13.. if kind % 2 == 1 => Value::Text(String::from_utf8_lossy(bytes).into_owned()),
            _ => Value::Other,
        });
    }
    Some(values)
}

fn be16(bytes: &[u8]) -> Option<u16> {
    Some(u16::from_be_bytes(bytes.get(..2)?.try_into().ok()?))
}

fn be32(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(..4)?.try_into().ok()?))
}

/// A number of seven bits a byte, the highest first, and what comes after it.
fn varint(bytes: &[u8]) -> Option<(u64, &[u8])> {
    let mut value = 0;
    for (index, byte) in bytes.iter().enumerate().take(9) {
        if index == 8 {
            return Some((value << 8 | u64::from(*byte), &bytes[9..]));
        }
        value = value << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Some((value, &bytes[index + 1..]));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: usize = 512;

    fn encoded(mut n: u64) -> Vec<u8> {
        let mut bytes = vec![(n & 0x7f) as u8];
        while n > 0x7f {
            n >>= 7;
            bytes.insert(0, (n & 0x7f) as u8 | 0x80);
        }
        bytes
    }

    /// A row with an empty key column and then a text or a number.
    fn row(key: u64, columns: &[Result<&str, u32>]) -> Vec<u8> {
        let kind = |column: &Result<&str, u32>| column.map_or(4, |text| 13 + 2 * text.len() as u64);
        let kinds: Vec<u8> = columns.iter().flat_map(|column| encoded(kind(column))).collect();
        let body = columns.iter().flat_map(|column| match column {
            Ok(text) => text.as_bytes().to_vec(),
            Err(number) => number.to_be_bytes().to_vec(),
        });
        let record: Vec<u8> = encoded(kinds.len() as u64 + 1).into_iter().chain(kinds).chain(body).collect();
        [encoded(record.len() as u64), encoded(key), record].concat()
    }

    /// A leaf with these rows, or an inner page that leads to these pages.
    fn page(kind: u8, cells: &[Vec<u8>], last: Option<u32>, header: usize) -> Vec<u8> {
        let mut bytes = vec![0; PAGE];
        bytes[header] = kind;
        bytes[header + 4] = cells.len() as u8;
        let mut pointers = header + 8;
        if let Some(last) = last {
            bytes[header + 8..header + 12].copy_from_slice(&last.to_be_bytes());
            pointers += 4;
        }
        let mut end = PAGE;
        for (index, cell) in cells.iter().enumerate() {
            end -= cell.len();
            bytes[end..end + cell.len()].copy_from_slice(cell);
            bytes[pointers + 2 * index..][..2].copy_from_slice(&(end as u16).to_be_bytes());
        }
        bytes
    }

    fn sample() -> Vec<u8> {
        let table = |key: u64, name: &'static str, root: u32| row(key, &[Ok("table"), Ok(name), Ok(name), Err(root)]);
        let schema = [table(1, "images", 2), table(2, "keypoints", 3), table(3, "two_view_geometries", 4)];
        let pair = |a: u64, b: u64| a * MAX_IMAGES + b;
        let null = |key: u64, column: Result<&str, u32>| {
            // The key's own column is empty, of kind 0.
            row(key, &[Ok(""), column])
        };
        let images = [null(1, Ok("a b.jpg")), null(2, Ok("c.jpg")), null(3, Ok("d.jpg"))];
        let features = [null(1, Err(70)), null(2, Err(5000))];
        let child = |page: u32| [page.to_be_bytes().to_vec(), encoded(9)].concat();
        let mut file = page(LEAF, &schema, None, HEADER);
        file[..16].copy_from_slice(b"SQLite format 3\0");
        file[16..18].copy_from_slice(&(PAGE as u16).to_be_bytes());
        file.extend(page(LEAF, &images, None, 0));
        file.extend(page(LEAF, &features, None, 0));
        file.extend(page(INNER, &[child(5)], Some(6), 0));
        file.extend(page(LEAF, &[null(pair(1, 2), Err(33))], None, 0));
        file.extend(page(LEAF, &[null(pair(1, 3), Err(0)), null(pair(2, 3), Err(18))], None, 0));
        file
    }

    fn read_bytes(bytes: &[u8]) -> Option<Shared> {
        let path =
            std::env::temp_dir().join(format!("ivv-database-{}-{:?}", std::process::id(), std::thread::current().id()));
        std::fs::write(&path, bytes).unwrap();
        let shared = read(&path);
        std::fs::remove_file(path).unwrap();
        shared
    }

    #[test]
    fn features_and_pairs_are_read() {
        let shared = read_bytes(&sample()).unwrap();
        let features: Vec<(&str, u64)> = shared.features.iter().map(|(name, n)| (name.as_str(), *n)).collect();
        assert_eq!(features, [("a b.jpg", 70), ("c.jpg", 5000), ("d.jpg", 0)]);
        let pairs: Vec<(&str, &str, u64)> = shared.pairs.iter().map(|(a, b, n)| (a.as_str(), b.as_str(), *n)).collect();
        assert_eq!(pairs, [("a b.jpg", "c.jpg", 33), ("c.jpg", "d.jpg", 18)]);
    }

    #[test]
    fn what_is_damaged_is_nothing() {
        let sample = sample();
        for length in [0, 99, 100, 700, sample.len() - 1] {
            assert_eq!(read_bytes(&sample[..length]), None, "{length}");
        }
        // A tree that holds itself has an end.
        let mut round = sample.clone();
        round[3 * PAGE + 8..3 * PAGE + 12].copy_from_slice(&4_u32.to_be_bytes());
        assert_eq!(read_bytes(&round), None);
        // Any byte may be another.
        for at in (0..sample.len()).step_by(7) {
            let mut other = sample.clone();
            other[at] ^= 0xff;
            let _ = read_bytes(&other);
        }
    }
}
