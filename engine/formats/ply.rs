//! Scenes as 3DGS PLY files (SPEC 9): reader of every variant, writer of the canonical one.

use std::io::{self, Write};
use std::path::Path;

use super::clock::Clock;
use super::compressed_ply::{is_compressed, read_compressed};
use super::decode::logit_of_byte;
use super::format::{ELSEWHERE, Reader, WriteScene, Writer};
use super::ply_time::{FREE_TIME, MOTION, SPAN, Temporal, free_time, free_time_comments};
use crate::error::{Error, Result};
use crate::files::ply_header::{Element, Header};
use crate::files::ply_rows::{Column, Rows};
use crate::files::write_atomic;
use crate::scene::dc_of_color;
use crate::scene::{ALWAYS, Motion, Splats};

/// Reads a scene from a 3DGS PLY file: ascii or binary of either byte order, properties by name in any order and of
/// any scalar type (rounded to f32), other properties and elements skipped.
///
/// Temporal properties are this project's, those of a `.ftgs.ply` (version 1) or those of Spacetime Gaussians whose motion is
/// along lines. A Gaussian is static when the file has none or when it rests and never fades (`t_scale` +infinity, a
/// `log_duration` of 1e6 sequences); static Gaussians come first, each population in the file's order, and `source_row` keeps the row.
/// Opacities of 0 and 1, whose logits are infinite, are taken as those of a byte are. Other values that are not finite are kept: the
/// renderer culls and counts them.
///
/// # Errors
/// [`Error::Data`] when the file cannot be read, its header is malformed, a property is missing or declared twice,
/// `f_rest` has other than 0, 9, 24 or 45 entries, or the file is shorter or longer than its header says.
pub fn read_ply(path: &Path) -> Result<Splats> {
    let (header, rows) = Rows::open(path)?;
    if is_compressed(&header) { read_compressed(path, &header, rows) } else { read_vertices(path, &header, rows) }
}

