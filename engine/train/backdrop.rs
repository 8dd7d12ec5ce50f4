//! A backdrop where no training camera looks.
//!
//! A viewer who looks a little past the edge of what was filmed would see a black hole. So at the end of a run large
//! static Gaussians go behind the scene, in unseen directions close to a seen one, in the colours seen nearest to them.
//! A scene of a single object, through which cameras see the background, gets none.

use super::lenses::seen;
use crate::error::Result;
use crate::parallel::{in_parallel, threads};
use crate::recon::evenly_chosen;
use crate::report::statistics::quantile;
use crate::scene::capture::Capture;
use crate::scene::{SH_C0, Splats, View, dc_of_color};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_4, PI};

/// Largest angle between a direction of the backdrop and the nearest one that a training camera sees, radians.
const REACH: f64 = FRAC_PI_4;
/// Distance of the backdrop, in units of the distance within which this share of the scene lies: nearer, it would hide
/// parts of the scene.
const BEHIND: f64 = 1.2;
const NEARLY_ALL: f64 = 0.999;
/// The least distance of the backdrop, in distances of the farthest camera: near a lens it would look wide.
const OUTSIDE: f64 = 2.0;
/// Opacity that a Gaussian must have to count as part of the scene.
const OPAQUE: f64 = 0.3;
/// Angle around a direction from which its colour is taken, radians, and the least number of Gaussians in it.
const ACROSS: f64 = 0.12;
const LEAST_POINTS: usize = 2;
/// Gaussians of a direction that the backdrop continues: those farther than this share of nearly all of them.
const FAR_SIDE: f64 = 0.8;
/// If a smaller share of the directions that cameras see has a colour, the background shows through the scene.
const LEAST_KNOWN: f64 = 0.9;
/// Standard deviation of a Gaussian of the backdrop, in units of the distance to its neighbours.
const WIDTH: f64 = 0.7;
/// Logit of its opacity: 0.98.
const OPACITY: f32 = 4.0;
/// The weight of a colour falls with this power of the angle.
const FALL: i32 = 3;
const MOST_VIEWS: usize = 1024;
const PIECE: usize = 4096;

/// A Gaussian of the scene, from the middle of the cameras.
struct Point {
    direction: DVec3,
    distance: f64,
    /// Solid angle times opacity.
    weight: f64,
    color: DVec3,
}

/// The backdrop of `scene`, which was trained on `capture`, both in the frame of training: in those of `n` directions,
/// evenly spread, that no training camera sees.
pub(super) fn backdrop_of(scene: &Splats, capture: &Capture, n: usize) -> Result<Splats> {
    let (mut views, photos) = (poses(capture, false)?, poses(capture, true)?);
    // Photographs may all show one wall; viewers stand where the rig stood.
    let middle = middle(if views.is_empty() { &photos } else { &views });
    views.extend(photos);
    backdrop(scene, middle, &evenly_chosen(views, MOST_VIEWS), n)
}

pub(super) fn put_before(scene: Splats, mut backdrop: Splats) -> Splats {
    backdrop.append(scene);
    backdrop.source_row = (0..backdrop.len() as u32).collect();
    backdrop
}

/// A view of every pose of the training cameras that are photographs, or are not.
fn poses(capture: &Capture, is_photo: bool) -> Result<Vec<View>> {
    let mut views = Vec::new();
    let cameras = capture.cameras.iter().enumerate();
    for (index, camera) in cameras.filter(|(_, camera)| !camera.is_test && camera.is_photo == is_photo) {
        for shot in camera.shots.iter().take(if camera.moves() { usize::MAX } else { 1 }) {
            views.push(capture.view(index, shot.frame)?);
        }
    }
    Ok(views)
}

fn middle(views: &[View]) -> DVec3 {
    views.iter().map(|view| view.pose.center()).sum::<DVec3>() / views.len().max(1) as f64
}

