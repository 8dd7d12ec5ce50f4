//! `ivv sound render`.

use crate::run::files::word;
use crate::ui::screen::out;
use ivv::internals::sound::geometry::Mode;
use ivv::internals::sound::hrtf::{HrtfSet, Lookup};
use ivv::internals::sound::loudness::{self, PEAK_LIMIT_DB};
use ivv::internals::sound::path::read_path;
use ivv::internals::sound::render::{RenderConfig, Rendered, SourceReport, render_ambix, render_signals, signals};
use ivv::internals::sound::scene_file::SoundScene;
use ivv::internals::sound::wav::{Depth, write};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Part of the time from which a gain beyond 6 dB is worth a warning.
const OFTEN: f64 = 0.05;

#[derive(clap::Args)]
pub struct Args {
    /// A scene.json, as `ivv sound localize` writes it.
    scene: PathBuf,
    /// The head's path in seconds of the clip: TUM, CSV (t,x,y,z,qx,qy,qz,qw), or the JSON of nerfstudio or nerfview.
    #[arg(long)]
    path: PathBuf,
    /// The .wav to write: two channels, 48 kHz, 24 bits.
    #[arg(short, long)]
    output: PathBuf,
    /// The ears: `sphere`, a SOFA file, or a folder of WAV files as SADIE's.
    #[arg(long, default_value = "sphere")]
    hrtf: PathBuf,
    /// paper2d, on the horizon; paper3d, with elevation; or physical, with delay and Doppler, for metric scenes.
    #[arg(long, default_value = "paper2d", value_parser = word::<Mode>)]
    mode: Mode,
    /// aligned, responses between the measured directions, or nearest, the measured one.
    #[arg(long, default_value = "aligned", value_parser = word::<Lookup>)]
    lookup: Lookup,
    /// Loudness of the result, LUFS. By default unchanged, with peaks below -1 dBTP.
    #[arg(long, allow_hyphen_values = true)]
    lufs: Option<f64>,
    /// Write 32 bit floats.
    #[arg(long)]
    float: bool,
    /// Also write the sound field at the head's place as first-order AmbiX (W, Y, Z, X), for players that turn the head.
    #[arg(long)]
    ambix: Option<PathBuf>,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let Args { mode, lookup, lufs, .. } = *args;
    if let Some(lufs) = lufs {
        anyhow::ensure!((-70.0..=0.0).contains(&lufs), "--lufs: expected a number from -70 to 0, found {lufs}");
    }
    let config = RenderConfig { mode, lookup, lufs, ..RenderConfig::default() };
    let scene = SoundScene::read(&args.scene)?;
    let head = read_path(&args.path, None)?.track;
    let hrtf = HrtfSet::open(&args.hrtf)?;
    let sounds = signals(&scene)?;
    let from = Instant::now();
    let rendered = render_signals(&scene, &sounds, &head, &hrtf, &config)?;
    let seconds = from.elapsed().as_secs_f64();
    let depth = if args.float { Depth::Float32 } else { Depth::Int24 };
    write(&args.output, &rendered.samples, depth)?;
    if let Some(path) = &args.ambix {
        let mut samples = render_ambix(&scene, &sounds, &head, &config)?;
        // As loud as what the ears hear, where its own peaks allow.
        let room = loudness::true_peak_db(&samples)?.map_or(f64::INFINITY, |peak| PEAK_LIMIT_DB - peak);
        loudness::amplify(&mut samples, rendered.report.gain_db.min(room));
        write(path, &samples, depth)?;
    }
    if json {
        out!("{}", serde_json::to_string(&rendered.report)?);
    } else {
        print(&rendered, &args.output, seconds);
    }
    Ok(())
}

fn print(rendered: &Rendered, output: &Path, seconds: f64) {
    let report = &rendered.report;
    let licence = &report.hrtf.licence;
    out!("ears: {}; licence: {licence}", report.hrtf.title);
    if !report.hrtf.sha256.is_empty() {
        out!("      sha256 {}", report.hrtf.sha256);
    }
    for SourceReport { id, gain_db: [low, high], clamped, beyond_6_db, unseen, jumps } in &report.sources {
        let [near, unseen, beyond] = [clamped, unseen, beyond_6_db].map(|part| 100.0 * part);
        out!(
            "source {id}: {low:+.1} to {high:+.1} dB against the recording; at the smallest distance {near:.0} % of the time; \
             {unseen:.0} % of its places were not seen; {jumps} jumps"
        );
        if *beyond_6_db > OFTEN {
            out!(
                "  for {beyond:.0} % of the clip the level is over 6 dB from the recording's, so its room sound is scaled too"
            );
        }
    }
    let lufs = report.loudness.lufs.map_or("silent".into(), |lufs| format!("{:.1} LUFS", lufs + report.gain_db));
    let (length, gain, pace) = (report.seconds, report.gain_db, report.seconds / seconds.max(1e-9));
    out!("{}: {length:.2} s, {lufs}, gain {gain:+.1} dB; {pace:.0} times real time", output.display());
}
