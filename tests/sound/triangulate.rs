//! Places from pixels.

use super::rigs::{normal, pixel, rig, sights};
use crate::common::prelude::*;
use ivv::internals::scene::undistort::Lens;
use ivv::internals::sound::rig::RigCamera;
use ivv::internals::sound::triangulate::{Sight, triangulate, triangulate_all};

fn place(random: &mut Random) -> DVec3 {
    DVec3::new(random.uniform(-0.8, 0.8), random.uniform(-0.5, 0.5), random.uniform(2.2, 3.8))
}

#[test]
fn without_noise_the_place_is_exact() {
    let (rig, mut random) = (rig(5, 30.0, 1), Random::new(1));
    for _ in 0..50 {
        let point = place(&mut random);
        let seen = sights(&rig, point, 0.0, &mut random);
        for fix in [triangulate(&seen).unwrap(), triangulate_all(&seen).remove(0)] {
            assert!((fix.p - point).length() <= 1e-9 * point.length(), "{} for {point}", fix.p);
            assert!(fix.reproj_px < 1e-6 && fix.sights.len() == 5);
        }
    }
}

#[test]
fn the_covariance_is_that_of_the_errors() {
    const RUNS: usize = 500;
    let (rig, mut random) = (rig(6, 30.0, 1), Random::new(2));
    let (mut squares, mut predicted, mut nees) = (0.0, 0.0, 0.0);
    for _ in 0..RUNS {
        let point = place(&mut random);
        let fix = triangulate(&sights(&rig, point, 1.0, &mut random)).unwrap();
        let error = fix.p - point;
        squares += error.length_squared();
        predicted += fix.cov.x_axis.x + fix.cov.y_axis.y + fix.cov.z_axis.z;
        nees += error.dot(fix.cov.inverse() * error);
    }
    let ratio = (squares / predicted).sqrt();
    assert!((ratio - 1.0).abs() <= 0.1, "errors are {ratio} times what is predicted");
    // 95 % of chi squared with three degrees, in the mean of the runs.
    let (mean, bound) = (nees / RUNS as f64, 1.96 * (6.0 / RUNS as f64).sqrt());
    assert!((mean - 3.0).abs() <= bound, "normalised squared error {mean}, not 3 +- {bound}");
}

#[test]
fn the_covariance_is_wider_where_cameras_disagree_by_more_than_they_claim() {
    let (rig, mut random) = (rig(6, 30.0, 1), Random::new(3));
    let point = place(&mut random);
    let mut seen = sights(&rig, point, 4.0, &mut random);
    let honest = triangulate(&seen).unwrap();
    seen.iter_mut().for_each(|sight| sight.sigma = 0.5);
    let boasting = triangulate(&seen).unwrap();
    let trace = |cov: DMat3| cov.x_axis.x + cov.y_axis.y + cov.z_axis.z;
    assert!(honest.excess == 1.0 && boasting.excess > 10.0, "{} {}", honest.excess, boasting.excess);
    // A claim of an eighth of the deviation alone makes a covariance of 1/64, and Huber's weights one of 1/22; what the cameras
    // disagree by brings most of it back.
    let ratio = trace(boasting.cov) / trace(honest.cov);
    assert!((0.5..1.5).contains(&ratio), "{ratio} times that of the true deviation");
}

