//! `ivv-gpu-model estimate`: a step on a card that is not here.

use crate::{message, out};
use anyhow::Context;
use ivv::Constants;
use ivv::internals::gpu::{Gpu, Options, Recording, StandIn, shaders_hash};
use ivv::internals::profile::{CARDS, Card, Recorded};
use ivv::internals::scene::capture::{Extent, Picture};
use ivv::internals::scene::{Intrinsics, Motion, Splats, View};
use ivv::internals::stage::Counters;
use ivv::internals::train::{Config, Setup, TermData, Trainer};
use ivv::internals::vk::DeviceChoice;
use ivv_gpu_model::{Budgets, Estimate, side_by_side};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Of the pairs of a pixel and a Gaussian in a tile those that a blend evaluates, and of these those that add to their pixel: as
/// counted in pictures of trained scenes.
const EVALUATED: f64 = 0.45;
const ADDED: f64 = 0.55;
/// Of the Gaussians in view, those that touch a tile.
const VISIBLE: f64 = 2.0 / 3.0;
/// Cameras with a grid and an offset each: as many as N3V has.
const CAMERAS: usize = 20;
const FRAMES: f64 = 300.0;
const TILE: u32 = 16;
const MOST_SIDE: u32 = 8192;
const MOST_GAUSSIANS: u32 = 4_000_000;
const MOST_PAIRS: u32 = 80_000_000;

#[derive(clap::Args)]
pub struct Args {
    /// H200, RTX4090, RX7900XTX, A770, or `all`.
    #[arg(required = true, value_name = "CARD")]
    cards: Vec<String>,
    /// The work of the step: the counters of a profile.json, or the folder that holds it. Without it, a picture of N3V.
    #[arg(long, value_name = "PROFILE", conflicts_with_all = ["gaussians", "pairs", "size"])]
    work: Option<PathBuf>,
    /// Gaussians, all of them in view.
    #[arg(long, default_value_t = 300_000, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_GAUSSIANS)))]
    gaussians: u32,
    /// Pairs of a Gaussian and a tile.
    #[arg(long, default_value_t = 3_000_000, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_PAIRS)))]
    pairs: u32,
    /// Pixels of the picture.
    #[arg(long, default_value = "1352x1014", value_parser = size)]
    size: [u32; 2],
    /// A folder that tools/gpu/statistics.sh wrote, in place of assets/gpu/budgets.tsv: what compilers made of the kernels.
    #[arg(long, value_name = "FOLDER")]
    compiled: Option<PathBuf>,
    /// Writes Markdown, as assets/gpu/estimate.md has it.
    #[arg(long)]
    markdown: bool,
    /// The preset to start from: balanced (the defaults), exact, fast, small, or the path of a preset's .json file.
    #[arg(long)]
    preset: Option<String>,
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let side = |text: &str| text.parse().ok().filter(|side| (1..=MOST_SIDE).contains(side));
    let sides = text.split_once('x').and_then(|(width, height)| Some([side(width)?, side(height)?]));
    sides.ok_or_else(|| format!("expected WIDTHxHEIGHT, each from 1 to {MOST_SIDE}"))
}

struct Work {
    counters: Counters,
    size: [u32; 2],
}

impl Args {
    fn cards(&self) -> anyhow::Result<Vec<&'static Card>> {
        if self.cards.iter().any(|name| name == "all") {
            return Ok(CARDS.iter().collect());
        }
        self.cards.iter().map(|name| Card::named(name).map_err(anyhow::Error::msg)).collect()
    }

    fn work(&self) -> anyhow::Result<Work> {
        if let Some(profile) = &self.work {
            let counters = Recorded::read(profile)?.counters;
            let most = |side: u32| f64::from(side) * f64::from(side);
            let is_within = (1.0..=f64::from(MOST_GAUSSIANS)).contains(&counters.gaussians)
                && (0.0..=f64::from(MOST_PAIRS)).contains(&counters.intersections)
                && (1.0..=most(MOST_SIDE)).contains(&counters.pixels);
            anyhow::ensure!(
                is_within,
                "{}: expected 1 to {MOST_GAUSSIANS} Gaussians, at most {MOST_PAIRS} pairs with tiles, and 1 to {} pixels",
                profile.display(),
                most(MOST_SIDE)
            );
            // Its pixels are told, not its sides.
            let width = (counters.pixels * 4.0 / 3.0).sqrt().ceil().min(f64::from(MOST_SIDE));
            let height = (counters.pixels / width).ceil().min(f64::from(MOST_SIDE));
            return Ok(Work { counters, size: [width as u32, height as u32] });
        }
        let [width, height] = self.size;
        let mut counters = Counters::default();
        counters.gaussians = f64::from(self.gaussians);
        (counters.live, counters.active) = (counters.gaussians, counters.gaussians);
        counters.visible = (VISIBLE * counters.active).round();
        counters.intersections = f64::from(self.pairs);
        counters.tiles = f64::from(width.div_ceil(TILE) * height.div_ceil(TILE));
        counters.pixels = f64::from(width) * f64::from(height);
        counters.evaluated = EVALUATED * f64::from(TILE * TILE) * counters.intersections;
        counters.added = ADDED * counters.evaluated;
        Ok(Work { counters, size: self.size })
    }

    fn compiled(&self) -> ivv::Result<Budgets> {
        match &self.compiled {
            Some(folder) => Budgets::read_folder(folder),
            None => Budgets::parse(Path::new("assets/gpu/budgets.tsv"), include_str!("../../assets/gpu/budgets.tsv")),
        }
    }
}

