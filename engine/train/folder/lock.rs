//! One training at a time in a run folder.

use crate::error::{Error, Result};
use std::fs::{File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// It stays in the run folder: a lock file that came and went could be locked twice.
const NAME: &str = ".lock";
/// Tries on a lock that another process holds, and the time between.
const TRIES: usize = 20;
const PAUSE: Duration = Duration::from_millis(50);
const MAX_TEXT: u64 = 1 << 12;

/// Holds a run folder for this process, until it ends.
#[derive(Debug)]
pub struct RunLock {
    _file: File,
}

#[derive(serde::Serialize, serde::Deserialize)]
struct Holder {
    pid: u32,
    host: String,
    /// Seconds since 1970.
    since: u64,
}

impl RunLock {
    /// Locks `folder`, which must be there; the fault says who holds it. Without locks of the file system it warns.
    pub fn take(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        let open = File::options().read(true).write(true).create(true).truncate(false).open(&path);
        let cannot = |e| Error::data(&path, "", format!("cannot be written: {e}"), "check the folder's permissions");
        let mut file = open.map_err(cannot)?;
        match patiently(&file) {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let reason = format!("a training is running in this folder: {}", told(&mut file));
                return Err(Error::data(folder, "", reason, "wait for its end, or choose another folder with -o"));
            }
            Err(TryLockError::Error(fault)) => {
                tracing::warn!("{}: cannot be locked ({fault}): start no second training there", path.display());
            }
        }
        let holder = Holder {
            pid: std::process::id(),
            host: gethostname::gethostname().to_string_lossy().into_owned(),
            since: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()),
        };
        let text = serde_json::to_vec(&holder).unwrap_or_default();
        file.set_len(0).and_then(|()| file.rewind()).and_then(|()| file.write_all(&text)).map_err(cannot)?;
        Ok(RunLock { _file: file })
    }
}

/// Locks `file`. A process that was killed holds its locks until it is gone, which is soon.
fn patiently(file: &File) -> std::result::Result<(), TryLockError> {
    for _ in 0..TRIES {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => std::thread::sleep(PAUSE),
            outcome => return outcome,
        }
    }
    file.try_lock()
}

fn told(file: &mut File) -> String {
    let mut text = String::new();
    let read = file.take(MAX_TEXT).read_to_string(&mut text);
    let Some(holder) = read.ok().and_then(|_| serde_json::from_str::<Holder>(&text).ok()) else {
        return "another process".to_owned();
    };
    let Holder { pid, host, since } = holder;
    let begun = UNIX_EPOCH.checked_add(Duration::from_secs(since));
    let minutes = begun.and_then(|begun| begun.elapsed().ok()).map_or(0, |elapsed| elapsed.as_secs() / 60);
    format!("process {pid} on {host}, for {} h {:02} min", minutes / 60, minutes % 60)
}
