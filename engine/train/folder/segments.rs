//! A long clip in segments that are trained one by one, each in the memory of its own frames: the static background is
//! trained once, with frames of the whole clip, each segment trains the moving part on top, and adjacent segments
//! cross-fade.
//!
//! Where two segments overlap, the Gaussians of the later one fade in while those of the earlier one fade out, each along
//! half of a bell, so that their sum is between 1 and 1.08. A Gaussian's visibility is a bell, and the product of two is
//! one too, so a fading Gaussian is an ordinary one with a span; one that is visible longer is cut in two.

use crate::error::{Error, Result};
use crate::files::{cannot_read, read_file, write_atomic};
use crate::scene::capture::Frames;
use crate::scene::{Motion, Part, Parts, Splats};
use std::path::{Path, PathBuf};

/// Slightly less than the opacity below which nothing is drawn.
const FAINT: f64 = 0.999 / 255.0;

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Segments {
    pub n_frames: u32,
    /// The frames that train the static background: as many as a segment has, all over the clip.
    pub still: Frames,
    /// By segment, its first frame and the one after its last.
    pub segments: Vec<[u32; 2]>,
    /// Of decoded images that each training keeps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cache_bytes: Option<u64>,
}

impl Segments {
    /// Cuts a clip of `n_frames` into as few segments of at most `length` frames as possible that share `overlap`
    /// frames with the next one, at most half of a segment; their lengths differ by a frame at most.
    pub fn new(n_frames: u32, length: u32, overlap: u32) -> std::result::Result<Self, String> {
        let is_cut = n_frames > length;
        if length < 2 || (is_cut && overlap > length / 2) {
            return Err(format!(
                "expected segments of at least 2 frames, half of which overlap at most, found {length} and {overlap}"
            ));
        }
        if n_frames < 2 {
            return Err(format!("expected a clip, found {n_frames} frame"));
        }
        let n = if is_cut { (n_frames - overlap).div_ceil(length - overlap) } else { 1 };
        let border = |segment: u32| u64::from(segment) * u64::from(n_frames - overlap.min(n_frames)) / u64::from(n);
        let segment = |segment: u32| [border(segment) as u32, (border(segment + 1) as u32 + overlap).min(n_frames)];
        let segments: Vec<[u32; 2]> = (0..n).map(segment).collect();
        let still = Frames { from: 0, to: None, every: n_frames.div_ceil(length) };
        Ok(Segments { n_frames, still, segments, cache_bytes: None })
    }

    pub fn file(folder: &Path) -> PathBuf {
        folder.join("segments.json")
    }

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

    pub fn write(&self, folder: &Path) -> Result<()> {
        write_atomic(&Self::file(folder), |to| Ok(serde_json::to_writer_pretty(to, self)?))
    }

    pub fn frames(&self, segment: usize) -> Frames {
        let [from, to] = self.segments[segment];
        Frames { from, to: Some(to), every: 1 }
    }

    /// True if a frame, or the change since the one before, belongs to two segments.
    pub fn is_at_seam(&self, frame: u32) -> bool {
        self.segments.windows(2).any(|pair| (pair[1][0]..=pair[0][1]).contains(&frame))
    }

    /// The dynamic Gaussians of `own`, the scene of a segment, on the clock of the whole clip.
    fn moving(&self, index: usize, own: &Splats) -> Splats {
        let [from, to] = self.segments[index];
        let mut moving = own.kept(|i| i >= own.n_static).into_owned();
        moving.degree.clear();
        let n_frames = f64::from(self.n_frames);
        let moving = moving.on_clock(f64::from(to - from) / n_frames, f64::from(from) / n_frames);
        if self.segments.len() == 1 {
            return moving;
        }
        let moving = &moving;
        let stretches = &self.stretches(index);
        let of = |i: usize| stretches.iter().filter_map(move |stretch| Some((i, stretch, stretch.piece(moving, i)?)));
        let pieces: Vec<(usize, &Stretch, Piece)> = (0..moving.len()).flat_map(of).collect();
        let mut faded = moving.in_order(&pieces.iter().map(|(i, ..)| *i).collect::<Vec<_>>());
        faded.position = pieces.iter().map(|(.., piece)| piece.position).collect();
        faded.motion = pieces.iter().map(|(.., piece)| piece.motion).collect();
        faded.opacity = pieces.iter().map(|(.., piece)| piece.opacity).collect();
        faded.span = pieces.iter().map(|(_, stretch, _)| [stretch.from as f32, stretch.to as f32]).collect();
        faded
    }

    fn seam(&self, earlier: usize) -> Seam {
        let (first, end) = (f64::from(self.segments[earlier + 1][0]), f64::from(self.segments[earlier][1]));
        let at = |frame: f64| frame / f64::from(self.n_frames);
        // Both are at half their opacity in the middle.
        let width = at(0.5 * (end - first + 1.0)) / std::f64::consts::LN_2.sqrt();
        let [going, coming] = [first - 1.0, end].map(|frame| Fade { peak: at(frame), width });
        Seam { going, coming, appears: at(first - 0.5), is_gone: at(end - 0.5) }
    }

