//! The pictures that steps compare with, on the device: for one step, or for all steps that need them.

use crate::error::Result;
use crate::gpu::{Buf, Gpu, Recording, Slice, Staging};
use crate::internals::train::terms::TermData;
use crate::scene::capture::{Asked, Picture};
use crate::stage::{NO_PRIOR, PriorPlanes};
use std::collections::HashMap;

/// The size of a picture, and how many of its pixels count.
#[derive(Clone, Copy)]
pub(in crate::internals::train) struct Counts {
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
pub(in crate::internals::train) struct Planes {
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

/// A picture that is on the device, or ready to be copied there.
pub(in crate::internals::train) struct Resident {
    pub counts: Counts,
    layout: Layout,
    /// In staging memory, where it is not on the device yet.
    staged: Option<Slice>,
    /// Where it stays on the device; none if it passes.
    place: Option<Buf<u32>>,
}

/// The pictures on the device.
pub(in crate::internals::train) struct Residents {
    data: TermData,
    /// Where pictures lie that pass.
    passing: Buf<u32>,
    none: Buf<u32>,
    kept: HashMap<Asked, Kept>,
}

impl Residents {
    /// For a run whose terms of the loss use `data` beside the colours.
    pub fn new(gpu: &Gpu, data: TermData) -> Result<Self> {
        let none = gpu.upload("no prior", &[NO_PRIOR])?;
        Ok(Residents { data, passing: gpu.alloc("truth", 1)?, none, kept: HashMap::new() })
    }

    /// Room for pictures of `pixels` pixels that pass.
    pub fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        self.passing = gpu.alloc("truth", Layout::new(gpu, pixels, self.data).words)?;
        Ok(())
    }

    /// Stages a picture for one step.
    #[tracing::instrument(level = "debug", name = "upload", skip_all)]
    pub fn pass(&self, gpu: &Gpu, staging: &Staging, picture: &Picture) -> Result<Resident> {
        let (counts, layout) = self.layout(gpu, picture);
        let staged = Some(staged(staging, picture, &layout)?);
        Ok(Resident { counts, layout, staged, place: None })
    }

    /// Stages a picture that stays on the device as `name`, if there is memory; for one step otherwise. The images that
    /// follow, of the same step too, count on it, so the step is to be recorded.
    #[tracing::instrument(level = "debug", name = "upload", skip_all)]
    pub fn keep(&mut self, gpu: &Gpu, staging: &Staging, name: Asked, picture: &Picture) -> Result<Resident> {
        let (counts, layout) = self.layout(gpu, picture);
        let place = match gpu.alloc("kept images", layout.words) {
            Err(error) if error.is_out_of_memory() => None,
            place => Some(place?),
        };
        let staged = Some(staged(staging, picture, &layout)?);
        if let Some(place) = &place {
            self.kept.insert(name, Kept { counts, layout, place: place.clone() });
        }
        Ok(Resident { counts, layout, staged, place })
    }

    /// The picture that stays as `name`.
    pub fn get(&self, name: &Asked) -> Option<Resident> {
        self.kept.get(name).cloned().map(Resident::from)
    }

    /// The picture that stayed as `name`, for its last step.
    pub fn take(&mut self, name: &Asked) -> Option<Resident> {
        self.kept.remove(name).map(Resident::from)
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

    /// Where the planes of a picture lie.
    pub fn planes(&self, resident: &Resident) -> Planes {
        let place = self.place(resident);
        let Layout { pixels, depths, flows, .. } = resident.layout;
        let prior = |first: Option<usize>, length: usize| {
            first.map_or_else(|| self.none.clone(), |first| place.range(first, length))
        };
        let priors = PriorPlanes { depths: prior(depths, pixels.div_ceil(2)), flows: prior(flows, pixels) };
        Planes { colors: place.range(0, pixels), priors }
    }

    /// Appends the copy of a picture that was staged.
    pub fn record_upload(&self, rec: &mut Recording, resident: &Resident) {
        if let Some(staged) = &resident.staged {
            rec.copy(staged.clone(), self.place(resident).range(0, resident.layout.words).slice());
        }
    }

    /// Bytes of the pictures that are kept.
    pub fn bytes(&self) -> u64 {
        self.kept.values().map(|kept| kept.place.slice().size()).sum()
    }

    /// Frees the memory of the pictures that are kept; false where there are none. Steps on the device keep theirs.
    pub fn release(&mut self) -> bool {
        !std::mem::take(&mut self.kept).is_empty()
    }

    /// Takes over the pictures that `other` keeps, of the same run.
    pub fn inherit(&mut self, other: &mut Residents) {
        self.kept = std::mem::take(&mut other.kept);
    }
}

impl From<Kept> for Resident {
    fn from(Kept { counts, layout, place }: Kept) -> Self {
        Resident { counts, layout, staged: None, place: Some(place) }
    }
}

/// Copies the planes of a picture into staging memory.
fn staged(staging: &Staging, picture: &Picture, layout: &Layout) -> Result<Slice> {
    let of_depth = layout.depths.map(|first| (first, bytemuck::cast_slice(&picture.depth)));
    let of_flow = layout.flows.map(|first| (first, bytemuck::cast_slice(&picture.flow)));
    let colors = Some((0, bytemuck::cast_slice(&picture.pixels)));
    let parts: Vec<(usize, &[u8])> = [colors, of_depth, of_flow].into_iter().flatten().collect();
    staging.staged_words("staged truth", layout.words, &parts)
}
