//! `ivv play`: a window that shows the engine's own frames, with sound.

mod keys;
mod overlay;
mod sound;
mod window;

use crate::device::DeviceArgs;
use crate::export_clip::{ClipArgs, refuse_stretched};
use crate::interrupt::Stop;
use crate::screen::alert;
use crate::shown::Source;
use crate::verbs::synth::size;
use anyhow::{Context, bail, ensure};
use ivv::scene::{Navigator, Playhead};
use ivv::sound::hrtf::HrtfSet;
use ivv::sound::scene_file::SoundScene;
use ivv::vk;
use std::path::PathBuf;
use window::{Output, Player, State};
use winit::event_loop::EventLoop;

/// Options of `ivv play`.
#[derive(clap::Args)]
#[command(after_help = keys::help())]
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
    /// What is shown first.
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

pub fn run(args: &Args) -> anyhow::Result<()> {
    let is_fit = |side: u32| (1..=16_384).contains(&side);
    if let Some((width, height)) = args.size.filter(|(width, height)| !(is_fit(*width) && is_fit(*height))) {
        bail!("--size: expected WxH, pixels from 1 to 16384, found {width}x{height}");
    }
    let source = Source::open(&args.source)?;
    let mut setting = ClipArgs::seen(args.seconds, args.cameras.clone()).setting(&source)?;
    let views = std::mem::take(&mut setting.views);
    let length = setting.clock.map_or(0.0, |clock| clock.seconds());
    if let Some(at) = args.at {
        ensure!((0.0..=length).contains(&at), "--at: expected seconds of the clip, 0 to {length}, found {at}");
    }
    let named = |name: &String| {
        let known = || views.iter().map(|view| view.name.as_str()).collect::<Vec<_>>().join(", ");
        let found = views.iter().position(|view| view.name == *name);
        found.with_context(|| format!("--camera {name}: there is no view of this name; there are: {}", known()))
    };
    let current = args.camera.as_ref().map_or(Ok(0), named)?;
    if let Some(scene) = &args.sound {
        setting.sounds = ivv::sound::clip::sounds(&SoundScene::read(scene)?, setting.start, length)?;
    } else {
        refuse_stretched(args.seconds, &setting.sounds)?;
    }
    let hrtf = if setting.sounds.is_empty() { None } else { Some(HrtfSet::open(&args.hrtf)?) };
    let mut shown = source.seen()?;

    let stop = Stop::listen()?;
    let no_display = "expected a display, found none; set DISPLAY to that of an X server, or use `ivv serve`";
    let events = EventLoop::new().context(no_display)?;
    let gpu = args.device.open_with(vk::surface_extensions(&events.owned_display_handle())?, args.validation)?;
    let navigator = Navigator::new(&views, &*shown.splats.some()?);
    let is_still = shown.splats.are_static() && setting.sounds.is_empty();
    let renderer = shown.splats.renderer(gpu, setting.constants)?;
    let is_playing = args.at.is_none() && args.screenshot.is_none();
    let clip = Playhead::new(if is_still { 0.0 } else { length }, args.at.unwrap_or_default(), is_playing);
    let flow_dt = setting.clock.map_or(1.0, |clock| 1.0 / f64::from(clock.frames));
    let state = State::default();
    let mut player =
        Player { args, stop: &stop, renderer, navigator, views, current, clip, flow_dt, sound: None, state };
    player.go(current);
    if let Some(hrtf) = hrtf {
        match sound::Sound::new(&setting.sounds, hrtf, player.heard()) {
            Ok(sound) => player.sound = Some(sound),
            Err(fault) => alert!("this plays without sound: {fault:#}"),
        }
    }
    player.run(events)
}
