//! Which way is up in a clip, and how large it is.

use fourdgs::{CoordinateFrame, SceneExtras};
use std::collections::BTreeMap;

/// Name of the entry of our own record that holds the direction, since the format knows axes alone.
const UP: &str = "up";
/// The format's numbers of a right-handed and of a left-handed frame, and of metres.
const RIGHT: u8 = 1;
const LEFT: u8 = 2;
const METRE: u8 = 1;

/// Which way is up in a clip, and how large it is: a headset needs both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct World {
    /// A direction of the scene's frame, not 0.
    pub up: [f64; 3],
    /// Metres of a unit of the scene, positive; none where nobody knows.
    pub metres_per_unit: Option<f64>,
}

impl World {
    /// Puts it into our own record, and as the nearest axis into the format's.
    pub(super) fn put_into(&self, own: &mut BTreeMap<String, String>, extras: &mut SceneExtras) {
        own.insert(UP.to_owned(), self.up.map(|x| x.to_string()).join(" "));
        let longest = (0..3).fold(0, |best, axis| if self.up[axis].abs() > self.up[best].abs() { axis } else { best });
        let up_axis = longest as u8 + if self.up[longest] < 0.0 { 3 } else { 0 };
        extras.provenance.frames.push(CoordinateFrame {
            name: String::new(),
            handedness: RIGHT,
            up_axis,
            // Another axis is asked for; a scene has no front.
            forward_axis: if longest == 2 { 0 } else { 2 },
            length_unit: if self.metres_per_unit == Some(1.0) { METRE } else { 0 },
            metres_per_unit: self.metres_per_unit.unwrap_or(0.0),
        });
    }

    /// That of a file, in our own record `own` or in the format's; none where it says nothing.
    pub(super) fn of(scene: &fourdgs::Scene, own: Option<&BTreeMap<String, String>>) -> Option<Self> {
        let frame = scene.provenance.frame();
        let is_direction = |up: &[f64; 3]| up.iter().all(|x| x.is_finite()) && *up != [0.0; 3];
        let told = own.and_then(|own| own.get(UP)).and_then(|text| {
            let numbers = text.split(' ').map(|part| part.parse().ok()).collect::<Option<Vec<f64>>>()?;
            <[f64; 3]>::try_from(numbers).ok().filter(is_direction)
        });
        let of_axis = |axis: u8| {
            std::array::from_fn(|k| match (k == usize::from(axis % 3), axis < 3) {
                (false, _) => 0.0,
                (true, true) => 1.0,
                (true, false) => -1.0,
            })
        };
        let up = told.or(frame.map(|frame| of_axis(frame.up_axis)))?;
        // By the number, or else by the name of the unit.
        Some(World { up, metres_per_unit: scene.provenance.metres_per_unit("") })
    }

    /// Whether a file says that its axes are left-handed: in the format's frame, or in the header's text where it has none.
    pub(super) fn is_left_handed(scene: &fourdgs::Scene) -> bool {
        let text = || scene.header.attributes.get("coordinate_system").is_some_and(|text| text.contains("left-handed"));
        scene.provenance.frame().map_or_else(text, |frame| frame.handedness == LEFT)
    }
}
