//! Training and test views of two files: none is both, and none is listed twice.

use std::collections::HashMap;
use std::collections::hash_map::Entry::{Occupied, Vacant};
use std::fs;
use std::path::Path;

use super::{Entry, REMEDY};
use crate::scene::capture::Faults;

/// How far two poses may differ, in any entry, to be one: files are written with as few digits.
const SAME_POSE: f64 = 1e-6;

/// Adds the test views to the training views; false if none is left. A view that is both leaves training, unless less than half of that
/// would remain; then it leaves the test views.
pub(super) fn join(entries: &mut Vec<Entry>, mut tests: Vec<Entry>, notes: &mut Vec<String>) -> bool {
    tests.iter_mut().for_each(|entry| entry.camera.is_test = true);
    let mut by_image: HashMap<&Path, usize> = HashMap::new();
    let mut by_place: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (index, entry) in entries.iter().enumerate() {
        by_image.insert(&entry.shot.image, index);
        by_place.entry(cell(entry)).or_default().push(index);
    }
    let reference = |test: &Entry| {
        let near = || by_place.get(&cell(test)).into_iter().flatten().copied();
        by_image.get(test.shot.image.as_path()).copied().or_else(|| near().find(|at| is_same(&entries[*at], test)))
    };
    let references: Vec<Option<usize>> = tests.iter().map(reference).collect();
    let mut of_training: Vec<usize> = references.iter().flatten().copied().collect();
    of_training.sort_unstable();
    of_training.dedup();
    let n_both = references.iter().flatten().count();
    let n_tests = tests.len();
    if n_both > 0 && 2 * of_training.len() <= entries.len() {
        let mut index = 0;
        entries.retain(|_| (of_training.binary_search(&index).is_err(), index += 1).0);
        notes.push(format!("{n_both} of {n_tests} test views are training views: they are left out of training"));
    } else if n_both > 0 {
        let mut references = references.iter();
        tests.retain(|_| references.next().is_some_and(Option::is_none));
        let why = "without them too little would be left to train on";
        let instead = if tests.is_empty() { "; other views are kept for testing" } else { "" };
        notes.push(format!(
            "{n_both} of {n_tests} test views are training views: they are left out of the test views, because {why}{instead}"
        ));
    }
    let has_test = n_tests == 0 || !tests.is_empty();
    entries.append(&mut tests);
    has_test
}

/// Where a camera is, roughly: the same for poses that are the same, but at the border of two cells.
fn cell(entry: &Entry) -> [i64; 3] {
    entry.camera.world_to_camera.translation.to_array().map(|v| (v / 1e-3).round() as i64)
}

fn is_same(a: &Entry, b: &Entry) -> bool {
    let rows = [a, b].map(|entry| entry.camera.world_to_camera.rows());
    let size = a.camera.world_to_camera.translation.abs().max_element().max(1.0);
    let pairs = rows[0].as_flattened().iter().zip(rows[1].as_flattened());
    let is_pose = pairs.into_iter().all(|(v, w)| (v - w).abs() <= SAME_POSE * size);
    let length = |entry: &Entry| fs::metadata(&entry.shot.image).map(|file| file.len()).ok();
    let is_picture = || {
        let bytes = |entry: &Entry| fs::read(&entry.shot.image).ok();
        length(a).is_some() && length(a) == length(b) && bytes(a) == bytes(b)
    };
    is_pose && a.time == b.time && is_picture()
}

/// Leaves out what is listed again just as before; a picture that is listed with two poses or at two times is a fault.
pub(super) fn check_twice(entries: &mut Vec<Entry>, file: &Path, notes: &mut Vec<String>, faults: &mut Faults) {
    let n_listed = entries.len();
    let mut first = HashMap::new();
    entries.retain(|entry| {
        let camera = &entry.camera;
        let what = (camera.world_to_camera, camera.intrinsics, camera.is_test, entry.time);
        match first.entry(entry.shot.image.clone()) {
            Occupied(before) if *before.get() == what => return false,
            Occupied(_) => faults.add(file, format!("`{}`", entry.name.display()), "is listed twice", REMEDY),
            Vacant(place) => {
                place.insert(what);
            }
        }
        true
    });
    let n = n_listed - entries.len();
    if n > 0 {
        notes.push(format!("frames that are listed twice: {n}; they are read once"));
    }
}
