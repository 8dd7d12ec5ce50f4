//! The true sound of a source in a free field, computed apart from the renderer that is judged by it.

use glam::DVec3;

use super::FS;
use super::align::LEAD;
use super::hrtf::{HrtfSet, Lookup};
use super::pose::PoseTrack;
use super::wola::Baker;

/// Samples for which the true response is held: a third of a millisecond.
const STEP: usize = 16;

/// A source of sound in a free field: what it says and where it is, at any time in seconds.
pub struct Emitter<'a> {
    /// As heard at a distance of one scene unit.
    pub voice: &'a dyn Fn(f64) -> f64,
    pub place: &'a dyn Fn(f64) -> DVec3,
    pub speed_of_sound: f64,
}

impl Emitter<'_> {
    /// The amplitude that arrives at a place at a time, and where it came from.
    pub fn arriving(&self, at: DVec3, t: f64) -> (f64, DVec3) {
        let mut said = t;
        let mut from = (self.place)(t);
        // The source moves far slower than sound: each turn gains at least two digits.
        for _ in 0..5 {
            said = t - from.distance(at) / self.speed_of_sound;
            from = (self.place)(said);
        }
        ((self.voice)(said) / from.distance(at).max(1e-3), from)
    }

    /// The sound at the ears of a head, each sample the sum of products with the response of the moment.
    pub fn binaural(&self, head: &PoseTrack, hrtf: &HrtfSet, n: usize) -> Vec<[f32; 2]> {
        let mut baker = Baker::new(hrtf.taps(Lookup::Aligned), hrtf.max_delay());
        let past = baker.size();
        // What arrives from `past` samples before the beginning to `LEAD` after the end.
        let time = |i: usize| (i as f64 - past as f64) / f64::from(FS);
        let arriving: Vec<f32> =
            (0..n + past + LEAD).map(|i| self.arriving(head.at(time(i)).p, time(i)).0 as f32).collect();
        let mut out = Vec::with_capacity(n);
        while out.len() < n {
            let t = (out.len() + STEP / 2) as f64 / f64::from(FS);
            let pose = head.at(t);
            let (_, from) = self.arriving(pose.p, t);
            let responses = baker.bake(&hrtf.filter(pose.q.inverse() * (from - pose.p), Lookup::Aligned));
            for i in out.len()..(out.len() + STEP).min(n) {
                let newest = past + LEAD + i;
                let heard = &arriving[newest + 1 - past..=newest];
                let sum = |response: &Vec<f32>| heard.iter().rev().zip(response).map(|(x, h)| x * h).sum::<f32>();
                out.push([sum(&responses[0]), sum(&responses[1])]);
            }
        }
        out
    }
}
