//! The pictures that a review looks at, chosen so that Gaussians are seen.

use crate::error::Result;
use crate::internals::train::Sight;
use crate::parallel::{in_parallel, threads};
use crate::random::permutation;
use crate::recon::{Pinhole, picked};
use crate::scene::Splats;
use glam::DVec3;

/// Pictures that must have shown a Gaussian before it is judged.
const LEAST_PICTURES: u32 = 4;
/// Different frames before its movement is judged; all of a shorter clip.
const LEAST_FRAMES: u32 = 3;
/// Pictures in any case: fewer do not show the noise.
const FIRST: usize = 24;
/// Pictures until the next count of unseen Gaussians.
const BATCH: usize = 8;
/// Unseen Gaussians that a choice of pictures is made for.
const SAMPLE: usize = 4096;
/// Random pictures that a choice is made from.
const CANDIDATES: usize = 1024;
/// Lenses that are tested for a Gaussian, and pictures of each.
const LENSES: usize = 1024;
const PICTURES_OF_A_LENS: usize = 32;
const PIECE: usize = 4096;
/// Alpha below which nothing is drawn.
const FAINT: f64 = 1.0 / 255.0;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    pub pictures: u32,
    /// Equivalent pictures at the height of its visibility: the squares of its temporal weights over the largest.
    pub telling: f64,
    /// From which it was seen, by place.
    pub lenses: u32,
    pub frames: u32,
    /// A picture was looked at from every lens that has it in view.
    pub by_all: bool,
    /// No camera sees it: it was hidden in `LEAST_PICTURES` pictures or more, one of every such lens among them.
    pub is_hidden: bool,
    /// Training pictures that have it in view for each of them that was looked at.
    pub scale: f64,
}

impl Seen {
    pub fn tells_all(&self) -> bool {
        self.tells_something() || self.is_hidden
    }

    pub(super) fn tells_something(&self) -> bool {
        self.telling >= f64::from(LEAST_PICTURES) - 1e-6
    }

    /// Factor of its information. One draw of signs a picture gives that as chi squared with a degree of freedom for each
    /// picture, so it is divided by the lower end of its 95 % interval, in units of that of `FIRST` pictures.
    pub(super) fn caution(&self) -> f64 {
        // Wilson and Hilferty (1931).
        let low = |n: f64| (1.0 - 2.0 / (9.0 * n) - 1.645 * (2.0 / (9.0 * n)).sqrt()).max(0.1).powi(3);
        (low(FIRST as f64) / low(self.telling.max(1.0))).max(1.0)
    }

    /// From as many directions as the band has functions, or from all there are.
    pub fn tells_band(&self, band: usize) -> bool {
        self.is_hidden || (self.tells_something() && (self.by_all || self.lenses as usize > 2 * band))
    }

    pub fn tells_motion(&self, n_frames: usize) -> bool {
        n_frames > 1 && self.tells_something() && self.frames as usize >= n_frames.min(LEAST_FRAMES as usize)
    }
}

pub(super) struct Shot {
    pub camera: usize,
    pub frame: u32,
    /// Shows no moment of the clip.
    is_photo: bool,
    /// By place.
    lens: usize,
    time: f64,
    pinhole: Pinhole,
}

#[derive(Clone, Copy, Default)]
struct Tally {
    /// Square of its largest temporal weight in a training picture.
    peak: f64,
    /// Training pictures that have it in view, and their lenses.
    in_view: u32,
    lenses_in_view: u32,
    /// Those that were looked at; a bit for each lens.
    looked: u32,
    looked_lenses: u128,
    /// Those that show it, the squares of its weights in them; a bit for each lens and each frame.
    pictures: u32,
    squares: f64,
    lenses: u128,
    frames: u64,
}

struct Planned {
    need: f64,
    lenses: Vec<usize>,
}

pub(super) struct Album<'a> {
    splats: &'a Splats,
    /// Of each Gaussian; and its largest standard deviation.
    opacity: Vec<(f64, f64)>,
    pub shots: Vec<Shot>,
    /// The first picture of each lens, and the number of all.
    lenses: Vec<usize>,
    is_looked_at: Vec<bool>,
    n_looked: usize,
    /// That were looked at, in the order of their bits.
    slots: (Vec<usize>, Vec<u32>),
    tallies: Vec<Tally>,
    threads: usize,
}

