//! Which pictures a review looks at, and what it saw of each Gaussian: the pictures are chosen so that Gaussians are seen.

use crate::error::Result;
use crate::internals::train::scores::Sight;
use crate::parallel::{in_parallel, threads};
use crate::random::permutation;
use crate::recon::Pinhole;
use crate::scene::Splats;
use glam::DVec3;

/// Pictures in which a Gaussian must have been seen before anything of it is judged.
const LEAST_PICTURES: u32 = 4;
/// Different frames among them before its movement is judged; all of the clip where it has fewer.
const LEAST_FRAMES: u32 = 3;
/// Pictures that are looked at in any case: fewer do not tell the noise.
const FIRST: usize = 24;
/// Pictures until the next count of the Gaussians that are still unseen.
const BATCH: usize = 8;
/// Gaussians that a choice of pictures is made for, evenly taken from those still unseen.
const SAMPLE: usize = 4096;
/// Pictures that a choice is made from, at random from those not looked at yet.
const CANDIDATES: usize = 1024;
/// Lenses that are asked which of their pictures hold a Gaussian, and pictures of each, evenly taken.
const LENSES: usize = 1024;
const PICTURES_OF_A_LENS: usize = 32;
/// Gaussians of one piece of work.
const PIECE: usize = 4096;
/// Alpha below which nothing is drawn.
const FAINT: f64 = 1.0 / 255.0;

/// What was seen of a Gaussian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Pictures that were looked at and show it.
    pub pictures: u32,
    /// As many pictures at the height of its visibility tell as much: the squares of its temporal weights in them, in units of
    /// the largest in any training picture.
    pub telling: f64,
    /// Places of lenses from which it was seen: a camera that moves has one for each picture.
    pub lenses: u32,
    /// Frames in which it was seen.
    pub frames: u32,
    /// A picture was looked at from every lens that has one in which it would be if nothing hid it.
    pub by_all: bool,
    /// It was hidden in `LEAST_PICTURES` pictures or more, among them one of every such lens: no camera sees it.
    pub is_hidden: bool,
    /// Training pictures for each picture that was looked at, among those that it is in the field of view of.
    pub scale: f64,
}

impl Seen {
    /// Whether enough was seen to judge whether the Gaussian is needed.
    pub fn tells_all(&self) -> bool {
        self.tells_something() || self.is_hidden
    }

    /// Whether it was seen in enough pictures.
    pub(super) fn tells_something(&self) -> bool {
        self.telling >= f64::from(LEAST_PICTURES) - 1e-6
    }

    /// By how much its information is taken for larger than it was found. One draw of signs a picture gives it as chi squared
    /// with a degree of freedom for each picture, whose lower end is far below its mean where they are few: what is found is
    /// divided by the lower end of its 95 % interval, in units of that of as many pictures as are looked at in any case.
    pub(super) fn caution(&self) -> f64 {
        // Wilson and Hilferty (1931).
        let low = |n: f64| (1.0 - 2.0 / (9.0 * n) - 1.645 * (2.0 / (9.0 * n)).sqrt()).max(0.1).powi(3);
        (low(FIRST as f64) / low(self.telling.max(1.0))).max(1.0)
    }

    /// Whether enough was seen to judge band `band`: from as many directions as the band has functions, or from all there are.
    pub fn tells_band(&self, band: usize) -> bool {
        self.is_hidden || (self.tells_something() && (self.by_all || self.lenses as usize > 2 * band))
    }

    /// Whether enough was seen to judge the movement in a clip of `n_frames`; of one moment nothing tells it.
    pub fn tells_motion(&self, n_frames: usize) -> bool {
        n_frames > 1 && self.tells_something() && self.frames as usize >= n_frames.min(LEAST_FRAMES as usize)
    }
}

/// A training picture.
struct Shot {
    camera: usize,
    frame: u32,
    /// Whether it is a photograph, which shows no moment of the clip.
    is_photo: bool,
    /// Index of its lens, by place.
    lens: usize,
    time: f64,
    pinhole: Pinhole,
}

