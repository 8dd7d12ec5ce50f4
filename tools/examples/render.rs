//! A picture of a scene file: cargo run --release --example render -- assets/demo/scene.ply out.png

use ivv::{Gpu, GpuOptions, Intrinsics, Outputs, Renderer, View, formats};
use std::path::Path;
use std::sync::Arc;

fn main() -> ivv::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, picture] = &arguments[..] else {
        eprintln!("usage: render SCENE PICTURE.png");
        std::process::exit(2);
    };
    let gpu = Arc::new(Gpu::open(&GpuOptions::default())?);
    let scene = formats::read(scene)?;
    let mut renderer = Renderer::new(gpu, &scene.splats.by_degree(), scene.clip.constants)?;
    // As in COLMAP, y points downwards.
    let view = View::look_at([1.5, -1.2, -3.6], [0.0, 0.35, 0.4], [0.0, -1.0, 0.0], Intrinsics::of_fov(640, 480, 45.0));
    let (frame, report) = renderer.render(&view, Outputs::Color)?;
    frame.write_png(Path::new(picture))?;
    println!("{} of {} Gaussians seen", report.visible, report.gaussians);
    Ok(())
}
