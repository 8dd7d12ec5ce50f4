//! A scene of a capture: cargo run --release --example train -- CAPTURE scene.ply

use ivv::formats::write_ply;
use ivv::gpu::Gpu;
use ivv::scene::capture::Capture;
use ivv::train::{Config, Event, Session, SessionOptions};
use std::path::Path;
use std::sync::Arc;

fn main() -> ivv::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [capture, scene] = &arguments[..] else {
        eprintln!("usage: train CAPTURE SCENE.ply");
        std::process::exit(2);
    };
    let gpu = Arc::new(Gpu::open(&Default::default())?);
    let capture = Capture::open(Path::new(capture))?;
    let config = Config { steps: 200, ..Config::default() };
    let mut session = Session::begin(gpu, &capture, config, SessionOptions::default())?;
    while session.step()? {
        for event in session.take_events() {
            if let Event::Step(report) = event {
                println!("step {}: loss {:.4}, {} Gaussians", report.step, report.loss, report.gaussians);
            }
        }
    }
    write_ply(Path::new(scene), &session.finish()?)
}