fn read_vertices(path: &Path, header: &Header, mut rows: Rows) -> Result<Splats> {
    let Some(vertex) = header.element("vertex") else {
        let remedy = "give a Gaussian splatting scene";
        return Err(Error::data(path, "header", "has no element `vertex`", remedy));
    };
    let layout = Layout::new(path, header, vertex)?;
    let mut still = Splats::new(layout.sh_degree);
    let mut moving = Splats::new(layout.sh_degree);
    let mut refused = None;
    for element in &header.elements {
        if element.name == "vertex" {
            rows.read(element, |row, bytes| {
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
    Ok(still)
}

/// Columns of the properties that make a Gaussian.
pub(super) struct Layout {
    pub(super) sh_degree: u32,
    position: [Column; 3],
    dc: [Column; 3],
    /// Channel-major: `rest[channel * (K - 1) + coefficient - 1]`.
    rest: Vec<Column>,
    opacity: Column,
    scale: [Column; 3],
    rotation: [Column; 4],
    temporal: Option<Temporal>,
}

impl Layout {
    pub(super) fn new(path: &Path, header: &Header, vertex: &Element) -> Result<Self> {
        let place = |name: &str| format!("element `vertex`, property `{name}`");
        if let Some(list) = vertex.properties.iter().find(|p| p.list_length.is_some()) {
            let remedy = "export it with plain properties only";
            return Err(Error::data(path, place(&list.name), "is a list", remedy));
        }
        let column = |name: &str| {
            let remedy = "give a Gaussian splatting scene, not a point cloud or a mesh";
            Column::find(vertex, name).ok_or_else(|| Error::data(path, place(name), "is missing", remedy))
        };
        let n_rest = vertex.properties.iter().filter(|p| p.name.starts_with("f_rest_")).count();
        let sh_degree = match n_rest {
            0 => 0,
            9 => 1,
            24 => 2,
            45 => 3,
            _ => {
                let reason = format!("{n_rest} properties; degrees 0 to 3 have 0, 9, 24 or 45");
                return Err(Error::data(path, place("f_rest_*"), reason, "export the scene with degree 3 or less"));
            }
        };
        Ok(Layout {
            sh_degree,
            position: [column("x")?, column("y")?, column("z")?],
            dc: [column("f_dc_0")?, column("f_dc_1")?, column("f_dc_2")?],
            rest: (0..n_rest).map(|i| column(&format!("f_rest_{i}"))).collect::<Result<_>>()?,
            opacity: column("opacity")?,
            scale: [column("scale_0")?, column("scale_1")?, column("scale_2")?],
            rotation: [column("rot_0")?, column("rot_1")?, column("rot_2")?, column("rot_3")?],
            temporal: Temporal::find(path, header, vertex)?,
        })
    }

    /// Appends the Gaussian of a row to those that it belongs to.
    ///
    /// # Errors
    /// Why it cannot be held.
    pub(super) fn push(
        &self,
        row: u32,
        bytes: &[u8],
        still: &mut Splats,
        moving: &mut Splats,
    ) -> std::result::Result<(), &'static str> {
        let motion = self.temporal.as_ref().map_or(Ok(None), |temporal| temporal.motion(bytes))?;
        let to = if motion.is_some() { moving } else { still };
        let span = self.temporal.as_ref().and_then(|temporal| temporal.span(bytes));
        to.span.extend(span.filter(|_| motion.is_some()));
        to.motion.extend(motion);
        to.source_row.push(row);
        to.position.push(self.position.map(|c| c.f32(bytes)));
        to.rotation.push(self.rotation.map(|c| c.f32(bytes)));
        to.scale.push(self.scale.map(|c| c.f32(bytes)));
        to.opacity.push(within(self.opacity.f32(bytes)));
        let color = self.dc.map(|c| c.f32(bytes));
        let is_plain = self.temporal.as_ref().is_some_and(Temporal::has_plain_colors);
        to.sh.push(if is_plain { color.map(|c| dc_of_color(f64::from(c))) } else { color });
        let per_channel = self.rest.len() / 3;
        for k in 0..per_channel {
            to.sh.push(std::array::from_fn(|channel| self.rest[channel * per_channel + k].f32(bytes)));
        }
        Ok(())
    }
}

/// The logit, made finite: programs that turn bytes into logits write infinite ones for what is opaque or invisible.
fn within(logit: f32) -> f32 {
    if logit.is_infinite() { logit_of_byte(if logit > 0.0 { 255 } else { 0 }) } else { logit }
}

pub(super) const READER: Reader = Reader {
    what: "a 3DGS, FreeTimeGS, Spacetime Gaussians or PlayCanvas compressed PLY",
    knows: |start| start.bytes == b"ply\n" || start.bytes == b"ply\r",
    read: read_ply,
};

pub(super) const WRITER: Writer = Writer {
    name: "ply",
    ending: Some(".ply"),
    about: "3DGS's, with the motion of dynamic Gaussians",
    write: WriteScene::Alone(write_ply),
};
pub(super) const FTGS_WRITER: Writer = Writer {
    name: "ftgs",
    ending: Some(".ftgs.ply"),
    about: "FreeTimeGS's PLY",
    write: WriteScene::WithClip(|path, splats, clock, _| write_ftgs(path, splats, clock)),
};

/// Writes a scene as a binary little-endian PLY in 3DGS's property order, rows in the order of `source_row` (ties: the
/// lower index first). The temporal properties follow when any Gaussian is dynamic; a static one then has velocity 0,
/// `t_center` 0 and `t_scale` +infinity. Where some are not always there, `t_from` and `t_to` follow. Reading a file that this
/// wrote and writing it again gives the same bytes, unless a logit of an opacity is infinite.
///
/// # Errors
/// [`Error::Data`] when the file cannot be written or the scene's arrays disagree in length.
pub fn write_ply(path: &Path, splats: &Splats) -> Result<()> {
    let names: Vec<&str> = match (splats.motion.is_empty(), splats.span.is_empty()) {
        (true, _) => Vec::new(),
        (false, true) => MOTION.to_vec(),
        (false, false) => MOTION.into_iter().chain(SPAN).collect(),
    };
    write_rows(path, splats, &[], &names, |dynamic| own_time(splats, dynamic), |_| true)
}

/// The values of [`MOTION`] and [`SPAN`] of a Gaussian by its place among the dynamic ones; none for a static one.
pub(super) fn own_time(splats: &Splats, dynamic: Option<usize>) -> [f32; 7] {
    let still = Motion { velocity: [0.0; 3], t_center: 0.0, t_scale: f32::INFINITY };
    let Motion { velocity: [x, y, z], t_center, t_scale } = dynamic.map_or(still, |at| splats.motion[at]);
    let [from, to] = dynamic.and_then(|at| splats.span.get(at)).copied().unwrap_or(ALWAYS);
    [x, y, z, t_center, t_scale, from, to]
}

/// Writes a scene as `.ftgs.ply`, version 1: 88 bytes a Gaussian of degree 0. With a `clock` its frames fall where the format
/// has them. Gaussians with a parameter that is not finite are left out; one that never fades has a standard deviation of 1e6
/// sequences.
///
/// # Errors
/// [`Error::Data`] when no Gaussian is left, the file cannot be written or the scene's arrays disagree in length.
pub fn write_ftgs(path: &Path, splats: &Splats, clock: Option<Clock>) -> Result<()> {
    if !(0..splats.len()).any(|i| splats.is_finite(i)) {
        return Err(Error::data(path, "", "there is no Gaussian to write", "a .ftgs.ply needs at least one"));
    }
    splats.refuse_spans(path, "this format", ELSEWHERE)?;
    let comments = free_time_comments(splats.sh_degree, clock);
    let temporal = |dynamic: Option<usize>| free_time(dynamic.map(|at| splats.motion[at]), clock);
    write_rows(path, splats, &comments, &FREE_TIME, temporal, |i| splats.is_finite(i))
}

/// Writes the rows that `keep` tells, with the temporal properties `names`. `temporal` gives their values, and maybe more behind
/// them, by the place among the dynamic Gaussians; none for a static one.
fn write_rows<const N: usize>(
    path: &Path,
    splats: &Splats,
    comments: &[String],
    names: &[&str],
    temporal: impl Fn(Option<usize>) -> [f32; N],
    keep: impl Fn(usize) -> bool,
) -> Result<()> {
    let remedy = "this is a fault of the program that made the scene";
    splats.check().map_err(|reason| Error::data(path, "", reason, remedy))?;
    let mut order: Vec<usize> = (0..splats.len()).filter(|i| keep(*i)).collect();
    order.sort_by_key(|&i| splats.source_row[i]);
    write_atomic(path, |to| {
        write_header(to, splats.sh_degree, order.len(), comments, names)?;
        let mut row = Vec::new();
        for &i in &order {
            row.clear();
            push_row(splats, i, &mut row);
            if !names.is_empty() {
                let values = temporal(i.checked_sub(splats.n_static));
                values.iter().take(names.len()).for_each(|v| row.extend(v.to_le_bytes()));
            }
            to.write_all(&row)?;
        }
        Ok(())
    })
}

/// Writes the header of `n` rows with the temporal properties `temporal`.
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
    let mut names: Vec<String> = ["x", "y", "z", "nx", "ny", "nz"].map(str::to_owned).to_vec();
    names.extend((0..3).map(|i| format!("f_dc_{i}")));
    names.extend((0..n_rest).map(|i| format!("f_rest_{i}")));
    names.push("opacity".to_owned());
    names.extend((0..3).map(|i| format!("scale_{i}")));
    names.extend((0..4).map(|i| format!("rot_{i}")));
    names.extend(temporal.iter().map(|name| (*name).to_owned()));
    for name in names {
        writeln!(to, "property float {name}")?;
    }
    writeln!(to, "end_header")
}

/// Appends the row of Gaussian `i`, without temporal properties.
pub(super) fn push_row(splats: &Splats, i: usize, row: &mut Vec<u8>) {
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
}
