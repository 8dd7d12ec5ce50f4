//! The terminal: what `ivv` writes there, how it shows progress, and how it ends.

pub mod fault;
pub mod interrupt;
pub mod progress;
pub mod screen;
mod status_line;
mod stderr;
pub mod trace;