/// What a Gaussian was in, as far as it was looked.
#[derive(Clone, Copy, Default)]
struct Tally {
    /// Square of its largest temporal weight in a training picture.
    peak: f64,
    /// Training pictures that it is in the field of view of, and the lenses that they are taken through.
    in_view: u32,
    lenses_in_view: u32,
    /// Of them those that were looked at; a bit for each lens.
    looked: u32,
    looked_lenses: u128,
    /// Pictures that show it, the squares of its weights in them; a bit for each lens and each frame.
    pictures: u32,
    squares: f64,
    lenses: u128,
    frames: u64,
}

/// What a Gaussian still needs, the pictures that were chosen taken off.
struct Planned {
    /// Pictures at the height of its visibility.
    need: f64,
    /// Lenses of those chosen.
    lenses: Vec<usize>,
}

/// The training pictures, and what was looked at of them.
pub(super) struct Album<'a> {
    splats: &'a Splats,
    /// Of each Gaussian, and the largest of its standard deviations.
    opacity: Vec<(f64, f64)>,
    shots: Vec<Shot>,
    /// Index of the first picture of each lens, and the number of all.
    lenses: Vec<usize>,
    is_looked_at: Vec<bool>,
    n_looked: usize,
    /// Lenses and frames that were looked at, in the order of their bits.
    slots: (Vec<usize>, Vec<u32>),
    tallies: Vec<Tally>,
    threads: usize,
}

