//! 3DGS's PLY (SPEC 9).

use super::compressed_ply::{is_compressed, read_compressed};
use super::format::{ELSEWHERE, Keeps, Reader, Writer, first_bytes, require_some};
use super::ply_known::network_beside;
use super::ply_layout::Layout;
use super::ply_time::{FREE_TIME, OWN_TIME, free_time, free_time_comments};
use super::rendering::Own;
use super::scene::{Clock, Scene};
use crate::error::{Error, Result};
use crate::files::ply_header::Header;
use crate::files::ply_rows::Rows;
use crate::files::write_atomic;
use crate::scene::{ALWAYS, Motion, Splats};
use std::io::{self, Write};
use std::path::Path;

/// ASCII or binary of either byte order; properties by name, of any scalar type (rounded to f32). Skips what changes no
/// picture, harmonics of degree 4 and above, and notes it. The discs of 2DGS become thin; mip-splatting's 3D filter is worked
/// in. Temporal properties are ours, those of a `.ftgs.ply`, or those of Spacetime Gaussians along lines.
pub fn read_ply(path: &Path) -> Result<Splats> {
    read(path).map(|scene| scene.splats)
}

fn read(path: &Path) -> Result<Scene> {
    let (header, rows) = Rows::open(path)?;
    let own = own(&header);
    let vertices = if is_compressed(&header) { read_compressed } else { read_vertices };
    let (splats, mut notes) = vertices(path, &header, rows)?;
    notes.extend(network_beside(path));
    Ok(Scene::new(splats, notes, own.as_ref()))
}

fn read_vertices(path: &Path, header: &Header, mut rows: Rows) -> Result<(Splats, Vec<String>)> {
    let Some(vertex) = header.element("vertex") else {
        let remedy = "give a Gaussian splatting scene";
        return Err(Error::data(path, "header", "has no element `vertex`", remedy));
    };
    let mut layout = Layout::new(path, header, vertex)?;
    let [mut still, mut moving] = [0, 1].map(|_| Splats::new(layout.sh_degree));
    let (mut refused, mut n_cut) = (None, 0);
    for element in &header.elements {
        if element.name == "vertex" {
            rows.read(element, |row, bytes| {
                n_cut += usize::from(layout.is_cut(bytes));
                if let Err(reason) = layout.push(row, bytes, &mut still, &mut moving) {
                    refused.get_or_insert((row, reason));
                }
            })?;
        } else {
            rows.skip(element)?;
        }
    }
    rows.finish()?;
    if let Some((row, reason)) = refused {
        let remedy = "fit it again with motion along lines only";
        return Err(Error::data(path, format!("row {row}"), reason, remedy));
    }
    still.n_static = still.len();
    still.append(moving);
    let mut notes = std::mem::take(&mut layout.notes);
    notes.extend(layout.notes_of_rows(n_cut, still.len()));
    Ok((still, notes))
}

fn own(header: &Header) -> Option<Own> {
    let said = header.comments.iter().filter_map(|line| line.strip_prefix(OWN)?.split_once(' '));
    let own: Own = said.map(|(name, value)| (name.to_owned(), value.to_owned())).collect();
    (!own.is_empty()).then_some(own)
}

pub(super) fn own_comments(own: &Own) -> Vec<String> {
    let plain = |text: &str| text.split_ascii_whitespace().collect::<Vec<_>>().join(" ");
    own.iter().map(|(name, value)| format!("{OWN}{} {}", plain(name), plain(value))).collect()
}

/// How the scene is rendered; none in a file of another program or format.
pub fn ply_own(path: &Path) -> Result<Option<Own>> {
    if is_ply(path)? { Rows::open(path).map(|(header, _)| own(&header)) } else { Ok(None) }
}

pub(super) fn is_ply(path: &Path) -> Result<bool> {
    first_bytes(path).map(|bytes| STARTS.contains(&&bytes[..]))
}

const STARTS: [&[u8]; 2] = [b"ply\n", b"ply\r"];
/// The prefix of this project's own comments: a name and a value follow.
const OWN: &str = "ivv ";

pub(super) const READER: Reader = Reader {
    what: "a 3DGS, FreeTimeGS, Spacetime Gaussians or PlayCanvas compressed PLY",
    knows: |start| STARTS.contains(&start.bytes),
    read,
};

pub(super) const WRITER: Writer = Writer {
    name: "ply",
    ending: Some(".ply"),
    about: "3DGS's, with the motion of dynamic Gaussians",
    keeps: Keeps { constants: true, non_finite: true, ..Keeps::NOTHING },
    write: |path, splats, clip, _| write_ply_with(path, splats, &clip.unusual()).map(|()| Vec::new()),
};
pub(super) const FTGS_WRITER: Writer = Writer {
    name: "ftgs",
    ending: Some(".ftgs.ply"),
    about: "FreeTimeGS's PLY",
    keeps: Keeps { constants: true, views: true, ..Keeps::NOTHING },
    write: |path, splats, clip, _| write_free_time(path, splats, clip.clock, &clip.unusual()).map(|()| Vec::new()),
};

