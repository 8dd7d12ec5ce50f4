//! The triangulated points of single frames: `points/<frame:05>.ply` of a capture folder (SPEC 8).

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::{Frames, Point, check_place};
use crate::error::{Error, Result};
use crate::files::ply_header::{Element, Header, Scalar};
use crate::files::ply_rows::{Column, Rows};

const SEEN_BY: &str = "camera_ids";
const REMEDY: &str = "triangulate the frame again, or set points = false in capture.toml";

/// A point that was triangulated from the images of one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePoint {
    /// World, scene units.
    pub position: [f64; 3],
    /// Red, green, blue.
    pub color: [u8; 3],
    /// Indices of the cameras that saw it, ascending, each once.
    pub seen_by: Vec<usize>,
}

/// The points of a PLY: `x y z`, and `red green blue` as bytes or as floats from 0 to 1; grey where absent.
pub(crate) fn read_cloud(path: &Path) -> Result<Vec<Point>> {
    let missing = |what: &str| Error::data(path, "header", format!("has no {what}"), "export the points again");
    let (header, mut rows) = Rows::open(path)?;
    let vertex = header.element("vertex").ok_or_else(|| missing("element `vertex`"))?;
    let plain = |name: &str| Column::find(vertex, name).ok_or_else(|| missing(&format!("property `{name}`")));
    let position = [plain("x")?, plain("y")?, plain("z")?];
    let color = ["red", "green", "blue"].map(|name| Column::find(vertex, name));
    let level = |column: Option<Column>, row: &[u8]| match column {
        Some(column) if column.is(Scalar::U8) => column.u8(row),
        Some(column) => (column.f64(row).clamp(0.0, 1.0) * 255.0).round() as u8,
        None => 128,
    };
    let mut points = Vec::new();
    read_vertices(path, &header, &mut rows, "", "remove the point", |bytes, _| {
        let position = position.map(|column| column.f64(bytes));
        check_place(position)?;
        points.push(Point { position, color: color.map(|column| level(column, bytes)) });
        Ok(())
    })?;
    Ok(points)
}

/// Hands out every vertex with its items of a list. What is wrong with one becomes an error with its row.
fn read_vertices(
    path: &Path,
    header: &Header,
    rows: &mut Rows,
    list: &str,
    remedy: &str,
    mut take: impl FnMut(&[u8], &[f64]) -> std::result::Result<(), String>,
) -> Result<()> {
    for element in &header.elements {
        if element.name != "vertex" {
            rows.skip(element)?;
            continue;
        }
        rows.read_with_list(element, list, |row, bytes, items| {
            let fault = |reason| Error::data(path, format!("element `vertex`, row {row}"), reason, remedy);
            take(bytes, items).map_err(fault)
        })?;
    }
    Ok(())
}

/// The folder of the frames' points, and the cameras of their CAMERA_IDs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FramePoints {
    pub folder: PathBuf,
    pub cameras: HashMap<u32, String>,
    /// Which files of the clip belong to its frames.
    pub frames: Frames,
}

impl FramePoints {
    pub fn has(&self, frame: u32) -> bool {
        self.path(frame).exists()
    }

    /// Checks the header of a frame's file, and the file's length.
    pub fn check(&self, frame: u32) -> Result<()> {
        let path = self.path(frame);
        let (header, _) = Rows::open(&path)?;
        Columns::find(&path, header.element("vertex")).map(|_| ())
    }

    /// The points of a frame in the world of the file, seen by those cameras that `index` knows by name.
    pub fn read(&self, frame: u32, index: impl Fn(&str) -> Option<usize>) -> Result<Vec<FramePoint>> {
        let known: HashMap<u32, Option<usize>> = self.cameras.iter().map(|(id, name)| (*id, index(name))).collect();
        let path = self.path(frame);
        let (header, mut rows) = Rows::open(&path)?;
        let columns = Columns::find(&path, header.element("vertex"))?;
        let mut points = Vec::new();
        read_vertices(&path, &header, &mut rows, SEEN_BY, REMEDY, |bytes, ids| {
            points.push(columns.point(bytes, ids, &known)?);
            Ok(())
        })?;
        rows.finish()?;
        Ok(points)
    }

    pub fn path(&self, frame: u32) -> PathBuf {
        let file = u64::from(self.frames.from) + u64::from(frame) * u64::from(self.frames.every);
        self.folder.join(format!("{file:05}.ply"))
    }
}

struct Columns {
    position: [Column; 3],
    color: [Column; 3],
}

impl Columns {
    fn find(path: &Path, vertex: Option<&Element>) -> Result<Self> {
        let missing = |what: &str| Error::data(path, "header", format!("has no {what}"), REMEDY);
        let vertex = vertex.ok_or_else(|| missing("element `vertex`"))?;
        let plain = |name: &str| Column::find(vertex, name).ok_or_else(|| missing(&format!("property `{name}`")));
        let byte = |name: &str| {
            let column = plain(name)?;
            if column.is(Scalar::U8) { Ok(column) } else { Err(missing(&format!("property `{name}` of type uchar"))) }
        };
        if !vertex.properties.iter().any(|property| property.name == SEEN_BY && property.list_length.is_some()) {
            return Err(missing(&format!("list `{SEEN_BY}`")));
        }
        Ok(Columns {
            position: [plain("x")?, plain("y")?, plain("z")?],
            color: [byte("red")?, byte("green")?, byte("blue")?],
        })
    }

    fn point(
        &self,
        row: &[u8],
        ids: &[f64],
        known: &HashMap<u32, Option<usize>>,
    ) -> std::result::Result<FramePoint, String> {
        let position = self.position.map(|column| column.f64(row));
        check_place(position)?;
        let mut seen_by = Vec::new();
        for &id in ids {
            let camera = known.get(&(id as u32)).filter(|_| f64::from(id as u32) == id);
            seen_by.extend(camera.ok_or_else(|| format!("was seen by camera {id}, which is not in sparse/0"))?);
        }
        seen_by.sort_unstable();
        seen_by.dedup();
        Ok(FramePoint { position, color: self.color.map(|column| column.u8(row)), seen_by })
    }
}
