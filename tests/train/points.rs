//! The first Gaussians from the points of every frame, and depth priors fitted to them, against what is true of a
//! synthetic capture.

use crate::common::prelude::*;
use crate::common::program::json;
use crate::synth::{Body, bodies};
use ivv::internals::scene::capture::{Camera, FramePoint};
use ivv::internals::stage::DepthSpace;
use ivv::internals::synth::Options;
use ivv::internals::train::{Initial, PointCounts, Unfit, fit_depths};

/// Points are noisy by 0.004 along each axis; outliers are farther from every surface, or rarely not.
const NEAR: f64 = 0.025;

struct Made {
    folder: PathBuf,
    capture: Capture,
    /// The same with the points of the reference frame alone.
    sparse: Capture,
}

fn made() -> &'static Made {
    static MADE: OnceLock<Made> = OnceLock::new();
    MADE.get_or_init(|| {
        let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("train-points");
        let options = Options { frames: 6, samples: 1, ..Preset::Small.options(5) };
        write_capture(&folder, &options, 2, &mut |_, _| {}).unwrap();
        let capture = Capture::open(&folder).unwrap();
        let mut manifest = Manifest::read(&folder).unwrap();
        manifest.points = false;
        manifest.write(&folder).unwrap();
        let sparse = Capture::open(&folder).unwrap();
        assert!(capture.has_frame_points() && !sparse.has_frame_points());
        Made { folder, capture, sparse }
    })
}

fn first(capture: &Capture, config: &Config) -> (Initial, Splats) {
    let world = capture.normalisation();
    let mut last = (0, 0);
    let initial = initialise(&capture.clone().transformed(&world), config, &mut |done, total| {
        assert!(done == last.0 + 1 && done <= total && (last.1 == total || last.0 == 0));
        last = (done, total);
    });
    let initial = initial.unwrap();
    assert!(last.0 == last.1 && last.1 >= capture.n_frames as usize, "{last:?}");
    (initial.clone(), world.inverse().splats(&initial.splats))
}

/// With what stands still as static Gaussians, so that it can be told apart.
fn config(init: Init) -> Config {
    Config { init, sh_degree: 0, init_static_tau: 0.0, ..exact() }
}

/// The first Gaussians of the capture by its flow, and by default, made once.
fn found(init: Init) -> &'static (Initial, Splats) {
    static FOUND: [OnceLock<(Initial, Splats)>; 2] = [const { OnceLock::new() }; 2];
    FOUND[usize::from(init == Init::Auto)].get_or_init(|| first(&made().capture, &config(init)))
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Truth {
    is_dynamic: bool,
    /// It moves by more than SPEC 5's threshold in a view that saw it.
    moves: bool,
    /// Scene units per clip.
    velocity: DVec3,
}

/// `None` of outliers.
fn truth(bodies: &[Body], capture: &Capture, point: &FramePoint, frame: u32) -> Option<Truth> {
    let (f, at) = (frame as usize, DVec3::from_array(point.position));
    let off = |body: &&Body| body.distance(body.local(body.pose(f), at));
    let body = bodies.iter().filter(|body| body.exists(frame.into())).min_by(|a, b| off(a).total_cmp(&off(b)))?;
    if off(&body) > NEAR {
        return None;
    }
    let after = if body.dynamic {
        let (rotation, place) = body.pose(f + 1);
        rotation * body.local(body.pose(f), at) + place
    } else {
        at
    };
    let moved = |camera: &Camera| {
        let place = |at: DVec3| {
            let DVec3 { x, y, z } = camera.world_to_camera.to_camera(at);
            [camera.intrinsics.fx * x / z, camera.intrinsics.fy * y / z]
        };
        let ([x, y], [u, v]) = (place(at), place(after));
        (u - x).hypot(v - y)
    };
    let moves = point.seen_by.iter().any(|&camera| moved(&capture.cameras[camera]) > 0.1);
    Some(Truth { is_dynamic: body.dynamic, moves, velocity: (after - at) * f64::from(capture.n_frames) })
}