#[test]
fn outliers_are_left_out() {
    let (rig, mut random) = (rig(8, 30.0, 1), Random::new(4));
    let (mut robust, mut oracle, mut n_outliers, mut n_kept) = (0.0, 0.0, 0, 0);
    for _ in 0..200 {
        let point = place(&mut random);
        let mut seen = sights(&rig, point, 1.0, &mut random);
        let is_outlier: Vec<bool> = seen.iter().map(|_| random.uniform(0.0, 1.0) < 0.3).collect();
        for (sight, camera) in seen.iter_mut().zip(&rig.cameras).zip(&is_outlier).filter(|(_, is)| **is).map(|(s, _)| s)
        {
            let anywhere = DVec2::new(random.uniform(0.0, 1280.0), random.uniform(0.0, 720.0));
            sight.at = camera.plane(anywhere).unwrap();
        }
        let inliers: Vec<Sight> = seen.iter().zip(&is_outlier).filter(|(_, is)| !**is).map(|(s, _)| *s).collect();
        let Some(truth) = triangulate(&inliers).filter(|_| inliers.len() > 2) else { continue };
        let fix = triangulate_all(&seen).remove(0);
        n_outliers += is_outlier.iter().filter(|is| **is).count();
        n_kept += fix.sights.iter().filter(|index| is_outlier[**index]).count();
        robust += (fix.p - point).length_squared();
        oracle += (truth.p - point).length_squared();
    }
    let ratio = (robust / oracle).sqrt();
    assert!(n_outliers > 300 && n_kept * 50 < n_outliers, "{n_kept} of {n_outliers} outliers were kept");
    assert!(ratio <= 1.3, "{ratio} times the error without outliers");
}

#[test]
fn two_things_are_told_apart() {
    let (rig, mut random) = (rig(6, 30.0, 1), Random::new(5));
    for _ in 0..30 {
        let (a, b) = (place(&mut random), place(&mut random));
        if (a - b).length() < 0.2 {
            continue;
        }
        let mut seen = sights(&rig, a, 1.0, &mut random);
        seen.extend(sights(&rig, b, 1.0, &mut random));
        let fixes = triangulate_all(&seen);
        assert!(fixes.len() >= 2);
        for point in [a, b] {
            let nearest = fixes[..2].iter().map(|fix| (fix.p - point).length()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.02, "{nearest} from {point}");
        }
    }
}

#[test]
fn what_cannot_be_seen_is_no_place() {
    let (rig, mut random) = (rig(3, 30.0, 1), Random::new(6));
    let seen = sights(&rig, DVec3::new(0.0, 0.0, 3.0), 1.0, &mut random);
    assert_eq!(triangulate(&[]), None);
    assert_eq!(triangulate(&seen[..1]), None);
    // Twice the same ray.
    assert_eq!(triangulate(&[seen[0], Sight { camera: 1, ..seen[0] }]), None);
    // Two detections of one camera do not make a place.
    assert_eq!(triangulate_all(&[seen[0], Sight { at: seen[0].at + 0.3, ..seen[0] }]), []);
    // Rays that part.
    let around = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0)) * seen[1].pose.rotation;
    let away = Sight { pose: Pose::at(seen[1].pose.center(), around), ..seen[1] };
    assert_eq!(triangulate_all(&[seen[0], away]), []);
    assert!(pixel(&rig.cameras[0], DVec3::new(0.0, 0.0, 3.0)).is_finite());
    assert!(normal(&mut random).is_finite());
}

