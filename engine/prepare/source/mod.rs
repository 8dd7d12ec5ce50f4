//! Recordings by others: cameras with their lenses and poses, and where their pictures are.

mod caliscope;
mod captures;
mod easymocap;
pub(super) mod footage;
mod immersive;
mod llff;
mod masks;
mod opencv;
mod others;
mod pose2sim;
mod recording;
mod rig;

use std::path::{Path, PathBuf};

use self::recording::Place;
pub(super) use self::recording::{Clocks, Footage, Source, SourceCamera};
use crate::error::Result;
use crate::prepare::pictures::Pictures;
use crate::prepare::settings::PrepareSettings;
use crate::scene::capture::{Faults, camera_place, check_asked, check_names, is_capture, is_unfinished, unread_poses};
use crate::words::count;

type Recogniser = fn(Place) -> bool;
type Reader = fn(Place, &mut Faults) -> Source;

/// Every format beyond captures: its name, how a folder is recognised, how it is read. The first that fits is taken.
const FORMATS: [(&str, Recogniser, Reader); 7] = [
    ("Google Immersive", |place| place.folder.join("models.json").is_file(), immersive::read),
    ("N3V", llff::is_n3v, llff::read),
    ("caliscope", |place| place.folder.join("camera_array.toml").is_file(), caliscope::read),
    ("EasyMocap", easymocap::is_easymocap, easymocap::read),
    ("anipose", pose2sim::is_anipose, pose2sim::read),
    ("Pose2Sim", |place| pose2sim::calibration(place).is_some(), pose2sim::read),
    ("COLMAP rig", rig::is_rig, rig::read),
];

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recognised {
    /// An English phrase, such as `a Pose2Sim recording`.
    pub what: String,
    /// The path for [`crate::prepare::prepare`]: the path itself or, of several recordings in it, the first.
    pub source: PathBuf,
}

/// The recording that [`crate::prepare::prepare`] can make a capture from; nothing where the path is a capture already, or unknown.
pub fn recognise(folder: &Path) -> Option<Recognised> {
    let settings = PrepareSettings::new(folder, Path::new(""));
    let place = Place { settings: &settings, folder, footage: folder };
    let (what, source) = match FORMATS.into_iter().find(|(_, is, _)| is(place)) {
        Some((format, ..)) => match pose2sim::trials(place).as_slice() {
            [] => (format!("{} {format} recording", if format.starts_with(['a', 'E']) { "an" } else { "a" }), None),
            trials => (format!("a {format} project of {}", count(trials.len(), "trial")), trials.first().cloned()),
        },
        None => {
            let poses = unread_poses(folder).first().map_or_else(String::new, |poses| format!(" ({poses})"));
            (pictures(&settings)?.name().to_owned() + &poses, None)
        }
    };
    Some(Recognised { what, source: source.unwrap_or(folder.to_owned()) })
}

pub(super) fn pictures(settings: &PrepareSettings) -> Option<Pictures> {
    let folder = settings.source.as_path();
    let place = Place { settings, folder, footage: settings.footage.as_deref().unwrap_or(folder) };
    let is_known = is_unfinished(folder) || is_capture(folder) || FORMATS.into_iter().any(|(_, is, _)| is(place));
    if is_known { None } else { Pictures::at(folder) }
}

impl Source {
    pub fn read(settings: &PrepareSettings, faults: &mut Faults) -> Result<Source> {
        let folder = settings.source.as_path();
        let place = Place { settings, folder, footage: settings.footage.as_deref().unwrap_or(folder) };
        let found = FORMATS.into_iter().find(|(_, is, _)| !is_unfinished(folder) && is(place));
        let source = match found {
            Some((format, _, read)) => {
                let mut source = Source { format, ..read(place, faults) };
                source.notes.extend(footage::notes(&source.cameras));
                faults.take(check_asked(folder, format, &settings.capture));
                source.exclude(&settings.capture.exclude, faults);
                Some(source)
            }
            None => captures::read(place, faults),
        };
        let Some(mut source) = source else {
            return Err(others::unknown(folder, |path| recognise(path).map(|known| (known.source, known.what))));
        };
        source.cameras.sort_by(|a, b| a.name.cmp(&b.name));
        match &settings.masks {
            Some(masks) => masks::find(&mut source, masks, faults),
            None if found.is_some() => source.notes.extend(masks::note(folder)),
            None => {}
        }
        if source.cameras.is_empty() && faults.n() == 0 {
            faults.add(&source.calibration, "", "holds no camera", "give a calibration with at least one camera");
        }
        for pair in source.cameras.windows(2).filter(|pair| pair[0].name == pair[1].name) {
            let place = camera_place(&pair[0].name);
            faults.add(&source.calibration, place, "is listed twice", "give every camera its own name");
        }
        for camera in &source.cameras {
            if let Some(reason) = camera.lens.fault() {
                let place = camera_place(&camera.name);
                faults.add(&source.calibration, place, reason, "calibrate the camera again, or correct the file");
            }
        }
        let names: Vec<&str> = source.cameras.iter().map(|camera| camera.name.as_str()).collect();
        check_names("--shift", settings.shifts.keys(), &names, &source.calibration, faults);
        source.choose_test_cameras(settings, faults);
        Ok(source)
    }

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
