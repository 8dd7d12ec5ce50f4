//! Where the images are that a capture's files name: where these say, or elsewhere below the capture, where only one place fits.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::named::is_capture;
use super::{CaptureBuilder, Spelled, by_number, is_hidden, is_image, is_picture, with_image_extension};

const MAX_DEPTH: usize = 4;
const MAX_FILES: usize = 200_000;
const MAX_NAMESAKES: usize = 64;
/// Parts that names of folders have in which pictures are no photographs.
const NO_PHOTOS: [&str; 10] =
    ["mask", "depth", "normal", "seg", "semantic", "label", "thumb", "flow", "alpha", "matte"];

/// An image as a file names it.
#[derive(Clone, Debug)]
pub(super) struct Wanted {
    /// The readings of the name, likelier first: several where its encoding is unknown.
    pub readings: Vec<PathBuf>,
    pub has_backslash: bool,
    pub leads_out: bool,
}

impl From<Spelled> for Wanted {
    fn from(Spelled { path, has_backslash, leads_out }: Spelled) -> Self {
        Wanted { readings: vec![path], has_backslash, leads_out }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Differs {
    No,
    InCase,
    InEnding,
}

type Vote = (usize, usize, usize);

/// A way in which images lie elsewhere: so many folders of their names are not there, and they are below this one.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Place {
    folder: PathBuf,
    n_dropped: usize,
    differs: Differs,
}

impl CaptureBuilder {
    /// Finds the images that `file` names, relative to `base`; missing ones below `root`, which every found file lies in. Gives for each
    /// image its file and which reading of its name that is; for one that was not found, where it should be.
    pub(super) fn locate(&mut self, root: &Path, base: &Path, file: &Path, wanted: &[Wanted]) -> Vec<(PathBuf, usize)> {
        let file = &file.file_name().unwrap_or_default().to_string_lossy();
        let mut search = Search { root, base, file, wanted, found: vec![None; wanted.len()], taken: HashSet::new() };
        search.directly();
        search.note_spelling(&mut self.notes);
        if search.found.iter().any(Option::is_none) {
            search.elsewhere(&listed(root, MAX_DEPTH), self);
        }
        let expected = |wanted: &Wanted| (with_ending(&base.join(&wanted.readings[0])), 0);
        search.found.into_iter().zip(wanted).map(|(found, wanted)| found.unwrap_or_else(|| expected(wanted))).collect()
    }
}

struct Search<'a> {
    root: &'a Path,
    base: &'a Path,
    file: &'a str,
    wanted: &'a [Wanted],
    found: Vec<Option<(PathBuf, usize)>>,
    taken: HashSet<PathBuf>,
}

