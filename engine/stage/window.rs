//! Windows of a clip: of the dynamic Gaussians only those that live near a view's time are on the device, so that neither its memory
//! nor the work of a frame grows with the length of the clip. A clip in parts in a file is read part by part, too. Where Gaussians
//! appear or disappear at once, a window begins, so that a window has them or has them not.

use super::params::moment;
use super::scene::far_origin;
use super::{Purpose, SceneBuffers, group_limit};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::scene::{Parts, Resident, Splats, View};
use crate::settings::Constants;
use std::path::Path;
use std::sync::Arc;

/// Dynamic Gaussians that are never worth a window: to cull them costs less than to upload them again.
const FEW: usize = 1 << 14;
const MOST: u32 = 256;
/// Twice as many windows must leave at most this part of the Gaussians in the fullest one.
const LESS: f64 = 0.8;
/// By how much lives and windows are longer than they are, for the rounding of the kernels.
const MARGIN: f64 = 1e-4;

/// A clip on the host or in a file, and what of it is on the device.
pub(super) struct Windows {
    /// The clip's Gaussians on the host. The first piece may have static Gaussians too.
    pieces: Vec<Piece>,
    /// The file that pieces are read from.
    clip: Option<Resident>,
    /// Where windows end and the next ones begin, normalised time, ascending.
    borders: Vec<f64>,
    origin: [f64; 3],
    limit: usize,
    n_bad: u32,
    shown: Option<usize>,
}

struct Piece {
    splats: Arc<Splats>,
    lives: Vec<Life>,
}

impl Piece {
    fn new(splats: Arc<Splats>, constants: &Constants) -> Self {
        Piece { lives: lives(&splats, constants), splats }
    }
}

/// When a dynamic Gaussian may be visible, normalised time.
#[derive(Clone, Copy)]
struct Life {
    first: f64,
    last: f64,
}

impl Windows {
    /// The windows of a clip, and its static Gaussians, which are in every window; none where windows would save too little.
    pub fn of(gpu: &Gpu, splats: &Arc<Splats>, constants: &Constants) -> Result<Option<(Self, SceneBuffers)>> {
        let pieces = vec![Piece::new(splats.clone(), constants)];
        let n = n_windows(&pieces, [0.0, 1.0]);
        if n < 2 && splats.span.is_empty() {
            return Ok(None);
        }
        let still = splats.kept(|i| i < splats.n_static);
        let mut windows = Windows::around(gpu, far_origin(splats), splats.sh_degree);
        windows.borders = borders(&pieces, [0.0, 1.0], n);
        windows.pieces = pieces;
        let scene = windows.load_static(gpu, &still, constants)?;
        Ok(Some((windows, scene)))
    }

    /// The same of a clip that is read as it is seen.
    pub fn of_parts(gpu: &Gpu, mut clip: Box<dyn Parts>, constants: &Constants) -> Result<(Self, SceneBuffers)> {
        let still = clip.still()?;
        let origin = match (still.is_empty(), clip.parts().is_empty()) {
            (true, false) => far_origin(&clip.part(0)?),
            _ => far_origin(&still),
        };
        let mut windows = Windows::around(gpu, origin, clip.sh_degree());
        windows.clip = Some(Resident::new(clip));
        let scene = windows.load_static(gpu, &still.by_degree(), constants)?;
        Ok((windows, scene))
    }

    fn around(gpu: &Gpu, origin: [f64; 3], sh_degree: u32) -> Self {
        let limit = group_limit(gpu, sh_degree as usize, Purpose::Picture);
        Windows { pieces: Vec::new(), clip: None, borders: Vec::new(), origin, limit, n_bad: 0, shown: None }
    }

    fn load_static(&mut self, gpu: &Gpu, still: &Splats, constants: &Constants) -> Result<SceneBuffers> {
        let scene = SceneBuffers::upload_around(gpu, still, constants, self.limit, self.origin)?;
        self.n_bad = scene.n_bad;
        Ok(scene)
    }

    fn window_of(&self, time: f64) -> usize {
        self.borders.partition_point(|border| *border <= time)
    }

    /// True if the window that `view` needs is not on the device.
    pub fn is_due(&self, view: &View) -> bool {
        let time = moment(view);
        self.shown != Some(self.window_of(time)) || self.clip.as_ref().is_some_and(|clip| !clip.holds(time))
    }

    pub fn load(&mut self, gpu: &Gpu, constants: &Constants, scene: &mut SceneBuffers, view: &View) -> Result<()> {
        self.shown = None;
        scene.clear_dynamic(self.n_bad);
        let time = moment(view);
        if let Some(clip) = self.clip.as_mut().filter(|clip| !clip.holds(time)) {
            self.pieces.clear();
            let (stretch, pieces) = clip.reach(time)?;
            self.pieces = pieces.into_iter().map(|splats| Piece::new(splats, constants)).collect();
            self.borders = borders(&self.pieces, stretch, n_windows(&self.pieces, stretch));
        }
        let at = self.window_of(time);
        let dynamic = SceneBuffers::upload_around(gpu, &self.part(at), constants, self.limit, self.origin)?;
        scene.append_dynamic(gpu, dynamic)?;
        self.shown = Some(at);
        Ok(())
    }