#[test]
fn what_moves_is_told_from_what_stands_still_and_how_it_moves() {
    let Made { folder, capture, .. } = made();
    let bodies = bodies(folder);
    let (initial, splats) = found(Init::Flow);
    assert!(initial.from == Init::Flow && !initial.joined, "{initial}");
    let counts = initial.counts.unwrap();
    assert_eq!((counts.n_static, counts.n_dynamic), (splats.n_static, splats.motion.len()));
    assert_eq!(counts.without_flow, 0);
    // Dynamic Gaussians come frame by frame, in the order of the points.
    let mut next = splats.n_static;
    let mut matches = |point: &FramePoint, frame: u32| {
        let is_here = splats.motion.get(next - splats.n_static).is_some_and(|motion| {
            let at = DVec3::from_array(splats.position[next].map(f64::from));
            motion.t_center == frame as f32 / capture.n_frames as f32
                && (at - DVec3::from_array(point.position)).length() < 1e-5
        });
        next += usize::from(is_here);
        is_here.then(|| next - 1)
    };
    let (mut true_dynamic, mut false_dynamic, mut missed, mut on_bodies, mut n_points) = (0, 0, 0, 0, 0);
    let (mut errors, mut speeds, mut without) = (Vec::new(), Vec::new(), 0);
    for frame in 0..capture.n_frames {
        for point in capture.points_of(frame).unwrap() {
            n_points += 1;
            let found = matches(&point, frame);
            let Some(truth) = truth(&bodies, capture, &point, frame) else { continue };
            on_bodies += usize::from(truth.is_dynamic);
            match (found.is_some(), truth.moves) {
                (true, true) => true_dynamic += 1,
                (true, false) => false_dynamic += usize::from(!truth.is_dynamic),
                (false, moves) => missed += usize::from(moves),
            }
            let Some(i) = found.filter(|_| truth.moves) else { continue };
            let velocity = DVec3::from_array(splats.motion[i - splats.n_static].velocity.map(f64::from));
            if velocity == DVec3::ZERO {
                without += 1;
            } else {
                errors.push((velocity - truth.velocity).length());
                speeds.push(truth.velocity.length());
            }
        }
    }
    assert_eq!((n_points, next), (counts.before, splats.len()));
    let median = |all: &mut Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let precision = f64::from(true_dynamic) / f64::from(true_dynamic + false_dynamic as i32);
    let recall = f64::from(true_dynamic) / f64::from(true_dynamic + missed as i32);
    let (error, speed) = (median(&mut errors), median(&mut speeds));
    println!(
        "{counts}; {on_bodies} points on bodies that move; precision {precision:.3}, recall {recall:.3}; velocity off by \
         {error:.3} at {speed:.3}, {without} moving points without one of {true_dynamic}"
    );
    // When one view of eight was enough, precision was 0.62 and recall 0.987.
    assert!(true_dynamic > 200 && precision > 0.8 && recall > 0.96);
    assert!(error < 0.1 * speed && without < true_dynamic / 5, "{error} {speed} {without}");
    // By default what moves is joined with hulls, and what stands still with the surfaces that the pictures show.
    let (joined, all) = found(Init::Auto);
    assert!((joined.from, joined.counts) == (Init::Flow, Some(counts)) && joined.joined, "{joined}");
    assert!(joined.to_string().contains("surfaces on which the images agree (init=auto"), "{joined}");
    assert!(joined.n_hulls == 3 && joined.to_string().contains("hulls of 3 frames"), "{joined}");
    assert!(all.n_static > 3 * counts.n_static / 2, "{joined}");
    let n_hull = all.motion.len() - splats.motion.len();
    assert!(n_hull > splats.motion.len(), "{joined}");
    assert!(all.motion[n_hull..] == splats.motion[..]);
    assert_eq!(all.position[all.n_static + n_hull..], splats.position[splats.n_static..]);
    let hull_frames: BTreeSet<u32> = all.motion[..n_hull].iter().map(|m| (6.0 * m.t_center).round() as u32).collect();
    assert_eq!(hull_frames, BTreeSet::from([1, 3, 5]));
    // Where nothing that rests is trained, what moves is the same.
    let (moving, alone) = first(capture, &Config { holds_static: true, ..config(Init::Auto) });
    assert!(alone.n_static == 0 && alone.motion == all.motion && moving.n_hulls == 3, "{moving}");
}

