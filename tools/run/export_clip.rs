//! `ivv export` to files in which time passes.

use crate::run::clip::{Setting, refuse_stretched, setting};
use crate::run::device::DeviceArgs;
use crate::run::source::Source;
use crate::ui::progress::Progress;
use crate::ui::screen::say;
use anyhow::ensure;
use glam::DVec3;
use ivv::internals::formats::{Clip, Clock, Contents, Encoded, FourDgs, Scene, World, WriteOptions, Written};
use ivv::internals::scene::{Splats, View, upright};
use ivv::internals::sound::hrtf::HrtfSet;
use ivv::internals::sound::scene_file::SoundScene;
use ivv::internals::stage::{Goal, Subject, compact};
use ivv::internals::words::count;
use std::path::{Path, PathBuf};

/// Views that files are compared in, and their longest side, pixels.
const MOST_VIEWS: usize = 8;
const LONGEST_SIDE: u32 = 640;

#[derive(clap::Args, Clone, Default)]
pub struct ClipArgs {
    /// Length of the clip, seconds, where neither a run nor the file says it.
    #[arg(long, value_name = "S")]
    pub seconds: Option<f64>,
    /// Views to start from: a cameras file (JSON, as of `ivv inspect --cameras`). By default those of the run's training cameras.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// Stores a .4dgs as small as it can be if pictures of it stay so many dB from those of the scene. By default it is nearly
    /// exact.
    #[arg(long, value_name = "DB", conflicts_with = "target_size")]
    min_psnr: Option<f64>,
    /// Stores a .4dgs as well as it can be in so many megabytes (10^6 bytes).
    #[arg(long, value_name = "MB")]
    target_size: Option<f64>,
    /// Sound of a .4dgs: the scene.json of `ivv sound localize`. By default that of the scene file.
    #[arg(long, value_name = "SCENE_JSON")]
    sound: Option<PathBuf>,
    /// The ears for the sound of a .4dgs: `sphere`, a SOFA file, or a folder of WAV files, of at most 2.4 MB. By default the
    /// browser's.
    #[arg(long, value_name = "EARS")]
    hrtf: Option<PathBuf>,
    /// Metres of a unit of the scene, for headsets. By default those of --sound or of the scene file.
    #[arg(long, value_name = "M")]
    metres_per_unit: Option<f64>,
    /// Writes the file even if the format, which cannot hold all colours, changes those of more than 1 in 10 Gaussians.
    #[arg(long)]
    clamp_colors: bool,
    /// Stores quickly, and without messages.
    #[arg(skip)]
    is_silent: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

impl ClipArgs {
    /// These options for a file that is only shown: without messages, and what it cannot hold is cut.
    pub fn unasked(&self) -> Self {
        ClipArgs { is_silent: true, ..self.clone() }
    }

    /// True if `source` is a `.4dgs` and no option changes it.
    pub fn is_as_it_is(&self, source: &Source) -> anyhow::Result<bool> {
        source.clip.as_ref().map_or(Ok(()), FourDgs::check_shown)?;
        let ClipArgs { cameras, seconds, sound, hrtf, metres_per_unit, .. } = self;
        let has_path = [cameras, sound, hrtf].into_iter().any(Option::is_some);
        let is_changed = has_path || seconds.is_some() || metres_per_unit.is_some();
        Ok(source.clip.is_some() && self.goal()?.is_none() && !is_changed)
    }

    /// Refuses the options that do not apply to a format without a clip, which may begin with `views` and have a clock all the same.
    pub fn refuse_without_clip(&self, format: &str, has_views: bool) -> anyhow::Result<()> {
        let given = [
            (self.min_psnr.is_some(), "--min-psnr"),
            (self.target_size.is_some(), "--target-size"),
            (self.sound.is_some(), "--sound"),
            (self.hrtf.is_some(), "--hrtf"),
            (self.metres_per_unit.is_some(), "--metres-per-unit"),
            (self.clamp_colors, "--clamp-colors"),
            (self.cameras.is_some() && !has_views, "--cameras"),
            (self.seconds.is_some() && !has_views, "--seconds"),
        ];
        let names: Vec<&str> = given.into_iter().filter(|(is_given, _)| *is_given).map(|(_, name)| name).collect();
        let (all, verb) = (names.join(", "), if names.len() == 1 { "does" } else { "do" });
        ensure!(names.is_empty(), "{all} {verb} not apply to the format {format}; leave it out, or export a .4dgs");
        Ok(())
    }

    pub fn bytes(&self, source: &Source, splats: Splats) -> anyhow::Result<Vec<u8>> {
        let clip = self.clip(source, splats.motion.is_empty())?;
        let scene = Scene { splats, clip, notes: Vec::new() };
        let options = self.options(source, &scene, WriteOptions::default())?;
        let (bytes, written) = FourDgs::encode(source.path, &scene, &options)?;
        written.notes.iter().for_each(|note| say!("{note}"));
        Ok(bytes)
    }

