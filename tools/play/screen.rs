//! Messages on standard error, which never end the work where nobody reads them.

use std::io::Write;

macro_rules! say {
    ($($part:tt)*) => { $crate::ui::screen::message(&format!($($part)*)) };
}

pub(crate) use {say, say as alert};

pub fn message(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Takes all that is written, so that a full disk or a closed pipe ends nothing.
pub struct Log;

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let _ = std::io::stderr().write_all(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
