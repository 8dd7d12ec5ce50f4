//! How ffmpeg is given files that others made: by a name that cannot be taken for a protocol, and with leave to open nothing
//! but that.

use std::ffi::OsString;
use std::path::Path;

/// Containers that are read; playlists and lists of files, which name other files, are not among them.
const FORMATS: &str = "mov,matroska,avi,mpegts,mpeg,mxf,flv,asf,ogg,dv,h264,hevc,m4v,ivf,gif,yuv4mpegpipe,wav,w64,flac,mp3,\
                       aac,aiff,caf";

/// The name of a file for ffmpeg: a colon in a path would make what stands before it a protocol.
pub(crate) fn file_url(path: &Path) -> OsString {
    let mut url = OsString::from("file:");
    url.push(path);
    url
}

/// What stands before an input: the input may open local files only, and must not be a playlist.
pub(crate) fn input(path: &Path) -> [OsString; 6] {
    let words = ["-protocol_whitelist", "file", "-format_whitelist", FORMATS, "-i"].map(OsString::from);
    let [a, b, c, d, e] = words;
    [a, b, c, d, e, file_url(path)]
}