impl<'a> Album<'a> {
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

    fn by_piece<T: Send>(&self, of: impl Fn(usize) -> T + Sync) -> Result<Vec<T>> {
        let n = self.splats.len();
        let piece = |k: usize| Ok((k * PIECE..n.min((k + 1) * PIECE)).map(&of).collect::<Vec<T>>());
        Ok(in_parallel(n.div_ceil(PIECE), self.threads, piece, |_| {})?.into_iter().flatten().collect())
    }

    /// True if a Gaussian would be in a picture if nothing hid it.
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

    /// Training pictures that hold a Gaussian, and their lenses.
    fn in_view(&self, i: usize) -> (u32, u32) {
        let n_lenses = self.lenses.len() - 1;
        let stride = n_lenses.div_ceil(LENSES).max(1);
        let (mut pictures, mut lenses) = (0, 0);
        for lens in (0..n_lenses).step_by(stride) {
            let shots = &self.shots[self.lenses[lens]..self.lenses[lens + 1]];
            let held = if i < self.splats.n_static {
                if self.holds(&shots[0], i) { shots.len() } else { 0 }
            } else {
                let is_there = |shot: &&Shot| self.opacity[i].0 * self.splats.weight_at(i, shot.time) >= FAINT;
                let there: Vec<&Shot> = shots.iter().filter(is_there).collect();
                let step = there.len().div_ceil(PICTURES_OF_A_LENS).max(1);
                (step * there.iter().step_by(step).filter(|shot| self.holds(shot, i)).count()).min(there.len())
            };
            pictures += held * stride;
            lenses += if held > 0 { stride } else { 0 };
        }
        (pictures as u32, lenses as u32)
    }

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

    pub fn all_seen(&self) -> Vec<Seen> {
        self.tallies.iter().map(|tally| self.seen(tally)).collect()
    }

    /// Notes that picture `at` was looked at, and the Gaussians that it shows.
    pub fn look(&mut self, at: usize, shows: &[bool]) -> Result<()> {
        fn bit<T: PartialEq>(slots: &mut Vec<T>, of: T) -> usize {
            slots.iter().position(|slot| *slot == of).unwrap_or_else(|| {
                slots.push(of);
                slots.len() - 1
            })
        }
        let (lens, frame) = (self.shots[at].lens, self.shots[at].frame);
        // Two that share a bit count as one.
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

    /// At most `most` next pictures: those that show most of what has not been seen. None if all but `share` of the
    /// Gaussians have been seen enough, or if no picture may show more.
    pub fn choose(&self, share: f64, most: usize, key: &[u64]) -> Result<Vec<usize>> {
        let lacks = |i: &usize| {
            let seen = self.seen(&self.tallies[*i]);
            !seen.tells_all() || !seen.tells_band(self.splats.degree_of(*i))
        };
        let lacking: Vec<usize> = (0..self.tallies.len()).filter(lacks).collect();
        let is_first = self.n_looked == 0;
        if !is_first && lacking.len() as f64 <= share * self.tallies.len() as f64 {
            return Ok(Vec::new());
        }
        let sample = picked(&lacking, SAMPLE);
        let mut candidates = permutation(self.shots.len(), &[key, &[self.n_looked as u64]].concat());
        candidates.retain(|at| !self.is_looked_at[*at]);
        candidates.truncate(CANDIDATES);
        let held = |k: usize| -> Result<Vec<(usize, f64)>> {
            let shot = &self.shots[candidates[k]];
            let held = (0..sample.len()).filter(|s| self.holds(shot, sample[*s]));
            // In units of a picture at the height of the Gaussian's visibility.
            let peak = |i: usize| self.tallies[i].peak.max(f64::MIN_POSITIVE);
            let worth = |i: usize| self.splats.weight_at(i, shot.time).powi(2) / peak(i);
            Ok(held.map(|s| (s, worth(sample[s]))).collect())
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
