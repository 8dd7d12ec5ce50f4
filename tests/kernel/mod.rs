//! Each kernel against its exact reference: edge sizes, poisoned memory, guarded ends.

mod adam;
mod batch;
mod bilateral;
mod blend;
mod clear;
mod clock;
mod cull;
mod density;
mod fisher;
mod losses;
mod lpips;
mod mcmc;
mod moments;
mod pose;
mod priors;
mod probe;
mod project;
mod scan;
mod show;
mod sort;
mod tiles;

use crate::common::prelude::*;
use crate::common::references::Tested;
use ivv_conformance::fixtures::adam::Scene;
use std::fmt::Display;

pub const TESTED: &[&[Tested]] = &[
    adam::TESTED,
    batch::TESTED,
    bilateral::TESTED,
    blend::TESTED,
    clear::TESTED,
    clock::TESTED,
    cull::TESTED,
    density::TESTED,
    fisher::TESTED,
    losses::TESTED,
    lpips::TESTED,
    mcmc::TESTED,
    moments::TESTED,
    pose::TESTED,
    priors::TESTED,
    probe::TESTED,
    project::TESTED,
    scan::TESTED,
    show::TESTED,
    sort::TESTED,
    tiles::TESTED,
];

#[track_caller]
fn assert_same_scene(label: impl Display, found: &Scene, truth: &Scene) {
    assert_same_splats(&label, &found.params, &truth.params);
    assert_same_splats(format_args!("{label}: first moments of"), &found.first, &truth.first);
    assert_same_splats(format_args!("{label}: second moments of"), &found.second, &truth.second);
    assert_same(format_args!("{label}: state"), &found.state, &truth.state);
}
