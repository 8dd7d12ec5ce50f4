//! A scene of a capture: cargo run --release --example train -- CAPTURE scene.ply

use ivv::formats::{self, Scene, WriteOptions};
use ivv::train::{Config, Event, Session, SessionOptions};
use ivv::{Capture, Gpu, GpuOptions};
use std::path::Path;
use std::sync::Arc;

fn main() -> ivv::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [capture, scene] = &arguments[..] else {
        eprintln!("usage: train CAPTURE SCENE.ply");
        std::process::exit(2);
    };
    let gpu = Arc::new(Gpu::open(&GpuOptions::default())?);
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
    formats::write(scene, &Scene::from(session.finish()?), &WriteOptions::default())?;
    Ok(())
}