/// The backdrop, around `middle`, of a scene for cameras with these `views`.
fn backdrop(scene: &Splats, middle: DVec3, views: &[View], n: usize) -> Result<Splats> {
    let mut found = Splats::new(scene.sh_degree);
    if n == 0 || views.is_empty() {
        return Ok(found);
    }
    let is_seen = |at: DVec3| views.iter().any(|view| seen(view, at).is_some());
    let mut points = points_of(scene, middle, is_seen)?;
    if points.is_empty() {
        return Ok(found);
    }
    points.sort_by(|a, b| a.direction.z.total_cmp(&b.direction.z));
    let distances: Vec<f64> = points.iter().map(|point| point.distance).collect();
    let farthest = views.iter().map(|view| view.pose.center().distance(middle)).fold(0.0, f64::max);
    let distance = (BEHIND * quantile(&distances, NEARLY_ALL)).max(OUTSIDE * farthest);
    let directions = evenly(n);
    let colors = in_parallel(n, threads(), |k| Ok(color_of(directions[k], &points)), |_| {})?;
    let known: Vec<(DVec3, DVec3)> = directions.iter().zip(&colors).filter_map(|(d, c)| Some((*d, (*c)?))).collect();
    let sees: Vec<bool> = directions.iter().map(|direction| is_seen(middle + distance * *direction)).collect();
    let sighted: Vec<usize> = (0..n).filter(|k| sees[*k]).collect();
    let n_known = sighted.iter().filter(|k| colors[**k].is_some()).count();
    if (n_known as f64) < LEAST_KNOWN * sighted.len() as f64 {
        return Ok(found);
    }
    let spacing = (4.0 * PI / n as f64).sqrt();
    let guess = |k: usize| {
        let direction = directions[k];
        if sees[k] || sighted.iter().all(|other| angle(directions[*other], direction) > REACH) {
            return Ok(None);
        }
        let weight = |other: DVec3| (angle(other, direction) + 0.3 * spacing).powi(-FALL);
        let (sum, all) = known.iter().fold((DVec3::ZERO, 0.0), |(sum, all), (other, color)| {
            (sum + weight(*other) * *color, all + weight(*other))
        });
        Ok(Some(sum / all))
    };
    let guesses = in_parallel(n, threads(), guess, |_| {})?;
    for (direction, color) in directions.iter().zip(guesses).filter_map(|(d, color)| Some((d, color?))) {
        found.position.push((middle + distance * *direction).as_vec3().to_array());
        found.sh.push(color.to_array().map(dc_of_color));
        found.sh.extend(std::iter::repeat_n([0.0; 3], found.n_coefficients() - 1));
    }
    found.n_static = found.position.len();
    found.rotation = vec![[1.0, 0.0, 0.0, 0.0]; found.n_static];
    found.scale = vec![[(WIDTH * spacing * distance).ln() as f32; 3]; found.n_static];
    found.opacity = vec![OPACITY; found.n_static];
    found.source_row = (0..found.n_static as u32).collect();
    Ok(found)
}

/// The Gaussians of a scene that a camera sees if nothing hides them, from `middle`.
fn points_of(scene: &Splats, middle: DVec3, is_seen: impl Fn(DVec3) -> bool + Sync) -> Result<Vec<Point>> {
    let k = scene.n_coefficients();
    let point = |i: usize| {
        let opacity = 1.0 / (1.0 + (-f64::from(scene.opacity[i])).exp());
        let at = DVec3::from_array(scene.position[i].map(f64::from));
        let distance = at.distance(middle);
        let counts = opacity > OPAQUE && distance.is_finite() && distance > 0.0 && is_seen(at);
        let area = (scene.scale[i].iter().map(|s| f64::from(*s)).sum::<f64>() * 2.0 / 3.0).exp();
        let color = DVec3::from_array(scene.sh[i * k].map(f64::from)) * SH_C0 + 0.5;
        let weight = opacity * area / (distance * distance);
        let is_finite = weight.is_finite() && color.is_finite();
        (counts && is_finite).then_some(Point { direction: (at - middle) / distance, distance, weight, color })
    };
    let n = scene.len();
    let piece = |p: usize| Ok((p * PIECE..n.min((p + 1) * PIECE)).filter_map(point).collect::<Vec<_>>());
    let all = in_parallel(n.div_ceil(PIECE), threads(), piece, |_| {})?;
    Ok(all.into_iter().flatten().collect())
}

/// Directions, evenly spread over the sphere: on a spiral, a golden angle apart.
fn evenly(n: usize) -> Vec<DVec3> {
    let direction = |k: usize| {
        let along = (2.0 * k as f64 + 1.0) / n as f64 - 1.0;
        let (sin, cos) = (PI * (1.0 + 5.0_f64.sqrt()) * k as f64).sin_cos();
        let across = (1.0 - along * along).sqrt();
        DVec3::new(across * cos, across * sin, along)
    };
    (0..n).map(direction).collect()
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    a.dot(b).clamp(-1.0, 1.0).acos()
}

