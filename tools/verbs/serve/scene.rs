//! The `.4dgs` that is sent: bytes in memory, or a file of any length.

use bytes::Bytes;
use http_body_util::{Either, Full};
use hyper::body::{Body, Frame};
use ivv::internals::files::{cannot_read, open_file};
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
pub struct ServedScene {
    data: Data,
    /// Names its bytes.
    pub tag: String,
}

#[derive(Clone)]
enum Data {
    Memory(Bytes),
    File(Arc<OpenFile>),
}

/// An open file with its state when it was opened. If it is temporary, it is removed with the last use.
struct OpenFile {
    file: File,
    state: State,
    _temporary: Option<TemporaryFile>,
}

/// The length of a file and when it was written, which tell whether it was replaced.
type State = (u64, Duration);

pub struct TemporaryFile(pub PathBuf);

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        // A file that cannot be removed does no harm.
        let _ = std::fs::remove_file(&self.0);
    }
}

impl ServedScene {
    pub fn new(bytes: Bytes) -> Self {
        ServedScene { tag: tag(&bytes), data: Data::Memory(bytes) }
    }

    /// A file, read as it is sent. A `temporary` one is removed with the scene, or at once where an open file needs no name.
    pub fn of_file(path: &Path, temporary: Option<TemporaryFile>) -> ivv::Result<Self> {
        let fault = |fault: io::Error| cannot_read(path, &fault);
        let file = open_file(path).map_err(fault)?;
        let state = state(&file).map_err(fault)?;
        let tag = tag(format!("{} {} {}", path.display(), state.0, state.1.as_nanos()).as_bytes());
        let open = OpenFile { file, state, _temporary: temporary.filter(|_| !cfg!(unix)) };
        Ok(ServedScene { data: Data::File(Arc::new(open)), tag })
    }

    pub fn len(&self) -> usize {
        match &self.data {
            Data::Memory(bytes) => bytes.len(),
            Data::File(open) => open.state.0 as usize,
        }
    }

    pub fn part(&self, range: Range<usize>) -> Either<Full<Bytes>, FilePart> {
        match &self.data {
            Data::Memory(bytes) => Either::Left(Full::new(bytes.slice(range))),
            Data::File(open) => {
                Either::Right(FilePart { open: open.clone(), left: range.start as u64..range.end as u64 })
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

pub struct FilePart {
    open: Arc<OpenFile>,
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
        // One thread answers all requests, so no other moves the position of the file.
        let mut file = &self.open.file;
        let read = file.seek(SeekFrom::Start(self.left.start)).and_then(|_| file.take(n).read_to_end(&mut piece));
        // An answer never mixes two scenes.
        let is_same = state(file).is_ok_and(|now| now == self.open.state);
        self.left.start += n;
        Poll::Ready(Some(match read {
            Ok(read) if read as u64 == n && is_same => Ok(Frame::data(piece.into())),
            Ok(_) => Err(io::ErrorKind::UnexpectedEof.into()),
            Err(fault) => Err(fault),
        }))
    }
}
