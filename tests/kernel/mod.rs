//! Each kernel against its exact twin: edge sizes, poisoned memory, guarded ends.

mod adam;
mod bilateral;
mod blend;
mod clock;
mod cull;
mod density;
mod eyes;
mod fisher;
mod losses;
mod lpips;
mod moments;
mod priors;
mod probe;
mod project;
mod scan;
mod show;
mod sort;
mod tiles;