impl<'a> Album<'a> {
    /// The training pictures of `sight`, none of them looked at.
    ///
    /// # Errors
    /// Those of the capture's views.
    pub fn new(splats: &'a Splats, sight: &Sight) -> Result<Self> {
        let cameras = &sight.capture.cameras;
        let (mut shots, mut lenses) = (Vec::new(), Vec::new());
        for (camera, own) in cameras.iter().enumerate().filter(|(_, camera)| !camera.is_test) {
            let moves = own.moves();
            for (k, shot) in own.shots.iter().enumerate() {
                if moves || k == 0 {
                    lenses.push(shots.len());
                }
                let view = sight.view(camera, shot.frame)?;
                let time = view.time + view.time_offset * view.flow_dt;
                let (lens, pinhole) = (lenses.len() - 1, Pinhole::new(&view));
                shots.push(Shot { camera, frame: shot.frame, is_photo: own.is_photo, lens, time, pinhole });
            }
        }
        lenses.push(shots.len());
        let of = |i: usize| {
            let largest = splats.scale[i].iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b));
            (1.0 / (1.0 + (-f64::from(splats.opacity[i])).exp()), f64::from(largest).exp())
        };
        let threads = threads();
        let mut album = Album {
            splats,
            opacity: (0..splats.len()).map(of).collect(),
            is_looked_at: vec![false; shots.len()],
            n_looked: 0,
            shots,
            lenses,
            slots: (Vec::new(), Vec::new()),
            tallies: Vec::new(),
            threads,
        };
        let mut times: Vec<f64> = album.shots.iter().map(|shot| shot.time).collect();
        times.sort_unstable_by(f64::total_cmp);
        times.dedup();
        album.tallies = album.by_piece(|i| {
            let (in_view, lenses_in_view) = album.in_view(i);
            let peak = times.iter().map(|time| album.splats.weight_at(i, *time)).fold(0.0, f64::max).powi(2);
            Tally { peak, in_view, lenses_in_view, ..Tally::default() }
        })?;
        Ok(album)
    }

    /// Training pictures.
    pub fn len(&self) -> usize {
        self.shots.len()
    }

    /// Camera and frame of a training picture.
    pub fn shot(&self, at: usize) -> (usize, u32) {
        (self.shots[at].camera, self.shots[at].frame)
    }

    /// `of` each Gaussian, on several threads.
    fn by_piece<T: Send>(&self, of: impl Fn(usize) -> T + Sync) -> Result<Vec<T>> {
        let n = self.splats.len();
        let piece = |k: usize| Ok((k * PIECE..n.min((k + 1) * PIECE)).map(&of).collect::<Vec<T>>());
        Ok(in_parallel(n.div_ceil(PIECE), self.threads, piece, |_| {})?.into_iter().flatten().collect())
    }

    /// Whether a Gaussian would be in a picture if nothing hid it.
    fn holds(&self, shot: &Shot, i: usize) -> bool {
        let (opacity, deviation) = self.opacity[i];
        if opacity * self.splats.weight_at(i, shot.time) < FAINT {
            return false;
        }
        let at = DVec3::from_array(self.splats.position[i].map(f64::from));
        let motion = i.checked_sub(self.splats.n_static).and_then(|k| self.splats.motion.get(k));
        let way = motion.map_or(DVec3::ZERO, |motion| {
            DVec3::from_array(motion.velocity.map(f64::from)) * (shot.time - f64::from(motion.t_center))
        });
        shot.pinhole.holds(at + way, deviation)
    }

    /// How much a picture tells of a Gaussian, in units of one at the height of its visibility.
    fn height(&self, i: usize, shot: &Shot) -> f64 {
        self.splats.weight_at(i, shot.time).powi(2) / self.tallies[i].peak.max(f64::MIN_POSITIVE)
    }

    /// Training pictures that hold a Gaussian, and the lenses that they are taken through.
    fn in_view(&self, i: usize) -> (u32, u32) {
        let n_lenses = self.lenses.len() - 1;
        let stride = n_lenses.div_ceil(LENSES).max(1);
        let (mut pictures, mut lenses) = (0, 0);
        for lens in (0..n_lenses).step_by(stride) {
            let shots = &self.shots[self.lenses[lens]..self.lenses[lens + 1]];
            let held = if i < self.splats.n_static {
                if self.holds(&shots[0], i) { shots.len() } else { 0 }
            } else {
                let there: Vec<&Shot> = shots
                    .iter()
                    .filter(|shot| self.opacity[i].0 * self.splats.weight_at(i, shot.time) >= FAINT)
                    .collect();
                let step = there.len().div_ceil(PICTURES_OF_A_LENS).max(1);
                (step * there.iter().step_by(step).filter(|shot| self.holds(shot, i)).count()).min(there.len())
            };
            pictures += held * stride;
            lenses += if held > 0 { stride } else { 0 };
        }
        (pictures as u32, lenses as u32)
    }

    /// What was seen of a Gaussian so far.
    fn seen(&self, tally: &Tally) -> Seen {
        let by_all = tally.looked_lenses.count_ones() >= tally.lenses_in_view;
        Seen {
            pictures: tally.pictures,
            telling: tally.squares / tally.peak.max(f64::MIN_POSITIVE),
            lenses: tally.lenses.count_ones(),
            frames: tally.frames.count_ones(),
            by_all: by_all && tally.lenses_in_view > 0,
            is_hidden: by_all && tally.pictures == 0 && tally.looked >= LEAST_PICTURES,
            scale: match (tally.in_view, tally.looked) {
                (in_view @ 1.., looked @ 1..) => f64::from(in_view) / f64::from(looked),
                _ => self.shots.len() as f64 / self.n_looked.max(1) as f64,
            },
        }
    }

    /// What was seen of each Gaussian so far.
    pub fn all_seen(&self) -> Vec<Seen> {
        self.tallies.iter().map(|tally| self.seen(tally)).collect()
    }

    /// Notes that picture `at` was looked at and shows the Gaussians that `shows` names.
    pub fn look(&mut self, at: usize, shows: &[bool]) -> Result<()> {
        fn bit<T: PartialEq>(slots: &mut Vec<T>, of: T) -> usize {
            slots.iter().position(|slot| *slot == of).unwrap_or_else(|| {
                slots.push(of);
                slots.len() - 1
            })
        }
        let (lens, frame) = (self.shots[at].lens, self.shots[at].frame);
        // Two that share a bit count as one: then less is judged, not more.
        let lens = 1 << (bit(&mut self.slots.0, lens) % 128);
        let frame = if self.shots[at].is_photo { 0 } else { 1 << (bit(&mut self.slots.1, frame) % 64) };
        let held = self.by_piece(|i| self.holds(&self.shots[at], i))?;
        (self.is_looked_at[at], self.n_looked) = (true, self.n_looked + 1);
        let time = self.shots[at].time;
        for (i, ((tally, held), shows)) in self.tallies.iter_mut().zip(held).zip(shows).enumerate() {
            if held {
                tally.looked += 1;
                tally.looked_lenses |= lens;
            }
            if *shows {
                let square = self.splats.weight_at(i, time).powi(2);
                tally.pictures += 1;
                tally.squares += square;
                tally.lenses |= lens;
                tally.frames |= frame;
            }
        }
        Ok(())
    }

    /// Gaussians of which too little has been seen to judge all their parts.
    fn lacking(&self) -> Vec<usize> {
        let lacks = |i: &usize| {
            let seen = self.seen(&self.tallies[*i]);
            !seen.tells_all() || !seen.tells_band(self.splats.degree_of(*i))
        };
        (0..self.tallies.len()).filter(lacks).collect()
    }

    /// The next pictures to look at, `most` at most: those that show most of what has not been seen. None where all but
    /// `share` of the Gaussians have been seen enough, or where no picture is left that may show more.
    pub fn choose(&self, share: f64, most: usize, key: &[u64]) -> Result<Vec<usize>> {
        let lacking = self.lacking();
        let is_first = self.n_looked == 0;
        if !is_first && lacking.len() as f64 <= share * self.tallies.len() as f64 {
            return Ok(Vec::new());
        }
        let n_sample = lacking.len().min(SAMPLE);
        let sample: Vec<usize> = (0..n_sample).map(|k| lacking[k * lacking.len() / n_sample]).collect();
        let mut candidates = permutation(self.shots.len(), &[key, &[self.n_looked as u64]].concat());
        candidates.retain(|at| !self.is_looked_at[*at]);
        candidates.truncate(CANDIDATES);
        let held = |k: usize| -> Result<Vec<(usize, f64)>> {
            let shot = &self.shots[candidates[k]];
            let held = (0..n_sample).filter(|s| self.holds(shot, sample[*s]));
            Ok(held.map(|s| (s, self.height(sample[s], shot))).collect())
        };
        let held = in_parallel(candidates.len(), self.threads, held, |_| {})?;
        let plan = |&i: &usize| {
            let directions = (2 * self.splats.degree_of(i) + 1).min(self.tallies[i].lenses_in_view as usize);
            let need = directions.max(LEAST_PICTURES as usize) as f64;
            Planned { need: (need - self.seen(&self.tallies[i]).telling).max(1.0), lenses: Vec::new() }
        };
        let mut planned: Vec<Planned> = sample.iter().map(plan).collect();
        // Through a lens that was looked through and did not show it, another picture hardly will.
        let gain = |k: usize, planned: &[Planned]| -> f64 {
            let lens = self.shots[candidates[k]].lens;
            let slot = self.slots.0.iter().position(|known| *known == lens);
            let one = |(s, weight): &(usize, f64)| {
                let (tally, planned) = (&self.tallies[sample[*s]], &planned[*s]);
                let is_new = slot.is_none_or(|slot| tally.looked_lenses >> (slot % 128) & 1 == 0);
                let worth = match planned.need > 0.0 {
                    false => 0.0,
                    true if is_new && !planned.lenses.contains(&lens) => 2.0,
                    true => f64::from(u8::from(tally.pictures > 0 || is_new)),
                };
                worth * weight
            };
            held[k].iter().map(one).sum()
        };
        let mut chosen = Vec::new();
        let n = if is_first { FIRST } else { BATCH }.min(most).min(candidates.len());
        let mut is_taken = vec![false; candidates.len()];
        while chosen.len() < n {
            let left = (0..candidates.len()).filter(|k| !is_taken[*k]);
            let best = left.map(|k| (gain(k, &planned), k)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            let Some((gained, k)) = best else { break };
            if gained == 0.0 && !is_first {
                break;
            }
            is_taken[k] = true;
            chosen.push(candidates[k]);
            for (s, weight) in &held[k] {
                planned[*s].need -= weight;
                planned[*s].lenses.push(self.shots[candidates[k]].lens);
            }
        }
        Ok(chosen)
    }
}
