//! Which images stay on the device, planned ahead for the steps to come.

use crate::scene::capture::Asked;
use std::collections::HashMap;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Residency {
    /// Decoded, and copied for this step alone.
    Passes,
    /// Decoded, and copied to stay for later steps, if the device has the memory.
    Stays,
    Stayed,
    /// Already there, and no later step needs it.
    Leaves,
}

impl Residency {
    pub fn is_decoded(self) -> bool {
        matches!(self, Residency::Passes | Residency::Stays)
    }
}

/// How each image of `order` comes to a device that keeps at most `budget` of their `bytes`. Images stay that fit first:
/// a device that holds half of them has the one it needs in 50 of 100 steps. If the one used least recently left, it
/// would be 15, since every epoch shows all in a new order.
pub(super) fn plan(order: &[Asked], bytes: impl Fn(&Asked) -> u64, budget: u64) -> Vec<Residency> {
    let last: HashMap<&Asked, usize> = order.iter().zip(0..).collect();
    let mut stays: HashMap<&Asked, bool> = HashMap::new();
    let (mut left, mut planned) = (budget, Vec::with_capacity(order.len()));
    for (at, asked) in order.iter().enumerate() {
        let is_last = last[asked] == at;
        planned.push(match stays.get(asked) {
            Some(true) if is_last => {
                left += bytes(asked);
                Residency::Leaves
            }
            Some(true) => Residency::Stayed,
            Some(false) => Residency::Passes,
            None => {
                let needed = bytes(asked);
                let fits = !is_last && needed <= left;
                left -= if fits { needed } else { 0 };
                stays.insert(asked, fits);
                if fits { Residency::Stays } else { Residency::Passes }
            }
        });
    }
    planned
}

#[cfg(test)]
mod tests {
    use super::Residency::*;
    use super::*;

    fn order(frames: &[u32]) -> Vec<Asked> {
        frames.iter().map(|frame| Asked::from((0, *frame))).collect()
    }

    #[test]
    fn those_stay_that_fit_first_as_long_as_a_later_step_has_them() {
        let order = order(&[1, 2, 3, 2, 3, 1, 3, 1, 2]);
        assert_eq!(plan(&order, |_| 10, 0), [Passes; 9]);
        assert_eq!(plan(&order, |_| 10, 9), [Passes; 9]);
        let one = [Stays, Passes, Passes, Passes, Passes, Stayed, Passes, Leaves, Passes];
        assert_eq!(plan(&order, |_| 10, 19), one);
        let two = [Stays, Stays, Passes, Stayed, Passes, Stayed, Passes, Leaves, Leaves];
        assert_eq!(plan(&order, |_| 10, 20), two);
        let all = [Stays, Stays, Stays, Stayed, Stayed, Stayed, Leaves, Leaves, Leaves];
        assert_eq!(plan(&order, |_| 10, u64::MAX / 2), all);
        // A small one fits beside a large one, and a larger one does not.
        let mixed = [Stays, Passes, Stays, Passes, Stayed, Stayed, Leaves, Leaves, Passes];
        assert_eq!(plan(&order, |asked| [0, 10, 30, 5][asked.frame as usize], 20), mixed);
    }

    #[test]
    fn what_leaves_makes_room_and_what_comes_once_passes() {
        // As where a run begins on smaller images.
        assert_eq!(plan(&order(&[1, 1, 2, 2, 3]), |_| 10, 10), [Stays, Leaves, Stays, Leaves, Passes]);
        assert_eq!(plan(&[], |_| 10, 10), []);
    }
}
