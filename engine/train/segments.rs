//! A long clip in segments that are trained one by one, each in the memory of its own frames: what rests is trained once, with frames
//! of the whole clip, each segment trains what moves on top, and the segments are joined so that each gives way to the next.
//!
//! Where two segments overlap, the Gaussians of the later one appear one by one in the first half of the overlap, and those of the
//! earlier one disappear one by one in the second half. At its middle all of both are there, so that nothing behind them is seen
//! through, as it would be if one faded while the other came. They appear and disappear between two frames.

use crate::error::{Error, Result};
use crate::files::{cannot_read, read_file, write_atomic};
use crate::random::Keyed;
use crate::scene::capture::Frames;
use crate::scene::{Part, Parts, Splats};
use std::path::{Path, PathBuf};

/// How a clip is cut into segments.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Segments {
    /// Frames of the clip.
    pub n_frames: u32,
    /// The frames that what rests is trained with: as many as a segment has, all over the clip.
    pub still: Frames,
    /// By segment, its first frame and the one behind its last.
    pub segments: Vec<[u32; 2]>,
    /// Bytes of decoded images that each training keeps; none for as many as one takes by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cache_bytes: Option<u64>,
}

impl Segments {
    /// Cuts a clip of `n_frames` into as few segments of at most `length` frames as share `overlap` frames with the next one; they are
    /// of one length but for a frame.
    ///
    /// # Errors
    /// What is wrong with the numbers.
    pub fn new(n_frames: u32, length: u32, overlap: u32) -> std::result::Result<Self, String> {
        if length < 2 || overlap >= length {
            return Err(format!(
                "expected segments of at least 2 frames that are longer than their overlap, found {length} and {overlap}"
            ));
        }
        if n_frames < 2 {
            return Err(format!("expected a clip, found {n_frames} frame"));
        }
        let own = length - overlap;
        let n = n_frames.saturating_sub(overlap).div_ceil(own).max(1);
        let border = |segment: u32| u64::from(segment) * u64::from(n_frames - overlap.min(n_frames)) / u64::from(n);
        let segment = |segment: u32| [border(segment) as u32, (border(segment + 1) as u32 + overlap).min(n_frames)];
        let segments: Vec<[u32; 2]> = (0..n).map(segment).collect();
        let still = Frames { from: 0, to: None, every: n_frames.div_ceil(length) };
        Ok(Segments { n_frames, still, segments, cache_bytes: None })
    }

    /// `segments.json` of `folder`.
    pub fn file(folder: &Path) -> PathBuf {
        folder.join("segments.json")
    }

    /// Reads those of a folder.
    ///
    /// # Errors
    /// [`Error::Data`] when the file is absent or not what [`Segments::write`] writes.
    pub fn read(folder: &Path) -> Result<Self> {
        let file = Self::file(folder);
        let text = read_file(&file).map_err(|fault| cannot_read(&file, &fault))?;
        let remedy = "give a folder that `ivv segments plan` made";
        let read: Segments =
            serde_json::from_slice(&text).map_err(|e| Error::data(&file, "", e.to_string(), remedy))?;
        let follows =
            |pair: &[[u32; 2]]| pair[0][0] < pair[1][0] && pair[1][0] <= pair[0][1] && pair[0][1] < pair[1][1];
        let is_cut = read.segments.first().is_some_and(|segment| segment[0] == 0)
            && read.segments.last().is_some_and(|segment| segment[1] == read.n_frames)
            && read.segments.iter().all(|[from, to]| from < to)
            && read.segments.windows(2).all(follows);
        if is_cut {
            Ok(read)
        } else {
            Err(Error::data(&file, "segments", "do not follow one another over the clip", remedy))
        }
    }

