//! The estimates of flow and depth against the truth they are made from.

use super::{exr, json, options, shared};
use crate::common::prelude::*;

fn floats(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
}

#[test]
fn flow_files_hold_the_exact_flow_with_the_stated_noise() {
    let (mut n, mut squares, mut moving) = (0.0, 0.0, 0);
    for (camera, frame) in (0..4).flat_map(|camera| (0..options().frames).map(move |frame| (camera, frame))) {
        let path = shared().join(format!("flow/cam{camera:02}/{frame:05}.flo"));
        assert_eq!(path.exists(), frame + 1 < options().frames, "{}", path.display());
        if frame + 1 == options().frames {
            continue;
        }
        let bytes = fs::read(&path).unwrap();
        assert_eq!(&bytes[..4], b"PIEH");
        assert_eq!(bytes[4..12].as_chunks().0.map_le(), [options().width, options().height]);
        let truth = exr(&shared().join(format!("truth/exact/cam{camera:02}/{frame:05}.exr")));
        let flow = floats(&bytes[12..]);
        assert_eq!(flow.len(), 2 * truth["flow.X"].len());
        for (i, pair) in flow.chunks(2).enumerate() {
            let exact = [truth["flow.X"][i], truth["flow.Y"][i]].map(f64::from);
            let length = exact[0].hypot(exact[1]);
            let error = (pair[0] - exact[0]).hypot(pair[1] - exact[1]);
            let sd = 0.017 + 0.03 * length;
            assert!(error <= 3.465 * sd * 1.415, "{} pixel {i}: {error} at {length}", path.display());
            // SPEC 5 takes flow beyond 0.1 pixels for motion.
            assert!(length > 0.0 || pair[0].hypot(pair[1]) < 0.1);
            moving += u32::from(length > 1.0);
            squares += (error / sd).powi(2) / 2.0;
            n += 1.0;
        }
    }
    let spread = (squares / n).sqrt();
    assert!((0.97..1.03).contains(&spread) && moving > 200, "noise of {spread} times the stated, {moving} moving");
}

/// Numbers of a header.
trait Words {
    fn map_le(&self) -> Vec<u32>;
}

impl Words for [[u8; 4]] {
    fn map_le(&self) -> Vec<u32> {
        self.iter().map(|b| u32::from_le_bytes(*b)).collect()
    }
}

#[test]
fn depth_files_are_inverse_depth_up_to_the_hidden_scale_and_shift() {
    let truth = json(&shared().join("truth.json"));
    let mut scales = Vec::new();
    for (camera, frame) in (0..4).flat_map(|camera| (0..options().frames).map(move |frame| (camera, frame))) {
        let bytes = fs::read(shared().join(format!("depth/cam{camera:02}/{frame:05}.npy"))).unwrap();
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        let end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let header = std::str::from_utf8(&bytes[10..end]).unwrap();
        assert!(end % 64 == 0 && header.ends_with('\n') && header.contains("'shape': (36, 48)"), "{header:?}");
        let prior = floats(&bytes[end..]);
        let exact = exr(&shared().join(format!("truth/exact/cam{camera:02}/{frame:05}.exr")));
        let hidden = &truth["depth_scale_shift"][format!("cam{camera:02}")][frame as usize];
        let (scale, shift) = (hidden[0].as_f64().unwrap(), hidden[1].as_f64().unwrap());
        assert_eq!(prior.len(), exact["depth.Z"].len());
        for (prior, depth) in prior.iter().zip(&exact["depth.Z"]) {
            let relative = (scale * prior + shift) * f64::from(*depth) - 1.0;
            assert!(relative.abs() < 3.465 * 0.01 + 0.03 + 1e-5, "{relative} off at depth {depth}");
        }
        let deviation = prior.iter().map(|p| (p - prior[0]).abs()).fold(0.0, f64::max);
        assert!(deviation > 0.1, "the prior is nearly constant");
        scales.push(scale);
    }
    scales.sort_by(f64::total_cmp);
    assert!(scales.windows(2).all(|pair| pair[0] < pair[1]), "each picture has its own scale");
}
