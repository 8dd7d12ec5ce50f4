//! OpenEXR priors: channels by their usual names.

use std::io::BufReader;
use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel, Vec2};

use crate::error::{Error, Result};
use crate::files::{cannot_read, open_file};
use crate::scene::capture::header::guarded;

/// Channels of flow and depth; the first that are present are read.
const FLOW: &[Channels] = &[&["flow.X", "flow.Y"], &["u", "v"], &["U", "V"], &["X", "Y"], &["R", "G"]];
const DEPTH: &[Channels] = &[&["depth.Z"], &["Z"], &["depth"], &["Y"], &["R"]];
/// Most channels of a layer: the decoder unpacks all of them.
const MAX_CHANNELS: usize = 64;
const REMEDY: &str = "make or copy the file again";

pub(super) type Channels = &'static [&'static str];

/// Size and channels of the first layer that has what is wanted.
pub(super) fn header(path: &Path, channels: usize) -> Result<((u32, u32), Channels)> {
    let file = BufReader::new(open_file(path).map_err(|cause| cannot_read(path, &cause))?);
    let meta = guarded(path, || Ok(MetaData::read_from_buffered(file, false)))?;
    let meta = meta.map_err(|cause| fault(path, format!("has a broken header: {cause}")))?;
    let wanted = if channels == 2 { FLOW } else { DEPTH };
    for names in wanted {
        for layer in meta.headers.iter().filter(|layer| !layer.deep) {
            let has = |name: &&str| layer.channels.list.iter().any(|channel| channel.name == **name);
            if !names.iter().all(has) {
                continue;
            }
            if layer.channels.list.len() > MAX_CHANNELS {
                return Err(fault(path, format!("has a layer of more than {MAX_CHANNELS} channels")));
            }
            let side = |side: usize| u32::try_from(side).ok().filter(|side| *side > 0);
            let size = side(layer.layer_size.x()).zip(side(layer.layer_size.y()));
            return size.map(|size| (size, *names)).ok_or_else(|| fault(path, "has no pixels"));
        }
    }
    let names: Vec<String> = wanted.iter().map(|names| names.join(" and ")).collect();
    Err(Error::data(path, "", "has none of the channels looked for", format!("name them {}", names.join(", or "))))
}

pub(super) fn read<const N: usize>(path: &Path, size: (u32, u32), names: Channels) -> Result<Vec<[f32; N]>> {
    let width = size.0 as usize;
    let n_pixels = width * size.1 as usize;
    let empty = move || vec![[f32::NAN; N]; n_pixels];
    let set = move |pixels: &mut Vec<[f32; N]>, at: Vec2<usize>, value: [f32; N]| {
        if let Some(pixel) = pixels.get_mut(at.y() * width + at.x()) {
            *pixel = value;
        }
    };
    let reader = || exr::prelude::read().no_deep_data().largest_resolution_level().specific_channels();
    let pixels = guarded(path, || {
        Ok(match *names {
            [x, y] => {
                let channels = reader().required(x).required(y);
                let pair =
                    move |pixels: &mut _, at, (x, y): (f32, f32)| set(pixels, at, std::array::from_fn(|k| [x, y][k]));
                let image = channels.collect_pixels(move |_, _| empty(), pair).first_valid_layer().all_attributes();
                image.non_parallel().from_file(path).map(|image| image.layer_data.channel_data.pixels)
            }
            _ => {
                let channels = reader().required(names[0]);
                let one = move |pixels: &mut _, at, (value,): (f32,)| set(pixels, at, [value; N]);
                let image = channels.collect_pixels(move |_, _| empty(), one).first_valid_layer().all_attributes();
                image.non_parallel().from_file(path).map(|image| image.layer_data.channel_data.pixels)
            }
        })
    })?;
    pixels.map_err(|cause| fault(path, format!("does not decode: {cause}")))
}

fn fault(path: &Path, reason: impl Into<String>) -> Error {
    Error::data(path, "", reason, REMEDY)
}
