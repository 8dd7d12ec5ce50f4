//! Numerical extremes: every parameter at the values that have ever hurt a renderer or an optimiser, as a table of rows.
//!
//! A row runs its cases on an open device and compares them with the reference in double precision, or with what must hold for
//! any numbers: nothing that is not finite, equal bits, a zero that is exactly zero. The table is that of the tests
//! (`tests/extreme`, a test a row) and of the program `ivv-conformance`, which runs it on a user's own device. Rows are named after N1 to
//! N30 of the project's study of numerics; each states the bound that it holds, and why where that is not the study's.

#![allow(missing_docs, reason = "its users are the tests of this workspace")]

pub mod adjoint;
mod case;
mod chaos;
mod clocks;
mod counts;
mod exposure;
pub mod fixtures;
pub mod frames;
mod lists;
mod losses;
mod moments;
pub mod one;
mod optimiser;
mod places;
mod poison;
mod prelude;
pub mod random;
mod row;
mod shapes;
mod sound;
mod table;
mod times;
mod worlds;

pub use row::{Bench, Lent, Row, Tally};
pub use table::ROWS;
