//! COLMAP's text files: one record in a line, an image in two.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::str::{FromStr, SplitAsciiWhitespace};

use super::raw::{MODELS, RawCamera, RawImage, RawPoint};
use crate::error::{self, Error};
use crate::files::{cannot_read, open_file};
use crate::scene::capture::Faults;

const REMEDY: &str = "correct this line, or export the model again";
/// Longest line: the observations of an image of 10,000 features have 400 kB.
const MAX_LINE_BYTES: u64 = 1 << 30;

/// The lines of a file with their numbers; comments and blank lines are left out where a record begins.
struct Lines<'a> {
    path: &'a Path,
    from: BufReader<File>,
    /// What is not UTF-8 in it stands as a sign for that.
    line: String,
    bytes: Vec<u8>,
    number: u64,
    /// The line has not been used: it comes again.
    is_held: bool,
}

impl<'a> Lines<'a> {
    fn open(path: &'a Path) -> error::Result<Self> {
        let file = open_file(path).map_err(|fault| cannot_read(path, &fault))?;
        let from = BufReader::new(file);
        Ok(Lines { path, from, line: String::new(), bytes: Vec::new(), number: 0, is_held: false })
    }

    /// The next line, whatever it holds; `false` at the end.
    fn any(&mut self) -> error::Result<bool> {
        if std::mem::take(&mut self.is_held) {
            return Ok(true);
        }
        self.bytes.clear();
        self.number += 1;
        let mut limited = (&mut self.from).take(MAX_LINE_BYTES);
        let read = limited.read_until(b'\n', &mut self.bytes).map_err(|fault| cannot_read(self.path, &fault))?;
        if read as u64 == MAX_LINE_BYTES {
            let reason = format!("has more than {MAX_LINE_BYTES} bytes");
            return Err(Error::data(self.path, self.place(), reason, REMEDY));
        }
        // Some programs on Windows begin UTF-8 with a mark.
        if self.number == 1 && self.bytes.starts_with(b"\xef\xbb\xbf") {
            self.bytes.drain(..3);
        }
        self.line = String::from_utf8_lossy(&self.bytes).into_owned();
        Ok(read > 0)
    }

