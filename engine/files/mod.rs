//! Files: written whole or not at all, read with bounds, and the containers that several formats share.

pub(crate) mod archive;
mod file;
pub(crate) mod npy;
pub(crate) mod ply_header;
pub(crate) mod ply_rows;
mod tensors;

pub use file::{Temporary, cannot_read, folder_of, open_file, read_file, read_text, remove_temporaries, write_atomic};
pub(crate) use file::{as_text, cannot_list, cannot_write, make_folder, parse_json, read_bytes, read_json, write_made};
pub use tensors::{Tensor, read_tensors, write_tensors};