/// Detected corners of a board in four webcams, against the places that caliscope itself found (BSD-2).
#[test]
fn corners_of_caliscope_meet_its_own_places() {
    let Some(folder) = shared("data/caliscope_4cam") else { return };
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let calibration: toml::Table = read("camera_array.toml").parse().unwrap();
    let cameras: Vec<RigCamera> = (0..4).map(|index| caliscope_camera(&calibration, index)).collect();
    let rows = |name: &str| -> Vec<Vec<f64>> {
        let number = |cell: &str| cell.parse().unwrap_or(f64::NAN);
        read(name).lines().skip(1).map(|line| line.split(',').map(number).collect()).collect()
    };
    let mut seen: BTreeMap<(u32, u32), Vec<(usize, DVec2)>> = BTreeMap::new();
    for row in rows("calibration/extrinsic/CHARUCO/xy_CHARUCO.csv") {
        let at = DVec2::new(row[4], row[5]);
        seen.entry((row[0] as u32, row[3] as u32)).or_default().push((row[1] as usize, at));
    }
    let truth = rows("calibration/extrinsic/CHARUCO/xyz_CHARUCO.csv");
    assert_eq!(truth.len(), 660);
    let (mut distances, mut squares, mut theirs) = (Vec::new(), [(0.0, 0); 4], [0.0; 4]);
    for row in &truth {
        let sights: Vec<Sight> = seen[&(row[0] as u32, row[2] as u32)]
            .iter()
            .map(|(index, at)| {
                let camera = &cameras[*index];
                let (pose, focal) = (camera.pose(0.0), camera.lens.intrinsics.focal());
                let at = camera.plane(*at).unwrap();
                Sight { camera: *index, pose, focal, at, sigma: 1.5, weight: 1.0 }
            })
            .collect();
        let fix = triangulate(&sights).unwrap();
        let own = DVec3::new(row[3], row[4], row[5]);
        distances.push((fix.p - own).length());
        for (camera, at) in &seen[&(row[0] as u32, row[2] as u32)] {
            let (pose, lens) = (cameras[*camera].pose(0.0), cameras[*camera].lens);
            let square = |point: DVec3| {
                let local = pose.to_camera(point);
                let shown = lens.pixel([local.x / local.z, local.y / local.z], lens.reach()).unwrap();
                (DVec2::from_array(shown) - *at).length_squared()
            };
            squares[*camera].0 += square(fix.p);
            squares[*camera].1 += 1;
            theirs[*camera] += square(own);
        }
    }
    distances.sort_by(f64::total_cmp);
    let rms = squares.map(|(sum, n)| (sum / f64::from(n)).sqrt());
    let n: i32 = squares.iter().map(|(_, n)| n).sum();
    let [mut own, mut all] = [0.0; 2];
    squares.iter().zip(theirs).for_each(|((ours, _), theirs)| (own, all) = (own + theirs, all + ours));
    let theirs: Vec<f64> = theirs.iter().zip(squares).map(|(sum, (_, n))| (sum / f64::from(n)).sqrt()).collect();
    println!(
        "{} corners, {n} sights, reprojection {rms:.2?} px; of caliscope's own places {theirs:.2?} px",
        truth.len()
    );
    // As the set's note says.
    let noted = [1.25, 2.05, 1.79, 1.45];
    assert!(theirs.iter().zip(noted).all(|(found, noted)| (found - noted).abs() < 0.01), "{theirs:?}");
    // Ours are those of the least reprojection, so they cannot be farther from what was seen.
    assert!(all <= own, "{all} {own}");
    let quantile = |part: f64| 1e3 * distances[(part * (distances.len() - 1) as f64) as usize];
    println!(
        "from caliscope's own: median {:.2} mm, 0.95 quantile {:.2} mm, at most {:.2} mm",
        quantile(0.5),
        quantile(0.95),
        quantile(1.0)
    );
    // Metres; a corner of the board is 54 mm from the next.
    assert!(quantile(0.5) < 2.0 && quantile(0.95) < 10.0);
    assert!(rms.iter().all(|rms| (0.9..2.15).contains(rms)), "{rms:?}");
}

fn caliscope_camera(calibration: &toml::Table, index: usize) -> RigCamera {
    let camera = &calibration["cameras"][index.to_string()];
    let numbers =
        |value: &toml::Value| -> Vec<f64> { value.as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect() };
    let rows = |name: &str| -> Vec<Vec<f64>> { camera[name].as_array().unwrap().iter().map(numbers).collect() };
    let (matrix, rotation, shift) = (rows("matrix"), rows("rotation"), numbers(&camera["translation"]));
    let [k1, k2, p1, p2, k3] = numbers(&camera["distortions"]).try_into().unwrap();
    let (fx, fy, cx, cy) = (matrix[0][0], matrix[1][1], matrix[0][2], matrix[1][2]);
    let intrinsics = Intrinsics { width: 1280, height: 720, fx, fy, cx, cy };
    let lens = Lens { intrinsics, distortion: Distortion::brown([k1, k2, k3, 0.0, 0.0, 0.0], [p1, p2]) };
    let row = |k: usize| [rotation[k][0], rotation[k][1], rotation[k][2], shift[k]];
    let pose = Pose::of_rows(&[row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]);
    RigCamera::new(&index.to_string(), lens, &[(0, pose)]).unwrap()
}
