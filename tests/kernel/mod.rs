//! Each kernel against its exact twin: edge sizes, poisoned memory, guarded ends.

mod blend;
mod cull;
mod project;
mod scan;
mod sort;
mod tiles;
