//! The pictures that steps compare with, on the device: there for one step, or kept for all steps that look at them.

use super::terms::TermData;
use crate::error::Result;
use crate::gpu::{Buf, Gpu, Recording, Slice, Staging};
use crate::scene::capture::{Asked, Picture};
use crate::stage::{NO_PRIOR, PriorPlanes};
use std::collections::HashMap;

/// The picture of a step.
#[derive(Clone, Copy)]
pub(super) enum Shot<'a> {
    /// It is copied to the device for this step alone.
    Passes(&'a Picture),
    /// It is copied to the device and stays there under this name, if the device has the memory.
    Stays(Asked, &'a Picture),
    /// It has stayed there.
    Stayed(Asked),
    /// It has stayed there, and leaves with this step.
    Leaves(Asked),
}

/// What a step must know of its picture without looking at it.
#[derive(Clone, Copy)]
pub(super) struct Counts {
    /// Width and height.
    pub size: [u32; 2],
    /// As in [`Picture`], but at least 1.
    pub n_visible: u32,
    /// As in [`Picture`].
    pub n_depth: u32,
    /// As in [`Picture`].
    pub n_flow: u32,
}

/// Where the planes of a picture lie in one buffer, in words: each as a binding can begin.
#[derive(Clone, Copy)]
struct Layout {
    pixels: usize,
    /// First word of the depths; none without any.
    depths: Option<usize>,
    /// First word of the flows; none without any.
    flows: Option<usize>,
    /// All words.
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

/// A picture in the device's memory.
pub(super) struct Planes {
    /// RGB and the mask in the top byte, 8 bits each, row-major.
    pub colors: Buf<u32>,
    pub priors: PriorPlanes,
}

/// A picture that stays.
#[derive(Clone)]
struct Kept {
    counts: Counts,
    layout: Layout,
    place: Buf<u32>,
}

/// The picture of a step as the device gets it.
pub(super) struct Loaded {
    pub counts: Counts,
    layout: Layout,
    /// In staging memory; none of what is on the device already.
    staged: Option<Slice>,
    /// Where it stays; none where it passes.
    place: Option<Buf<u32>>,
}

/// The pictures on the device.
pub(super) struct Images {
    data: TermData,
    /// Where pictures lie that pass.
    passing: Buf<u32>,
    none: Buf<u32>,
    kept: HashMap<Asked, Kept>,
}

impl Images {
    /// Of a run whose terms of the loss take `data` beside the colours.
    pub fn new(gpu: &Gpu, data: TermData) -> Result<Self> {
        let none = gpu.upload("no prior", &[NO_PRIOR])?;
        Ok(Images { data, passing: gpu.alloc("truth", 1)?, none, kept: HashMap::new() })
    }

    /// Room for pictures of `pixels` pixels that pass.
    pub fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        self.passing = gpu.alloc("truth", Layout::new(gpu, pixels, self.data).words)?;
        Ok(())
    }

    /// Takes a picture to where the device copies it from; none where `shot` names one that is not there. One that stays is there for
    /// the images that follow, of the same step too, so the step is to be recorded.
    pub fn load(&mut self, gpu: &Gpu, staging: &Staging, shot: Shot) -> Result<Option<Loaded>> {
        let (picture, name) = match shot {
            Shot::Passes(picture) => (picture, None),
            Shot::Stays(name, picture) => (picture, Some(name)),
            Shot::Stayed(name) => return Ok(self.kept.get(&name).cloned().map(Loaded::from)),
            Shot::Leaves(name) => return Ok(self.kept.remove(&name).map(Loaded::from)),
        };
        let Picture { width, height, n_visible, n_depth, n_flow, .. } = *picture;
        let counts = Counts { size: [width, height], n_visible: n_visible.max(1), n_depth, n_flow };
        let used = TermData { depth: self.data.depth && n_depth > 0, flow: self.data.flow && n_flow > 0 };
        let layout = Layout::new(gpu, picture.pixels.len(), used);
        let place = match name.map(|_| gpu.alloc("kept images", layout.words)) {
            // Then it passes.
            Some(Err(error)) if error.is_out_of_memory() => None,
            place => place.transpose()?,
        };
        let of_depth = layout.depths.map(|first| (first, bytemuck::cast_slice(&picture.depth)));
        let of_flow = layout.flows.map(|first| (first, bytemuck::cast_slice(&picture.flow)));
        let colors = Some((0, bytemuck::cast_slice(&picture.pixels)));
        let parts: Vec<(usize, &[u8])> = [colors, of_depth, of_flow].into_iter().flatten().collect();
        let staged = staging.staged_words("staged truth", layout.words, &parts)?;
        if let (Some(name), Some(place)) = (name, &place) {
            self.kept.insert(name, Kept { counts, layout, place: place.clone() });
        }
        Ok(Some(Loaded { counts, layout, staged: Some(staged), place }))
    }

    fn place<'a>(&'a self, loaded: &'a Loaded) -> &'a Buf<u32> {
        loaded.place.as_ref().unwrap_or(&self.passing)
    }

    /// Where the picture of a step lies.
    pub fn planes(&self, loaded: &Loaded) -> Planes {
        let (place, Layout { pixels, depths, flows, .. }) = (self.place(loaded), loaded.layout);
        let prior = |first: Option<usize>, length: usize| {
            first.map_or_else(|| self.none.clone(), |first| place.range(first, length))
        };
        let priors = PriorPlanes { depths: prior(depths, pixels.div_ceil(2)), flows: prior(flows, pixels) };
        Planes { colors: place.range(0, pixels), priors }
    }

    /// Appends the copy of what [`Images::load`] gave.
    pub fn record_upload(&self, rec: &mut Recording, loaded: &Loaded) {
        if let Some(staged) = &loaded.staged {
            rec.copy(staged.clone(), self.place(loaded).range(0, loaded.layout.words).slice());
        }
    }

    /// Whether the picture of this name is there.
    pub fn has(&self, name: &Asked) -> bool {
        self.kept.contains_key(name)
    }

    /// Bytes of the pictures that are kept.
    pub fn kept_bytes(&self) -> u64 {
        self.kept.values().map(|kept| kept.place.slice().size()).sum()
    }

    /// Gives up the memory of the pictures that are kept; says whether there were any. Steps on the device keep theirs.
    pub fn release(&mut self) -> bool {
        !std::mem::take(&mut self.kept).is_empty()
    }

    /// Takes over the pictures that `other` keeps, of the same run.
    pub fn inherit(&mut self, other: &mut Images) {
        self.kept = std::mem::take(&mut other.kept);
    }
}

impl From<Kept> for Loaded {
    fn from(Kept { counts, layout, place }: Kept) -> Self {
        Loaded { counts, layout, staged: None, place: Some(place) }
    }
}
