//! `ivv sound inspect-hrtf`.

use crate::ui::screen::out;
use ivv::sound::FS;
use ivv::sound::hrtf::{HrtfSet, Lookup, degrees};
use ivv::sound::metrics::{ild_db, itd};
use std::path::PathBuf;

/// Options of `ivv sound inspect-hrtf`.
#[derive(clap::Args)]
pub struct Args {
    /// `sphere`, a SOFA file, or a folder of WAV files as SADIE's.
    hrtf: PathBuf,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let set = HrtfSet::open(&args.hrtf)?;
    let side = set.nearest(degrees(90.0, 0.0));
    let (ears, [left, right]) = ([0, 1].map(|ear| set.raw(side, ear)), set.extra(side));
    let (lead, louder) = (1e6 * (itd(ears[0], ears[1]) + (right - left) / f64::from(FS)), ild_db(ears[0], ears[1]));
    let elevations = (0..set.directions().len()).map(|at| set.angles(at).1);
    let (low, high) = elevations.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), el| (a.min(el), b.max(el)));
    if json {
        let line = serde_json::json!({
            "title": set.meta.title, "licence": set.meta.licence, "sha256": set.meta.sha256,
            "directions": set.directions().len(), "triangles": set.hull().triangles().len(), "radius_m": set.radius_m,
            "taps": set.taps(Lookup::Nearest), "elevation_deg": [low, high], "latency_samples": set.latency(),
            "alignment_loss_db": set.alignment_db(), "left_lead_us": lead, "left_louder_db": louder,
        });
        out!("{line}");
        return Ok(());
    }
    out!("title      {}", set.meta.title);
    out!("licence    {}", set.meta.licence);
    out!("sha256     {}", if set.meta.sha256.is_empty() { "none (computed)" } else { &set.meta.sha256 });
    out!(
        "directions {} in {} triangles, elevations {low:.0} to {high:.0} degrees, measured at {} m",
        set.directions().len(),
        set.hull().triangles().len(),
        set.radius_m
    );
    out!("responses  {} taps at {FS} Hz, aligned to {:.0} dB", set.taps(Lookup::Nearest), set.alignment_db());
    out!("from left  the left ear leads by {lead:.0} us and is {louder:.1} dB louder");
    Ok(())
}
