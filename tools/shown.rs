//! What a verb is given to look at: a scene file, the folder of a run, or that of a run that has not ended.

use crate::screen::say;
use ivv::formats::{FourDgs, read_scene};
use ivv::scene::Splats;
use ivv::train::{Checkpoint, Run};
use ivv::{Constants, Error};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A scene and where it is from.
pub struct Shown {
    /// The file that was read.
    pub file: PathBuf,
    /// In the capture's own frame.
    pub splats: Splats,
    /// The step that it is of, where the run has not ended.
    pub unfinished: Option<u64>,
    /// How it is rendered, where its file says that.
    pub constants: Option<Constants>,
}

/// Whether `path` is the folder of a run.
pub fn is_run(path: &Path) -> bool {
    Run::file(path).is_file()
}

/// What a verb is given, before the Gaussians of it are asked for.
pub struct Source<'a> {
    /// A scene file, or the folder of a run.
    pub path: &'a Path,
    /// Where it is a `.4dgs`: what is in it beside Gaussians is asked for first.
    pub clip: Option<FourDgs>,
}

impl<'a> Source<'a> {
    /// Reads a `.4dgs`, and nothing of any other.
    ///
    /// # Errors
    /// Those of the file.
    pub fn open(path: &'a Path) -> ivv::Result<Self> {
        let clip = if FourDgs::is(path) { Some(FourDgs::read(path)?) } else { None };
        Ok(Source { path, clip })
    }

    /// Its Gaussians, as [`open`].
    ///
    /// # Errors
    /// As [`open`].
    pub fn scene(&self) -> ivv::Result<Shown> {
        let Some(clip) = &self.clip else { return of_path(self.path) };
        Ok(of_file(self.path, clip.splats()?, clip.own().map(|own| of_own(own).0)))
    }
}

/// Reads the scene of `path`; of a run without scene.ply its newest checkpoint, and says of which step that is.
///
/// # Errors
/// Those of the files; [`Error::Data`] when a folder is neither a run's nor a scene, or a run has no checkpoint either.
pub fn open(path: &Path) -> ivv::Result<Shown> {
    Source::open(path)?.scene()
}

/// The scene of anything but a `.4dgs`.
fn of_path(path: &Path) -> ivv::Result<Shown> {
    let scene = path.join("scene.ply");
    if scene.is_file() {
        return Ok(of_file(&scene, read_scene(&scene)?, None));
    }
    if is_run(path) {
        return newest(path);
    }
    if path.is_dir() && !path.join("meta.json").is_file() {
        let reason = "expected a run (run.json) or a SOG scene (meta.json), found neither";
        return Err(Error::data(path, "", reason, "give the folder of a run of `ivv train`, or a scene file"));
    }
    Ok(of_file(path, read_scene(path)?, None))
}

fn of_file(path: &Path, splats: Splats, constants: Option<Constants>) -> Shown {
    Shown { splats, file: path.to_owned(), unfinished: None, constants }
}

/// The newest checkpoint of the run in `folder`.
fn newest(folder: &Path) -> ivv::Result<Shown> {
    let checkpoints = folder.join("checkpoints");
    let Some(checkpoint) = Checkpoint::newest(&checkpoints)? else {
        let remedy = "wait for the first checkpoint, or continue the run with `ivv train --resume -o RUN`";
        return Err(Error::data(folder, "", "the run has no scene.ply and no checkpoint yet", remedy));
    };
    let Checkpoint { step, total, .. } = checkpoint;
    say!("{}: the run has not ended; this is its newest checkpoint, of step {step} of {total}", folder.display());
    let file = Checkpoint::file(&checkpoints, step);
    Ok(Shown { splats: checkpoint.splats(), file, unfinished: Some(step), constants: None })
}

/// What a `.4dgs` says of how it is rendered.
pub fn own(constants: &Constants, background: [f32; 3]) -> BTreeMap<String, String> {
    let numbers = [
        ("alpha_max", constants.alpha_max),
        ("alpha_min", constants.alpha_min),
        ("blur", constants.blur),
        ("near", constants.near),
        ("t_min", constants.t_min),
    ];
    let mut own: BTreeMap<String, String> = numbers.map(|(name, value)| (name.to_owned(), value.to_string())).into();
    own.insert("background".to_owned(), background.map(|part| part.to_string()).join(" "));
    own
}

/// The other way: the default of each value that is absent or meaningless.
pub fn of_own(own: &BTreeMap<String, String>) -> (Constants, Option<[f32; 3]>) {
    let usual = Constants::default();
    let number = |name: &str, usual: f32, is_one: &dyn Fn(f32) -> bool| {
        own.get(name).and_then(|text| text.parse().ok()).filter(|value| is_one(*value)).unwrap_or(usual)
    };
    let is_part = |value: f32| value > 0.0 && value < 1.0;
    let is_length = |value: f32| value > 0.0 && value.is_finite();
    let constants = Constants {
        alpha_max: number("alpha_max", usual.alpha_max, &|value| is_part(value) && value > 0.5),
        alpha_min: number("alpha_min", usual.alpha_min, &|value| is_part(value) && value < 0.5),
        blur: number("blur", usual.blur, &is_length),
        near: number("near", usual.near, &is_length),
        t_min: number("t_min", usual.t_min, &|value| value == 0.0 || is_part(value)),
        ..usual
    };
    let parts = own.get("background").map(|text| text.split(' ').filter_map(|part| part.parse().ok()));
    let background = parts.and_then(|parts| <[f32; 3]>::try_from(parts.collect::<Vec<f32>>()).ok());
    (constants, background.filter(|parts| parts.iter().all(|part| part.is_finite())))
}
