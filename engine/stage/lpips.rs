//! LPIPS v0.1 (SPEC 4, L_perc; Zhang et al. 2018) of a crop, with its cotangent: a loss and a metric.

use std::path::Path;

use super::capacity;
use super::lpips_tiles::{Share, Tile};
use super::lpips_trunk::{Conv, Extent, Layer, Network, TAP_PIXELS, Trunk, tap_planes};
use crate::error::{Error, Result};
use crate::gpu::generated::constants::lpips_conv::{BLOCKS, PIXELS};
use crate::gpu::generated::{
    self, lpips_conv, lpips_conv_bwd, lpips_input, lpips_input_bwd, lpips_pool, lpips_pool_bwd, lpips_tap,
    lpips_tap_bwd,
};
use crate::gpu::kernel::Pod;
use crate::gpu::{Buf, Gpu, Grid, KernelInfo, Recording};

/// Widths of subgroups that have kernels of their own, in the order of the table; others share the first kernel.
const WIDTHS: [u32; 3] = [16, 32, 64];

/// A part of a picture, and the same of the truth.
#[derive(Clone, Copy)]
pub struct Compared<'a> {
    /// The picture, `[height][width]`: colour in the first three channels, about [0, 1].
    pub image: &'a Buf<[f32; 4]>,
    /// RGB and the mask in the top byte, 8 bits each. A hidden pixel (mask 0) of the picture is taken to equal the truth.
    pub truth: &'a Buf<u32>,
    pub size: [u32; 2],
    /// First column and row of the part.
    pub origin: [u32; 2],
    /// Width and height of the part, which lies within the picture.
    pub crop: [u32; 2],
}

/// How a colour of [0, 1] is scaled for the trunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// Its place in [-1, 1]: what LPIPS is made for.
    Scaled,
    /// The colour as it is, as tables of several papers have it.
    Unscaled,
}

#[derive(Clone, Copy)]
pub struct Cotangent<'a> {
    /// `weight` times the derivative of LPIPS by the picture's colour is added to the crop's pixels of this.
    pub d_image: &'a Buf<[f32; 4]>,
    pub weight: f32,
}

pub struct Lpips {
    net: Network,
    maps: Vec<Maps>,
    d_blocks: Buf<f32>,
    sums: Buf<[f32; 4]>,
}

/// Scratch of one depth, which only grows: features of picture and truth, and the picture's cotangent.
struct Maps {
    features: [Buf<[f32; 4]>; 2],
    /// The place of its window that a pool took.
    choices: [Buf<u32>; 2],
    cotangent: Buf<[f32; 4]>,
}

impl Lpips {
    /// Reads the weights of a trunk and of LPIPS from a safetensors file, as `tools/lpips_weights.py` makes it.
    pub fn load(gpu: &Gpu, path: &Path) -> Result<Self> {
        let net = Network::load(gpu, path)?;
        let empty = |name| gpu.alloc(name, 0);
        let maps = net.channels.iter().map(|_| {
            Ok(Maps {
                features: [empty(FEATURES)?, empty(FEATURES)?],
                choices: [gpu.alloc(CHOICES, 0)?, gpu.alloc(CHOICES, 0)?],
                cotangent: empty(COTANGENT)?,
            })
        });
        let maps = maps.collect::<Result<_>>()?;
        Ok(Lpips { net, maps, d_blocks: gpu.alloc(D_BLOCKS, 0)?, sums: gpu.alloc(SUMS, 0)? })
    }

    pub fn trunk(&self) -> Trunk {
        self.net.trunk
    }

    /// Bytes of scratch for a crop of `size`, with a cotangent or without: about 174 or 119 a pixel for AlexNet, 688 or 466 for
    /// SqueezeNet. A crop that is too small for the trunk is an error.
    pub fn scratch_bytes(&self, size: [u32; 2], with_cotangent: bool) -> Result<u64> {
        Ok(self.net.extent(size, with_cotangent)?.bytes())
    }

    fn fit(&mut self, gpu: &Gpu, extent: &Extent) -> Result<()> {
        for (maps, len) in self.maps.iter_mut().zip(&extent.maps) {
            for side in 0..2 {
                grow(gpu, &mut maps.features[side], FEATURES, len.features)?;
                grow(gpu, &mut maps.choices[side], CHOICES, len.choices)?;
            }
            grow(gpu, &mut maps.cotangent, COTANGENT, len.cotangent)?;
        }
        grow(gpu, &mut self.d_blocks, D_BLOCKS, extent.d_blocks)
    }

    /// The same with a cotangent, and the bytes of the largest buffer.
    pub(crate) fn loss_bytes(&self, size: [u32; 2]) -> Result<[u64; 2]> {
        let extent = self.net.extent(size, true)?;
        Ok([extent.bytes(), extent.largest()])
    }

