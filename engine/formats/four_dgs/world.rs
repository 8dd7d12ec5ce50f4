use fourdgs::{CoordinateFrame, SceneExtras};
use std::collections::BTreeMap;

/// Entry of our own record, since the format knows axes alone.
const UP: &str = "up";
/// Attribute of the header, such as `y-up-right-handed`.
const AXES: &str = "coordinate_system";
/// The format's numbers.
const RIGHT: u8 = 1;
const LEFT: u8 = 2;
const METRE: u8 = 1;

/// The direction that is up, and the size of a unit, for headsets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct World {
    /// A direction of the scene's frame, not 0.
    pub up: [f64; 3],
    /// Metres of a unit of the scene, positive; none where unknown.
    pub metres_per_unit: Option<f64>,
}

impl World {
    /// The format's number of the axis nearest to upwards: x, y, z, -x, -y, -z.
    fn up_axis(&self) -> u8 {
        let longest = (0..3).fold(0, |best, axis| if self.up[axis].abs() > self.up[best].abs() { axis } else { best });
        longest as u8 + if self.up[longest] < 0.0 { 3 } else { 0 }
    }

    pub(in crate::internals::formats) fn is_y_up(&self) -> bool {
        self.up_axis() == 1
    }

    pub(super) fn put_into(&self, own: &mut BTreeMap<String, String>, extras: &mut SceneExtras) {
        own.insert(UP.to_owned(), self.up.map(|x| x.to_string()).join(" "));
        let up_axis = self.up_axis();
        extras.provenance.frames.push(CoordinateFrame {
            name: String::new(),
            handedness: RIGHT,
            up_axis,
            // Another axis is asked for; a scene has no front.
            forward_axis: if up_axis % 3 == 2 { 0 } else { 2 },
            length_unit: if self.metres_per_unit == Some(1.0) { METRE } else { 0 },
            metres_per_unit: self.metres_per_unit.unwrap_or(0.0),
        });
    }

    /// By our own record, the format's, or the header's text.
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
        let text = || scene.header.attributes.get(AXES).and_then(|text| axis_of_text(text));
        let up = told.or_else(|| frame.map(|frame| frame.up_axis).or_else(text).map(of_axis))?;
        // By the number, or by the unit's name.
        Some(World { up, metres_per_unit: scene.provenance.metres_per_unit("").filter(|metres| metres.is_finite()) })
    }

    /// By the format's frame, or by the header's text where it has none.
    pub(super) fn is_left_handed(scene: &fourdgs::Scene) -> bool {
        let text = || scene.header.attributes.get(AXES).is_some_and(|text| text.contains("left-handed"));
        scene.provenance.frame().map_or_else(text, |frame| frame.handedness == LEFT)
    }
}

/// The axis of `y-up...` or `-z-up...`.
fn axis_of_text(text: &str) -> Option<u8> {
    let (rest, first) = text.strip_prefix('-').map_or((text, 0), |rest| (rest, 3));
    let axis = ["x-up", "y-up", "z-up"].iter().position(|name| rest.starts_with(*name))?;
    Some(first + axis as u8)
}
