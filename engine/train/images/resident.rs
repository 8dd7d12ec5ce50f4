//! The pictures that steps compare with, on the device: for one step, or for all steps that need them.

use crate::error::Result;
use crate::gpu::{Buf, Gpu, Recording, Slice, Staging};
use crate::internals::train::TermData;
use crate::scene::capture::{Asked, Picture};
use crate::stage::{NO_PRIOR, PriorPlanes};
use std::collections::HashMap;

/// A picture's size, and how many of its pixels count.
#[derive(Clone, Copy)]
pub struct Counts {
    pub size: [u32; 2],
    /// As in [`Picture`], but at least 1.
    pub n_visible: u32,
    pub n_depth: u32,
    pub n_flow: u32,
}

/// Where the planes of a picture lie in one buffer, in words; none where there are none. Each is as a binding can begin.
#[derive(Clone, Copy)]
struct Layout {
    pixels: usize,
    depths: Option<usize>,
    flows: Option<usize>,
    words: usize,
}

impl Layout {
    fn new(gpu: &Gpu, pixels: usize, data: TermData) -> Self {
        let alignment = gpu.caps().storage_alignment.div_ceil(4) as usize;
        let mut words = pixels;
        let mut plane = |is_there: bool, length: usize| {
            let first = words.next_multiple_of(alignment);
            words = if is_there { first + length } else { words };
            is_there.then_some(first)
        };
        let depths = plane(data.depth, pixels.div_ceil(2));
        let flows = plane(data.flow, pixels);
        Layout { pixels, depths, flows, words }
    }
}

pub struct Planes {
    /// RGB and the mask in the top byte, 8 bits each, row-major.
    pub colors: Buf<u32>,
    pub priors: PriorPlanes,
}

/// A picture that is on the device, or ready to be copied there.
#[derive(Clone)]
pub struct Resident {
    pub counts: Counts,
    layout: Layout,
    /// In staging memory, where it is not on the device yet.
    staged: Option<Slice>,
    /// Where it stays on the device; none if it passes.
    place: Option<Buf<u32>>,
}

pub struct Residents {
    data: TermData,
    passing: Buf<u32>,
    none: Buf<u32>,
    kept: HashMap<Asked, Resident>,
}

impl Residents {
    /// Keeps images for a run that uses `data` beside the colours.
    pub fn new(gpu: &Gpu, data: TermData) -> Result<Self> {
        let none = gpu.upload("no prior", &[NO_PRIOR])?;
        Ok(Residents { data, passing: gpu.alloc("truth", 1)?, none, kept: HashMap::new() })
    }

    pub fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        self.passing = gpu.alloc("truth", Layout::new(gpu, pixels, self.data).words)?;
        Ok(())
    }

    #[tracing::instrument(level = "debug", name = "upload", skip_all)]
    pub fn pass(&self, gpu: &Gpu, staging: &Staging, picture: &Picture) -> Result<Resident> {
        let (counts, layout) = self.layout(gpu, picture);
        let staged = Some(staged(staging, picture, &layout)?);
        Ok(Resident { counts, layout, staged, place: None })
    }

    /// Stages a picture that stays on the device as `name`, if there is memory; for one step otherwise. The images that
    /// follow count on it, so the step is to be recorded.
    #[tracing::instrument(level = "debug", name = "upload", skip_all)]
    pub fn keep(&mut self, gpu: &Gpu, staging: &Staging, name: Asked, picture: &Picture) -> Result<Resident> {
        let (counts, layout) = self.layout(gpu, picture);
        let place = match gpu.alloc("kept images", layout.words) {
            Err(error) if error.is_out_of_memory() => None,
            place => Some(place?),
        };
        let staged = Some(staged(staging, picture, &layout)?);
        let kept = Resident { counts, layout, staged: None, place };
        if kept.place.is_some() {
            self.kept.insert(name, kept.clone());
        }
        Ok(Resident { staged, ..kept })
    }

    pub fn get(&self, name: &Asked) -> Option<Resident> {
        self.kept.get(name).cloned()
    }

    /// For the last step of the picture.
    pub fn take(&mut self, name: &Asked) -> Option<Resident> {
        self.kept.remove(name)
    }

    fn layout(&self, gpu: &Gpu, picture: &Picture) -> (Counts, Layout) {
        let Picture { width, height, n_visible, n_depth, n_flow, .. } = *picture;
        let counts = Counts { size: [width, height], n_visible: n_visible.max(1), n_depth, n_flow };
        let used = TermData { depth: self.data.depth && n_depth > 0, flow: self.data.flow && n_flow > 0 };
        let layout = Layout::new(gpu, picture.pixels.len(), used);
        (counts, layout)
    }

    fn place<'a>(&'a self, resident: &'a Resident) -> &'a Buf<u32> {
        resident.place.as_ref().unwrap_or(&self.passing)
    }

    pub fn planes(&self, resident: &Resident) -> Planes {
        let place = self.place(resident);
        let Layout { pixels, depths, flows, .. } = resident.layout;
        let prior = |first: Option<usize>, length: usize| {
            first.map_or_else(|| self.none.clone(), |first| place.range(first, length))
        };
        let priors = PriorPlanes { depths: prior(depths, pixels.div_ceil(2)), flows: prior(flows, pixels) };
        Planes { colors: place.range(0, pixels), priors }
    }

    pub fn record_upload(&self, rec: &mut Recording, resident: &Resident) {
        if let Some(staged) = &resident.staged {
            rec.copy(staged.clone(), self.place(resident).range(0, resident.layout.words).slice());
        }
    }

    pub fn bytes(&self) -> u64 {
        self.kept.values().filter_map(|kept| kept.place.as_ref()).map(|place| place.slice().size()).sum()
    }

    /// Frees the pictures that are kept; false where there are none. Steps on the device keep theirs.
    pub fn release(&mut self) -> bool {
        !std::mem::take(&mut self.kept).is_empty()
    }

    pub fn inherit(&mut self, other: &mut Residents) {
        self.kept = std::mem::take(&mut other.kept);
    }
}

fn staged(staging: &Staging, picture: &Picture, layout: &Layout) -> Result<Slice> {
    let of_depth = layout.depths.map(|first| (first, bytemuck::cast_slice(&picture.depth)));
    let of_flow = layout.flows.map(|first| (first, bytemuck::cast_slice(&picture.flow)));
    let colors = Some((0, bytemuck::cast_slice(&picture.pixels)));
    let parts: Vec<(usize, &[u8])> = [colors, of_depth, of_flow].into_iter().flatten().collect();
    staging.staged_words("staged truth", layout.words, &parts)
}
