//! The counted work of a frame, and its passes with their times and their share of it.

use super::cull::{ARGS_SCAN, ARGS_SORT};
use super::pairs::{Blocks, Pairs};
use super::scan::SCAN_BLOCK;
use super::sort::SORT_BLOCK;
use super::{Group, Lists, SceneBuffers, Workspace};
use crate::error::Result;
use crate::gpu::table::{self, Cost, Count, Spec};
use crate::gpu::{Gpu, Grid, Pass, PassTime, Recording, Work};
use serde::{Deserialize, Serialize};

/// The work of a frame; sums over its strips.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Counters {
    pub gaussians: f64,
    /// In the view's time and frustum.
    pub active: f64,
    pub visible: f64,
    pub intersections: f64,
    pub tiles: f64,
    pub pixels: f64,
    /// Pairs of a pixel and an intersection that the blend evaluates: its block of pixels is hit, the pixel not finished.
    pub evaluated: f64,
    pub added: f64,
    /// Pixels that are finished before their list's end.
    pub finished: f64,
    /// Gaussians of blocks of which one may live at the view's time, and the static ones.
    #[serde(default)]
    pub live: f64,
    #[serde(skip)]
    groups: Vec<[f64; 3]>,
}

impl Counters {
    /// Those of the strip of `n_tiles` tiles and `n_pixels` pixels that `work` rendered last, with `lists`.
    pub fn read(
        gpu: &Gpu,
        work: &Workspace,
        scene: &SceneBuffers,
        lists: &Lists,
        n_tiles: u32,
        n_pixels: u32,
    ) -> Result<Self> {
        let status = gpu.read(&work.status)?.first().copied().unwrap_or_default();
        let ranges = gpu.read(&work.cull.ranges)?;
        let (active, intersections) = (status.n_active, status.n_intersections);
        let tiles = n_tiles as usize;
        let blocks = Blocks {
            view: gpu.read(&work.view)?.first().copied().unwrap_or_default(),
            lanes: work.blend.subgroup_size,
            pixels_per_lane: work.blend.pixels_per_lane,
            splats: gpu.read(&work.projected.splats.range(0, super::project::SPLAT_PLANES * active as usize))?,
            ids: gpu.read(&lists.splat_ids.range(0, intersections as usize))?,
            first: gpu.read(&work.tiles.tile_first.range(0, tiles))?,
            last: gpu.read(&work.tiles.tile_last.range(0, tiles))?,
        };
        let Pairs { evaluated, added, finished } = blocks.pairs();
        let of_group = |(group, range): (&Group, &[u32; 2])| {
            Ok([group.n, group.live.count(gpu, group.n)?, range[1] - range[0]].map(f64::from))
        };
        let groups = scene.groups.iter().zip(&ranges).map(of_group).collect::<Result<Vec<_>>>()?;
        Ok(Counters {
            gaussians: f64::from(scene.n),
            live: groups.iter().map(|[_, live, _]| live).sum(),
            active: f64::from(active),
            visible: f64::from(status.n_visible),
            intersections: f64::from(intersections),
            tiles: f64::from(n_tiles),
            pixels: f64::from(n_pixels),
            evaluated,
            added,
            finished,
            groups,
        })
    }

    /// The counts that strips and frames add up.
    fn sums(&mut self) -> [&mut f64; 9] {
        let Counters { live, active, visible, intersections, tiles, pixels, evaluated, added, finished, .. } = self;
        [live, active, visible, intersections, tiles, pixels, evaluated, added, finished]
    }

    /// Adds those of another strip or frame of the same scene.
    pub fn add(&mut self, other: &Counters) {
        self.gaussians = other.gaussians;
        self.sums().into_iter().zip(other.clone().sums()).for_each(|(sum, more)| *sum += *more);
    }

    /// The mean of `n` frames that were added up.
    pub fn over(&self, n: f64) -> Counters {
        let mut mean = Counters { groups: Vec::new(), ..self.clone() };
        mean.sums().into_iter().for_each(|sum| *sum /= n);
        mean
    }

