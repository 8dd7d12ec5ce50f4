//! `ivv-play`: a window that shows the engine's own frames, with sound.

mod keys;
mod overlay;
#[path = "../run"]
#[expect(dead_code, reason = "`ivv` uses the rest")]
mod run {
    pub mod appearance;
    pub mod clip;
    pub mod device;
    pub mod files;
    pub mod source;
}
mod sound;
#[path = "."]
mod ui {
    #[path = "../ui/interrupt.rs"]
    pub mod interrupt;
    pub mod screen;
}
mod window;

use crate::run::clip::{Setting, refuse_stretched, setting};
use crate::run::device::DeviceArgs;
use crate::run::source::{Gaussians, Source};
use crate::ui::interrupt::{Interrupted, Stop};
use crate::ui::screen::alert;
use anyhow::{Context, ensure};
use clap::Parser;
use ivv::internals::scene::{Navigator, Playhead, Splats};
use ivv::internals::sound::hrtf::HrtfSet;
use ivv::internals::sound::scene_file::SoundScene;
use ivv::internals::vk;
use std::borrow::Cow;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;
use window::{Output, Player, State};
use winit::event_loop::EventLoop;

/// Shows a scene in a window, by the engine itself: where you look, with sound and the times of frames and passes.
#[derive(Parser)]
#[command(name = "ivv-play", version, after_help = keys::help())]
pub struct Args {
    /// The folder of a run, or a scene file.
    #[arg(value_name = "RUN|SCENE")]
    source: PathBuf,
    /// Rests at this time of the clip instead of playing from the start, seconds.
    #[arg(long, value_name = "SECONDS")]
    at: Option<f64>,
    /// Starts at this view, by its name: a training camera's, or one of --cameras.
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// Size of the window, pixels. By default 1280x720, or less of one side for the shape of the first view.
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// The output that is shown first.
    #[arg(long, value_enum, default_value_t = Output::Color)]
    output: Output,
    /// Shows times of frames and passes from the start.
    #[arg(long)]
    stats: bool,
    /// Shows frames as they come instead of waiting for the display, where the window can do that.
    #[arg(long)]
    no_vsync: bool,
    /// Ends after so many frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    frames: Option<u64>,
    /// Writes the last frame that the window took, then ends. Needs --frames; without --stats it has no time bar.
    #[arg(long, value_name = "FILE.png", requires = "frames")]
    screenshot: Option<PathBuf>,
    /// Length of the clip, seconds, where neither a run nor the file says it.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Views to start from: a cameras file (JSON, as of `ivv inspect --cameras`). By default those of the run's training cameras.
    #[arg(long)]
    cameras: Option<PathBuf>,
    /// Sound: the scene.json of `ivv sound localize`. By default that of the scene file, if it is a .4dgs.
    #[arg(long, value_name = "SCENE_JSON")]
    sound: Option<PathBuf>,
    /// Responses of a head: sphere, a SOFA file, or a folder of WAV files.
    #[arg(long, default_value = "sphere")]
    hrtf: PathBuf,
    /// Lets Vulkan's validation layer check every call, and tells what it says. Slow.
    #[arg(long)]
    validation: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

fn main() -> ExitCode {
    let args = Args::parse();
    // The reader of SOFA files warns of good files; what is wrong with bad ones is in the error. Windows warn of odd displays.
    let told = Targets::new()
        .with_default(LevelFilter::WARN)
        .with_target("sofar", LevelFilter::OFF)
        .with_target("winit", LevelFilter::ERROR);
    let log = tracing_subscriber::fmt::layer()
        .with_writer(|| ui::screen::Log)
        .with_ansi(std::io::stderr().is_terminal())
        .log_internal_errors(false)
        .with_filter(told);
    tracing_subscriber::registry().with(log).init();
    let Err(error) = run(&args) else { return ExitCode::SUCCESS };
    alert!("ivv-play: {error:#}");
    let interrupted = error.downcast_ref::<Interrupted>().map(|_| Interrupted::EXIT_CODE);
    let code = error.downcast_ref().map(ivv::Error::exit_code).or(interrupted);
    ExitCode::from(code.unwrap_or(2))
}

/// `WIDTHxHEIGHT` of a window.
fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse().ok().filter(|side| (1..=16_384).contains(side));
    let sides = text.split_once('x').and_then(|(width, height)| side(width).zip(side(height)));
    sides.ok_or_else(|| "expected WxH, pixels from 1 to 16384".to_owned())
}

/// Some Gaussians, enough to tell where the scene is: all, those that rest, or, where those are few, such as a backdrop alone, those of
/// the first part.
fn some(gaussians: &mut Gaussians) -> ivv::Result<Cow<'_, Splats>> {
    match gaussians {
        Gaussians::Whole(splats) => Ok(Cow::Borrowed(splats)),
        Gaussians::Parts(clip) => match clip.still()? {
            still if clip.parts().first().is_some_and(|part| part.n > still.len()) => clip.part(0).map(Cow::Owned),
            still => Ok(Cow::Owned(still)),
        },
    }
}

fn run(args: &Args) -> anyhow::Result<()> {
    let source = Source::open(&args.source)?;
    let Setting { clip: mut known, start } = setting(&source, args.seconds, args.cameras.as_deref())?;
    let views = std::mem::take(&mut known.views);
    let length = known.clock.map_or(0.0, |clock| clock.seconds());
    if let Some(at) = args.at {
        ensure!((0.0..=length).contains(&at), "--at: expected seconds of the clip, 0 to {length}, found {at}");
    }
    let named = |name: &String| {
        let names = || views.iter().map(|view| view.name.as_str()).collect::<Vec<_>>().join(", ");
        let found = views.iter().position(|view| view.name == *name);
        found.with_context(|| format!("--camera {name}: there is no view of this name; there are: {}", names()))
    };
    let current = args.camera.as_ref().map_or(Ok(0), named)?;
    if let Some(scene) = &args.sound {
        known.sounds = ivv::internals::sound::clip::sounds(&SoundScene::read(scene)?, start, length)?;
    } else {
        refuse_stretched(args.seconds, &known.sounds)?;
    }
    let hrtf = if known.sounds.is_empty() { None } else { Some(HrtfSet::open(&args.hrtf)?) };
    let mut shown = source.seen()?;

    let stop = Stop::listen()?;
    let no_display = "expected a display, found none; set DISPLAY to that of an X server, or use `ivv serve`";
    let events = EventLoop::new().context(no_display)?;
    let surface = vk::surface_extensions(&events.owned_display_handle())?;
    let gpu = args.device.open_as(vk::DeviceChoice { surface, validation: args.validation, ..args.device.choice() })?;
    let navigator = Navigator::new(&views, &*some(&mut shown.splats)?);
    let is_still = shown.splats.are_static() && known.sounds.is_empty();
    let renderer = shown.splats.renderer(gpu, known.constants)?;
    let is_playing = args.at.is_none() && args.screenshot.is_none();
    let clip = Playhead::new(if is_still { 0.0 } else { length }, args.at.unwrap_or_default(), is_playing);
    let flow_dt = known.clock.map_or(1.0, |clock| 1.0 / f64::from(clock.frames));
    let state = State::default();
    let mut player =
        Player { args, stop: &stop, renderer, navigator, views, current, clip, flow_dt, sound: None, state };
    player.go(current);
    if let Some(hrtf) = hrtf {
        match sound::Sound::new(&known.sounds, hrtf, player.heard()) {
            Ok(sound) => player.sound = Some(sound),
            Err(fault) => alert!("this plays without sound: {fault:#}"),
        }
    }
    player.run(events)
}