pub fn run(args: &Args, device: &DeviceChoice, json: bool) -> anyhow::Result<()> {
    let (cards, work, compiled) = (args.cards()?, args.work()?, args.compiled()?);
    let config = match &args.preset {
        Some(name) => Config::default().with_preset(name)?,
        None => Config::default(),
    };
    let mut estimates = Vec::with_capacity(cards.len());
    for card in cards {
        message(&format!("recording a step for {}", card.name));
        let recording = recorded(card, &config, device, &work)?;
        estimates.push(Estimate::new(card, &recording, &work.counters, &compiled));
    }
    if json {
        return out(&serde_json::to_string_pretty(&estimates)?);
    }
    if args.markdown {
        out(&side_by_side(&estimates))?;
        out(&format!("Microseconds. Kernels: {}.\n", shaders_hash()))?;
        return estimates.iter().try_for_each(|estimate| out(&estimate.markdown()));
    }
    estimates.iter().try_for_each(|estimate| out(&estimate.terminal()))
}

/// A step as the engine records it for the card. What the Gaussians are does not matter: the recording has what the work may need.
fn recorded(card: &Card, config: &Config, device: &DeviceChoice, work: &Work) -> anyhow::Result<Recording> {
    // It holds buffers, and nothing runs on it.
    let stands_in = StandIn { subgroup_size: card.lanes };
    let options = Options { device: device.clone(), stands_in: Some(stands_in), ..Options::default() };
    let gpu = Arc::new(Gpu::open(&options)?);
    let [width, height] = work.size;
    let forward = View::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], Intrinsics::of_fov(width, height, 53.0));
    let view = View { time: 0.0, flow_dt: 1.0 / FRAMES, ..forward };
    // Halves: a depth of 1, no motion.
    let n_pixels = (width * height) as usize;
    let picture = Picture::new(width, height, vec![u32::MAX; n_pixels]);
    let picture = picture.with_priors(vec![0x3c00; n_pixels], vec![[0; 2]; n_pixels]);
    let setup = Setup {
        n_filming: CAMERAS,
        learns_offset: if config.offsets { vec![true; CAMERAS] } else { Vec::new() },
        has_grid: if config.grids.is_some() { vec![true; CAMERAS] } else { Vec::new() },
        data: TermData { depth: config.loss.depth > 0.0, flow: config.loss.flow > 0.0 },
        ..Setup::plain(Extent { center: [0.0; 3], radius: 1.0 }, 1.0 / FRAMES)
    };
    let n = work.counters.gaussians as usize;
    let total = config.total(CAMERAS as u64 * FRAMES as u64);
    let mut trainer =
        Trainer::new(gpu, &cloud(n, config.sh_degree), Constants::default(), config.clone(), total, setup)?;
    // A quarter more than there are, as a run that grew its lists has.
    trainer.limit_intersections((1.25 * work.counters.intersections) as u32);
    trainer.recorded(0, &view, &picture).context("a step cannot be recorded on this device")
}

fn cloud(n: usize, sh_degree: u32) -> Splats {
    let empty = Splats::new(sh_degree);
    Splats {
        position: vec![[0.0, 0.0, 4.0]; n],
        rotation: vec![[1.0, 0.0, 0.0, 0.0]; n],
        scale: vec![[-4.0; 3]; n],
        opacity: vec![0.0; n],
        sh: vec![[0.0; 3]; n * empty.n_coefficients()],
        motion: vec![Motion { velocity: [0.0; 3], t_center: 0.0, t_scale: 0.0 }; n],
        source_row: (0..n as u32).collect(),
        ..empty
    }
}