    /// Appends LPIPS of `what`, and its cotangent, if there is a place for it. Gives sums by workgroup; the first number of their
    /// total is LPIPS, 0 for equal pictures.
    pub fn record(
        &mut self,
        gpu: &Gpu,
        rec: &mut Recording,
        what: &Compared<'_>,
        cotangent: Option<Cotangent<'_>>,
    ) -> Result<Buf<[f32; 4]>> {
        let ends = [0, 1].map(|axis| u64::from(what.origin[axis]) + u64::from(what.crop[axis]));
        assert!((0..2).all(|axis| ends[axis] <= what.size[axis].into()), "a crop lies within its picture");
        let extent = self.net.extent(what.crop, cotangent.is_some())?;
        self.fit(gpu, &extent)?;
        grow(gpu, &mut self.sums, SUMS, extent.sums)?;
        let shares: Vec<Share> = self.net.taps().map(|map| Share::whole(extent.sizes[map])).collect();
        let passes = Passes { lpips: self, sizes: &extent.sizes, lanes: gpu.caps().subgroup_size };
        rec.section("lpips");
        let taps = Taps { shares: &shares, sums: &self.sums, first_sum: 0 };
        passes.forward(rec, what, Shown::Scaled, taps, cotangent.is_some());
        if let Some(cotangent) = cotangent {
            passes.backward(rec, what, &cotangent);
        }
        Ok(self.sums.range(0, extent.sums))
    }

    /// Appends LPIPS of `what` alone, however large it is: in tiles whose buffers have at most `most_bytes` each. Gives sums as
    /// [`Lpips::record`] does; of several tiles they differ in their last bits.
    pub fn record_score(
        &mut self,
        gpu: &Gpu,
        rec: &mut Recording,
        what: &Compared<'_>,
        shown: Shown,
        most_bytes: u64,
    ) -> Result<Buf<[f32; 4]>> {
        let tiles = self.tiles(what.crop, most_bytes)?;
        let extents = tiles.iter().map(|tile| self.net.extent(tile.size, false)).collect::<Result<Vec<_>>>()?;
        extents.iter().try_for_each(|extent| self.fit(gpu, extent))?;
        let n_sums =
            |tile: &Tile| tile.shares.iter().map(|share| share.pixels().div_ceil(TAP_PIXELS) as usize).sum::<usize>();
        let sums = gpu.alloc(SUMS, tiles.iter().map(n_sums).sum::<usize>())?;
        rec.section("lpips");
        let mut first = 0;
        for (tile, extent) in tiles.iter().zip(&extents) {
            let origin = [0, 1].map(|axis| what.origin[axis] + tile.first[axis]);
            let part = Compared { origin, crop: tile.size, ..*what };
            let passes = Passes { lpips: self, sizes: &extent.sizes, lanes: gpu.caps().subgroup_size };
            let taps = Taps { shares: &tile.shares, sums: &sums, first_sum: first };
            passes.forward(rec, &part, shown, taps, false);
            first += n_sums(tile) as u32;
        }
        Ok(sums)
    }

    /// Bytes of scratch of a score of `size`, and of its largest buffer, where that may have `most_bytes`.
    pub fn score_bytes(&self, size: [u32; 2], most_bytes: u64) -> Result<[u64; 2]> {
        let each = self.tiles(size, most_bytes)?;
        let extents = each.iter().map(|tile| self.net.extent(tile.size, false)).collect::<Result<Vec<_>>>()?;
        Ok([Extent::bytes, Extent::largest].map(|of| extents.iter().map(of).max().unwrap_or(0)))
    }

    /// A picture of `size` in as few tiles as have buffers of `most_bytes` at most.
    fn tiles(&self, size: [u32; 2], most_bytes: u64) -> Result<Vec<Tile>> {
        // Names what is wrong with a picture that is too small.
        self.net.extent(size, false)?;
        let mut n = [1, 1];
        loop {
            let tiles = self.net.tiles(size, n).unwrap_or_default();
            let sides = [0, 1].map(|axis| tiles.iter().map(|tile| tile.size[axis]).max().unwrap_or(0));
            let needed = self.net.extent(sides, false)?.largest();
            if needed <= most_bytes {
                return Ok(tiles);
            }
            let longer = usize::from(sides[1] >= sides[0]);
            let axis = [longer, 1 - longer].into_iter().find(|axis| n[*axis] * self.net.step() <= size[*axis]);
            n[axis.ok_or_else(|| too_large(FEATURES, needed, most_bytes))?] *= 2;
        }
    }
}

const FEATURES: &str = "lpips features";
const CHOICES: &str = "lpips choices";
const COTANGENT: &str = "d lpips features";
const D_BLOCKS: &str = "d lpips blocks";
const SUMS: &str = "lpips sums";

