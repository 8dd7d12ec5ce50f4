//! What others recorded: cameras with their lenses and poses, and where their pictures are.

mod caliscope;
mod captures;
pub(super) mod footage;
mod immersive;
mod llff;
mod opencv;
mod pose2sim;
mod recording;
mod rig;

use std::path::Path;

use self::recording::Place;
pub(super) use self::recording::{Clocks, Footage, Source, SourceCamera};
use crate::error::{Error, Result};
use crate::prepare::pictures::Pictures;
use crate::prepare::settings::PrepareSettings;
use crate::scene::capture::{Faults, check_asked, check_names, is_capture, is_unfinished};

type Recogniser = fn(Place) -> bool;
type Reader = fn(Place, &mut Faults) -> Source;

/// Every format beyond those that are read as captures: its name, how a folder is recognised, how it is read. The first that
/// fits is taken.
const FORMATS: [(&str, Recogniser, Reader); 5] = [
    ("Google Immersive", |place| place.folder.join("models.json").is_file(), immersive::read),
    ("N3V", llff::is_n3v, llff::read),
    ("caliscope", |place| place.folder.join("camera_array.toml").is_file(), caliscope::read),
    ("Pose2Sim", |place| pose2sim::calibration(place.folder).is_some(), pose2sim::read),
    ("COLMAP rig", rig::is_rig, rig::read),
];

/// See [`crate::prepare::recognise`].
pub(super) fn recognise(folder: &Path) -> Option<String> {
    let settings = PrepareSettings::new(folder, Path::new(""));
    let place = Place { settings: &settings, folder, footage: folder };
    match FORMATS.into_iter().find(|(_, is, _)| is(place)) {
        Some((format, ..)) => Some(format!("a {format} recording")),
        None => pictures(&settings).map(|pictures| pictures.name().to_owned()),
    }
}

/// Pictures without cameras, where the source is nothing else.
pub(super) fn pictures(settings: &PrepareSettings) -> Option<Pictures> {
    let folder = settings.source.as_path();
    let place = Place { settings, folder, footage: settings.footage.as_deref().unwrap_or(folder) };
    let is_known = is_unfinished(folder) || is_capture(folder) || FORMATS.into_iter().any(|(_, is, _)| is(place));
    if is_known { None } else { Pictures::at(folder) }
}

impl Source {
    /// Reads the source of the settings; the format is recognised from the folder's content.
    ///
    /// # Errors
    /// [`Error::Data`] when the folder is in no known format.
    pub fn read(settings: &PrepareSettings, faults: &mut Faults) -> Result<Source> {
        let folder = settings.source.as_path();
        let place = Place { settings, folder, footage: settings.footage.as_deref().unwrap_or(folder) };
        let found = FORMATS.into_iter().find(|(_, is, _)| !is_unfinished(folder) && is(place));
        let source = match found {
            Some((format, _, read)) => {
                let mut source = Source { format, ..read(place, faults) };
                faults.take(check_asked(
                    folder,
                    if format == "COLMAP rig" { "COLMAP" } else { format },
                    &settings.capture,
                ));
                source.exclude(&settings.capture.exclude, faults);
                Some(source)
            }
            None => captures::read(place, faults),
        };
        let Some(mut source) = source else {
            let reason = if folder.is_dir() { "not a recognised recording" } else { "no such folder" };
            let remedy = "give a folder with models.json, poses_bounds.npy, camera_array.toml, Pose2Sim's calibration/, \
                          cameras.txt and images.txt beside videos, capture.toml, train_meta.json, transforms.json or a \
                          COLMAP model in sparse/0; or photos, a video or a folder of videos, whose cameras COLMAP finds";
            return Err(Error::data(folder, "", reason, remedy));
        };
        source.cameras.sort_by(|a, b| a.name.cmp(&b.name));
        if source.cameras.is_empty() && faults.n() == 0 {
            faults.add(&source.calibration, "", "holds no camera", "give a calibration with at least one camera");
        }
        for pair in source.cameras.windows(2).filter(|pair| pair[0].name == pair[1].name) {
            let place = format!("camera `{}`", pair[0].name.escape_debug());
            faults.add(&source.calibration, place, "is listed twice", "give every camera its own name");
        }
        for camera in &source.cameras {
            if let Some(reason) = camera.lens.fault() {
                let place = format!("camera `{}`", camera.name.escape_debug());
                faults.add(&source.calibration, place, reason, "calibrate the camera again, or correct the file");
            }
        }
        let names: Vec<&str> = source.cameras.iter().map(|camera| camera.name.as_str()).collect();
        check_names("--shift", settings.shifts.keys(), &names, &source.calibration, faults);
        source.choose_test_cameras(settings, faults);
        Ok(source)
    }

    /// Leaves out the cameras of these names.
    fn exclude(&mut self, names: &[String], faults: &mut Faults) {
        if names.is_empty() {
            return;
        }
        let known: Vec<&str> = self.cameras.iter().map(|camera| camera.name.as_str()).collect();
        check_names("--exclude", names, &known, &self.calibration, faults);
        self.cameras.retain(|camera| !names.contains(&camera.name));
        self.notes.push(format!("left out with --exclude: {}", names.join(", ")));
    }

    fn choose_test_cameras(&mut self, settings: &PrepareSettings, faults: &mut Faults) {
        let Some(chosen) = &settings.capture.test_cameras else { return };
        let names: Vec<&str> = self.cameras.iter().map(|camera| camera.name.as_str()).collect();
        check_names("test cameras", chosen, &names, &self.calibration, faults);
        self.cameras.iter_mut().for_each(|camera| camera.is_test = chosen.contains(&camera.name));
    }
}