/// Hulls of cameras that do not look at one place are phantoms.
#[test]
fn hulls_are_joined_with_the_flow_only_where_most_cameras_look_inward() {
    let Made { capture, .. } = made();
    let mut outward = capture.clone();
    // Each turns half round its own vertical axis, away from the others.
    let half_round = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
    for camera in outward.cameras.iter_mut().filter(|camera| !camera.is_test) {
        let Pose { rotation, translation } = camera.world_to_camera;
        camera.world_to_camera = Pose { rotation: half_round * rotation, translation: half_round * translation };
    }
    let (inward, outward) = (&found(Init::Auto).0, first(&outward, &config(Init::Auto)).0);
    assert_eq!((inward.from, inward.n_hulls), (Init::Flow, 3));
    assert_eq!((outward.from, outward.n_hulls), (Init::Flow, 0));
}

#[test]
fn depth_priors_are_fitted_to_the_hidden_scale_and_shift() {
    let Made { folder, capture, .. } = made();
    let hidden = json(&folder.join("truth.json"));
    let world = Similarity { origin: [0.5, -1.0, 2.0], scale: 0.7 };
    let mut capture = capture.clone().transformed(&world);
    // A camera without priors.
    let without = capture.cameras.iter().rposition(|camera| !camera.is_test).unwrap();
    capture.cameras[without].shots.iter_mut().for_each(|shot| shot.depth = None);
    let fits = fit_depths(&capture, DepthSpace::Inverse, 2, &mut |_, _| {}).unwrap();
    let (mut scales, mut shifts) = (Vec::new(), Vec::new());
    for ((camera, frame), fit) in fits.iter() {
        let name = &capture.cameras[camera].name;
        let Ok(fit) = fit else {
            assert!(camera == without && fit == Err(Unfit::NoPrior), "{name}, frame {frame}: {fit:?}");
            continue;
        };
        let truth = &hidden["depth_scale_shift"][name][frame as usize];
        let [scale, shift] = [0, 1].map(|k| truth[k].as_f64().unwrap() / world.scale);
        assert!(fit.n_points >= 50 && fit.residual < 0.05, "{name}, frame {frame}: {fit:?}");
        scales.push((fit.scale / scale - 1.0).abs());
        shifts.push((fit.shift - shift).abs());
    }
    scales.sort_by(f64::total_cmp);
    shifts.sort_by(f64::total_cmp);
    let (n, last) = (scales.len(), scales.len() - 1);
    println!("{}; scales off {:.4} and {:.4}", fits.summary(), scales[n / 2], scales[last]);
    println!("shifts off {:.4} and {:.4}", shifts[n / 2], shifts[last]);
    assert_eq!(n, 7 * 6);
    assert!(scales[n / 2] < 0.02 && scales[last] < 0.08, "{scales:?}");
    let summary = fits.summary();
    assert_eq!((summary.images, summary.usable, summary.unfit[&Unfit::NoPrior]), (48, 42, 6));
    // The prior is inverse depth: it falls where depth rises.
    let metric = fit_depths(&capture, DepthSpace::Metric, 1, &mut |_, _| {}).unwrap().summary();
    assert_eq!(metric.usable, 0, "{metric}");
    assert!(metric.unfit[&Unfit::Inverted] >= 40, "{metric}");
}

