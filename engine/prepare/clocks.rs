//! By how much the clocks of cameras differ, where a source knows: written beside the capture, so that what training learns
//! can be compared with it.

use std::collections::BTreeMap;

use super::images::Images;
use super::source::{Clocks, Source};

/// By camera, the frames of the capture by which its pictures show a later time than their number says. Measured times have no
/// zero of their own: the mean camera's are taken. A camera whose clock is not known at a chosen frame is left out. Where sound told the
/// shifts, it is what of them is less than a frame.
pub(super) fn true_offsets(source: &Source, images: &Images) -> BTreeMap<String, f64> {
    let select = images.select();
    let every = f64::from(select.every);
    match &source.clocks {
        Clocks::Unknown => images.rests.clone(),
        Clocks::Offsets(offsets) => {
            let shifted = images.cameras.iter().filter_map(|camera| {
                let shift = f64::from(camera.start) - f64::from(select.start);
                Some((camera.name.clone(), (offsets.get(&camera.name)? + shift) / every))
            });
            shifted.collect()
        }
        Clocks::Times(times) => {
            let known = images.cameras.iter().filter_map(|camera| {
                let times = times.get(&camera.name)?;
                let frames = (0..select.n).filter(|frame| camera.has(*frame));
                let late = |frame: u32| {
                    let time = times.get(camera.source_frame(frame, select.every)? as usize).copied().flatten()?;
                    Some(time * images.fps - f64::from(frame))
                };
                let late: Vec<f64> = frames.map(late).collect::<Option<_>>()?;
                Some((camera.name.clone(), late.iter().sum::<f64>() / late.len().max(1) as f64))
            });
            let mut offsets: BTreeMap<String, f64> = known.collect();
            let mean = offsets.values().sum::<f64>() / offsets.len().max(1) as f64;
            offsets.values_mut().for_each(|offset| *offset -= mean);
            offsets
        }
    }
}
