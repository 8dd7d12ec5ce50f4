//! Images that are not there, cameras that are not wanted, and worlds that mirror.

use std::path::{Path, PathBuf};

use super::{Camera, CaptureBuilder, CaptureSettings, Faults, check_names, listed};
use crate::scene::Pose;
use glam::{DMat3, DVec3};

impl CaptureBuilder {
    pub(super) fn has_no_image(&self) -> bool {
        let mut shots = self.cameras.iter().flat_map(|camera| &camera.shots).peekable();
        shots.peek().is_some() && shots.all(|shot| !shot.image.exists())
    }

    /// Leaves out the images that are not there, with faults or, where that is asked for, a note.
    pub fn check_missing(&mut self, path: &Path, settings: &CaptureSettings, faults: &mut Faults) {
        let path = if path.is_file() { path.parent().unwrap_or(path) } else { path };
        let mut missing: Vec<PathBuf> = Vec::new();
        let mut n_images = 0;
        for camera in &mut self.cameras {
            n_images += camera.shots.len();
            camera.shots.retain(|shot| {
                let exists = shot.image.exists();
                missing.extend((!exists).then(|| shot.image.clone()));
                exists
            });
        }
        let n = missing.len();
        let Some(first) = missing.first() else { return };
        if n == n_images && n > 1 {
            return self.none_is_there(path, n, first, faults);
        }
        if settings.skip_missing {
            self.notes.push(format!("{n} images are missing and left out"));
            self.cameras.retain(|camera| !camera.shots.is_empty());
            return;
        }
        let remedy = self.elsewhere_words(path).unwrap_or_else(|| {
            format!("add the images, or leave out those that are missing with --skip-missing: {n} of {n_images}")
        });
        missing.iter().for_each(|image| faults.add(image, "", "is missing", &remedy));
    }

    fn none_is_there(&self, path: &Path, n: usize, first: &Path, faults: &mut Faults) {
        let at = first.strip_prefix(path).unwrap_or(first).display();
        let found = match listed(path, 2).first() {
            Some(found) => format!("found pictures of other names, as {}", found.display()),
            None => "found no picture in the capture".to_owned(),
        };
        let reason = format!("none of the {n} images that it names is there: looked for {at}, {found}");
        let remedy = self.elsewhere_words(path);
        let remedy = remedy.unwrap_or_else(|| "add the images, or name their folder with --images FOLDER".to_owned());
        faults.add(&self.calibration, "", reason, remedy);
    }

    fn elsewhere_words(&self, path: &Path) -> Option<String> {
        let named =
            |folder: &PathBuf| if folder.as_os_str().is_empty() { ".".into() } else { folder.display().to_string() };
        let folders: Vec<String> = self.elsewhere.iter().take(5).map(named).collect();
        let first = folders.first()?;
        let (some, path) = (folders.join(" and in "), path.display());
        Some(format!("images of these names lie in {some}: choose one, as with `ivv check {path} --images {first}`"))
    }

    pub fn exclude(&mut self, names: &[String], faults: &mut Faults) {
        if names.is_empty() {
            return;
        }
        let known: Vec<&str> = self.cameras.iter().map(|camera| camera.name.as_str()).collect();
        check_names("--exclude", names, &known, &self.calibration, faults);
        let before = self.cameras.len();
        self.cameras.retain(|camera| !names.contains(&camera.name));
        self.notes.push(format!("{} of {before} cameras are left out with --exclude", before - self.cameras.len()));
    }

    /// Where all cameras mirror, the world is left-handed: its x is turned around, for cameras and points alike.
    pub(super) fn unmirror(&mut self) {
        let own = |camera: &Camera| {
            let moving: Vec<Pose> = camera.shots.iter().filter_map(|shot| shot.world_to_camera).collect();
            if moving.is_empty() { vec![camera.world_to_camera] } else { moving }
        };
        let all: Vec<Pose> = self.cameras.iter().flat_map(own).collect();
        if all.is_empty() || !all.iter().all(|pose| pose.rotation.determinant() < 0.0) {
            return;
        }
        let turned = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        self.cameras.iter_mut().flat_map(Camera::poses_mut).for_each(|pose| pose.rotation *= turned);
        self.points.iter_mut().for_each(|point| point.position[0] = -point.position[0]);
        let n = all.len();
        self.notes.push(format!("all {n} poses mirror, as in a left-handed world: the world's x is turned around"));
    }

    pub(super) fn foretell(&mut self, faults: &Faults) {
        if faults.n() > 0 {
            return;
        }
        if !self.cameras.iter().any(|camera| camera.is_test) {
            let note = "no camera is kept for testing, so nothing will be scored: choose some with --test-cameras";
            self.notes.push(note.into());
        }
        if self.points.is_empty() && self.frame_points.is_none() {
            self.notes.push("there are no points: the first Gaussians will be where images agree, or at random".into());
        }
        let of = |camera: &Camera| (camera.intrinsics.width, camera.intrinsics.height);
        let mut sizes: Vec<(u32, u32)> = self.cameras.iter().map(of).collect();
        sizes.sort_unstable();
        sizes.dedup();
        if let [(w, h), .., (w_most, h_most)] = sizes.as_slice() {
            let n = sizes.len();
            self.notes.push(format!("images have {n} sizes, from {w} x {h} to {w_most} x {h_most}"));
        }
    }
}
