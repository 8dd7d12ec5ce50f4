//! What the passes of a frame take, in the demo: cargo run --release --example profile_kernel -- blend

use ivv::{Constants, Gpu, GpuOptions, Outputs, Renderer, demo};
use std::sync::Arc;

const FRAMES: u32 = 20;

fn main() -> ivv::Result<()> {
    let kernel = std::env::args().nth(1).unwrap_or_default();
    let gpu = Arc::new(Gpu::open(&GpuOptions::default())?);
    let (splats, views) = demo();
    let mut renderer = Renderer::new(gpu.clone(), &splats.by_degree(), Constants::default())?;
    // Kernels are compiled at their first dispatch.
    renderer.draw(&views[0], Outputs::Color)?;
    println!("{}", gpu.caps().name);
    let mut passes = Vec::new();
    for _ in 0..FRAMES {
        passes.push(renderer.profile(&views[0], Outputs::Color)?.passes);
    }
    for (at, pass) in passes[0].iter().enumerate().filter(|(_, pass)| pass.label.contains(&kernel)) {
        let least = passes.iter().map(|frame| frame[at].ns).fold(f64::INFINITY, f64::min);
        println!("{:<28} {:>3} x {:>8.1} us", pass.label, pass.dispatches, 1e-3 * least);
    }
    Ok(())
}