    /// Parts of the clip, in order, in each of which the segment is full or fades in one way.
    fn stretches(&self, index: usize) -> Vec<Stretch> {
        let coming = index.checked_sub(1).map(|earlier| self.seam(earlier));
        let going = (index + 1 < self.segments.len()).then(|| self.seam(index));
        let begin = coming.as_ref().map_or(f64::NEG_INFINITY, |seam| seam.appears);
        let end = going.as_ref().map_or(f64::INFINITY, |seam| seam.is_gone);
        let (coming, going) = (coming.map(|seam| seam.coming), going.map(|seam| seam.going));
        let inner = [&coming, &going].into_iter().flatten().map(|fade| fade.peak);
        let mut cuts: Vec<f64> = inner.filter(|at| begin < *at && *at < end).chain([begin, end]).collect();
        cuts.sort_unstable_by(f64::total_cmp);
        cuts.dedup();
        let stretch = |cut: &[f64]| {
            let (from, to) = (cut[0], cut[1]);
            let fades = [coming.filter(|fade| to <= fade.peak), going.filter(|fade| from >= fade.peak)];
            Stretch { from, to, fades: fades.into_iter().flatten().collect() }
        };
        cuts.windows(2).map(stretch).collect()
    }
}

/// Half a bell: 1 at `peak`, exp(-((t - peak) / width)^2) at a time t on one side of it; normalised times of the clip.
#[derive(Clone, Copy)]
struct Fade {
    peak: f64,
    width: f64,
}

/// A cross-fade. The half bells are cut off half a frame before their first and after their last frame.
struct Seam {
    going: Fade,
    coming: Fade,
    appears: f64,
    is_gone: f64,
}

struct Stretch {
    from: f64,
    to: f64,
    fades: Vec<Fade>,
}

struct Piece {
    position: [f32; 3],
    motion: Motion,
    opacity: f32,
}

impl Stretch {
    /// Dynamic Gaussian `i` in this stretch; none if it is not visible.
    fn piece(&self, moving: &Splats, i: usize) -> Option<Piece> {
        let (position, motion, logit) = (moving.position[i], moving.motion[i], moving.opacity[i]);
        let mut opacity = 1.0 / (1.0 + (-f64::from(logit)).exp());
        let (mut center, mut tau) = (f64::from(motion.t_center), f64::from(motion.t_scale).exp());
        for Fade { peak, width } in &self.fades {
            let (both, ahead) = (tau.powi(2) + width.powi(2), center - peak);
            opacity *= (-ahead.powi(2) / both).exp();
            center = peak + ahead * width.powi(2) / both;
            tau = 1.0 / (tau.powi(-2) + width.powi(-2)).sqrt();
        }
        let nearest = center.clamp(self.from, self.to);
        if opacity * (-((nearest - center) / tau).powi(2)).exp() < FAINT {
            return None;
        }
        if self.fades.is_empty() {
            return Some(Piece { position, motion, opacity: logit });
        }
        let later = center - f64::from(motion.t_center);
        let position = std::array::from_fn(|k| (f64::from(position[k]) + f64::from(motion.velocity[k]) * later) as f32);
        let motion = Motion { t_center: center as f32, t_scale: tau.ln() as f32, ..motion };
        let opacity = (opacity / (1.0 - opacity).max(f64::EPSILON)).ln() as f32;
        Some(Piece { position, motion, opacity })
    }
}

/// The segments of a plan as one clip, of which one segment at a time is in memory. `F` reads the scene of a segment, on
/// its own clock, or the static background, which has no number.
pub struct Joined<F> {
    path: PathBuf,
    segments: Segments,
    read: F,
    sh_degree: u32,
    parts: Vec<Part>,
}

