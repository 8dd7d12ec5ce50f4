//! How a scene is rendered: what its run or its file says.

use crate::run::files::{config_of, is_run};
use crate::ui::screen::{alert, say};
use ivv::Constants;
use ivv::internals::formats::{self, FourDgs, Own, Rendering, list, ply_own};
use ivv::internals::train::{Config, Run};
use std::ffi::OsStr;
use std::path::Path;

#[derive(Clone, Copy, Debug, Default)]
pub struct Appearance {
    /// In the scene's own frame.
    pub constants: Constants,
    /// The background that it was made over, where run or file says that.
    pub background: Option<[f32; 3]>,
}

impl Appearance {
    /// How the run in the folder `path` is rendered, or what the file `path` says, which is `clip` if it is a `.4dgs`; a `scene.ply` that
    /// does not say it takes the constants of the run beside it. Also the notes on impossible values, already printed.
    pub fn of(path: &Path, clip: Option<&FourDgs>) -> ivv::Result<(Self, Vec<String>)> {
        if is_run(path) {
            return Ok((Self::of_run(path), Vec::new()));
        }
        let own = match clip {
            Some(clip) => clip.own().cloned(),
            None if path.is_file() => ply_own(path)?,
            None => None,
        };
        if let Some(own) = own {
            let Rendering { constants, background, notes } = Rendering::of(&own);
            notes.iter().for_each(|note| alert!("{}: {note}", path.display()));
            return Ok((Appearance { constants, background }, notes));
        }
        let is_scene = path.file_name() == Some(OsStr::new("scene.ply"));
        let folder = path.parent().filter(|folder| is_scene && is_run(folder));
        let look = folder.map(Self::of_run).unwrap_or_default();
        let unusual = look.unusual();
        if !unusual.is_empty() {
            say!("{}: rendered with {} of the run.json beside it", path.display(), list(&unusual));
        }
        Ok((look, Vec::new()))
    }

    pub fn new(run: &Run, config: &Config) -> Self {
        Appearance { constants: run.constants_of_capture(), background: Some(config.background) }
    }

    /// How the run in `folder` is rendered; as usual, with a warning, where its files cannot be read.
    fn of_run(folder: &Path) -> Self {
        let read = || -> ivv::Result<Self> {
            let constants = Run::read(folder)?.constants_of_capture();
            // Segments that were joined have none of their own.
            let has_config = folder.join("config.json").is_file();
            let config = has_config.then(|| config_of(folder)).transpose()?;
            Ok(Appearance { constants, background: config.map(|config| config.background) })
        };
        read().unwrap_or_else(|fault| {
            alert!("rendered as usual, since it is not known how the run was: {fault}");
            Appearance::default()
        })
    }

    pub fn unusual(&self) -> Own {
        formats::unusual(&self.constants, self.background)
    }
}
