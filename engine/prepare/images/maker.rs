//! The pictures of one camera: decoded, scaled, undistorted, with their masks and priors.

use std::path::{Path, PathBuf};

use image::imageops::FilterType;
use image::{DynamicImage, ExtendedColorType, imageops};

use super::camera::Camera;
use crate::error::{Error, Result};
use crate::files::{make_folder, open_file, write_atomic};
use crate::prepare::fit::Crop;
use crate::prepare::foreign::decode_image;
use crate::prepare::settings::ImageFormat;
use crate::scene::Intrinsics;
use crate::scene::capture::{Shot, alpha_of};
use crate::scene::prior::{read_depth, read_flow, write_depth_halves, write_flow_halves};
use crate::scene::undistort::{Distortion, Undistortion};

pub(super) struct Maker<'a> {
    output: &'a Path,
    camera: &'a Camera,
    undistortion: Option<Undistortion>,
    /// From the part as it is recorded to the finished pictures: this one scales too.
    from_recorded: Option<Undistortion>,
    validity: Option<Vec<u8>>,
}

impl<'a> Maker<'a> {
    pub fn new(output: &'a Path, camera: &'a Camera) -> Self {
        let distorts = camera.lens.distortion != Distortion::None;
        let undistortion = distorts.then(|| Undistortion::new(camera.lens, camera.pinhole));
        let validity = undistortion.as_ref().and_then(Undistortion::validity);
        let Crop { width, height, .. } = camera.part;
        let recorded = || Undistortion::new(camera.lens.resized(width, height), camera.pinhole);
        let from_recorded = (!camera.is_as_recorded()).then(recorded);
        Maker { output, camera, undistortion, from_recorded, validity }
    }

    pub fn image<const C: usize>(&self, pixels: &[[u8; C]]) -> Vec<[u8; C]> {
        self.undistortion.as_ref().map_or_else(|| pixels.to_vec(), |undistortion| undistortion.image(pixels))
    }

    pub fn scaled(&self, path: &Path, filter: FilterType) -> Result<DynamicImage> {
        let (width, height) = self.camera.recorded;
        let mut image = decode_image(path, width, height)?;
        let (part, Intrinsics { width, height, .. }) = (self.camera.part, self.camera.lens.intrinsics);
        if part != Crop::whole(self.camera.recorded) {
            image = image.crop_imm(part.x, part.y, part.width, part.height);
        }
        if (width, height) == (part.width, part.height) {
            return Ok(image);
        }
        Ok(resized(image, [width, height], filter))
    }

    fn path(&self, folder: &str, frame: u32) -> PathBuf {
        self.output.join(folder).join(&self.camera.name).join(format!("{frame:05}.png"))
    }

    pub fn mask_is_done(&self, frame: u32) -> bool {
        (self.validity.is_none() && self.camera.masks.is_empty()) || self.path("masks", frame).is_file()
    }

    /// The mask of the source, or what of the undistorted picture is valid, if there is need of one.
    pub fn write_mask(&self, frame: u32, mask: Option<&Path>) -> Result<()> {
        match (mask, &self.validity) {
            (Some(mask), _) => self.write_plane("masks", frame, mask, false),
            (None, Some(validity)) => self.write_png("masks", frame, validity),
            (None, None) => Ok(()),
        }
    }

    pub fn write_plane(&self, folder: &str, frame: u32, from: &Path, of_alpha: bool) -> Result<()> {
        if self.path(folder, frame).is_file() {
            return Ok(());
        }
        let plane = self.scaled(from, FilterType::Nearest)?;
        let plane = if of_alpha { alpha_of(plane) } else { plane.into_luma8().into_raw() };
        let plane = self.undistortion.as_ref().map_or_else(|| plane.clone(), |undistortion| undistortion.mask(&plane));
        self.write_png(folder, frame, &plane)
    }

    fn part<T: Copy>(&self, plane: &[T]) -> Vec<T> {
        let Crop { x, y, width, height } = self.camera.part;
        let [across, x, width] = [self.camera.recorded.0, x, width].map(|side| side as usize);
        let rows = plane.chunks_exact(across).skip(y as usize).take(height as usize);
        rows.flat_map(|row| &row[x..x + width]).copied().collect()
    }

