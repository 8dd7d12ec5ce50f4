//! N3V (DyNeRF) and MeetRoom: `poses_bounds.npy` of LLFF and a video of each camera, in the order of their names.

use super::footage::{self, sequence_names, video_names};
use super::recording::{Place, Source};
use crate::error::Error;
use crate::files::npy::read_npy;
use crate::scene::capture::{Faults, camera_of_row, is_capture, read_rows};
use crate::scene::undistort::{Distortion, Lens};

const REMEDY: &str = "give the file that came with the videos, and all of them";

/// True for a clip of cameras with `poses_bounds.npy`: as many videos, or folders of frames, as rows. LLFF's and Mip-NeRF 360's
/// photographs have such a file too.
pub(super) fn is_n3v(place: Place) -> bool {
    let poses = place.folder.join("poses_bounds.npy");
    let n_clips = || {
        let sequences = sequence_names(place.footage).into_iter().filter(|name| name.starts_with("cam")).count();
        video_names(place.footage).len().max(sequences)
    };
    let n_rows = || read_npy(&poses).ok().and_then(|array| array.shape.first().copied());
    poses.is_file() && (n_rows() == Some(n_clips()) || !is_capture(place.folder))
}

pub(super) fn read(place: Place, faults: &mut Faults) -> Source {
    let calibration = place.folder.join("poses_bounds.npy");
    let mut source = Source::of(&calibration);
    let Some(array) = faults.take(read_rows(&calibration, REMEDY)) else { return source };
    let mut names = footage::video_names(place.footage);
    if names.is_empty() {
        names = footage::sequence_names(place.footage);
        names.retain(|name| name.starts_with("cam"));
    }
    let rows = rows(&names, array.len());
    let rows = rows.map_err(|(reason, remedy)| Error::data(&calibration, "", reason, remedy));
    let Some((rows, note)) = faults.take(rows) else { return source };
    source.notes.extend(note);
    for (row, name) in rows.into_iter().zip(names) {
        match camera_of_row(&array[row]) {
            Ok((intrinsics, pose)) => {
                let lens = Lens { intrinsics, distortion: Distortion::None };
                source.add(&name, Ok((lens, pose)), place.footage, REMEDY, faults);
            }
            Err(reason) => faults.add(&calibration, format!("row {row}"), reason, REMEDY),
        }
    }
    source
}

/// The row of each of the cameras `names`, in the order of their numbers, of `n`; and a note. Only the order ties names to rows.
fn rows(names: &[String], n: usize) -> Result<(Vec<usize>, Option<String>), (String, String)> {
    if names.len() == n {
        let by_text = names.is_sorted();
        let note = names.first().zip(names.last()).filter(|_| !by_text).map(|(first, last)| {
            format!(
                "the rows of poses_bounds.npy are those of the cameras in the order of their numbers, {first} to {last}; names sorted as \
                 text have another order"
            )
        });
        return Ok(((0..n).collect(), note));
    }
    let number = |name: &String| name[name.trim_end_matches(|c: char| c.is_ascii_digit()).len()..].parse().ok();
    let numbers: Option<Vec<usize>> = names.iter().map(number).collect();
    // Cameras 0 to n - 1: some are absent, but not the last.
    if let Some(numbers) =
        numbers.filter(|all| names.len() < n && all.last() == Some(&(n - 1)) && all.is_sorted_by(|a, b| a < b))
    {
        let absent: Vec<String> = (0..n).filter(|row| !numbers.contains(row)).map(|row| row.to_string()).collect();
        let note = format!(
            "poses_bounds.npy has {n} rows, there are {} cameras: each is given the row of its number, and {} are absent",
            names.len(),
            absent.join(", ")
        );
        return Ok((numbers, Some(note)));
    }
    let reason = format!("describes {n} cameras, there are {}: {}", names.len(), names.join(", "));
    let remedy = "only the order of the videos ties them to the rows, so all of them must be there: put back those that came with the \
                  file, or remove others, and leave cameras out with --exclude NAMES";
    Err((reason, remedy.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(of: &[u32]) -> Vec<String> {
        of.iter().map(|number| format!("cam_{number}")).collect()
    }

    #[test]
    fn rows_are_those_of_numbers() {
        let (all, note) = rows(&names(&[0, 1, 2, 10]), 4).unwrap();
        assert!(all == [0, 1, 2, 3] && note.unwrap().contains("cam_0 to cam_10"));
        assert_eq!(rows(&names(&[0, 1, 2]), 3).unwrap(), (vec![0, 1, 2], None));
        let (some, note) = rows(&names(&[0, 2, 4]), 5).unwrap();
        assert!(some == [0, 2, 4] && note.unwrap().contains("1, 3 are absent"));
        // Which are absent is not known.
        for (present, n) in [(&[0, 2, 3][..], 5), (&[0, 2, 6], 5), (&[0, 1, 2], 2), (&[], 3)] {
            assert!(rows(&names(present), n).unwrap_err().1.contains("--exclude"), "{present:?}");
        }
    }
}