#[test]
fn fits_of_depth_priors_are_kept_until_something_changes() {
    let folder = Folder::new("depth-fits");
    let options = Options { frames: 1, ..Preset::Tiny.options(3) };
    write_capture(&folder.0, &options, 2, &mut |_, _| {}).unwrap();
    let capture = Capture::open(&folder.0).unwrap();
    let fits = |capture: &Capture| fit_depths(capture, DepthSpace::Inverse, 2, &mut |_, _| {});
    let kept = folder.0.join("depth/fits.json");
    let found = fits(&capture).unwrap();
    assert!(found.summary().usable > 2 && kept.is_file(), "{}", found.summary());
    // A prior that cannot be read is not read again while it looks as it did.
    let shot = &capture.cameras[capture.training_frames()[0].0].shots[0];
    let path = shot.depth.as_ref().unwrap();
    let (bytes, changed) = (std::fs::read(path).unwrap(), std::fs::metadata(path).unwrap().modified().unwrap());
    std::fs::write(path, vec![0; bytes.len()]).unwrap();
    let file = std::fs::File::options().write(true).open(path).unwrap();
    file.set_modified(changed).unwrap();
    assert_eq!(fits(&capture).unwrap(), found);
    // Another frame of training has other units, another date another prior, and what cannot be understood is not believed.
    let scaled = capture.clone().transformed(&Similarity { origin: [0.0; 3], scale: 0.5 });
    assert!(fits(&scaled).is_err());
    file.set_modified(changed + std::time::Duration::from_secs(1)).unwrap();
    assert!(fits(&capture).is_err());
    std::fs::write(path, bytes).unwrap();
    std::fs::write(&kept, b"{").unwrap();
    assert_eq!(fits(&capture).unwrap(), found);
}

#[test]
fn a_capture_without_points_of_frames_is_fitted_to_its_sparse_points() {
    let Made { capture, sparse, .. } = made();
    let [by_frame, sparse] =
        [capture, sparse].map(|capture| fit_depths(capture, DepthSpace::Inverse, 2, &mut |_, _| {}).unwrap());
    let mut off: Vec<f64> = Vec::new();
    for ((camera, frame), fit) in sparse.iter() {
        let other = by_frame.iter().find(|(image, _)| *image == (camera, frame));
        let (Ok(fit), Some((_, Ok(other)))) = (fit, other) else { continue };
        off.push((fit.scale / other.scale - 1.0).abs());
    }
    off.sort_by(f64::total_cmp);
    assert!(off.len() > 40 && off[off.len() / 2] < 0.05, "{off:?}");
}

#[test]
fn concatenation_keeps_every_point_of_every_frame() {
    let Made { capture, .. } = made();
    let (initial, splats) = first(capture, &config(Init::Concat));
    let counts = initial.counts.unwrap();
    assert_eq!(counts, PointCounts { before: splats.len(), n_dynamic: splats.len(), ..PointCounts::default() });
    assert_eq!((splats.n_static, splats.len()), (0, 6 * 600));
    assert!(splats.motion.iter().all(|m| m.velocity == [0.0; 3] && (m.t_scale.exp() - 2.0 / 6.0).abs() < 1e-6));
    assert!(splats.motion.iter().enumerate().all(|(i, m)| m.t_center == (i / 600) as f32 / 6.0));
    assert!(splats.opacity.iter().all(|o| (1.0 / (1.0 + (-o).exp()) - 0.1).abs() < 1e-6));
    // The size is that among the points of the same frame.
    let points = capture.points_of(3).unwrap();
    let at = |point: &FramePoint| DVec3::from_array(point.position);
    let mut near: Vec<f64> = points[1..].iter().map(|other| (at(other) - at(&points[0])).length()).collect();
    near.sort_by(f64::total_cmp);
    let mean = (near[0] + near[1] + near[2]) / 3.0;
    assert!((f64::from(splats.scale[3 * 600][0].exp()) / mean - 1.0).abs() < 1e-4);
}

