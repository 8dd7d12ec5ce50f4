//! Looking at a video file.

use std::ffi::OsString;
use std::path::Path;

use super::Video;
use super::colour;
use super::times::{rate, shown};
use crate::error::{Error, Result};
use crate::prepare::program::FFPROBE;
use crate::prepare::shifts::frame_of_day;
use crate::video::input;

/// Sound may begin so much before the first picture, seconds, for what encoders of sound need ahead; beyond that, pictures begin late.
const AHEAD: f64 = 0.05;
/// No codec has a frame wait for more.
const MOST_WAIT: u32 = 16;

#[derive(serde::Deserialize)]
struct Probe {
    streams: Vec<Stream>,
    #[serde(default)]
    format: Container,
}

#[derive(Default, serde::Deserialize)]
struct Container {
    #[serde(default)]
    format_name: String,
    start_time: Option<String>,
    #[serde(default)]
    tags: Tags,
}

#[derive(Default, serde::Deserialize)]
struct Tags {
    timecode: Option<String>,
}

#[derive(serde::Deserialize)]
struct Stream {
    codec_type: String,
    width: Option<u32>,
    height: Option<u32>,
    avg_frame_rate: Option<String>,
    r_frame_rate: Option<String>,
    nb_frames: Option<String>,
    has_b_frames: Option<u32>,
    field_order: Option<String>,
    color_range: Option<String>,
    color_space: Option<String>,
    color_transfer: Option<String>,
    color_primaries: Option<String>,
    #[serde(default)]
    tags: Tags,
    #[serde(default)]
    side_data_list: Vec<SideData>,
}

#[derive(serde::Deserialize)]
struct SideData {
    rotation: Option<f64>,
    dv_profile: Option<u32>,
    dv_bl_signal_compatibility_id: Option<u32>,
}

/// Looks at a video file: what its container tells, and when each of its pictures is shown. Nothing is decoded where packets tell that.
pub(in crate::internals::prepare) fn probe(path: &Path) -> Result<Video> {
    let bad = |reason: &str| Error::data(path, "", reason, "give a video that ffmpeg can read");
    let probe = ask(path)?;
    let timecodes = probe.streams.iter().map(|stream| &stream.tags).chain([&probe.format.tags]);
    let timecode = timecodes.filter_map(|tags| tags.timecode.clone()).next();
    let begins = probe.format.start_time.as_deref().and_then(|time| time.parse::<f64>().ok()).filter(|s| s.is_finite());
    let begins = begins.unwrap_or_default();
    let has_sound = probe.streams.iter().any(|stream| stream.codec_type == "audio");
    let stream = probe.streams.into_iter().find(|stream| stream.codec_type == "video");
    let stream = stream.ok_or_else(|| bad("holds no video"))?;
    let shown = shown(path)?;
    let (Some(first), Some(width), Some(height)) = (shown.times.first().copied(), stream.width, stream.height) else {
        return Err(bad(if shown.times.is_empty() { "holds no frame" } else { "has no size" }));
    };
    let stated: Vec<f64> =
        [&stream.r_frame_rate, &stream.avg_frame_rate].into_iter().filter_map(|it| ratio(it.as_deref()?)).collect();
    let fps = rate(&shown.times, &stated).ok_or_else(|| bad("has no frame rate"))?;
    let is = |format: &str| probe.format.format_name.split(',').any(|name| name == format);
    // Others count from where a broadcast began.
    let zero = if is("mov") || is("matroska") || is("avi") { 0.0 } else { begins };
    // Frames that wait for later ones may make the first picture late; that says nothing of when it was taken.
    let slack = f64::from(stream.has_b_frames.unwrap_or(0).min(MOST_WAIT) + 1) / fps + AHEAD;
    let n_there = shown.times.len() + shown.n_hidden;
    let named = stream.nb_frames.as_deref().and_then(|n| n.parse::<u32>().ok()).filter(|n| *n as usize > n_there);
    let turned = stream.side_data_list.iter().filter_map(|data| data.rotation).any(|turn| turn.abs() % 180.0 == 90.0);
    let (width, height) = if turned { (height, width) } else { (width, height) };
    let tags = colour::Tags {
        transfer: stream.color_transfer.as_deref(),
        primaries: stream.color_primaries.as_deref(),
        matrix: stream.color_space.as_deref(),
        range: stream.color_range.as_deref(),
    };
    let mut colour = tags.conversion();
    if let Some((profile, base)) =
        stream.side_data_list.iter().find_map(|it| Some((it.dv_profile?, it.dv_bl_signal_compatibility_id?)))
    {
        if base == 0 {
            let reason = format!("is Dolby Vision of profile {profile}, whose colours only a decoder of Dolby knows");
            return Err(Error::data(path, "", reason, "export it as HDR10, HLG or SDR with the program that made it"));
        }
        if let Some(colour) = &mut colour {
            colour.name = format!("Dolby Vision {profile}.{base} on {}", colour.name);
        }
    }
    Ok(Video {
        path: path.to_owned(),
        width,
        height,
        fps,
        began: if first - zero > slack { zero } else { first },
        begins,
        has_sound,
        timecode: timecode.and_then(|code| frame_of_day(&code, fps)),
        named: named.filter(|_| shown.by_packets),
        colour,
        top_first: stream.field_order.as_deref().and_then(top_first),
        // Others have no index of key frames that can be relied on.
        keys: if shown.by_packets && (is("mov") || is("matroska")) { shown.keys } else { Vec::new() },
        times: shown.times,
    })
}

fn ratio(text: &str) -> Option<f64> {
    let (above, below) = text.split_once('/')?;
    Some(above.parse::<f64>().ok()? / below.parse::<f64>().ok()?).filter(|fps| fps.is_finite() && *fps > 0.0)
}

/// Which field is shown first: the first letter is the one that is coded first, the second the one that is shown first.
fn top_first(order: &str) -> Option<bool> {
    match order {
        "tt" | "bt" => Some(true),
        "bb" | "tb" => Some(false),
        _ => None,
    }
}

fn ask(path: &Path) -> Result<Probe> {
    let entries = "stream=codec_type,width,height,avg_frame_rate,r_frame_rate,nb_frames,has_b_frames,field_order,color_range,\
                   color_space,color_transfer,color_primaries:stream_side_data=rotation,dv_profile,\
                   dv_bl_signal_compatibility_id:stream_tags=timecode:format=format_name,start_time:format_tags=timecode";
    let arguments = ["-v", "error", "-show_entries", entries, "-of", "json"];
    let arguments: Vec<OsString> = arguments.iter().map(OsString::from).chain(input(path)).collect();
    let output = FFPROBE.run(arguments, path)?;
    serde_json::from_slice(&output)
        .map_err(|_| Error::data(path, "", "is not understood by ffprobe", "give a video that ffmpeg can read"))
}