    /// A scene of the whole clip; an error where no scene is right for all times.
    pub(crate) fn load_whole(&mut self, gpu: &Gpu, constants: &Constants) -> Result<SceneBuffers> {
        let (what, remedy) = ("what is asked of a scene as a whole", "give one of the segments that it was joined of");
        if let Some(clip) = &mut self.clip {
            let reason = format!("is a clip in parts, which {what} cannot take");
            return Err(Error::data(clip.clip().path(), "", reason, remedy));
        }
        let splats = &self.pieces[0].splats;
        splats.refuse_spans(Path::new("the scene"), what, remedy)?;
        SceneBuffers::upload_around(gpu, splats, constants, self.limit, self.origin)
    }

    fn part(&self, at: usize) -> Splats {
        let begin = at.checked_sub(1).map_or(f64::NEG_INFINITY, |before| self.borders[before]);
        let end = self.borders.get(at).copied().unwrap_or(f64::INFINITY);
        let of_piece = |Piece { splats, lives }: &Piece| {
            let n_static = splats.n_static;
            let is_in = |i: &usize| {
                let Life { first, last } = lives[i - n_static];
                // A window begins wherever one appears or disappears, so it is there throughout or never.
                let span = splats.span.get(i - n_static);
                let is_there = span.is_none_or(|[from, to]| f64::from(*from) < end && f64::from(*to) > begin);
                is_there && first <= end + MARGIN && last >= begin - MARGIN
            };
            splats.in_order(&(n_static..splats.len()).filter(is_in).collect::<Vec<_>>())
        };
        if let ([piece], None) = (&self.pieces[..], &self.clip) {
            return of_piece(piece);
        }
        let mut pieces = self.pieces.iter().map(of_piece);
        let mut all = pieces.next().unwrap_or_default();
        pieces.for_each(|piece| all.append(piece));
        all.by_degree()
    }
}

/// The ends of the windows of a stretch of a clip, `n` of them evenly, and more where Gaussians appear or disappear.
fn borders(pieces: &[Piece], stretch: [f64; 2], n: u32) -> Vec<f64> {
    let [begin, end] = within_clip(stretch);
    let even = (0..=n).filter(|_| n > 1).map(|k| begin + (end - begin) * f64::from(k) / f64::from(n));
    let given = pieces.iter().flat_map(|piece| piece.splats.span.as_flattened());
    let given = given.filter(|time| time.is_finite()).map(|time| f64::from(*time));
    let mut borders: Vec<f64> = even.chain(given).collect();
    borders.sort_unstable_by(f64::total_cmp);
    borders.dedup();
    borders
}

fn within_clip([begin, end]: [f64; 2]) -> [f64; 2] {
    [begin.max(0.0), end.min(1.0)]
}

/// When each dynamic Gaussian may be visible: `bound.comp` on the host, a little longer. One with a number that is not finite is
/// in every window, so that it is counted.
fn lives(splats: &Splats, constants: &Constants) -> Vec<Life> {
    let cut = f64::from(constants.alpha_min.max(constants.knobs.temporal_cut));
    let life = |(motion, opacity): (&crate::scene::Motion, &f32)| {
        let opacity = 1.0 / (1.0 + (-f64::from(*opacity)).exp());
        let (center, tau) = (f64::from(motion.t_center), f64::from(motion.t_scale).exp());
        let reach = tau * ((opacity / cut).ln() + MARGIN).max(0.0).sqrt() * (1.0 + MARGIN) + MARGIN;
        let (first, last) = (center - reach, center + reach);
        if constants.knobs.culls.time_cull && first.is_finite() && last.is_finite() {
            Life { first, last }
        } else {
            Life { first: f64::NEG_INFINITY, last: f64::INFINITY }
        }
    };
    let mut lives: Vec<Life> = splats.motion.iter().zip(&splats.opacity[splats.n_static..]).map(life).collect();
    for (life, [from, to]) in lives.iter_mut().zip(&splats.span) {
        *life = Life { first: life.first.max(f64::from(*from)), last: life.last.min(f64::from(*to)) };
    }
    lives
}

/// The number of windows of a stretch of a clip: twice as many as long as that leaves less in each.
fn n_windows(pieces: &[Piece], stretch: [f64; 2]) -> u32 {
    let lives = || pieces.iter().flat_map(|piece| &piece.lives);
    let total: usize = pieces.iter().map(|piece| piece.lives.len()).sum();
    if total < FEW {
        return 1;
    }
    let (mut n, mut most) = (1, total);
    while n < MOST {
        let finer = fullest(lives(), within_clip(stretch), 2 * n);
        if finer as f64 > LESS * most as f64 {
            break;
        }
        (n, most) = (2 * n, finer);
    }
    n
}

fn fullest<'a>(lives: impl Iterator<Item = &'a Life>, [begin, end]: [f64; 2], n: u32) -> usize {
    let window = |time: f64| {
        let part = (time - begin) / (end - begin).max(f64::MIN_POSITIVE);
        (part * f64::from(n)).floor().clamp(0.0, f64::from(n - 1)) as usize
    };
    let mut change = vec![0i64; n as usize + 1];
    for Life { first, last } in lives {
        change[window(*first)] += 1;
        change[window(*last) + 1] -= 1;
    }
    let running = change.iter().scan(0, |sum, step| {
        *sum += step;
        Some(*sum)
    });
    running.max().unwrap_or(0) as usize
}