impl<F: FnMut(Option<usize>) -> Result<Splats> + Send> Joined<F> {
    /// Reads all scenes, one after the other. `path` is named in faults.
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
            let from = moving.span.iter().map(|span| f64::from(span[0])).reduce(f64::min).unwrap_or(f64::NEG_INFINITY);
            let to = moving.span.iter().map(|span| f64::from(span[1])).reduce(f64::max).unwrap_or(f64::INFINITY);
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
            [(90, 30, 6), (600, 60, 8), (7, 60, 6), (61, 60, 6), (10, 2, 1), (300, 60, 0), (5, 5, 8)]
        {
            let Segments { segments, still, .. } = Segments::new(n_frames, length, overlap).unwrap();
            assert_eq!((segments[0][0], segments[segments.len() - 1][1]), (0, n_frames));
            assert!(segments.windows(2).all(|pair| pair[0][1] - pair[1][0] == overlap), "{segments:?}");
            let lengths: Vec<u32> = segments.iter().map(|[from, to]| to - from).collect();
            let (least, most) = (lengths.iter().min().unwrap(), lengths.iter().max().unwrap());
            assert!(*most <= length && most - least <= 1, "{lengths:?}");
            assert!(still.of(n_frames).len() as u32 <= length);
        }
        for (n_frames, length, overlap) in [(9, 1, 0), (9, 4, 3), (1, 4, 1)] {
            assert!(Segments::new(n_frames, length, overlap).is_err());
        }
    }

    /// Seen for long and for short, at the begin, the middle and the end of a segment.
    fn moving() -> Splats {
        let motion = |k: usize| Motion {
            velocity: [1.0, 0.0, -2.0],
            t_center: [0.0, 0.1, 0.5, 0.9, 1.0][k % 5],
            t_scale: [f32::INFINITY, 0.0, -2.5][k / 5],
        };
        Splats {
            position: (0..15).map(|k| [k as f32, 1.0, -1.0]).collect(),
            rotation: vec![[1.0, 0.0, 0.0, 0.0]; 15],
            scale: vec![[0.0; 3]; 15],
            opacity: (0..15).map(|k| 2.0 - 0.3 * k as f32).collect(),
            sh: vec![[0.0; 3]; 15],
            motion: (0..15).map(motion).collect(),
            source_row: (0..15).collect(),
            ..Splats::new(0)
        }
    }

    /// Opacity of Gaussian `row` at a time, and where it is; at most one piece is there.
    fn shown(pieces: &Splats, row: u32, time: f64) -> (f64, Option<[f64; 3]>) {
        let there: Vec<usize> =
            (0..pieces.len()).filter(|&i| pieces.source_row[i] == row && pieces.is_there(i, time)).collect();
        assert!(there.len() <= 1, "two pieces of one Gaussian at once");
        let Some(&i) = there.first() else { return (0.0, None) };
        let ahead = time - f64::from(pieces.motion[i].t_center);
        let place = |k: usize| f64::from(pieces.position[i][k]) + f64::from(pieces.motion[i].velocity[k]) * ahead;
        let opacity = pieces.weight_at(i, time) / (1.0 + (-f64::from(pieces.opacity[i])).exp());
        (opacity, Some(std::array::from_fn(place)))
    }

    #[test]
    fn one_segment_fades_while_the_next_one_comes() {
        for (length, overlap) in [(34, 6), (31, 1), (30, 0), (16, 8)] {
            let segments = Segments::new(90, length, overlap).unwrap();
            let n = segments.segments.len();
            // How much of a segment is there at a frame: what its pieces show of a Gaussian that would always be seen.
            let mut weights = vec![[0.0_f64; 90]; n];
            for (index, weights) in weights.iter_mut().enumerate() {
                let (from, to) = (segments.segments[index][0], segments.segments[index][1]);
                let scale = f64::from(to - from) / 90.0;
                let before = moving().on_clock(scale, f64::from(from) / 90.0);
                let pieces = segments.moving(index, &moving());
                pieces.check().unwrap();
                for frame in 0..90 {
                    let time = f64::from(frame) / 90.0;
                    weights[frame as usize] = shown(&pieces, 0, time).0 / shown(&before, 0, time).0;
                    for row in 0..15 {
                        let ((own, place), (now, there)) = (shown(&before, row, time), shown(&pieces, row, time));
                        let expected = own * weights[frame as usize];
                        // A piece below the threshold may be left out.
                        let is_left_out = now == 0.0 && expected < 1.0 / 255.0;
                        assert!(
                            (now - expected).abs() < 1e-5 || is_left_out,
                            "{index} {row} {frame}: {now} {expected}"
                        );
                        let moved = place.zip(there).map(|(a, b)| glam::DVec3::from(a).distance(b.into()));
                        assert!(moved.unwrap_or(0.0) < 1e-4, "{index} {row} {frame}: {place:?} {there:?}");
                    }
                }
            }
            for (earlier, pair) in segments.segments.windows(2).enumerate() {
                let (first, end) = (pair[1][0] as usize, pair[0][1] as usize);
                let is_full = |weight: f64| (weight - 1.0).abs() < 1e-6;
                for (frame, (a, b)) in weights[earlier].into_iter().zip(weights[earlier + 1]).enumerate() {
                    match frame {
                        _ if frame < first => assert!(b == 0.0 && (is_full(a) || earlier > 0)),
                        _ if frame >= end => assert!(a == 0.0 && (is_full(b) || earlier + 2 < n)),
                        _ => assert!((0.999..1.08).contains(&(a + b)), "frame {frame}: {a} and {b}"),
                    }
                }
            }
        }
    }

    #[test]
    fn a_segment_alone_does_not_fade_and_pieces_are_few() {
        let alone = Segments::new(9, 30, 6).unwrap().moving(0, &moving());
        assert!(alone.span.is_empty() && alone.len() == 15);
        // Seen throughout, in the overlap alone, in it and behind it, in the middle alone.
        let cut = Segments::new(90, 34, 6).unwrap().moving(1, &moving());
        let of = |row: u32| cut.source_row.iter().filter(|of| **of == row).count();
        assert_eq!([of(0), of(10), of(11), of(12)], [3, 1, 2, 1]);
        assert_eq!(cut.span.len(), cut.len());
    }
}
