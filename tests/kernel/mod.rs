//! Each kernel against its exact twin: edge sizes, poisoned memory, guarded ends.

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

use crate::common::twins::Tested;

/// Every kernel test that has a twin.
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
