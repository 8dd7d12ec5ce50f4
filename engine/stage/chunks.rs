//! Long lists on GPUs: cut into chunks that are blended at once, and merged. See `include/chunk.glsl`.

use super::params::TILE_PIXELS;
use super::{Blend, Lists, Outputs, Purpose, Tiles, ViewBuffers, Zeros};
use crate::error::Result;
use crate::gpu::generated::constants::chunk::{CHUNK, CHUNK_ALL, CHUNK_ITEMS, CHUNK_LONG};
use crate::gpu::generated::{self, blend_merge, chunk_light, chunk_list};
use crate::gpu::{Buf, Gpu, Grid, Recording};

/// Bytes, per intersection, of the longest binding: a vec4 for each pixel of a chunk.
pub(super) const BYTES: u64 = 16 * TILE_PIXELS as u64 * CHUNKS as u64 / CHUNK as u64;
/// Chunks of lists with CHUNK entries in all, at most: lists of one entry more have two.
const CHUNKS: u32 = 2;

pub(super) const N_ZEROS: usize = 12;

/// The chunks of a picture's long lists, and what each leaves for every pixel of its tile.
pub(super) struct Chunks {
    /// Grids: over chunks and tiles, over chunks, over long lists; the fourth word of each counts its items.
    pub args: Buf<u32>,
    pub items: Buf<[u32; 2]>,
    // Of each long list, tile and first chunk.
    long_lists: Buf<[u32; 2]>,
    pub light: Buf<f32>,
    /// Colour, and transmittance with the sign of whether the pixel goes on; later the colours behind instead.
    pub image0: Buf<[f32; 4]>,
    /// The same of depth, inverse depth and flow; `image0` where nobody asks for them.
    pub image1: Buf<[f32; 4]>,
    /// Number of the last entry added; `image0` where no backward pass follows.
    pub last: Buf<u32>,
}

impl Chunks {
    /// Room for the chunks of all lists of up to `intersections` entries together.
    pub fn new(gpu: &Gpu, intersections: u32, outputs: Outputs, purpose: Purpose, zeros: &mut Zeros) -> Result<Self> {
        let n = (u64::from(CHUNKS) * u64::from(intersections) / u64::from(CHUNK)) as usize;
        let pixels = n * TILE_PIXELS as usize;
        let image0: Buf<[f32; 4]> = gpu.alloc("chunk color", pixels)?;
        let has_image1 = outputs == Outputs::All;
        Ok(Chunks {
            args: zeros.take(N_ZEROS),
            items: gpu.alloc("chunks", n)?,
            long_lists: gpu.alloc("long lists", n)?,
            light: gpu.alloc("chunk light", pixels)?,
            image1: if has_image1 { gpu.alloc("chunk depth flow", pixels)? } else { image0.clone() },
            last: if purpose == Purpose::Picture { image0.cast() } else { gpu.alloc("chunk last", pixels)? },
            image0,
        })
    }

    pub fn grid(&self) -> Grid {
        self.indirect(CHUNK_ALL)
    }

    fn indirect(&self, at: u32) -> Grid {
        Grid::Indirect(self.args.range(4 * at as usize, 4).slice())
    }

    pub fn record_list(&self, rec: &mut Recording, tiles: &Tiles, lists: &Lists, eye: ViewBuffers, n_tiles: u32) {
        let Chunks { args: chunk_args, items: chunk_items, long_lists, light: chunk_light, .. } = self;
        let (tile_first, tile_last) = (&tiles.tile_first, &tiles.tile_last);
        rec.pass(
            chunk_list::Args { tile_first, tile_last, chunk_args, chunk_items, long_lists },
            chunk_list::Push { n_tiles },
            Grid::Threads(n_tiles),
        );
        let (view, splat_ids, splats) = (eye.view, &lists.splat_ids, &eye.projected.splats);
        rec.pass(
            chunk_light::Args { view, chunk_args, chunk_items, tile_first, tile_last, splat_ids, splats, chunk_light },
            (),
            self.indirect(CHUNK_ITEMS),
        );
    }

    /// Appends the merging of the blended chunks into the images of `blend` and, before a backward pass, its tail.
    pub fn record_merge(&self, rec: &mut Recording, tiles: &Tiles, eye: ViewBuffers, blend: &Blend) {
        let Blend { image0, image1, tail, .. } = blend;
        let no_tail = image0.cast();
        let args = blend_merge::Args {
            view: eye.view,
            chunk_args: &self.args,
            long_lists: &self.long_lists,
            tile_first: &tiles.tile_first,
            tile_last: &tiles.tile_last,
            chunk0: &self.image0,
            chunk1: &self.image1,
            chunk_last: &self.last,
            image0,
            image1: image1.as_ref().unwrap_or(image0),
            tail: tail.as_ref().unwrap_or(&no_tail),
        };
        let kernel = generated::blend_merge(tail.is_some(), image1.is_none());
        rec.pass_variant(kernel, args, (), self.indirect(CHUNK_LONG));
    }
}
