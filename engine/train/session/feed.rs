//! The images of a run in their order: decoded ahead, or in the device's memory already.

use crate::error::Result;
use crate::parallel::threads;
use crate::scene::capture::{Asked, CacheStats, Capture, FrameCache, Picture, PriorPlan, pixel_bytes};
use crate::train::images::Shot;
use std::collections::HashMap;
use std::sync::Arc;
use std::vec::IntoIter;

/// How the image of a step comes to the device.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// Decoded, for this step alone.
    Passes,
    /// Decoded, to stay on the device.
    Stays,
    /// It has stayed there.
    Stayed,
    /// It has stayed there, and no later step has it.
    Leaves,
}

/// The images of the steps to come.
pub(super) struct Feed {
    /// Of those steps alone whose image must be decoded.
    cache: FrameCache,
    steps: IntoIter<(Asked, Way)>,
}

/// The image of a step.
pub(super) struct Next {
    asked: Asked,
    way: Way,
    /// Where it had to be decoded.
    picture: Option<Arc<Picture>>,
}

impl Feed {
    /// The images of `order` with the priors that `plan` names. At most `cache_bytes` of them are kept on the host and
    /// `image_bytes` on the device.
    ///
    /// # Errors
    /// [`crate::Error::Data`] where the capture has no such image.
    pub fn new(
        capture: &Capture,
        order: Vec<Asked>,
        plan: &PriorPlan,
        cache_bytes: u64,
        image_bytes: u64,
    ) -> Result<Self> {
        let bytes = |asked: &Asked| {
            let camera = capture.cameras.get(asked.camera);
            let shot = camera.and_then(|camera| camera.shot(asked.frame));
            let has_depth = plan.depth.contains_key(&(asked.camera, asked.frame));
            let has_flow = plan.flow && shot.is_some_and(|shot| shot.flow.is_some());
            let pixels = camera.map_or(0, |camera| {
                let reduced = |side: u32| u64::from(side / asked.reduction.min(side).max(1));
                reduced(camera.intrinsics.width) * reduced(camera.intrinsics.height)
            });
            pixels * pixel_bytes(has_depth, has_flow)
        };
        let ways = ways(&order, bytes, image_bytes);
        let decoded = order.iter().zip(&ways).filter(|(_, way)| matches!(way, Way::Passes | Way::Stays));
        let decoded: Vec<Asked> = decoded.map(|(asked, _)| *asked).collect();
        let cache = FrameCache::new(capture, decoded, plan, cache_bytes, threads())?;
        let steps: Vec<_> = order.into_iter().zip(ways).collect();
        Ok(Feed { cache, steps: steps.into_iter() })
    }

    /// The next step's image; none at the end.
    ///
    /// # Errors
    /// Those of the image.
    pub fn next_image(&mut self) -> Result<Option<Next>> {
        let Some((asked, way)) = self.steps.next() else { return Ok(None) };
        let picture = match way {
            Way::Passes | Way::Stays => self.cache.next_picture().transpose()?,
            Way::Stayed | Way::Leaves => None,
        };
        Ok(Some(Next { asked, way, picture }))
    }

    /// What the decoding has done so far.
    pub fn stats(&self) -> CacheStats {
        self.cache.stats()
    }
}

impl Next {
    /// Its name, where the device must have it already.
    pub fn on_device(&self) -> Option<&Asked> {
        self.picture.is_none().then_some(&self.asked)
    }

    /// As a trainer takes it.
    pub fn shot(&self) -> Shot<'_> {
        match (&self.picture, self.way) {
            (Some(picture), Way::Stays) => Shot::Stays(self.asked, picture),
            (Some(picture), _) => Shot::Passes(picture),
            (None, Way::Leaves) => Shot::Leaves(self.asked),
            (None, _) => Shot::Stayed(self.asked),
        }
    }
}

/// How each image of `order` comes to a device that keeps at most `budget` of their `bytes`.
///
/// Those stay that fit first, and as long as a later step has them. Were the one used least recently to leave for the next, a
/// device that holds half of the images would have the one it needs in 15 of 100 steps: every epoch shows all of them once, in a
/// new random order, so most others come by between two uses of an image. Of those that just stay it has 50.
fn ways(order: &[Asked], bytes: impl Fn(&Asked) -> u64, budget: u64) -> Vec<Way> {
    let last: HashMap<&Asked, usize> = order.iter().zip(0..).collect();
    let mut stays: HashMap<&Asked, bool> = HashMap::new();
    let (mut left, mut ways) = (budget, Vec::with_capacity(order.len()));
    for (at, asked) in order.iter().enumerate() {
        let is_last = last[asked] == at;
        ways.push(match stays.get(asked) {
            Some(true) if is_last => {
                left += bytes(asked);
                Way::Leaves
            }
            Some(true) => Way::Stayed,
            Some(false) => Way::Passes,
            None => {
                let needed = bytes(asked);
                let fits = !is_last && needed <= left;
                left -= if fits { needed } else { 0 };
                stays.insert(asked, fits);
                if fits { Way::Stays } else { Way::Passes }
            }
        });
    }
    ways
}

#[cfg(test)]
mod tests {
    use super::Way::*;
    use super::*;

    fn order(frames: &[u32]) -> Vec<Asked> {
        frames.iter().map(|frame| Asked::from((0, *frame))).collect()
    }

    #[test]
    fn those_stay_that_fit_first_as_long_as_a_later_step_has_them() {
        let order = order(&[1, 2, 3, 2, 3, 1, 3, 1, 2]);
        assert_eq!(ways(&order, |_| 10, 0), [Passes; 9]);
        assert_eq!(ways(&order, |_| 10, 9), [Passes; 9]);
        let one = [Stays, Passes, Passes, Passes, Passes, Stayed, Passes, Leaves, Passes];
        assert_eq!(ways(&order, |_| 10, 19), one);
        let two = [Stays, Stays, Passes, Stayed, Passes, Stayed, Passes, Leaves, Leaves];
        assert_eq!(ways(&order, |_| 10, 20), two);
        let all = [Stays, Stays, Stays, Stayed, Stayed, Stayed, Leaves, Leaves, Leaves];
        assert_eq!(ways(&order, |_| 10, u64::MAX / 2), all);
        // A small one fits beside a large one, and a larger one does not.
        let mixed = [Stays, Passes, Stays, Passes, Stayed, Stayed, Leaves, Leaves, Passes];
        assert_eq!(ways(&order, |asked| [0, 10, 30, 5][asked.frame as usize], 20), mixed);
    }

    #[test]
    fn what_leaves_makes_room_and_what_comes_once_passes() {
        // As where a run begins on smaller images.
        assert_eq!(ways(&order(&[1, 1, 2, 2, 3]), |_| 10, 10), [Stays, Leaves, Stays, Leaves, Passes]);
        assert_eq!(ways(&[], |_| 10, 10), []);
    }
}