    /// Writes them into a folder.
    ///
    /// # Errors
    /// [`Error::Data`] when the file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_atomic(&Self::file(folder), |to| Ok(serde_json::to_writer_pretty(to, self)?))
    }

    /// The frames of a segment.
    pub fn frames(&self, segment: usize) -> Frames {
        let [from, to] = self.segments[segment];
        Frames { from, to: Some(to), every: 1 }
    }

    /// Whether a frame, or what changes between it and the one before, is of two segments.
    pub fn is_at_seam(&self, frame: u32) -> bool {
        self.segments.windows(2).any(|pair| (pair[1][0]..=pair[0][1]).contains(&frame))
    }

    /// The dynamic Gaussians of `own`, the scene of a segment, on the clock of the whole clip.
    fn moving(&self, index: usize, own: &Splats) -> Splats {
        let [from, to] = self.segments[index];
        let mut moving = own.kept(|i| i >= own.n_static).into_owned();
        moving.degree.clear();
        let n_frames = f64::from(self.n_frames);
        let mut moving = moving.on_clock(f64::from(to - from) / n_frames, f64::from(from) / n_frames);
        if self.segments.len() > 1 {
            let random = Keyed::new(&[index as u64]);
            moving.span = (0..moving.len() as u64).map(|i| self.span(index, random.uniform(i))).collect();
        }
        moving
    }

    /// From when up to when a Gaussian of a segment is there, normalised time of the clip; `when`, from 0 to 1, says how late in its half
    /// of an overlap it appears and disappears.
    fn span(&self, segment: usize, when: f64) -> [f32; 2] {
        // Half a frame before the frame that is the first with, or without.
        let border = |[from, to]: [f64; 2]| {
            let frame = (from + when * (to - from)).floor();
            ((frame - 0.5) / f64::from(self.n_frames)) as f32
        };
        // The overlap's first frame, its middle and the frame behind it, in each of which something may change.
        let overlap = |at: usize| {
            let (from, to) = (f64::from(self.segments[at + 1][0]), f64::from(self.segments[at][1]));
            [from, (0.5 * (from + to)).floor(), to]
        };
        let from = segment.checked_sub(1).map_or(f32::NEG_INFINITY, |before| {
            let [first, middle, _] = overlap(before);
            border([first, middle + 1.0])
        });
        let to = (segment + 1 < self.segments.len()).then(|| {
            let [_, middle, end] = overlap(segment);
            border([(middle + 1.0).min(end), end + 1.0])
        });
        [from, to.unwrap_or(f32::INFINITY)]
    }
}

/// The segments of a plan as one clip, of which one segment at a time is in memory. `F` reads the scene of a segment, on its own clock,
/// or of what rests, which has no number.
pub struct Joined<F> {
    path: PathBuf,
    segments: Segments,
    read: F,
    sh_degree: u32,
    parts: Vec<Part>,
}

impl<F: FnMut(Option<usize>) -> Result<Splats> + Send> Joined<F> {
    /// Reads all scenes, one after the other; faults of what they are together are told of `path`.
    ///
    /// # Errors
    /// Those of `read`; [`Error::Data`] where degrees differ.
    pub fn new(path: &Path, segments: Segments, mut read: F) -> Result<Self> {
        let sh_degree = read(None)?.sh_degree;
        let mut parts = Vec::new();
        for index in 0..segments.segments.len() {
            let scene = read(Some(index))?;
            if scene.sh_degree != sh_degree {
                let reason = format!("has degree {}, what rests has {sh_degree}", scene.sh_degree);
                let remedy = "train the segment again, on top of what rests";
                return Err(Error::data(path, format!("segment {index}"), reason, remedy));
            }
            let moving = segments.moving(index, &scene);
            let hull =
                |hull: [f64; 2], span: &[f32; 2]| [hull[0].min(f64::from(span[0])), hull[1].max(f64::from(span[1]))];
            let none = [f64::INFINITY, f64::NEG_INFINITY];
            let [from, to] = match moving.span.iter().fold(none, hull) {
                hull if hull == none => [f64::NEG_INFINITY, f64::INFINITY],
                hull => hull,
            };
            parts.push(Part { from, to, n: moving.len() });
        }
        Ok(Joined { path: path.to_owned(), segments, read, sh_degree, parts })
    }
}

impl<F: FnMut(Option<usize>) -> Result<Splats> + Send> Parts for Joined<F> {
    fn path(&self) -> &Path {
        &self.path
    }

    fn sh_degree(&self) -> u32 {
        self.sh_degree
    }

    fn parts(&self) -> &[Part] {
        &self.parts
    }

    fn still(&mut self) -> Result<Splats> {
        let scene = (self.read)(None)?;
        let mut still = scene.kept(|i| i < scene.n_static).into_owned();
        still.degree.clear();
        Ok(still)
    }