#[test]
fn without_flow_all_is_static_and_what_a_capture_lacks_is_told() {
    let Made { folder, capture, .. } = made();
    let mut at_rest = capture.clone();
    for camera in &mut at_rest.cameras {
        let size = [camera.intrinsics.width, camera.intrinsics.height];
        let header = [*b"PIEH", size[0].to_le_bytes(), size[1].to_le_bytes()].concat();
        let file = folder.join(format!("at-rest-{}.flo", camera.name));
        let zeros = vec![0; 8 * size[0] as usize * size[1] as usize];
        std::fs::write(&file, [header, zeros].concat()).unwrap();
        camera.shots.iter_mut().filter_map(|shot| shot.flow.as_mut()).for_each(|flow| flow.clone_from(&file));
    }
    let (none, _) = first(&at_rest, &config(Init::Flow));
    let counts = none.counts.unwrap();
    assert_eq!((counts.n_static, counts.n_dynamic), (600, 0));
    assert_eq!((none.splats.n_static, none.splats.motion.len()), (600, 0));
    let usual = exact().init_static_tau;
    let (paper, _) = first(capture, &Config { init_static_tau: usual, ..config(Init::Flow) });
    let counts = paper.counts.unwrap();
    assert_eq!((paper.splats.n_static, paper.splats.motion.len()), (0, counts.after()));
    let taus: Vec<f32> = paper.splats.motion.iter().map(|motion| motion.t_scale.exp()).collect();
    assert!(taus[..counts.n_static].iter().all(|tau| (tau - 10.0).abs() < 1e-4));
    assert!(taus[counts.n_static..].iter().all(|tau| (tau - 2.0 / 6.0).abs() < 1e-6));
    let mut without = capture.clone();
    without.cameras.iter_mut().flat_map(|camera| &mut camera.shots).for_each(|shot| shot.flow = None);
    let error = initialise(&without, &config(Init::Flow), &mut |_, _| {}).unwrap_err();
    assert!(error.exit_code() == 3 && error.to_string().contains("has no optical flow"), "{error}");
    assert_eq!(initialise(&without, &config(Init::Auto), &mut |_, _| {}).unwrap().from, Init::Hull);
}

#[test]
fn few_points_are_joined_with_surfaces_unless_they_alone_are_asked_for() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("train-few-points");
    let options = Options { frames: 2, samples: 1, ..Preset::Small.options(5) };
    write_capture(&folder, &options, 2, &mut |_, _| {}).unwrap();
    let capture = Capture::open(&folder).unwrap();
    for frame in 0..2 {
        let few = capture.points_of(frame).unwrap().into_iter().take(20);
        let seen = |point: FramePoint| SeenPoint { position: point.position, rgb: [128; 3], camera_ids: vec![1, 2] };
        write_points(&folder.join(format!("points/{frame:05}.ply")), &few.map(seen).collect::<Vec<_>>()).unwrap();
    }
    let capture = Capture::open(&folder).unwrap();
    let world = capture.normalisation();
    let capture = capture.transformed(&world);
    let first = |init: Init| initialise(&capture, &config(init), &mut |_, _| {}).unwrap();
    let (asked, auto) = (first(Init::Flow), first(Init::Auto));
    assert!(asked.from == Init::Flow && (1..=40).contains(&asked.splats.len()), "{asked}");
    assert!(auto.from == Init::Flow && auto.joined && auto.splats.len() > 200, "{auto}");
}

#[test]
fn by_the_papers_rule_one_view_of_many_is_enough() {
    let Made { capture, .. } = made();
    let (two, any) = (&found(Init::Flow).0, first(capture, &config(Init::AnyView)).0);
    assert_eq!((any.from, Init::AnyView.name().as_str()), (Init::AnyView, "any_view"));
    assert_eq!(serde_json::from_str::<Init>("\"any_view\"").unwrap(), Init::AnyView);
    let [two, any] = [two, &any].map(|initial| initial.counts.unwrap());
    println!("two views: {two}; any view: {any}");
    assert_eq!(any.before, two.before);
    assert!(any.n_dynamic > two.n_dynamic && any.n_static <= two.n_static, "{any:?} {two:?}");
}