impl Search<'_> {
    fn directly(&mut self) {
        for (found, wanted) in self.found.iter_mut().zip(self.wanted) {
            let there = wanted.readings.iter().map(|name| with_ending(&self.base.join(name)));
            *found = there.zip(0..).find(|(path, _)| path.exists());
            self.taken.extend(found.iter().map(|(path, _)| path.clone()));
        }
    }

    fn note_spelling(&self, notes: &mut Vec<String>) {
        let n = self.wanted.iter().filter(|wanted| wanted.has_backslash).count();
        if n > 0 {
            notes.push(format!("names with backslashes, as Windows writes them: {n}; read as /"));
        }
        let mut leading_out = self.wanted.iter().zip(&self.found).filter(|(wanted, _)| wanted.leads_out);
        let n = leading_out.clone().count();
        if let Some((_, Some((path, _)))) = leading_out.find(|(_, found)| found.is_some()) {
            let taken = self.below(path);
            notes.push(format!("names that lead out of the capture: {n}; files below it are taken, as {taken}"));
        }
    }

    /// Finds what lies elsewhere in `files`, place by place: first the place that explains most.
    fn elsewhere(&mut self, files: &[PathBuf], builder: &mut CaptureBuilder) {
        let mut by_stem: HashMap<String, Vec<usize>> = HashMap::new();
        files.iter().enumerate().for_each(|(at, file)| by_stem.entry(stem(file)).or_default().push(at));
        // Folders of names of which some were found: the others of these are no pictures that were moved.
        let found = self.wanted.iter().zip(&self.found).filter(|(_, found)| found.is_some());
        let groups: HashSet<&Path> = found.filter_map(|(wanted, _)| wanted.readings[0].parent()).collect();
        for _ in 0..8 {
            let mut votes: HashMap<Place, Vec<Vote>> = HashMap::new();
            for (index, wanted) in self.wanted.iter().enumerate().filter(|(index, _)| self.found[*index].is_none()) {
                for (reading, name) in wanted.readings.iter().enumerate() {
                    let is_apart = !groups.contains(name.parent().unwrap_or(Path::new("")));
                    for (place, at) in self.places(name, is_apart, files, &by_stem) {
                        votes.entry(place).or_default().push((index, reading, at));
                    }
                }
            }
            let Some((place, of)) = best(votes, &mut builder.elsewhere) else { break };
            let first = self.wanted[of[0].0].readings[of[0].1].clone();
            builder.notes.push(self.note(&place, &first, &files[of[0].2], of.len()));
            for (index, reading, at) in of {
                let path = self.root.join(&files[at]);
                self.taken.insert(path.clone());
                self.found[index] = Some((path, reading));
            }
        }
    }

    /// The files that a name may mean, and how; unless it is apart from names that were found, only those in the folder that it names.
    fn places(
        &self,
        name: &Path,
        is_apart: bool,
        files: &[PathBuf],
        by_stem: &HashMap<String, Vec<usize>>,
    ) -> Vec<(Place, usize)> {
        let said = self.base.strip_prefix(self.root).ok().map(|base| lower(&base.join(name)));
        let (lower_name, n_parts) = (lower(name), name.iter().count());
        let mut places = Vec::new();
        for &at in by_stem.get(&stem(name)).into_iter().flatten().take(MAX_NAMESAKES) {
            let (file, lower_file) = (&files[at], lower(&files[at]));
            let same_folder = said.as_ref().is_some_and(|said| lower_file.parent() == said.parent());
            if self.taken.contains(&self.root.join(file)) || !(is_apart || same_folder) {
                continue;
            }
            let pairs = lower_name.iter().rev().zip(lower_file.iter().rev()).skip(1);
            let n_same = pairs.take_while(|(a, b)| a == b).count();
            let folder: PathBuf = file.iter().take(file.iter().count() - 1 - n_same).collect();
            if is_odd(&folder) {
                continue;
            }
            let is_same = file.iter().rev().zip(name.iter().rev()).take(n_same + 1).all(|(a, b)| a == b);
            let differs = if is_same {
                Differs::No
            } else if lower_file.file_name() == lower_name.file_name() {
                Differs::InCase
            } else if !is_picture(name) {
                // A name without an ending has none to differ in.
                Differs::No
            } else {
                Differs::InEnding
            };
            places.push((Place { folder, n_dropped: n_parts - 1 - n_same, differs }, at));
        }
        places
    }

    fn below(&self, path: &Path) -> String {
        path.strip_prefix(self.root).unwrap_or(path).display().to_string()
    }

    fn note(&self, place: &Place, name: &Path, file: &Path, n: usize) -> String {
        let base = self.base.strip_prefix(self.root).unwrap_or(self.base);
        let (name, file_) = (base.join(name), file.display());
        let name = name.display();
        let moved = place.n_dropped > 0 || place.folder != base;
        match place.differs {
            _ if moved => {
                format!("images that are not where {} says ({name}): {n}; taken from {file_} and so on", self.file)
            }
            Differs::InEnding => {
                format!("images with another ending than {} says: {n}; {file_} is taken for {name}", self.file)
            }
            _ => format!("names that differ from files in upper and lower case: {n}; {file_} is taken for {name}"),
        }
    }
}