fn too_large(name: &str, needed: u64, limit: u64) -> Error {
    let remedy = "compare a smaller crop: --set loss.lpips_crop=512";
    capacity::too_large(format!("bytes of `{name}` in one binding"), needed, limit, remedy)
}

/// Gives `buf` room for `len` items, unless it has it.
fn grow<T: Pod>(gpu: &Gpu, buf: &mut Buf<T>, name: &str, len: usize) -> Result<()> {
    let (needed, limit) = ((len * size_of::<T>()) as u64, gpu.caps().max_binding_bytes);
    if needed > limit {
        return Err(too_large(name, needed, limit));
    }
    if buf.len() < len {
        *buf = gpu.alloc(name, len)?;
    }
    Ok(())
}

struct Passes<'a> {
    lpips: &'a Lpips,
    sizes: &'a [[u32; 2]],
    lanes: u32,
}

struct Taps<'a> {
    shares: &'a [Share],
    sums: &'a Buf<[f32; 4]>,
    /// Where in `sums` those of this crop begin.
    first_sum: u32,
}

impl Passes<'_> {
    fn forward(&self, rec: &mut Recording, what: &Compared<'_>, shown: Shown, taps: Taps, with_cotangent: bool) {
        let Lpips { net, maps, .. } = self.lpips;
        let Taps { shares, sums, mut first_sum } = taps;
        let (gain, offset) = if shown == Shown::Scaled { (2.0, -1.0) } else { (1.0, 0.0) };
        let ([crop_width, crop_height], [first_x, first_y]) = (what.crop, what.origin);
        let [features, truth_features] = &maps[0].features;
        rec.pass(
            lpips_input::Args { image: what.image, truth: what.truth, features, truth_features },
            lpips_input::Push { width: what.size[0], first_x, first_y, crop_width, crop_height, gain, offset },
            Grid::Threads(crop_width * crop_height),
        );
        rec.scale(f64::from(crop_width * crop_height));
        let mut shares = shares.iter();
        for layer in &net.layers {
            match layer {
                Layer::Conv(conv) => (0..2).for_each(|side| self.conv(rec, conv, side)),
                Layer::Pool { from, to, .. } => {
                    let (push, planes) = (self.pool_push(*from, *to), net.planes(*to));
                    for side in 0..2 {
                        let features = &maps[*from].features[side];
                        let (pooled, choices) = (&maps[*to].features[side], &maps[*to].choices[side]);
                        let grid = Grid::Threads(push.out_width * push.out_height * planes);
                        rec.pass(lpips_pool::Args { features, pooled, choices }, push, grid);
                        rec.scale(f64::from(push.out_width * push.out_height * planes));
                    }
                }
                Layer::Tap { of, linear } => {
                    let Some(share) = shares.next().filter(|share| share.pixels() > 0) else { continue };
                    let (pixels, planes, width) = (share.pixels(), net.planes(*of), self.sizes[*of][0]);
                    let [features, truth_features] = &maps[*of].features;
                    let (n_groups, per_pixel) = (pixels.div_ceil(TAP_PIXELS), 1.0 / share.of as f32);
                    let grid = Grid::Groups(n_groups);
                    let ([columns, _], first) = (share.size, share.first[1] * width + share.first[0]);
                    if with_cotangent {
                        let d_features = &maps[*of].cotangent;
                        rec.pass(
                            lpips_tap_bwd::Args { features, truth_features, linear, sums, d_features },
                            lpips_tap_bwd::Push { pixels, columns, first, width, planes, first_sum, per_pixel },
                            grid,
                        );
                    } else {
                        rec.pass(
                            lpips_tap::Args { features, truth_features, linear, sums },
                            lpips_tap::Push { pixels, columns, first, width, planes, first_sum, per_pixel },
                            grid,
                        );
                    }
                    rec.scale(f64::from(pixels * planes));
                    first_sum += n_groups;
                }
            }
        }
    }

    /// One layer of the picture (side 0) or the truth (side 1).
    fn conv(&self, rec: &mut Recording, conv: &Conv, side: usize) {
        let Lpips { net, maps, .. } = self.lpips;
        let ([in_width, in_height], [out_width, out_height]) = (self.sizes[conv.from], self.sizes[conv.to]);
        let in_planes = net.planes(conv.from);
        let run = tap_planes(4 * in_planes * conv.kernel);
        rec.pass_variant(
            self.conv_kernel(false),
            lpips_conv::Args {
                features: &maps[conv.from].features[side],
                weights: &conv.forward,
                bias: &conv.bias,
                maps: &maps[conv.to].features[side].cast(),
            },
            lpips_conv::Push {
                in_width,
                in_height,
                in_planes,
                in_first: 0,
                out_width,
                out_height,
                out_channels: conv.outputs,
                out_stride: 4 * net.planes(conv.to),
                out_first: conv.first,
                columns: 1,
                run,
                steps: conv.kernel * run / 4,
                stride: conv.stride,
                pad: conv.pad,
                add: 0,
                mask: 0,
            },
            self.conv_grid(out_width * out_height, conv.outputs),
        );
        rec.scale(conv.multiply_adds(self.sizes[conv.to], net.channels[conv.from]));
    }

    fn conv_kernel(&self, is_backward: bool) -> &'static KernelInfo {
        generated::lpips_conv(is_backward, WIDTHS.iter().position(|width| *width == self.lanes).map_or(0, |at| at + 1))
    }

    fn conv_grid(&self, pixels: u32, channels: u32) -> Grid {
        Grid::Threads(pixels.div_ceil(PIXELS) * channels.div_ceil(BLOCKS * self.lanes) * self.lanes)
    }

    fn pool_push(&self, from: usize, to: usize) -> lpips_pool::Push {
        let ([width, height], [out_width, out_height]) = (self.sizes[from], self.sizes[to]);
        lpips_pool::Push { width, height, planes: self.lpips.net.planes(from), out_width, out_height }
    }

    fn backward(&self, rec: &mut Recording, what: &Compared<'_>, cotangent: &Cotangent<'_>) {
        let Lpips { net, maps, d_blocks, .. } = self.lpips;
        // Maps whose cotangent has been begun; the others hold what an earlier crop left.
        let mut begun: Vec<bool> = (0..maps.len()).map(|map| net.taps().any(|tap| tap == map)).collect();
        for layer in net.layers.iter().rev() {
            match layer {
                Layer::Conv(conv) => {
                    self.conv_back(rec, conv, begun[conv.from]);
                    begun[conv.from] = true;
                }
                Layer::Pool { from, to, .. } => {
                    let lpips_pool::Push { width, height, planes, out_width, out_height } = self.pool_push(*from, *to);
                    rec.pass(
                        lpips_pool_bwd::Args {
                            features: &maps[*from].features[0],
                            choices: &maps[*to].choices[0],
                            d_pooled: &maps[*to].cotangent,
                            d_features: &maps[*from].cotangent,
                        },
                        lpips_pool_bwd::Push { width, height, planes, out_width, out_height },
                        Grid::Threads(width * height * planes),
                    );
                    rec.scale(f64::from(width * height * planes));
                }
                Layer::Tap { .. } => {}
            }
        }
        let Some(Layer::Conv(first)) = net.layers.first() else { return };
        let ([crop_width, crop_height], [first_x, first_y]) = (what.crop, what.origin);
        rec.pass(
            lpips_input_bwd::Args { d_blocks, truth: what.truth, d_image: cotangent.d_image },
            lpips_input_bwd::Push {
                width: what.size[0],
                first_x,
                first_y,
                crop_width,
                crop_height,
                blocks_x: first.blocks(crop_width),
                stride: first.stride,
                pad: first.pad - first.blocks_before() * first.stride,
                weight: cotangent.weight,
            },
            Grid::Threads(crop_width * crop_height),
        );
        rec.scale(f64::from(crop_width * crop_height));
    }

    fn conv_back(&self, rec: &mut Recording, conv: &Conv, add: bool) {
        let Lpips { net, maps, d_blocks, .. } = self.lpips;
        let [in_width, in_height] = self.sizes[conv.to];
        let [out_width, out_height] = self.sizes[conv.from].map(|n| conv.blocks(n));
        let out_channels = conv.stride * conv.stride * net.channels[conv.from];
        // A block of `stride` pixels a side is reached by so many outputs a side.
        let (taps, run) = (conv.kernel.div_ceil(conv.stride), tap_planes(conv.outputs));
        let to_picture = conv.from == 0;
        rec.pass_variant(
            self.conv_kernel(true),
            lpips_conv_bwd::Args {
                features: &maps[conv.to].cotangent,
                weights: &conv.backward,
                forward: &maps[conv.from].features[0].cast(),
                maps: &if to_picture { d_blocks.clone() } else { maps[conv.from].cotangent.cast() },
            },
            lpips_conv_bwd::Push {
                in_width,
                in_height,
                in_planes: net.planes(conv.to),
                in_first: conv.first / 4,
                out_width,
                out_height,
                out_channels,
                out_stride: out_channels,
                out_first: 0,
                columns: taps,
                run,
                steps: taps * taps * run / 4,
                stride: 1,
                pad: taps - 1 - conv.blocks_before(),
                add: u32::from(add),
                mask: u32::from(!to_picture),
            },
            self.conv_grid(out_width * out_height, out_channels),
        );
        rec.scale(conv.multiply_adds(self.sizes[conv.to], net.channels[conv.from]));
    }
}