/// Writes binary little-endian rows in the order of `source_row`, with the temporal properties if any Gaussian is dynamic.
/// Writing what was read gives the same bytes, unless a logit of an opacity is infinite.
pub fn write_ply(path: &Path, splats: &Splats) -> Result<()> {
    write_ply_with(path, splats, &Own::new())
}

/// As [`write_ply`], with `own` in comments of the header.
pub fn write_ply_with(path: &Path, splats: &Splats, own: &Own) -> Result<()> {
    let names = match (splats.motion.is_empty(), splats.span.is_empty()) {
        (true, _) => &[],
        (false, true) => &OWN_TIME[..5],
        (false, false) => &OWN_TIME[..],
    };
    let temporal = |dynamic: Option<usize>| own_time(splats, dynamic);
    let rows = (0..splats.len()).collect();
    write_rows(path, splats, rows, &own_comments(own), names, temporal)
}

/// [`OWN_TIME`] of a Gaussian by its index among the dynamic ones; `None` is a static one.
pub(super) fn own_time(splats: &Splats, dynamic: Option<usize>) -> [f32; 7] {
    let still = Motion { velocity: [0.0; 3], t_center: 0.0, t_scale: f32::INFINITY };
    let Motion { velocity: [x, y, z], t_center, t_scale } = dynamic.map_or(still, |at| splats.motion[at]);
    let [from, to] = dynamic.and_then(|at| splats.span.get(at)).copied().unwrap_or(ALWAYS);
    [x, y, z, t_center, t_scale, from, to]
}

/// Writes a `.ftgs.ply`, version 1, with the frames of `clock` where the format has them. Leaves out Gaussians that are not
/// finite. One that never fades has a standard deviation of 1e6 sequences.
pub fn write_ftgs(path: &Path, splats: &Splats, clock: Option<Clock>) -> Result<()> {
    write_free_time(path, splats, clock, &Own::new())
}

fn write_free_time(path: &Path, splats: &Splats, clock: Option<Clock>, own: &Own) -> Result<()> {
    let rows: Vec<usize> = (0..splats.len()).filter(|&i| splats.is_finite(i)).collect();
    require_some(path, &rows, ".ftgs.ply")?;
    splats.refuse_spans(path, "this format", ELSEWHERE)?;
    let mut comments = free_time_comments(splats.sh_degree, clock);
    comments.extend(own_comments(own));
    let temporal = |dynamic: Option<usize>| free_time(dynamic.map(|at| splats.motion[at]), clock);
    write_rows(path, splats, rows, &comments, &FREE_TIME, temporal)
}

/// Writes the Gaussians `rows` in the order of `source_row`. `temporal` gives at least the values of the properties `names`, by the
/// index among the dynamic Gaussians.
fn write_rows<const N: usize>(
    path: &Path,
    splats: &Splats,
    mut rows: Vec<usize>,
    comments: &[String],
    names: &[&str],
    temporal: impl Fn(Option<usize>) -> [f32; N],
) -> Result<()> {
    let remedy = "this is a fault of the program that made the scene";
    splats.check().map_err(|reason| Error::data(path, "", reason, remedy))?;
    rows.sort_by_key(|&i| splats.source_row[i]);
    write_atomic(path, |to| {
        write_header(to, splats.sh_degree, rows.len(), comments, names)?;
        let mut row = Vec::new();
        rows.iter().try_for_each(|&i| {
            row.clear();
            push_row(splats, i, &temporal(i.checked_sub(splats.n_static))[..names.len()], &mut row);
            to.write_all(&row)
        })
    })
}

pub(super) fn write_header(
    to: &mut dyn Write,
    sh_degree: u32,
    n: usize,
    comments: &[String],
    temporal: &[&str],
) -> io::Result<()> {
    let n_rest = 3 * (Splats::new(sh_degree).n_coefficients() - 1);
    writeln!(to, "ply\nformat binary_little_endian 1.0")?;
    comments.iter().try_for_each(|line| writeln!(to, "comment {line}"))?;
    writeln!(to, "element vertex {n}")?;
    let plain = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let numbered = |prefix: &str, n: usize| (0..n).map(|i| format!("{prefix}_{i}")).collect();
    let parts = [
        plain(&["x", "y", "z", "nx", "ny", "nz"]),
        numbered("f_dc", 3),
        numbered("f_rest", n_rest),
        plain(&["opacity"]),
        numbered("scale", 3),
        numbered("rot", 4),
        plain(temporal),
    ];
    parts.iter().flatten().try_for_each(|name| writeln!(to, "property float {name}"))?;
    writeln!(to, "end_header")
}

pub(super) fn push_row(splats: &Splats, i: usize, temporal: &[f32], row: &mut Vec<u8>) {
    let mut push = |values: &[f32]| values.iter().for_each(|v| row.extend(v.to_le_bytes()));
    push(&splats.position[i]);
    push(&[0.0; 3]);
    let k = splats.n_coefficients();
    let sh = &splats.sh[i * k..(i + 1) * k];
    push(&sh[0]);
    for channel in 0..3 {
        sh[1..].iter().for_each(|coefficient| push(&[coefficient[channel]]));
    }
    push(&[splats.opacity[i]]);
    push(&splats.scale[i]);
    push(&splats.rotation[i]);
    push(temporal);
}
