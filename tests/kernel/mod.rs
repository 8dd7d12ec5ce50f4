//! Each kernel against its exact twin: edge sizes, poisoned memory, guarded ends.

mod scan;
mod sort;
