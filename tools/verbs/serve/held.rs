//! The `.4dgs` that is sent: bytes in memory, or a file of any length.

use bytes::Bytes;
use http_body_util::{Either, Full};
use hyper::body::{Body, Frame};
use ivv::files::{cannot_read, open_file};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::{Duration, UNIX_EPOCH};

/// Bytes of a file that are sent at once.
const PIECE: u64 = 1 << 18;

/// A `.4dgs` that is sent.
#[derive(Clone)]
pub struct Scene {
    held: Held,
    /// Names its bytes.
    pub tag: String,
}

#[derive(Clone)]
enum Held {
    Memory(Bytes),
    File(Arc<Kept>),
}

/// An open file with its state when it was opened. If it is temporary, it is removed when nobody needs it any more.
struct Kept {
    file: File,
    state: State,
    _removed: Option<Removed>,
}

/// Its length and when it was written, by which a file that is written anew is told.
type State = (u64, Duration);

/// A file that is removed when this is dropped.
pub struct Removed(pub PathBuf);

impl Drop for Removed {
    fn drop(&mut self) {
        // What cannot be removed does no harm.
        let _ = std::fs::remove_file(&self.0);
    }
}

impl Scene {
    /// These bytes.
    pub fn new(bytes: Bytes) -> Self {
        Scene { tag: tag(&bytes), held: Held::Memory(bytes) }
    }

    /// Those of a file, which is read as it is sent; with `removed` it goes with the scene, or at once where an open file needs no
    /// name, so that nothing is left of a server that is killed.
    ///
    /// # Errors
    /// Those of the file.
    pub fn of_file(path: &Path, removed: Option<Removed>) -> ivv::Result<Self> {
        let fault = |fault: io::Error| cannot_read(path, &fault);
        let file = open_file(path).map_err(fault)?;
        let state = state(&file).map_err(fault)?;
        let tag = tag(format!("{} {} {}", path.display(), state.0, state.1.as_nanos()).as_bytes());
        let kept = Kept { file, state, _removed: removed.filter(|_| !cfg!(unix)) };
        Ok(Scene { held: Held::File(Arc::new(kept)), tag })
    }

    /// How many bytes there are.
    pub fn len(&self) -> usize {
        match &self.held {
            Held::Memory(bytes) => bytes.len(),
            Held::File(kept) => kept.state.0 as usize,
        }
    }

    /// A part of them, to be sent.
    pub fn part(&self, range: Range<usize>) -> Either<Full<Bytes>, FilePart> {
        match &self.held {
            Held::Memory(bytes) => Either::Left(Full::new(bytes.slice(range))),
            Held::File(kept) => {
                Either::Right(FilePart { kept: kept.clone(), left: range.start as u64..range.end as u64 })
            }
        }
    }
}

fn state(file: &File) -> io::Result<State> {
    let data = file.metadata()?;
    let changed = data.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok()).unwrap_or_default();
    Ok((data.len(), changed))
}

fn tag(named: &[u8]) -> String {
    let tag: String = Sha256::digest(named)[..16].iter().map(|byte| format!("{byte:02x}")).collect();
    format!("\"{tag}\"")
}

/// A part of a file, piece by piece.
pub struct FilePart {
    kept: Arc<Kept>,
    left: Range<u64>,
}

impl Body for FilePart {
    type Data = Bytes;
    type Error = io::Error;

    fn poll_frame(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<io::Result<Frame<Bytes>>>> {
        if self.left.is_empty() {
            return Poll::Ready(None);
        }
        let n = PIECE.min(self.left.end - self.left.start);
        let mut piece = Vec::new();
        // One thread answers all, so that none other moves the file's place in between.
        let mut file = &self.kept.file;
        let read = file.seek(SeekFrom::Start(self.left.start)).and_then(|_| file.take(n).read_to_end(&mut piece));
        // An answer is never of two scenes.
        let is_same = state(file).is_ok_and(|now| now == self.kept.state);
        self.left.start += n;
        Poll::Ready(Some(match read {
            Ok(read) if read as u64 == n && is_same => Ok(Frame::data(piece.into())),
            Ok(_) => Err(io::ErrorKind::UnexpectedEof.into()),
            Err(fault) => Err(fault),
        }))
    }
}
