//! The scene that the project ships.

use super::Folder;
use crate::common::prelude::*;

fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

#[test]
fn the_demo_is_the_same_bytes_everywhere() {
    let folder = Folder::new("demo");
    let (scene, views) = demo();
    let (ply, json) = (folder.file("scene.ply"), folder.file("cameras.json"));
    write_ply(&ply, &scene).unwrap();
    write_views(&json, &views).unwrap();
    assert_eq!(read_ply(&ply).unwrap(), scene);
    assert_eq!(read_views(&json).unwrap(), views);
    let bytes = fs::read(&ply).unwrap();
    assert!(bytes.len() < 700_000, "{} bytes", bytes.len());
    assert_eq!(hash(&bytes), SCENE, "the scene changed: look at it, then note its new hash {:#x}", hash(&bytes));
    let bytes = fs::read(&json).unwrap();
    assert_eq!(hash(&bytes), VIEWS, "the views changed: look at them, then note their new hash {:#x}", hash(&bytes));
}

const SCENE: u64 = 0xc366_68ba_f6ff_1e6a;
const VIEWS: u64 = 0x6f34_945a_b705_83c4;

#[test]
fn the_demo_shows_both_populations_to_every_view() {
    let (scene, views) = demo();
    scene.check().unwrap();
    assert!((4_500..6_000).contains(&scene.len()));
    assert!(scene.motion.len() > 500 && scene.n_static > 3_000);
    assert!(scene.motion.iter().any(|m| m.velocity != [0.0; 3]), "nothing moves");
    assert!(scene.motion.iter().any(|m| m.velocity == [0.0; 3] && m.t_scale.exp() < 0.5), "nothing fades");
    let summary = scene.summary();
    assert_eq!(summary.n_non_finite, 0);
    assert_eq!(views.len(), 8);
    for view in &views {
        let [right, down, forward, _] = view.pose.rows();
        let mut seen = [0, 0];
        for (i, p) in scene.position.iter().enumerate() {
            let motion = i.checked_sub(scene.n_static).map(|d| scene.motion[d]);
            let at: [f64; 3] = std::array::from_fn(|k| {
                let step = motion.map_or(0.0, |m| f64::from(m.velocity[k]) * (view.time - f64::from(m.t_center)));
                f64::from(p[k]) + step
            });
            let [x, y, z] = [right, down, forward].map(|r| r[0] * at[0] + r[1] * at[1] + r[2] * at[2] + r[3]);
            let (u, v) =
                (view.intrinsics.fx * x / z + view.intrinsics.cx, view.intrinsics.fy * y / z + view.intrinsics.cy);
            if z > 0.1 && (0.0..320.0).contains(&u) && (0.0..240.0).contains(&v) {
                seen[usize::from(motion.is_some())] += 1;
            }
        }
        assert!(seen[0] > 2_000 && seen[1] > 400, "{} sees {seen:?} static and dynamic Gaussians", view.name);
    }
}
