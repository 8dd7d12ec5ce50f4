//! What a preparation will make, and about how long that takes, said before it begins.

use super::costs::{About, Batch};
use super::images::Images;
use super::settings::PrepareSettings;
use super::source::Source;
use super::triangulate;
use crate::scene::Intrinsics;
use crate::scene::undistort::Distortion;
use crate::words::count;

/// Less is not worth a line before it begins, seconds.
const LONG: f64 = 10.0;

/// What is said before the pictures and points of a source with cameras are made: how much that is, and about how long it takes.
/// Nothing where little is left.
pub(super) fn announced(images: &Images, source: &Source, settings: &PrepareSettings) -> Option<String> {
    let n = images.n_frames() as usize;
    let is_left = |folder: &str, name: String| !images.output.join(folder).join(name).is_file();
    let of_images: f64 = images
        .cameras
        .iter()
        .map(|camera| {
            let left =
                (0..images.n_frames()).filter(|frame| is_left("images", images.image_name(camera, *frame))).count();
            let of = camera.lens.intrinsics;
            Batch::new(left, (of.width, of.height)).images(camera.lens.distortion != Distortion::None)
        })
        .sum();
    let what = triangulate::asked(source, settings).0;
    let with_points = triangulate::of_frames(what, n);
    let done = (0..images.n_frames()).filter(|frame| !is_left("points", format!("{frame:05}.ply"))).count();
    let training: Vec<Intrinsics> =
        images.cameras.iter().filter(|camera| !camera.is_test).map(|camera| camera.pinhole.intrinsics).collect();
    let of_frame = training.first().map_or(0.0, |of| {
        Batch::new(training.len(), (of.width, of.height)).points(triangulate::n_pairs(training.len()))
    });
    let of_points = with_points.saturating_sub(done) as f64 * of_frame;
    let seconds = (of_images + of_points) / settings.threads.max(1) as f64;
    let points =
        if of_points > 0.0 { format!(", and points of {}", count(with_points, "frame")) } else { String::new() };
    (seconds >= LONG).then(|| {
        format!(
            "{} of {}{points}: {} (CPU, threads: {}); an interrupted run goes on where it stopped",
            count(n, "frame"),
            count(images.cameras.len(), "camera"),
            About(seconds),
            settings.threads
        )
    })
}
