//! From pixels to ears.

use super::horizon;
use super::measure::{compare, lateness};
use super::rigs::{mouths, rig};
use super::simulate::{Motion, Simulated, simulate};
use crate::common::prelude::*;
use ivv::internals::sound::localize::{LocalizeSettings, localize};

/// From the simulated world (z up) to that of the cameras (y down), the beginning of the walk in their middle; and back.
const MIDDLE: DVec3 = DVec3::new(-0.9, 1.8, 0.0);

fn to_cameras(p: DVec3) -> DVec3 {
    let p = p - MIDDLE;
    DVec3::new(p.x, -p.z, p.y + 3.0)
}

fn from_cameras(p: DVec3) -> DVec3 {
    DVec3::new(p.x, p.z - 3.0, -p.y) + MIDDLE
}

/// T35 with the source where it is found by what cameras see, their clocks half of a frame apart: the limits are those of the
/// true track.
#[test]
fn t35_a_localised_source_is_heard_where_it_is() {
    let Simulated { scene, recording, head, truth } = &simulate(Motion::Walk, 0.4, 35, horizon());
    let mut rig = rig(6, 30.0, 13);
    for (camera, offset) in rig.cameras.iter_mut().zip([0.25, -0.2, 0.15, -0.25, 0.2, -0.15]) {
        camera.offset = offset;
    }
    let seen = mouths(&rig, 35, |frame, _| vec![to_cameras(scene.sources[0].track.at(frame / 30.0).unwrap())]);
    let found = localize(&rig, &seen, &LocalizeSettings { metres_per_unit: Some(1.0), hold: false });
    assert_eq!(found.tracks.len(), 1);
    let back = |sample: &SourceSample| SourceSample { p: from_cameras(sample.p), ..*sample };
    let samples = found.tracks[0].samples.iter().map(back).collect();
    let mut localised = scene.clone();
    localised.sources[0].track = SourceTrack { samples, ..found.tracks[0].clone() };
    let config = RenderConfig::default();
    let heard = render_signals(&localised, std::slice::from_ref(recording), head, horizon(), &config).unwrap();
    let error = compare(&heard.samples, truth, horizon(), |t| lateness(scene, head, t));
    println!("{error:?}");
    assert!(error.azimuth <= 2.0 && error.level <= 0.3 && error.frames > 4, "{error:?}");
}
