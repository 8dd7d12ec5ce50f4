//! Comparisons to the bit, which say what differs first.

use ivv::internals::scene::{Frame, Splats};
use ivv::internals::stage::Gradients;
use ivv_conformance::adjoint::{GROUPS, flat};
use std::fmt::{Debug, Display};

/// A value that is compared by its bits: -0 is not 0, and a NaN is itself.
pub trait Same: Debug {
    fn is_same(&self, other: &Self) -> bool;
}

macro_rules! integers {
    ($($of:ty)*) => {
        $(impl Same for $of {
            fn is_same(&self, other: &Self) -> bool {
                self == other
            }
        })*
    };
}
integers! { u8 u32 u64 i64 }

impl Same for f32 {
    fn is_same(&self, other: &Self) -> bool {
        self.to_bits() == other.to_bits()
    }
}

impl Same for f64 {
    fn is_same(&self, other: &Self) -> bool {
        self.to_bits() == other.to_bits()
    }
}

impl<T: Same, const N: usize> Same for [T; N] {
    fn is_same(&self, other: &Self) -> bool {
        self.iter().zip(other).all(|(one, other)| one.is_same(other))
    }
}

/// Demands that two lists are equal to the bit.
///
/// # Panics
/// Where they are not, with the first difference and how many there are.
#[track_caller]
pub fn assert_same<T: Same>(label: impl Display, found: &[T], truth: &[T]) {
    let differs = |i: &usize| !found[*i].is_same(&truth[*i]);
    let n = found.len().min(truth.len());
    let lengths = match found.len() == truth.len() {
        true => String::new(),
        false => format!(", {} values instead of {}", found.len(), truth.len()),
    };
    if let Some(first) = (0..n).find(differs) {
        let (all, found, truth) = ((first..n).filter(differs).count(), &found[first], &truth[first]);
        panic!("{label}: {all} of {n} differ{lengths}; number {first} is {found:?} instead of {truth:?}");
    }
    assert!(lengths.is_empty(), "{label}: the first {n} are equal{lengths}");
}

/// As [`assert_same`], of every number of a picture.
#[track_caller]
pub fn assert_same_frame(label: impl Display, found: &Frame, truth: &Frame) {
    assert_same(format_args!("{label}: colour"), &found.color, &truth.color);
    assert_same(format_args!("{label}: alpha"), &found.alpha, &truth.alpha);
    assert_same(format_args!("{label}: depth"), &found.depth, &truth.depth);
    assert_same(format_args!("{label}: inverse depth"), &found.inverse_depth, &truth.inverse_depth);
    assert_same(format_args!("{label}: flow"), &found.flow, &truth.flow);
}

/// As [`assert_same`], of every number of a scene's Gaussians.
#[track_caller]
pub fn assert_same_splats(label: impl Display, found: &Splats, truth: &Splats) {
    let motion = |splats: &Splats| bytemuck::cast_slice::<_, [f32; 5]>(&splats.motion).to_vec();
    assert_same(format_args!("{label}: position"), &found.position, &truth.position);
    assert_same(format_args!("{label}: rotation"), &found.rotation, &truth.rotation);
    assert_same(format_args!("{label}: scale"), &found.scale, &truth.scale);
    assert_same(format_args!("{label}: opacity"), &found.opacity, &truth.opacity);
    assert_same(format_args!("{label}: sh"), &found.sh, &truth.sh);
    assert_same(format_args!("{label}: motion"), &motion(found), &motion(truth));
    assert_same(format_args!("{label}: span"), &found.span, &truth.span);
}

/// As [`assert_same`], of every number of a gradient.
#[track_caller]
pub fn assert_same_gradients(label: impl Display, found: &Gradients, truth: &Gradients) {
    for group in GROUPS {
        assert_same(format_args!("{label}: {group}"), &flat(found, group), &flat(truth, group));
    }
}

fn said<T: Same + std::panic::RefUnwindSafe>(found: &[T], truth: &[T]) -> String {
    let panic = std::panic::catch_unwind(|| assert_same("depth", found, truth)).unwrap_err();
    panic.downcast_ref::<String>().expect("a message").clone()
}

#[test]
fn equal_lists_pass_and_a_difference_is_told_with_its_place_and_both_values() {
    assert_same("integers", &[1u32, 2, 3], &[1, 2, 3]);
    assert_same("none", &[0f32; 0], &[]);
    assert_same("bits", &[[f32::NAN, -0.0]], &[[f32::NAN, -0.0]]);
    for (found, truth, expected) in [
        (&[1.0f32, 2.0, 3.0][..], &[1.0f32, 2.5, 4.0][..], "2 of 3 differ; number 1 is 2.0 instead of 2.5"),
        (&[0.0], &[-0.0], "1 of 1 differ; number 0 is 0.0 instead of -0.0"),
        (&[1.0], &[1.0, 2.0], "the first 1 are equal, 1 values instead of 2"),
        (&[], &[2.0], "the first 0 are equal, 0 values instead of 1"),
        (&[1.0, 3.0, 7.0], &[2.0, 3.0], "1 of 2 differ, 3 values instead of 2; number 0 is 1.0 instead of 2.0"),
    ] {
        assert_eq!(said(found, truth), format!("depth: {expected}"));
    }
    assert_eq!(said(&[[7u8, 8]], &[[7, 9]]), "depth: 1 of 1 differ; number 0 is [7, 8] instead of [7, 9]");
}