    fn record(&mut self) -> error::Result<bool> {
        while self.any()? {
            let line = self.line.trim_ascii();
            if !line.is_empty() && !line.starts_with('#') {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn place(&self) -> String {
        format!("line {}", self.number)
    }
}

/// Reads every record; one that is faulty is noted and left out.
fn records(
    path: &Path,
    faults: &mut Faults,
    mut record: impl FnMut(&mut Lines, &mut Faults) -> error::Result<Result<(), String>>,
) {
    let mut all = |faults: &mut Faults| -> error::Result<()> {
        let mut lines = Lines::open(path)?;
        while lines.record()? {
            let place = lines.place();
            if let Err(reason) = record(&mut lines, faults)? {
                faults.add(path, place, reason, REMEDY);
            }
        }
        Ok(())
    };
    let outcome = all(faults);
    faults.take(outcome);
}

fn next<T: FromStr>(fields: &mut SplitAsciiWhitespace, what: &str) -> Result<T, String> {
    let field = fields.next().ok_or_else(|| format!("ends before the {what}"))?;
    field.parse().map_err(|_| {
        let start: String = field.chars().take(40).collect();
        format!("the {what} is `{}`", start.escape_debug())
    })
}

fn numbers<const N: usize>(fields: &mut SplitAsciiWhitespace, what: &str) -> Result<[f64; N], String> {
    let mut values = [0.0; N];
    for value in &mut values {
        *value = next(fields, what)?;
    }
    Ok(values)
}

pub(super) fn cameras(path: &Path, faults: &mut Faults) -> Vec<RawCamera> {
    let mut cameras = Vec::new();
    records(path, faults, |lines, _| Ok(camera(lines).map(|camera| cameras.push(camera))));
    cameras
}

fn camera(lines: &Lines) -> Result<RawCamera, String> {
    let mut fields = lines.line.split_ascii_whitespace();
    let id = next(&mut fields, "id of the camera")?;
    let name: String = next(&mut fields, "model")?;
    let Some(kind) = MODELS.iter().find(|kind| kind.name == name) else {
        return Err(format!("the model `{}` is unknown", name.chars().take(40).collect::<String>().escape_debug()));
    };
    let (width, height) = (next(&mut fields, "width")?, next(&mut fields, "height")?);
    let params = (0..kind.n_params).map(|_| next(&mut fields, "parameter")).collect::<Result<_, _>>()?;
    let n_more = fields.count();
    if n_more > 0 {
        return Err(format!("has {n_more} parameters more than {} takes", kind.name));
    }
    Ok(RawCamera { place: lines.place(), id, kind, width, height, params })
}

/// `images.txt`, and how many images lack the line of observations, which may be blank and which some programs leave out.
pub(super) fn images(path: &Path, faults: &mut Faults) -> (Vec<RawImage>, usize) {
    let (mut images, mut n_alone) = (Vec::new(), 0);
    records(path, faults, |lines, _| {
        let image = image(lines);
        // The last image's blank line may have been lost by an editor.
        if lines.any()? {
            let fields: Vec<&str> = lines.line.split_ascii_whitespace().collect();
            if !are_observations(&fields) && begins_image(&fields) {
                lines.is_held = true;
                n_alone += 1;
            } else if !fields.len().is_multiple_of(3) {
                let reason = format!("the line of its observations has {} fields, not three for each", fields.len());
                return Ok(Err(reason));
            }
        }
        Ok(image.map(|image| images.push(image)))
    });
    (images, n_alone)
}

/// True if fields are x, y and the number of a point, again and again.
fn are_observations(fields: &[&str]) -> bool {
    let (all, rest) = fields.as_chunks::<3>();
    let is_one = |[x, y, id]: &[&str; 3]| [x, y].iter().all(|v| v.parse::<f64>().is_ok()) && id.parse::<i64>().is_ok();
    rest.is_empty() && all.iter().all(is_one)
}

/// True if fields are those of an image: its number, seven numbers of its pose, the number of its camera, a name.
fn begins_image(fields: &[&str]) -> bool {
    let is_number = |field: &&str| field.parse::<f64>().is_ok();
    let is_id = |at: usize| fields.get(at).is_some_and(|field| field.parse::<u32>().is_ok());
    fields.len() > 9 && is_id(0) && is_id(8) && fields[1..8].iter().all(is_number)
}

fn image(lines: &Lines) -> Result<RawImage, String> {
    let mut fields = lines.line.split_ascii_whitespace();
    let id = next(&mut fields, "id of the image")?;
    let (quaternion, translation) = (numbers(&mut fields, "quaternion")?, numbers(&mut fields, "translation")?);
    let camera_id = next(&mut fields, "id of the camera")?;
    // A name may have spaces, so it is the rest of the line.
    let mut name = lines.bytes.trim_ascii();
    for _ in 0..9 {
        let end = name.iter().position(u8::is_ascii_whitespace).unwrap_or(name.len());
        name = name[end..].trim_ascii_start();
    }
    Ok(RawImage { place: lines.place(), id, quaternion, translation, camera_id, name: name.to_owned() })
}

pub(super) fn points(path: &Path, faults: &mut Faults, mut add: impl FnMut(RawPoint, &mut Faults)) {
    records(path, faults, |lines, faults| Ok(point(lines).map(|point| add(point, faults))));
}

fn point(lines: &Lines) -> Result<RawPoint, String> {
    let mut fields = lines.line.split_ascii_whitespace();
    let (id, position) = (next(&mut fields, "id of the point")?, numbers(&mut fields, "position")?);
    let mut color = [0; 3];
    for channel in &mut color {
        *channel = next(&mut fields, "colour")?;
    }
    let [_reprojection_error] = numbers(&mut fields, "error")?;
    let mut seen_in = Vec::new();
    while let Some(field) = fields.next() {
        seen_in.push(field.parse().map_err(|_| format!("the track has the image `{}`", field.escape_debug()))?);
        let _observation: u32 = next(&mut fields, "observation of the track")?;
    }
    Ok(RawPoint { place: lines.place(), id, position, color, seen_in })
}