    /// How many of `count` there are, in one group of Gaussians or in all. What is not counted by group is spread as the active are.
    pub fn units(&self, count: Count, group: Option<usize>) -> f64 {
        let of_group = group.and_then(|group| self.groups.get(group).copied());
        let [n, live, active] = of_group.unwrap_or([self.gaussians, self.live, self.active]);
        let share = if self.active > 0.0 { active / self.active } else { 0.0 };
        match count {
            Count::Gaussians => n,
            Count::Live => live,
            Count::Active => active,
            Count::Idle => n - active,
            Count::Visible => self.visible * share,
            Count::Intersections => self.intersections * share,
            Count::Tiles => self.tiles,
            Count::Pixels => self.pixels,
            Count::Evaluated => self.evaluated,
            Count::Added => self.added,
            Count::Dispatches | Count::Recorded => 1.0,
        }
    }

    /// Units of `pass`, and the least that it must do.
    pub fn cost(&self, pass: &Pass) -> (f64, Cost) {
        let units = pass.scale * self.units(pass.count, pass.group);
        let mut cost = Cost::default();
        match &pass.work {
            Work::Copy(from, _) => cost.copied = 2.0 * from.size() as f64,
            Work::Fill(slice, _) => cost.filled = slice.size() as f64,
            Work::Dispatch { .. } => {
                let cost_of = row(pass).and_then(|row| Some(row.family.cost?(row)));
                for term in cost_of.unwrap_or_default() {
                    let n = term.per.map_or(units, |count| pass.scale * self.units(count, pass.group));
                    cost.add(&term.cost, n);
                }
            }
        }
        (units, cost)
    }

    /// Workgroups of `pass`; where the device counts them, as it will.
    pub fn workgroups(&self, pass: &Pass) -> f64 {
        let Work::Dispatch { kernel, grid, .. } = &pass.work else { return 0.0 };
        match grid {
            Grid::Threads(n) => f64::from(n.div_ceil(kernel.local)),
            Grid::Groups(n) => f64::from(*n),
            Grid::Indirect(args) => {
                let family = row(pass).map_or("", |row| row.family.name());
                // Blends have a workgroup a tile; those for the chunks of long lists are not counted.
                match family {
                    "blend_fwd" | "blend_bwd" => return self.tiles,
                    "chunk_light" | "blend_merge" => return 0.0,
                    _ => {}
                }
                // `emit` has a thread for each Gaussian; what has no count is a scan over the active ones.
                let is_of_active = family == "emit" || pass.count == Count::Dispatches;
                let count = if is_of_active { Count::Active } else { pass.count };
                let each = match args.offset() as usize / size_of::<[u32; 4]>() {
                    ARGS_SCAN => SCAN_BLOCK,
                    ARGS_SORT => SORT_BLOCK,
                    _ => kernel.local as usize,
                };
                (self.units(count, pass.group) / each as f64).ceil()
            }
        }
    }
}

fn row(pass: &Pass) -> Option<&'static Spec> {
    table::kernel(pass.kernel()?.name)
}

/// One line of a profile: all passes of a frame with the same label.
#[derive(Clone, Debug, Serialize)]
pub struct PassReport {
    pub label: String,
    pub dispatches: u64,
    pub ns: f64,
    /// Units that the time grows with, in all.
    pub units: f64,
    pub cost: Cost,
}

/// Adds the passes of `rec`, which took `times` for what `counters` say, to the `lines` of the same frame.
pub fn add_passes(
    mut lines: Vec<PassReport>,
    rec: &Recording,
    times: &[PassTime],
    counters: &Counters,
) -> Vec<PassReport> {
    for (pass, time) in rec.passes().iter().zip(times) {
        let (units, cost) = counters.cost(pass);
        let at = lines.iter().position(|line| line.label == time.label).unwrap_or_else(|| {
            let label = time.label.clone();
            lines.push(PassReport { label, dispatches: 0, ns: 0.0, units: 0.0, cost: Cost::default() });
            lines.len() - 1
        });
        let line = &mut lines[at];
        line.dispatches += 1;
        line.ns += time.ns;
        line.units += units;
        line.cost.add(&cost, 1.0);
    }
    lines
}