    pub fn write_priors(&self, frame: u32, shot: &Shot) -> Result<()> {
        let (width, height) = self.camera.recorded;
        let Intrinsics { width: to_width, height: to_height, .. } = self.camera.pinhole.intrinsics;
        if let Some(from) = &shot.flow {
            self.write_prior("flow", frame, from, |undistortion, to| {
                let flow = undistortion.flow(&self.part(&read_flow(from, width, height)?));
                write_flow_halves(to, &flow, to_width, to_height)
            })?;
        }
        if let Some(from) = &shot.depth {
            self.write_prior("depth", frame, from, |undistortion, to| {
                let depth = undistortion.depth(&self.part(&read_depth(from, width, height)?));
                write_depth_halves(to, &depth, to_width, to_height)
            })?;
        }
        Ok(())
    }

    /// Writes a prior that is not there yet: a copy where pictures stay as they are recorded, else what `change` makes of it.
    fn write_prior(
        &self,
        folder: &str,
        frame: u32,
        from: &Path,
        change: impl FnOnce(&Undistortion, &Path) -> Result<()>,
    ) -> Result<()> {
        let own = from.extension().filter(|_| self.from_recorded.is_none());
        let to = self.path(folder, frame).with_extension(own.unwrap_or("npy".as_ref()));
        if to.is_file() {
            return Ok(());
        }
        make_folder(&self.output.join(folder).join(&self.camera.name))?;
        match &self.from_recorded {
            None => take_over(from, &to),
            Some(undistortion) => change(undistortion, &to),
        }
    }

    fn write_png(&self, folder: &str, frame: u32, plane: &[u8]) -> Result<()> {
        let path = self.path(folder, frame);
        if path.is_file() {
            return Ok(());
        }
        make_folder(&self.output.join(folder).join(&self.camera.name))?;
        let Intrinsics { width, height, .. } = self.camera.pinhole.intrinsics;
        ImageFormat::Png.write(&path, plane, (width, height), ExtendedColorType::L8)
    }
}

/// A copy of a file of the source. No link: whoever edits the capture's images in place would change the source's.
pub(in crate::internals::prepare) fn take_over(from: &Path, to: &Path) -> Result<()> {
    let fault = |fault: std::io::Error| {
        let reason = format!("cannot be copied to {}: {fault}", to.display());
        Error::data(from, "", reason, "check permissions and free space")
    };
    let mut file = open_file(from).map_err(fault)?;
    write_atomic(to, |to| std::io::copy(&mut file, to).map(|_| ()))
}

/// An image in another size. What shows through at a rim has no colour, so colours count as far as they are opaque.
fn resized(image: DynamicImage, [width, height]: [u32; 2], filter: FilterType) -> DynamicImage {
    if !image.color().has_alpha() {
        return image.resize_exact(width, height, filter);
    }
    let mut image = image.into_rgba32f();
    image.pixels_mut().for_each(|image::Rgba([r, g, b, a])| [r, g, b].into_iter().for_each(|c| *c *= *a));
    let mut image = imageops::resize(&image, width, height, filter);
    for image::Rgba([r, g, b, a]) in image.pixels_mut().filter(|pixel| pixel.0[3] > 0.0) {
        [r, g, b].into_iter().for_each(|c| *c /= *a);
    }
    DynamicImage::ImageRgba32F(image).into_rgba8().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rims_have_the_colour_of_what_is_opaque() {
        let row = [[200, 100, 50, 255], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]];
        let image = image::RgbaImage::from_raw(4, 1, row.as_flattened().to_vec()).unwrap();
        let half = resized(image.into(), [2, 1], FilterType::Triangle).into_rgba8();
        let [left, right] = [half.get_pixel(0, 0).0, half.get_pixel(1, 0).0];
        assert!((100..180).contains(&left[3]) && left[..3] == [200, 100, 50], "{left:?}");
        assert!(right[3] < 40, "{right:?}");
    }
}