/// The colour of the farthest `points` in a direction, which are ordered by z; none if there are too few.
fn color_of(direction: DVec3, points: &[Point]) -> Option<DVec3> {
    let least = ACROSS.cos();
    // No coordinate differs by more than the angle.
    let [from, to] = [-ACROSS, ACROSS].map(|off| points.partition_point(|point| point.direction.z < direction.z + off));
    let own: Vec<&Point> = points[from..to].iter().filter(|point| point.direction.dot(direction) > least).collect();
    if own.len() < LEAST_POINTS {
        return None;
    }
    let distances: Vec<f64> = own.iter().map(|point| point.distance).collect();
    let nearest = FAR_SIDE * quantile(&distances, FAR_SIDE);
    let far = own.iter().filter(|point| point.distance >= nearest);
    let (sum, all) = far.fold((DVec3::ZERO, 0.0), |(sum, all), p| (sum + p.weight * p.color, all + p.weight));
    (all > 0.0).then(|| sum / all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Intrinsics, Motion};

    fn view() -> View {
        View::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], Intrinsics::of_fov(64, 64, 90.0))
    }

    fn around(scene: &Splats, views: &[View], n: usize) -> Splats {
        backdrop(scene, middle(views), views, n).unwrap()
    }

    /// Static Gaussians on a sphere of radius 4: red where x is positive, blue elsewhere.
    fn shell(is_there: impl Fn(DVec3) -> bool) -> Splats {
        let mut splats = Splats::new(1);
        for direction in evenly(4000).into_iter().filter(|direction| is_there(*direction)) {
            let color = if direction.x > 0.0 { [0.9, 0.1, 0.1] } else { [0.1, 0.1, 0.9] };
            splats.position.push((4.0 * direction).as_vec3().to_array());
            splats.sh.push(color.map(dc_of_color));
            splats.sh.extend([[0.0; 3]; 3]);
        }
        let n = splats.position.len();
        splats.n_static = n;
        splats.rotation = vec![[1.0, 0.0, 0.0, 0.0]; n];
        splats.scale = vec![[-3.0; 3]; n];
        splats.opacity = vec![3.0; n];
        splats.source_row = (0..n as u32).collect();
        splats
    }

    #[test]
    fn it_stands_behind_the_scene_beside_what_is_seen_in_the_colours_there() {
        let view = view();
        let found = around(&shell(|direction| direction.z > 0.0), std::slice::from_ref(&view), 1000);
        found.check().unwrap();
        assert_eq!((found.n_static, found.sh_degree), (found.len(), 1));
        let mut nearest = f64::INFINITY;
        for (at, sh) in found.position.iter().zip(found.sh.chunks(4)) {
            let at = DVec3::from_array(at.map(f64::from));
            assert!((at.length() - 4.0 * BEHIND).abs() < 1e-4 && seen(&view, at).is_none(), "{at}");
            // The corners of the picture are 55 degrees from its middle, and directions some 6 degrees apart.
            let off = angle(at.normalize(), DVec3::Z);
            assert!(off < 56_f64.to_radians() + REACH, "{at}");
            nearest = nearest.min(off);
            let [red, _, blue] = sh[0].map(|c| f64::from(c) * SH_C0 + 0.5);
            assert!((0.05..0.95).contains(&red) && (0.05..0.95).contains(&blue), "{red} {blue}");
            if at.x.abs() > 2.0 {
                assert_eq!(red > blue, at.x > 0.0, "{at}: {red} {blue}");
            }
            assert!(sh[1..].iter().all(|c| *c == [0.0; 3]));
        }
        // It begins at the picture's edge, and goes all around it.
        assert!(found.len() > 200 && nearest < 52_f64.to_radians(), "{} {}", found.len(), nearest.to_degrees());
        let mean = found.position.iter().fold([0.0; 2], |[x, y], at| [x + at[0], y + at[1]]);
        assert!(mean.iter().all(|sum| (sum / found.len() as f32).abs() < 0.1), "{mean:?}");
    }

    #[test]
    fn a_scene_that_leaves_the_background_through_has_none() {
        let object = shell(|direction| angle(direction, DVec3::Z) < 0.4);
        assert!(around(&object, &[view()], 1000).is_empty());
        assert!(around(&Splats::new(3), &[view()], 1000).is_empty());
        let room = shell(|_| true);
        assert!(around(&room, &[], 1000).is_empty() && around(&room, &[view()], 0).is_empty());
        // Nothing of a Gaussian that is not finite.
        let mut broken = room.clone();
        (broken.position[0], broken.scale[1], broken.sh[8]) = ([f32::NAN; 3], [f32::INFINITY; 3], [f32::NAN; 3]);
        let found = around(&broken, &[view()], 1000);
        assert!(found.len() > 200 && found.check().is_ok());
        assert!(found.position.iter().chain(&found.sh).flatten().all(|x| x.is_finite()));
    }

    #[test]
    fn it_stands_outside_of_cameras_that_are_farther_off_than_what_they_see() {
        // Four cameras 20 from their middle, around what is 4 from it.
        let eyes = [[20.0, 0.0, 0.0], [0.0, 0.0, 20.0], [-20.0, 0.0, 0.0], [0.0, 0.0, -20.0]];
        let views = eyes.map(|eye| View::look_at(eye, [0.0; 3], [0.0, -1.0, 0.0], Intrinsics::of_fov(64, 64, 40.0)));
        let found = around(&shell(|_| true), &views, 1000);
        assert!(found.len() > 100, "{}", found.len());
        for at in found.position.iter().map(|at| DVec3::from_array(at.map(f64::from))) {
            assert!((at.length() - OUTSIDE * 20.0).abs() < 1e-3, "{at}");
        }
    }

    #[test]
    fn it_comes_first() {
        let mut scene = shell(|_| true);
        let n = scene.len();
        // The last is dynamic, and degrees differ.
        scene.n_static -= 1;
        scene.motion = vec![Motion { velocity: [1.0; 3], t_center: 0.5, t_scale: 0.0 }];
        scene.degree = vec![0; n];
        let found = around(&scene, &[view()], 1000);
        let (added, all) = (found.len(), put_before(scene.clone(), found));
        all.check().unwrap();
        assert!(added > 200 && (all.len(), all.n_static, all.motion.len()) == (n + added, n - 1 + added, 1));
        assert_eq!(all.position[added..], scene.position[..]);
        assert!((0..all.len()).all(|i| all.degree_of(i) == usize::from(i < added)));
    }
}