    fn part(&mut self, index: usize) -> Result<Splats> {
        (self.read)(Some(index)).map(|scene| self.segments.moving(index, &scene))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Motion;

    #[test]
    fn segments_cover_the_clip_evenly_and_share_frames() {
        for (n_frames, length, overlap) in
            [(90, 30, 6), (600, 60, 6), (7, 60, 6), (61, 60, 6), (10, 2, 1), (300, 60, 0), (5, 4, 3)]
        {
            let Segments { segments, still, .. } = Segments::new(n_frames, length, overlap).unwrap();
            assert_eq!((segments[0][0], segments[segments.len() - 1][1]), (0, n_frames));
            assert!(segments.windows(2).all(|pair| pair[0][1] - pair[1][0] == overlap), "{segments:?}");
            let lengths: Vec<u32> = segments.iter().map(|[from, to]| to - from).collect();
            let (least, most) = (lengths.iter().min().unwrap(), lengths.iter().max().unwrap());
            assert!(*most <= length && most - least <= 1, "{lengths:?}");
            assert!(still.of(n_frames).len() as u32 <= length);
        }
        for (n_frames, length, overlap) in [(9, 1, 0), (9, 4, 4), (1, 4, 1)] {
            assert!(Segments::new(n_frames, length, overlap).is_err());
        }
    }

    #[test]
    fn one_segment_gives_way_to_the_next_and_something_is_always_there() {
        let dynamic = |n: usize| Splats {
            position: vec![[0.0; 3]; n],
            rotation: vec![[1.0, 0.0, 0.0, 0.0]; n],
            scale: vec![[0.0; 3]; n],
            opacity: vec![0.0; n],
            sh: vec![[0.0; 3]; n],
            motion: vec![Motion { velocity: [1.0, 0.0, 0.0], t_center: 0.5, t_scale: 0.0 }; n],
            source_row: (0..n as u32).collect(),
            ..Splats::new(0)
        };
        let still = Splats { n_static: 3, motion: Vec::new(), ..dynamic(3) };
        let segments = Segments::new(90, 34, 6).unwrap();
        assert_eq!(segments.segments, [[0, 34], [28, 62], [56, 90]]);
        let join = |segments: &Segments, n: usize| {
            let mut joined = still.clone();
            (0..segments.segments.len()).for_each(|index| joined.append(segments.moving(index, &dynamic(n))));
            joined
        };
        let joined = join(&segments, 400);
        joined.check().unwrap();
        assert_eq!((joined.n_static, joined.motion.len()), (3, 1200));
        assert!((joined.motion[400].t_center - 45.0 / 90.0).abs() < 1e-6);
        assert!((joined.motion[0].velocity[0] - 90.0 / 34.0).abs() < 1e-5);
        let there = |segment: usize, frame: u32| {
            let range = 3 + 400 * segment..3 + 400 * (segment + 1);
            range.filter(|&i| joined.is_there(i, f64::from(frame) / 90.0)).count()
        };
        assert!((0..28).all(|frame| [there(0, frame), there(1, frame), there(2, frame)] == [400, 0, 0]));
        // The later segment comes while the earlier one is all there, and then that goes.
        let of_overlap: Vec<[usize; 2]> = (28..34).map(|frame| [there(0, frame), there(1, frame)]).collect();
        assert!(of_overlap.iter().all(|[before, behind]| *before.max(behind) == 400), "{of_overlap:?}");
        assert!(
            of_overlap.windows(2).all(|pair| pair[0][0] >= pair[1][0] && pair[0][1] <= pair[1][1]),
            "{of_overlap:?}"
        );
        assert_eq!(of_overlap[3], [400, 400]);
        // No frame changes more than its share.
        let most =
            of_overlap.windows(2).map(|pair| pair[0][0].abs_diff(pair[1][0]) + pair[0][1].abs_diff(pair[1][1])).max();
        assert!(most < Some(170), "{of_overlap:?}");
        assert!((34..56).all(|frame| [there(0, frame), there(1, frame), there(2, frame)] == [0, 400, 0]));
        assert!((62..90).all(|frame| [there(0, frame), there(1, frame), there(2, frame)] == [0, 0, 400]));
        // One segment alone is always there.
        let alone = join(&Segments::new(9, 30, 6).unwrap(), 2);
        assert!(alone.span.is_empty());
        // Without an overlap one follows the other.
        let cut = join(&Segments::new(8, 4, 0).unwrap(), 5);
        let n = |time: f64| (3..13).filter(|&i| cut.is_there(i, time)).collect::<Vec<_>>();
        assert_eq!((n(3.0 / 8.0), n(4.0 / 8.0)), ((3..8).collect(), (8..13).collect()));
    }
}
