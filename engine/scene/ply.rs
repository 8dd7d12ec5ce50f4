//! Scenes as 3DGS PLY files (SPEC 9): reader of every variant, writer of the canonical one.

use std::io::{self, Write};
use std::path::Path;

use super::file::write_atomic;
use super::ply_header::{Element, Header};
use super::ply_rows::{Column, Rows};
use super::splats::{Motion, Splats};
use crate::error::{Error, Result};

/// The temporal properties, in the file's order; a file has all of them or none.
const MOTION: [&str; 5] = ["velocity_0", "velocity_1", "velocity_2", "t_center", "t_scale"];

/// Reads a scene from a 3DGS PLY file: ascii or binary of either byte order, properties by name in any order and of
/// any scalar type (rounded to f32), other properties and elements skipped.
///
/// A Gaussian is static when the file has no temporal properties or when its velocity is 0 and its `t_scale` is
/// +infinity; static Gaussians come first, each population in the file's order, and `source_row` keeps the row. Values
/// that are not finite are kept: the renderer culls and counts them.
///
/// # Errors
/// [`Error::Data`] when the file cannot be read, its header is malformed, a property is missing or declared twice,
/// `f_rest` has other than 0, 9, 24 or 45 entries, or the file is shorter or longer than its header says.
pub fn read_ply(path: &Path) -> Result<Splats> {
    let (header, rows) = Rows::open(path)?;
    read_vertices(path, &header, rows)
}

/// The rest of [`read_ply`], once the header is known.
pub(super) fn read_vertices(path: &Path, header: &Header, mut rows: Rows) -> Result<Splats> {
    let Some(vertex) = header.element("vertex") else {
        let remedy = "give a Gaussian splatting scene";
        return Err(Error::data(path, "header", "has no element `vertex`", remedy));
    };
    let layout = Layout::new(path, vertex)?;
    let mut still = Splats::new(layout.sh_degree);
    let mut moving = Splats::new(layout.sh_degree);
    for element in &header.elements {
        if element.name == "vertex" {
            rows.read(element, |row, bytes| layout.push(row, bytes, &mut still, &mut moving))?;
        } else {
            rows.skip(element)?;
        }
    }
    rows.finish()?;
    still.n_static = still.len();
    still.append_dynamic(moving);
    Ok(still)
}

/// Columns of the properties that make a Gaussian.
struct Layout {
    sh_degree: u32,
    position: [Column; 3],
    dc: [Column; 3],
    /// Channel-major: `rest[channel * (K - 1) + coefficient - 1]`.
    rest: Vec<Column>,
    opacity: Column,
    scale: [Column; 3],
    rotation: [Column; 4],
    motion: Option<[Column; 5]>,
}

impl Layout {
    fn new(path: &Path, vertex: &Element) -> Result<Self> {
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
        let has_motion = MOTION.iter().any(|name| Column::find(vertex, name).is_some());
        Ok(Layout {
            sh_degree,
            position: [column("x")?, column("y")?, column("z")?],
            dc: [column("f_dc_0")?, column("f_dc_1")?, column("f_dc_2")?],
            rest: (0..n_rest).map(|i| column(&format!("f_rest_{i}"))).collect::<Result<_>>()?,
            opacity: column("opacity")?,
            scale: [column("scale_0")?, column("scale_1")?, column("scale_2")?],
            rotation: [column("rot_0")?, column("rot_1")?, column("rot_2")?, column("rot_3")?],
            motion: if has_motion {
                let [vx, vy, vz, center, scale] = MOTION;
                Some([column(vx)?, column(vy)?, column(vz)?, column(center)?, column(scale)?])
            } else {
                None
            },
        })
    }

    fn push(&self, row: u32, bytes: &[u8], still: &mut Splats, moving: &mut Splats) {
        let motion = self.motion.map(|columns| {
            let [vx, vy, vz, t_center, t_scale] = columns.map(|c| c.f32(bytes));
            Motion { velocity: [vx, vy, vz], t_center, t_scale }
        });
        let to = match motion {
            Some(motion) if motion.velocity != [0.0; 3] || motion.t_scale != f32::INFINITY => {
                moving.motion.push(motion);
                moving
            }
            _ => still,
        };
        to.source_row.push(row);
        to.position.push(self.position.map(|c| c.f32(bytes)));
        to.rotation.push(self.rotation.map(|c| c.f32(bytes)));
        to.scale.push(self.scale.map(|c| c.f32(bytes)));
        to.opacity.push(self.opacity.f32(bytes));
        to.sh.push(self.dc.map(|c| c.f32(bytes)));
        let per_channel = self.rest.len() / 3;
        for k in 0..per_channel {
            to.sh.push(std::array::from_fn(|channel| self.rest[channel * per_channel + k].f32(bytes)));
        }
    }
}

/// Writes a scene as a binary little-endian PLY in 3DGS's property order, rows in the order of `source_row` (ties: the
/// lower index first). The temporal properties follow when any Gaussian is dynamic; a static one then has velocity 0,
/// `t_center` 0 and `t_scale` +infinity. Reading a file that this wrote and writing it again gives the same bytes.
///
/// # Errors
/// [`Error::Data`] when the file cannot be written or the scene's arrays disagree in length.
pub fn write_ply(path: &Path, splats: &Splats) -> Result<()> {
    let remedy = "this is a fault of the program that made the scene";
    splats.check().map_err(|reason| Error::data(path, "", reason, remedy))?;
    write_atomic(path, |to| {
        write_header(to, splats)?;
        let mut order: Vec<usize> = (0..splats.len()).collect();
        order.sort_by_key(|&i| splats.source_row[i]);
        let mut row = Vec::new();
        for i in order {
            row.clear();
            push_row(splats, i, &mut row);
            to.write_all(&row)?;
        }
        Ok(())
    })
}

fn write_header(to: &mut dyn Write, splats: &Splats) -> io::Result<()> {
    let n_rest = 3 * (splats.n_coefficients() - 1);
    write!(to, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", splats.len())?;
    let mut names: Vec<String> = ["x", "y", "z", "nx", "ny", "nz"].map(str::to_owned).to_vec();
    names.extend((0..3).map(|i| format!("f_dc_{i}")));
    names.extend((0..n_rest).map(|i| format!("f_rest_{i}")));
    names.push("opacity".to_owned());
    names.extend((0..3).map(|i| format!("scale_{i}")));
    names.extend((0..4).map(|i| format!("rot_{i}")));
    if !splats.motion.is_empty() {
        names.extend(MOTION.map(str::to_owned));
    }
    for name in names {
        writeln!(to, "property float {name}")?;
    }
    writeln!(to, "end_header")
}

fn push_row(splats: &Splats, i: usize, row: &mut Vec<u8>) {
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
    if !splats.motion.is_empty() {
        let motion = match i.checked_sub(splats.n_static) {
            Some(dynamic) => splats.motion[dynamic],
            None => Motion { velocity: [0.0; 3], t_center: 0.0, t_scale: f32::INFINITY },
        };
        push(&motion.velocity);
        push(&[motion.t_center, motion.t_scale]);
    }
}