/// The place that explains most of the missing images, with their readings and files; nothing where two places tie.
fn best(votes: HashMap<Place, Vec<Vote>>, elsewhere: &mut Vec<PathBuf>) -> Option<(Place, Vec<Vote>)> {
    let mut places: Vec<_> = votes
        .into_iter()
        .map(|(place, of)| {
            let mut n_of: HashMap<usize, usize> = HashMap::new();
            of.iter().for_each(|(_, _, at)| *n_of.entry(*at).or_default() += 1);
            let mut seen = HashSet::new();
            let once = of.into_iter().filter(|(index, _, at)| n_of[at] == 1 && seen.insert(*index));
            (place, once.collect::<Vec<_>>())
        })
        .filter(|(_, of)| !of.is_empty())
        .collect();
    // Of folders `images` and `images_4` the first has the pictures of full size.
    let shrinks = |place: &Place| {
        let name = place.folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        name.rsplit_once('_').and_then(|(_, n)| n.parse::<u32>().ok()).unwrap_or(0)
    };
    let rank =
        |(place, of): &(Place, Vec<_>)| (std::cmp::Reverse(of.len()), place.differs, place.n_dropped, shrinks(place));
    places.sort_by(|a, b| rank(a).cmp(&rank(b)).then_with(|| a.0.folder.cmp(&b.0.folder)));
    let mut places = places.into_iter();
    let first = places.next()?;
    let same = |other: &(Place, Vec<_>)| rank(other) == rank(&first);
    let rivals: Vec<PathBuf> = places.filter(|other| same(other)).map(|(place, _)| place.folder).collect();
    if rivals.is_empty() {
        return Some(first);
    }
    elsewhere.extend([first.0.folder].into_iter().chain(rivals));
    None
}

fn is_odd(folder: &Path) -> bool {
    let folder = folder.to_string_lossy().to_lowercase();
    NO_PHOTOS.iter().any(|part| folder.contains(part))
}

/// The path; without an ending, with that of an image that exists.
fn with_ending(path: &Path) -> PathBuf {
    if is_picture(path) { path.to_owned() } else { with_image_extension(path) }
}

fn lower(path: &Path) -> PathBuf {
    path.to_string_lossy().to_lowercase().into()
}

/// The common part of a name and its file, without ending and case.
fn stem(name: &Path) -> String {
    let stem = if is_picture(name) { name.file_stem() } else { name.file_name() };
    stem.unwrap_or_default().to_string_lossy().to_lowercase()
}

/// The pictures below a folder, relative to it, outer ones first, without those of captures in it.
pub(super) fn listed(root: &Path, depth: usize) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![(PathBuf::new(), 0)]);
    let mut n_seen = 0;
    while let Some((folder, level)) = folders.pop() {
        let mut entries: Vec<_> = fs::read_dir(root.join(&folder)).into_iter().flatten().flatten().collect();
        entries.sort_by_key(fs::DirEntry::file_name);
        n_seen += entries.len();
        if n_seen > MAX_FILES {
            break;
        }
        for entry in entries.into_iter().filter(|entry| !is_hidden(&entry.path())) {
            let (name, path) = (folder.join(entry.file_name()), entry.path());
            if is_picture(&path) && path.is_file() {
                files.push(name);
            } else if level < depth && path.is_dir() && !is_capture(&path) {
                folders.push((name, level + 1));
            }
        }
    }
    files.sort_by(|a, b| a.components().count().cmp(&b.components().count()).then_with(|| a.cmp(b)));
    files
}

pub(super) fn images_of(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<PathBuf> = entries.map(|entry| PathBuf::from(entry.file_name())).collect();
    names.retain(|name| is_image(name));
    names.sort_by_cached_key(|name| by_number(&name.to_string_lossy()));
    names
}
