use super::encode::Encoded;
use crate::error::{Error, Result};
use crate::scene::View;
use crate::words::count;
use std::path::Path;

/// Part of the Gaussians whose colours may be off by more than shows.
const MOST_OFF: f64 = 0.1;

#[derive(Debug, Default)]
pub struct Losses {
    n: usize,
    n_clamped_colors: usize,
    n_clamped_harmonics: usize,
    n_off: usize,
}

impl Losses {
    pub fn count(&mut self, encoded: &Encoded, views: &[View]) {
        self.n += encoded.len();
        self.n_clamped_colors += encoded.n_clamped_colors;
        self.n_clamped_harmonics += encoded.n_clamped_harmonics;
        self.n_off += encoded.n_off(views);
    }

    /// The note on colours that are cut, if any. Refuses a file that makes too many colours wrong, unless `clamp_colors`.
    pub fn judge(&self, path: &Path, clamp_colors: bool) -> Result<Option<String>> {
        let Losses { n, n_clamped_colors, n_clamped_harmonics, n_off } = *self;
        if n_off as f64 > MOST_OFF * n as f64 && !clamp_colors {
            let reason = format!(
                "expected colours that a .4dgs holds, found {n_off} of {} off by more than 2 levels of 255",
                count(n, "Gaussian")
            );
            return Err(Error::data(path, "", reason, "export as PLY, or give --clamp-colors"));
        }
        Ok((n_clamped_colors + n_clamped_harmonics > 0).then(|| {
            format!(
                "{} with a base colour beyond 0 to 1, {n_clamped_harmonics} with harmonics beyond -4 to 4: cut to that, and the \
                 rest of their coefficients makes it good; {n_off} are off by more than 2 levels of 255",
                count(n_clamped_colors, "Gaussian")
            )
        }))
    }
}
