//! How a scene is rendered: what its run or its file says.

use crate::run::files::{is_run, read_json};
use crate::ui::screen::{alert, say};
use ivv::Constants;
use ivv::formats::{FourDgs, Own, ply_own};
use ivv::train::{Config, Run};
use std::ffi::OsStr;
use std::path::Path;

const RUN: &str = "give the folder of a run of `ivv train`";

/// How a scene is rendered.
#[derive(Clone, Copy, Debug, Default)]
pub struct Look {
    /// In the scene's own frame.
    pub constants: Constants,
    /// The background that it was made over, where run or file says that.
    pub background: Option<[f32; 3]>,
}

impl Look {
    /// How the run in the folder `path` is rendered, or what the file `path` says; `clip` is that file where it is a `.4dgs`. A `scene.ply`
    /// that does not say it takes the constants of the run beside it, and a message names those that are not the usual ones.
    ///
    /// # Errors
    /// Those of the file.
    pub fn of(path: &Path, clip: Option<&FourDgs>) -> ivv::Result<Self> {
        if is_run(path) {
            return Ok(Self::of_run(path));
        }
        let own = match clip {
            Some(clip) => clip.own().cloned(),
            None if path.is_file() => ply_own(path)?,
            None => None,
        };
        if let Some(own) = own {
            let (look, wrong) = of_own(&own);
            for name in wrong {
                let found = own.get(name).map_or("", |text| text).escape_debug();
                alert!("{}: its `{name}` is `{found}`, which cannot be; the usual one is taken", path.display());
            }
            return Ok(look);
        }
        let is_scene = path.file_name() == Some(OsStr::new("scene.ply"));
        let Some(folder) = path.parent().filter(|folder| is_scene && is_run(folder)) else {
            return Ok(Look::default());
        };
        let look = Self::of_run(folder);
        let unusual = look.unusual();
        if !unusual.is_empty() {
            say!("{}: rendered with {} of the run.json beside it", path.display(), list(&unusual));
        }
        Ok(look)
    }

    /// How `run` is rendered, which was trained with `config`.
    pub fn new(run: &Run, config: &Config) -> Self {
        Look { constants: run.constants_of_capture(), background: Some(config.background) }
    }

    /// How the run in `folder` is rendered; as usual, with a warning, where its files cannot be read.
    fn of_run(folder: &Path) -> Self {
        let read = || -> ivv::Result<Self> {
            let constants = Run::read(folder)?.constants_of_capture();
            let config = folder.join("config.json");
            // Segments that were joined have none of their own.
            let config: Option<Config> = if config.is_file() { Some(read_json(&config, RUN)?) } else { None };
            Ok(Look { constants, background: config.map(|config| config.background) })
        };
        read().unwrap_or_else(|fault| {
            alert!("rendered as usual, since it is not known how the run was: {fault}");
            Look::default()
        })
    }

    /// The values that differ from the usual ones.
    pub fn unusual(&self) -> Own {
        let usual = own(&Constants::default(), [0.0; 3]);
        let mut own = own(&self.constants, self.background.unwrap_or_default());
        own.retain(|name, value| usual.get(name) != Some(value));
        own
    }
}

/// What a file says of how a scene is rendered.
pub fn own(constants: &Constants, background: [f32; 3]) -> Own {
    let numbers = [
        ("alpha_max", constants.alpha_max),
        ("alpha_min", constants.alpha_min),
        ("blur", constants.blur),
        ("near", constants.near),
        ("t_min", constants.t_min),
    ];
    let mut own: Own = numbers.map(|(name, value)| (name.to_owned(), value.to_string())).into();
    own.insert("background".to_owned(), background.map(|part| part.to_string()).join(" "));
    own
}

/// The values with their names, for a message.
pub fn list(own: &Own) -> String {
    own.iter().map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ")
}

/// Reads what [`own`] writes. Absent and impossible values become the usual ones; also gives the names of the impossible ones.
fn of_own(own: &Own) -> (Look, Vec<&'static str>) {
    let usual = Constants::default();
    let mut wrong = Vec::new();
    let mut number = |name: &'static str, usual: f32, is_one: &dyn Fn(f32) -> bool| {
        let Some(text) = own.get(name) else { return usual };
        let value = text.parse().ok().filter(|value| is_one(*value));
        value.unwrap_or_else(|| {
            wrong.push(name);
            usual
        })
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
    let background = own.get("background").and_then(|text| {
        let parts = text.split(' ').map(|part| part.parse().ok()).collect::<Option<Vec<f32>>>();
        let parts = parts.and_then(|parts| <[f32; 3]>::try_from(parts).ok());
        let parts = parts.filter(|parts| parts.iter().all(|part| part.is_finite()));
        if parts.is_none() {
            wrong.push("background");
        }
        parts
    });
    (Look { constants, background }, wrong)
}
