//! What a scene holds, in numbers.

use super::{Folder, sample};
use crate::common::prelude::*;

#[test]
fn a_summary_counts_populations_bytes_and_faults() {
    let folder = Folder::new("summary");
    let mut scene = sample(2, 5, 3);
    scene.position[1][2] = f32::NAN;
    scene.motion[2].velocity[0] = f32::INFINITY;
    scene.motion[1].t_scale = f32::INFINITY;
    scene.position[0] = [-10.0, 20.0, 30.0];
    scene.motion[0].t_center = -7.0;
    scene.motion[1].t_center = 9.0;
    let summary = scene.summary();
    assert_eq!((summary.n, summary.n_static, summary.n_dynamic, summary.sh_degree), (8, 5, 3, 2));
    assert_eq!(summary.n_non_finite, 2);
    assert_eq!(summary.device.geometry, 8 * 48);
    assert_eq!(summary.device.motion, 3 * 16);
    assert_eq!(summary.device.sh_bands, [8 * 16, 8 * 48, 8 * 64]);
    assert_eq!(summary.device.total, 8 * (48 + 128) + 48);
    let bounds = summary.bounds.unwrap();
    assert_eq!((bounds.min[0], bounds.max[1], bounds.max[2]), (-10.0, 20.0, 30.0));
    assert_eq!(summary.time_range, Some([-7.0, 9.0]));
    let opacity = summary.opacity.unwrap();
    assert!(0.0 < opacity.min && opacity.min < opacity.p50 && opacity.p50 < opacity.max && opacity.max < 1.0);
    let scale = summary.scale.unwrap();
    assert!(0.0 < scale.min && scale.p01 <= scale.p25 && scale.p75 <= scale.p99 && scale.p99 <= scale.max);
    let path = folder.file("scene.ply");
    write_ply(&path, &scene).unwrap();
    let file = std::fs::read(&path).unwrap();
    let header = file.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    assert_eq!(summary.ply_bytes, (file.len() - header) as u64);
    assert_eq!(summary.ply_bytes_per_gaussian * 8, summary.ply_bytes);
    // With spans too.
    scene.span = vec![[0.0, 0.5]; 3];
    write_ply(&path, &scene).unwrap();
    let (file, summary) = (std::fs::read(&path).unwrap(), scene.summary());
    let header = file.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    assert_eq!(summary.ply_bytes, (file.len() - header) as u64);
    let text = serde_json::to_string(&summary).unwrap();
    assert!(text.contains("\"n_dynamic\":3"), "{text}");
}

#[test]
fn quantiles_are_of_the_nearest_rank() {
    let mut scene = sample(0, 101, 0);
    scene.position = (0..101).map(|i| [i as f32, -(i as f32), 0.5]).collect();
    let bounds = scene.summary().bounds.unwrap();
    assert_eq!((bounds.min, bounds.p01), ([0.0, -100.0, 0.5], [1.0, -99.0, 0.5]));
    assert_eq!((bounds.p99, bounds.max), ([99.0, -1.0, 0.5], [100.0, 0.0, 0.5]));
}

#[test]
fn an_empty_scene_has_a_summary() {
    let summary = Splats::new(3).summary();
    assert_eq!((summary.n, summary.n_non_finite, summary.device.total, summary.ply_bytes), (0, 0, 0, 0));
    assert!(summary.bounds.is_none() && summary.opacity.is_none() && summary.time_range.is_none());
}
