//! PLY files of clips longer than memory: static Gaussians, then the dynamic ones part by part, which comments of the header
//! list. Other readers see a plain scene.

use super::ply::{is_ply, own_comments, own_time, push_row, write_header};
use super::ply_layout::Layout;
use super::ply_time::OWN_TIME;
use super::rendering::Own;
use crate::error::{Error, Result};
use crate::files::ply_header::{Element, Encoding, Header};
use crate::files::ply_rows::Rows;
use crate::files::write_made;
use crate::scene::{Part, Parts, Splats};
use std::path::{Path, PathBuf};

/// Comment: number of static Gaussians.
const STILL: &str = "ivv_static";
/// Comment of a part: number of Gaussians, begin, end.
const PART: &str = "ivv_part";
const REMEDY: &str = "join the segments again";

pub struct PlyParts {
    path: PathBuf,
    header: Header,
    vertex: Element,
    layout: Layout,
    n_static: u64,
    parts: Vec<Part>,
}

impl PlyParts {
    /// `None` where the file lists no parts, or is no PLY.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        if !is_ply(path)? {
            return Ok(None);
        }
        let (header, _) = Rows::open(path)?;
        let said = |key: &'static str| {
            header.comments.iter().filter_map(move |line| line.strip_prefix(key)?.strip_prefix(' '))
        };
        let Some(still) = said(STILL).next() else { return Ok(None) };
        let fault = |reason: String| Error::data(path, "header, comments on parts", reason, REMEDY);
        let n_static = still.parse().map_err(|_| fault(format!("expected a number of Gaussians, found `{still}`")))?;
        let parts = said(PART).map(|line| {
            part(line).ok_or_else(|| fault(format!("expected number, begin and end of a part, found `{line}`")))
        });
        let parts: Vec<Part> = parts.collect::<Result<_>>()?;
        let vertex = header.elements.first().filter(|element| element.name == "vertex");
        let (Some(vertex), true) = (vertex, header.encoding != Encoding::Ascii) else {
            return Err(fault("expected binary rows of `vertex` first, found others".to_owned()));
        };
        let told = parts.iter().try_fold(n_static, |sum: u64, part| sum.checked_add(part.n as u64));
        if told != Some(vertex.count) {
            return Err(fault(format!("do not tell of the {} Gaussians that there are", vertex.count)));
        }
        let (layout, vertex) = (Layout::new(path, &header, vertex)?, vertex.clone());
        Ok(Some(PlyParts { path: path.to_owned(), header, vertex, layout, n_static, parts }))
    }

    pub fn n_static(&self) -> usize {
        self.n_static as usize
    }

    /// Static and dynamic Gaussians of `n` rows from `first` on.
    fn rows(&self, first: u64, n: u64) -> Result<[Splats; 2]> {
        let (_, mut rows) = Rows::open(&self.path)?;
        rows.seek(&self.header, self.vertex.row_size().unwrap_or(0), first)?;
        let [mut still, mut moving] = [0, 1].map(|_| Splats::new(self.layout.sh_degree));
        let mut refused = None;
        rows.read(&Element { count: n, ..self.vertex.clone() }, |row, bytes| {
            if let Err(reason) = self.layout.push(first as u32 + row, bytes, &mut still, &mut moving) {
                refused.get_or_insert((first + u64::from(row), reason));
            }
        })?;
        still.n_static = still.len();
        match refused {
            Some((row, reason)) => Err(Error::data(&self.path, format!("row {row}"), reason, REMEDY)),
            None => Ok([still, moving]),
        }
    }
}

fn part(line: &str) -> Option<Part> {
    let words: Vec<&str> = line.split(' ').collect();
    let [n, from, to] = words[..] else { return None };
    let part = Part { n: n.parse::<u32>().ok()? as usize, from: from.parse().ok()?, to: to.parse().ok()? };
    (part.from < part.to).then_some(part)
}

impl Parts for PlyParts {
    fn path(&self) -> &Path {
        &self.path
    }

    fn sh_degree(&self) -> u32 {
        self.layout.sh_degree
    }

    fn parts(&self) -> &[Part] {
        &self.parts
    }

    fn still(&mut self) -> Result<Splats> {
        let [still, moving] = self.rows(0, self.n_static)?;
        if moving.is_empty() {
            return Ok(still);
        }
        let reason = format!("{} Gaussians move that should rest", moving.len());
        Err(Error::data(&self.path, format!("rows 0 to {}", self.n_static), reason, REMEDY))
    }

    fn part(&mut self, index: usize) -> Result<Splats> {
        let first = self.n_static + self.parts[..index].iter().map(|part| part.n as u64).sum::<u64>();
        let Part { from, to, n } = self.parts[index];
        let [still, moving] = self.rows(first, n as u64)?;
        let is_outside = |span: &[f32; 2]| f64::from(span[0]) < from || f64::from(span[1]) > to;
        let is_limited = from > f64::NEG_INFINITY || to < f64::INFINITY;
        if still.is_empty() && !moving.span.iter().any(is_outside) && (!is_limited || !moving.span.is_empty()) {
            return Ok(moving);
        }
        let reason = "Gaussians are there at times that are not those of the part";
        Err(Error::data(&self.path, format!("part {index}"), reason, REMEDY))
    }
}

/// Writes a clip with one part at a time in memory.
pub fn write_parts(path: &Path, clip: &mut dyn Parts, own: &Own) -> Result<()> {
    let still = clip.still()?;
    let parts = clip.parts().to_vec();
    let comments: Vec<String> = std::iter::once(format!("{STILL} {}", still.len()))
        .chain(parts.iter().map(|part| format!("{PART} {} {} {}", part.n, part.from, part.to)))
        .chain(own_comments(own))
        .collect();
    let n = still.len() + parts.iter().map(|part| part.n).sum::<usize>();
    if u32::try_from(n).is_err() {
        let reason = format!("the clip has {n} Gaussians, a PLY of ours holds at most {}", u32::MAX);
        return Err(Error::data(path, "", reason, "write it as .4dgs"));
    }
    write_made(path, |put| {
        let mut bytes = Vec::new();
        write_header(&mut bytes, clip.sh_degree(), n, &comments, &OWN_TIME)
            .map_err(|fault| Error::data(path, "header", fault.to_string(), REMEDY))?;
        put(&bytes)?;
        let mut rows = |splats: &Splats| {
            (0..splats.len()).try_for_each(|i| {
                bytes.clear();
                push_row(splats, i, &own_time(splats, i.checked_sub(splats.n_static)), &mut bytes);
                put(&bytes)
            })
        };
        rows(&still)?;
        drop(still);
        (0..parts.len()).try_for_each(|index| rows(&clip.part(index)?))
    })
}