    /// `options` with those of this command, and with the grades that reach its goal, which are searched for.
    pub fn options(&self, source: &Source, scene: &Scene, options: WriteOptions) -> anyhow::Result<WriteOptions> {
        let options = WriteOptions { clamp_colors: self.clamp_colors, is_quick: self.is_silent, ..options };
        let Some(goal) = self.goal()? else { return Ok(options) };
        let (path, splats) = (source.path, options.moment(&scene.splats));
        let contents = Contents::of(path, &scene.clip, splats.motion.is_empty(), &options)?;
        let encoded = Encoded::new(&splats, contents.clock);
        if !self.is_silent {
            // A refusal comes before the search.
            encoded.losses(contents.views).judge(path, self.clamp_colors)?;
        }
        let views = spread(contents.views);
        let constants = scene.clip.constants;
        let subject =
            Subject { path, splats: &splats, encoded: &encoded, contents: &contents, constants, views: &views };
        let mut progress = Progress::passing("files", 0);
        let found = compact(&self.device.open()?, &subject, goal, &mut |n, most| progress.reach(n, most, "tried"))?;
        say!(
            "{:.2} MB, {:.1} dB from the scene in {}, after {}; halvings of the finest grids: {}",
            found.bytes.len() as f64 / 1e6,
            found.psnr,
            count(views.len(), "view"),
            count(found.n_tried, "file"),
            found.grades
        );
        Ok(WriteOptions { grades: found.grades, ..options })
    }

    /// Writes a `.4dgs` part by part; `None` if `source` is no clip in parts, or --min-psnr or --target-size need the whole.
    pub fn write_parts(&self, source: &Source, to: &Path) -> anyhow::Result<Option<Written>> {
        let (None, Some((_, mut parts))) = (self.goal()?, source.parts()?) else { return Ok(None) };
        let clip = self.clip(source, false)?;
        let options = WriteOptions { clamp_colors: self.clamp_colors, ..WriteOptions::default() };
        let written = FourDgs::write_parts(to, &mut *parts, &clip, &options)?;
        written.notes.iter().for_each(|note| say!("{note}"));
        Ok(Some(written))
    }

    pub fn clip(&self, source: &Source, is_still: bool) -> anyhow::Result<Clip> {
        let Setting { mut clip, start } = setting(source, self.seconds, self.cameras.as_deref())?;
        let clock = match clip.clock {
            Some(clock) => clock,
            None if is_still => Clock::STILL,
            None => anyhow::bail!(
                "{} does not say how long its clip is; give --seconds, or the folder of the run instead of its scene.ply",
                source.path.display()
            ),
        };
        clip.clock = Some(clock);
        if let Some(scene) = &self.sound {
            let (ears, scene) = (clip.sounds.ears().cloned(), SoundScene::read(scene)?);
            let metres_per_unit = scene.metres_per_unit.or(clip.world.and_then(|world| world.metres_per_unit));
            clip.world = Some(World { up: scene.up.to_array(), metres_per_unit });
            clip.sounds = ivv::internals::sound::clip::sounds(&scene, start, clock.seconds())?.heard_with(ears);
            let bytes = clip.sounds.n_bytes() as f64 / 1e6;
            say!("{} of sound, {bytes:.2} MB", count(clip.sounds.len(), "source"));
        } else {
            refuse_stretched(self.seconds, &clip.sounds)?;
        }
        if let Some(hrtf) = &self.hrtf {
            ensure!(!clip.sounds.is_empty(), "--hrtf: expected a scene with sound, found none; give --sound too");
            let ears = ivv::internals::sound::clip::ears(&HrtfSet::open(hrtf)?);
            say!("ears: {}; {:.2} MB", ears.about(), ears.bytes().len() as f64 / 1e6);
            clip.sounds = clip.sounds.heard_with(Some(ears));
        }
        if let Some(metres) = self.metres_per_unit {
            check_metres(metres)?;
            // Without any, as COLMAP has it: against the y axis.
            let upright = || upright(&clip.views).unwrap_or(DVec3::NEG_Y).to_array();
            let up = clip.world.map_or_else(upright, |world| world.up);
            clip.world = Some(World { up, metres_per_unit: Some(metres) });
        }
        Ok(clip)
    }

    fn goal(&self) -> anyhow::Result<Option<Goal>> {
        let checked = |option, unit, number: f64| {
            let is_positive = number.is_finite() && number > 0.0;
            ensure!(is_positive, "{option}: expected a positive number of {unit}, found {number}");
            Ok(number)
        };
        Ok(match (self.min_psnr, self.target_size) {
            (Some(db), _) => Some(Goal::Psnr(checked("--min-psnr", "dB", db)?)),
            (None, Some(size)) => Some(Goal::Bytes((1e6 * checked("--target-size", "megabytes", size)?) as u64)),
            (None, None) => None,
        })
    }
}

pub fn check_metres(metres: f64) -> anyhow::Result<()> {
    ensure!(metres.is_finite() && metres > 0.0, "--metres-per-unit: expected a positive number, found {metres}");
    Ok(())
}

/// Views to look from: at most some of those given, at times all over the clip.
fn spread(views: &[View]) -> Vec<View> {
    let n = views.len().min(MOST_VIEWS);
    let at = |k: usize| {
        let view = &views[k * views.len() / n];
        let view = view.reduced(view.intrinsics.width.max(view.intrinsics.height).div_ceil(LONGEST_SIDE));
        View { time: (k as f64 + 0.5) / n as f64, time_offset: 0.0, ..view }
    };
    (0..n).map(at).collect()
}
