//! The decode-ahead cache.

use super::{Folder, dynamic, png};
use crate::common::prelude::*;
use ivv::internals::scene::capture::{Asked, FrameCache};

/// Bytes of a decoded image of the captures here; one that is being decoded counts twice.
const IMAGE: u64 = 6 * 4 * 4;

/// Three cameras, four frames, an epoch for each of `n_epochs` in random order.
fn capture(test: &str, n_epochs: usize) -> (Folder, Capture, Vec<(usize, u32)>) {
    let folder = Folder::new(test);
    dynamic::write(&folder, 4);
    let capture = folder.open();
    let mut random = Random::new(5);
    let mut order = Vec::new();
    for _ in 0..n_epochs {
        let mut epoch = [capture.training_frames(), capture.test_frames()].concat();
        for at in (1..epoch.len()).rev() {
            epoch.swap(at, (random.bits() % (at as u64 + 1)) as usize);
        }
        order.extend(epoch);
    }
    assert_eq!(order.len(), 12 * n_epochs);
    (folder, capture, order)
}

#[test]
fn pictures_come_in_order_for_any_budget_and_number_of_threads() {
    let (_folder, capture, order) = capture("cache-order", 5);
    for n_threads in [0, 1, 2, 7] {
        for budget in [0, 1, 2 * IMAGE, 5 * IMAGE, 14 * IMAGE, u64::MAX / 2] {
            let mut cache =
                FrameCache::new(&capture, order.iter().copied(), &PriorPlan::default(), budget, n_threads).unwrap();
            for &(camera, frame) in &order {
                let picture = cache.next_picture().unwrap().unwrap();
                assert_eq!(*picture, capture.picture(camera, frame).unwrap(), "{camera} {frame}");
            }
            assert!(cache.next_picture().is_none() && cache.next_picture().is_none());
            let stats = cache.stats();
            assert!(stats.peak_bytes > 0 && stats.peak_bytes <= budget.max(2 * IMAGE), "{stats:?} in {budget}");
            assert_eq!(stats.n_decoded + stats.n_hits, order.len() as u64);
            assert!(stats.n_decoded >= 12);
        }
    }
}

#[test]
fn an_image_that_fits_is_decoded_once() {
    let (_folder, capture, order) = capture("cache-once", 6);
    // The last image is decoded beside the eleven others.
    let mut cache = FrameCache::new(&capture, order.clone(), &PriorPlan::default(), 13 * IMAGE, 1).unwrap();
    while let Some(picture) = cache.next_picture() {
        picture.unwrap();
    }
    assert_eq!(cache.stats().n_decoded, 12);
    assert_eq!(cache.stats().n_hits, order.len() as u64 - 12);
}

#[test]
fn an_image_is_reduced_where_it_is_decoded_and_takes_the_smaller_room() {
    let (_folder, capture, order) = capture("cache-reduced", 2);
    // The same image whole and reduced, and by more than its shorter side.
    let asked: Vec<Asked> = order
        .iter()
        .flat_map(|&(camera, frame)| [1, 2, 9].map(|reduction| Asked { camera, frame, reduction }))
        .collect();
    let mut cache = FrameCache::new(&capture, asked.clone(), &PriorPlan::default(), u64::MAX / 2, 2).unwrap();
    for Asked { camera, frame, reduction } in asked {
        let whole = capture.picture(camera, frame).unwrap();
        let expected = if reduction == 1 { whole } else { whole.reduced(reduction.min(4)) };
        assert_eq!(*cache.next_picture().unwrap().unwrap(), expected, "{camera} {frame} by {reduction}");
    }
    assert_eq!(cache.stats().n_decoded, 36);

    let halves = order.iter().map(|&(camera, frame)| Asked { camera, frame, reduction: 2 });
    // A quarter of the pixels each, beside the one that is being decoded.
    let room = 12 * IMAGE / 4 + 2 * IMAGE;
    let mut cache = FrameCache::new(&capture, halves, &PriorPlan::default(), room, 1).unwrap();
    while let Some(picture) = cache.next_picture() {
        picture.unwrap();
    }
    assert_eq!((cache.stats().n_decoded, cache.stats().n_hits), (12, order.len() as u64 - 12));
}

#[test]
fn what_is_needed_last_leaves_first() {
    let (_folder, capture, _) = capture("cache-last", 1);
    // Twelve images in turn and room for ten: were the least recently used to leave, each would be decoded every time.
    let round: Vec<_> = [capture.training_frames(), capture.test_frames()].concat();
    let order = round.repeat(6);
    let mut cache = FrameCache::new(&capture, order.clone(), &PriorPlan::default(), 10 * IMAGE, 1).unwrap();
    for _ in &order {
        cache.next_picture().unwrap().unwrap();
    }
    let stats = cache.stats();
    assert!(stats.n_hits >= 15 && stats.n_decoded > 12, "{stats:?}");
}

#[test]
fn errors_come_in_order_and_name_the_file() {
    let (folder, capture, order) = capture("cache-errors", 3);
    let broken = [(0, 1), (2, 3)];
    let start = png(6, 4, 0);
    folder.write("ims/0/000001.png", &start[..start.len() / 2]);
    folder.write("ims/2/000003.png", png(4, 6, 0));
    for budget in [0, 4 * IMAGE, 100 * IMAGE] {
        let mut cache = FrameCache::new(&capture, order.clone(), &PriorPlan::default(), budget, 3).unwrap();
        let mut n_errors = 0;
        for &(camera, frame) in &order {
            match cache.next_picture().unwrap() {
                Ok(picture) => assert_eq!(*picture, capture.picture(camera, frame).unwrap()),
                Err(error) => {
                    assert!(broken.contains(&(camera, frame)), "{error}");
                    let name = format!("ims/{camera}/{frame:06}.png");
                    assert!(error.exit_code() == 3 && error.to_string().contains(&name), "{error}");
                    n_errors += 1;
                }
            }
        }
        assert_eq!(n_errors, 6);
    }
}

#[test]
fn a_cache_may_be_dropped_at_any_time_and_refuses_an_unknown_frame() {
    let (_folder, capture, order) = capture("cache-drop", 2);
    for n_taken in [0, 1, 5, 24] {
        let mut cache = FrameCache::new(&capture, order.clone(), &PriorPlan::default(), 3 * IMAGE, 4).unwrap();
        for _ in 0..n_taken {
            cache.next_picture().unwrap().unwrap();
        }
    }
    assert!(FrameCache::new(&capture, [(0, 0); 0], &PriorPlan::default(), 0, 2).unwrap().next_picture().is_none());
    let error = FrameCache::new(&capture, [(0, 0), (0, 4)], &PriorPlan::default(), 0, 2).err().unwrap();
    assert!(error.to_string().contains("camera 0, frame 4"), "{error}");
}
