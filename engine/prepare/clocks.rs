//! By how much the clocks of cameras differ, where a source knows: written beside the capture, so that what training learns
//! can be compared with it.

use std::collections::BTreeMap;

use super::images::Images;
use super::source::{Clocks, Source};

/// By camera, the frames of the capture by which its pictures show a later time than their number says. Measured times have no
/// zero of their own: the mean camera's are taken. A camera whose clock is not known at a chosen frame is left out.
pub(super) fn true_offsets(source: &Source, images: &Images) -> BTreeMap<String, f64> {
    let select = images.select();
    let every = f64::from(select.every);
    match &source.clocks {
        Clocks::Unknown => BTreeMap::new(),
        Clocks::Offsets(offsets) => {
            let shifted = images.cameras.iter().filter_map(|camera| {
                let shift = f64::from(camera.start) - f64::from(select.start);
                Some((camera.name.clone(), (offsets.get(&camera.name)? + shift) / every))
            });
            shifted.collect()
        }
        Clocks::Times(times) => {
            let at = |start: u32, i: u32| start as usize + (i * select.every) as usize;
            let mean_time = |times: &Vec<Option<f64>>, start: u32| -> Option<f64> {
                let sum: Option<f64> = (0..select.n).map(|i| times.get(at(start, i)).copied().flatten()).sum();
                Some(sum? / f64::from(select.n))
            };
            let known = images.cameras.iter().filter_map(|camera| {
                let frames = mean_time(times.get(&camera.name)?, camera.start)? * images.fps;
                Some((camera.name.clone(), frames))
            });
            let mut offsets: BTreeMap<String, f64> = known.collect();
            let mean = offsets.values().sum::<f64>() / offsets.len().max(1) as f64;
            offsets.values_mut().for_each(|offset| *offset -= mean);
            offsets
        }
    }
}
