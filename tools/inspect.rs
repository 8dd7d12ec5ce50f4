//! `ivv inspect`.

use ivv::scene::{Quantiles, read_scene};
use std::path::PathBuf;

/// Options of `ivv inspect`.
#[derive(clap::Args)]
pub struct Args {
    /// A scene file: 3DGS or compressed PLY, .splat, .spz, or the folder or meta.json of a SOG.
    scene: PathBuf,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let summary = read_scene(&args.scene)?.by_degree().summary();
    if json {
        println!("{}", serde_json::to_string_pretty(&summary)?);
        return Ok(());
    }
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    println!(
        "{}: {} Gaussians, {} static and {} dynamic, SH degree {}",
        args.scene.display(),
        summary.n,
        summary.n_static,
        summary.n_dynamic,
        summary.sh_degree
    );
    let by_degree = |counts: [usize; 4]| counts.map(|n| n.to_string()).join(" / ");
    println!(
        "modelled:      {:.1} MiB of parameters; SH degree 0 / 1 / 2 / 3: {} static, {} dynamic",
        mib(summary.parameter_bytes),
        by_degree(summary.static_by_degree),
        by_degree(summary.dynamic_by_degree)
    );
    println!("as PLY:        {} bytes each, {:.1} MiB in all", summary.ply_bytes_per_gaussian, mib(summary.ply_bytes));
    println!(
        "on the device: {:.1} MiB: geometry {:.1}, motion {:.1}, SH by band {}",
        mib(summary.device.total),
        mib(summary.device.geometry),
        mib(summary.device.motion),
        summary.device.sh_bands.iter().map(|b| format!("{:.1}", mib(*b))).collect::<Vec<_>>().join(" + ")
    );
    if let Some(b) = &summary.bounds {
        println!("extent:        {:?} to {:?}; 98 % within {:?} to {:?}", b.min, b.max, b.p01, b.p99);
    }
    let line = |q: &Quantiles| format!("{:.4} / {:.4} / {:.4}", q.p01, q.p50, q.p99);
    if let (Some(opacity), Some(scale)) = (&summary.opacity, &summary.scale) {
        println!("1 % / median / 99 %: opacity {}, standard deviation {}", line(opacity), line(scale));
    }
    if let Some([first, last]) = summary.time_range {
        println!("time:          peaks from {first} to {last}");
    }
    if summary.n_non_finite > 0 {
        println!("not finite:    {} Gaussians, which are never drawn", summary.n_non_finite);
    }
    Ok(())
}
