//! The one error type of the engine. Every variant says what, where, why and the remedy; its exit code is SPEC 10's.

use std::fmt;
use std::path::{Path, PathBuf};

/// `Result` with the engine's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// An error of the engine.
#[derive(Debug)]
pub enum Error {
    /// A file that cannot be read, written or believed.
    Data {
        /// The file.
        file: PathBuf,
        /// Where in the file: a row, a byte offset, a property or a view; empty for the file as a whole.
        place: String,
        /// The fault there.
        reason: String,
        /// The remedy.
        remedy: String,
    },
    /// No Vulkan device can run the engine.
    NoDevice {
        /// Why none will do.
        reason: String,
        /// The remedy.
        remedy: String,
    },
    /// Memory or a limit of the device is exceeded.
    OutOfMemory {
        /// The thing that was to be allocated or bound.
        what: String,
        /// Bytes (or items, as `what` says) needed; 0 where the driver does not say.
        needed: u64,
        /// The limit that binds, in the same unit.
        limit: u64,
        /// The remedy.
        remedy: String,
    },
    /// The driver ran out of memory in a call that does not say how much it needed.
    DriverOutOfMemory {
        /// The call.
        call: &'static str,
        /// Whose memory: `the device` or `the host`.
        of: &'static str,
    },
    /// The device stopped answering.
    DeviceLost {
        /// The last pass known to have begun; empty where none was under way or the device keeps no breadcrumbs.
        after_pass: String,
    },
    /// Other processes of the same run do not answer.
    RanksLost {
        /// The known cause.
        reason: String,
    },
    /// A Vulkan call failed in a way that has no better name.
    Vulkan {
        /// The call.
        call: &'static str,
        /// The driver's answer.
        reason: String,
    },
    /// A value that must be finite is not.
    NonFinite {
        /// The buffer or quantity.
        what: String,
        /// How many values.
        count: u64,
        /// The remedy.
        remedy: &'static str,
    },
}

const AGAIN: &str = "run again, with --device to choose another device if it persists";

impl Error {
    pub(crate) fn no_device(reason: impl Into<String>, remedy: &str) -> Self {
        Error::NoDevice { reason: reason.into(), remedy: remedy.to_owned() }
    }

    /// A fault of `file` at `place`.
    pub fn data(file: &Path, place: impl Into<String>, reason: impl Into<String>, remedy: impl Into<String>) -> Self {
        Error::Data { file: file.to_owned(), place: place.into(), reason: reason.into(), remedy: remedy.into() }
    }

    /// True if it may pass once others free memory.
    pub fn is_out_of_memory(&self) -> bool {
        matches!(self, Error::OutOfMemory { .. } | Error::DriverOutOfMemory { .. })
    }

    /// The process exit code of SPEC 10.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Data { .. } => 3,
            Error::NoDevice { .. } | Error::DeviceLost { .. } | Error::RanksLost { .. } | Error::Vulkan { .. } => 4,
            Error::OutOfMemory { .. } | Error::DriverOutOfMemory { .. } => 5,
            Error::NonFinite { .. } => 6,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Data { file, place, reason, remedy } => {
                write!(f, "{}", file.display())?;
                if !place.is_empty() {
                    write!(f, ", {place}")?;
                }
                write!(f, ": {reason}; {remedy}")
            }
            Error::NoDevice { reason, remedy } => write!(f, "no usable Vulkan device: {reason}; {remedy}"),
            Error::OutOfMemory { what, needed: 0, remedy, .. } => {
                write!(f, "{what} failed: the device or its driver is out of memory; {remedy}")
            }
            Error::OutOfMemory { what, needed, limit, remedy } => {
                write!(f, "{what} needs {needed}, the limit is {limit}; {remedy}")
            }
            Error::DriverOutOfMemory { call, of } => write!(
                f,
                "{call} failed: {of} is out of memory; close other programs, choose a device with more memory, or use a \
                 smaller scene or picture"
            ),
            Error::DeviceLost { after_pass } => {
                write!(f, "the device was lost; ")?;
                if !after_pass.is_empty() {
                    write!(f, "the last pass known to have begun is `{after_pass}`; ")?;
                }
                write!(f, "{AGAIN}")?;
                if after_pass.is_empty() {
                    write!(f, ", or with --breadcrumbs to learn in which pass it is lost")?;
                }
                Ok(())
            }
            Error::RanksLost { reason } => write!(
                f,
                "the processes of this run no longer step together: {reason}; start all of them again, with --resume where \
                 there is a checkpoint"
            ),
            Error::Vulkan { call, reason } => write!(f, "{call} failed: {reason}; {AGAIN}"),
            Error::NonFinite { what, count, remedy } => {
                write!(f, "{what} holds {count} values that are not finite; {remedy}")
            }
        }
    }
}

impl std::error::Error for Error {}

#[cfg(test)]
mod tests {
    use super::Error;

    #[test]
    fn faults_of_the_device_and_of_what_it_gives_tell_a_remedy() {
        let faults = [
            (Error::RanksLost { reason: "MPI has ended".to_owned() }, "--resume"),
            (Error::Vulkan { call: "vkQueueSubmit", reason: "ERROR_UNKNOWN".to_owned() }, "--device"),
            (Error::NonFinite { what: "view `a`".to_owned(), count: 2, remedy: "look at it" }, "look at it"),
            (Error::DeviceLost { after_pass: String::new() }, "--device"),
        ];
        for (fault, remedy) in faults {
            let told = fault.to_string();
            assert!(told.rsplit_once("; ").is_some_and(|(_, last)| last.contains(remedy)), "{told}");
        }
    }
}
