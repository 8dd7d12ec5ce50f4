//! The first Gaussians, from a capture's points, its cameras and its pictures.
//!
//! - `flow`: points of every frame. Those that the optical flow moves become dynamic, the others of one frame static.
//! - `sweep` and `agree`: static surfaces, by plane sweep, where the capture has no points.
//! - `hull` and `follow`: moving surfaces, by visual hulls from foreground masks at evenly spaced frames.
//!
//! Colours are medians over the cameras that see a point, because each has its own exposure.

mod agree;
mod chosen;
mod eye;
mod flow;
mod follow;
mod hull;
mod pinhole;
mod points;
mod settings;
mod sizing;
mod surfaces;
mod sweep;

pub(crate) use chosen::{evenly_chosen, picked};
pub use flow::PointCounts;
pub(crate) use pinhole::Pinhole;
pub(crate) use points::{from_points, random_points};
pub use settings::{Init, Settings};

use crate::error::{Error, Result};
use crate::report::statistics::median_high;
use crate::scene::capture::{Capture, Shot};
use crate::scene::{Motion, Splats};
use crate::words::count;
use chosen::{are_cut_out, cameras, views};
use eye::Axis;
use flow::FromFrames;
use hull::Cube;
use points::Found;
use sizing::{SIZE, Sizing};
use std::fmt;
use surfaces::{Surfaces, Views};

/// Called as (pieces done, pieces in all).
pub(crate) type Progress<'a> = dyn FnMut(usize, usize) + 'a;

/// Frames from one hull to the next, at least: little moves in between.
const HULL_STRIDE: u32 = 2;
/// How long a Gaussian from a hull is visible, in intervals between hulls: two hulls overlap half-way.
const HULL_TAU: f64 = 0.7;
/// Pixels that are decoded for hulls, but of four frames at least.
const HULL_PIXELS: u64 = 1 << 28;
/// Without surfaces, a run with fewer points begins at random places: 100 gave no recognisable room in 500 steps.
const ENOUGH: usize = 200;
/// Opacity of Gaussians on surfaces: they cover the pictures from the first step, and Gaussians behind them still learn.
const SURFACE_OPACITY: f64 = 0.5;

/// The first Gaussians, and where they come from.
#[derive(Clone, Debug)]
pub struct Initial {
    pub splats: Splats,
    /// The source of the dynamic ones, or of all if the capture names none; never [`Init::Auto`].
    pub from: Init,
    /// Points and surfaces were joined, as [`Init::Auto`] does if it finds both.
    pub joined: bool,
    pub because: String,
    pub n_hulls: usize,
    /// Static Gaussians from photographs.
    pub n_photos: usize,
    pub counts: Option<PointCounts>,
    /// The number before thinning, if that is more than the settings allow.
    pub thinned_from: Option<usize>,
}

impl fmt::Display for Initial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Initial { splats, from, joined, because, n_hulls, n_photos, counts, thinned_from } = self;
        let (n_static, n_dynamic) = (splats.n_static, splats.len() - splats.n_static);
        let source = match from {
            Init::Flow if *joined => "the points and the flow of every frame and surfaces on which the images agree",
            Init::Flow | Init::AnyView => "the points and the flow of every frame",
            Init::Concat => "the points of every frame",
            Init::Auto | Init::Points => "the capture's points",
            Init::Hull if *joined => "visual hulls, surfaces on which the images agree, and the capture's points",
            Init::Frustum if *joined => "surfaces on which the images agree, and the capture's points",
            Init::Hull => "visual hulls and surfaces on which the images agree",
            Init::Frustum => "surfaces on which the images agree",
            Init::Random => "random points",
        };
        let dynamic = if n_dynamic > 0 { format!(" and {n_dynamic} dynamic") } else { String::new() };
        let init = if *joined { Init::Auto.name() } else { from.name() };
        write!(f, "{n_static} static{dynamic} Gaussians from {source} (init={init}: {because})")?;
        if *n_hulls > 0 {
            write!(f, ", hulls of {}", count(*n_hulls, "frame"))?;
        }
        if *n_photos > 0 {
            write!(f, ", {n_photos} of the static ones from photographs")?;
        }
        if let Some(counts) = counts {
            write!(f, "; {counts}")?;
        }
        thinned_from
            .map_or(Ok(()), |all| write!(f, "; evenly chosen from {all} to keep max_gaussians, with room to grow"))
    }
}

impl Initial {
    fn new(splats: Splats, from: Init, because: String) -> Self {
        Initial { splats, from, joined: false, because, n_hulls: 0, n_photos: 0, counts: None, thinned_from: None }
    }
}

/// Makes the first Gaussians of `capture`, which is in the frame of training: at random places if nothing is found.
/// Without `settings.trains_static` only dynamic ones are made, and there may be none.
pub(crate) fn initialise(capture: &Capture, settings: &Settings, progress: &mut Progress) -> Result<Initial> {
    let mut initial =
        if settings.trains_static { all(capture, settings, progress)? } else { moving(capture, settings, progress)? };
    if capture.has_photos() {
        let mut splats = of_photos(capture, settings)?;
        initial.n_photos = splats.len();
        splats.append(initial.splats);
        initial.splats = splats;
    }
    let (n, most) = (initial.splats.len(), settings.most);
    if n > most {
        initial.splats = initial.splats.in_order(&(0..most).map(|i| i * n / most).collect::<Vec<_>>());
        initial.thinned_from = Some(n);
    }
    initial.splats.source_row = (0..initial.splats.len() as u32).collect();
    Ok(initial)
}

fn all(capture: &Capture, settings: &Settings, progress: &mut Progress) -> Result<Initial> {
    let lacks = |what: &str| {
        let remedy = "set it to one of auto, flow, any_view, concat, points, hull, frustum and random";
        Err(Error::data(&capture.path, "setting `init`", format!("the capture has no {what}"), remedy))
    };
    let has_foreground = marks_motion(capture);
    let (has_frame_points, has_flow) = (capture.has_frame_points(), has_flow(capture));
    let (from, because) = match settings.init {
        Init::Auto if has_frame_points && has_flow => (Init::Flow, "the capture has points of every frame and flow"),
        Init::Auto if has_foreground => (Init::Hull, "the capture has foreground masks"),
        Init::Auto => (Init::Frustum, "the capture has neither flow with points of every frame nor foreground masks"),
        Init::Flow | Init::AnyView if !has_flow => return lacks("optical flow"),
        Init::Flow | Init::AnyView | Init::Concat if !has_frame_points => return lacks("points of every frame"),
        Init::Points if capture.points.is_empty() => return lacks("points"),
        Init::Hull if !has_foreground => return lacks("foreground masks"),
        asked => (asked, "asked for"),
    };
    let because = because.to_owned();
    match from {
        Init::Points => {
            return Ok(Initial::new(from_points(&capture.points, capture, settings.sh_degree), from, because));
        }
        Init::Random => return Ok(at_random(capture, settings, because)),
        Init::AnyView | Init::Concat => {}
        Init::Flow if settings.init == Init::Flow => {}
        _ => return from_pictures(capture, settings, from, because, progress),
    }
    let FromFrames { still: (still, sizes), moving, counts } = flow::from_frames(capture, settings, from, progress)?;
    let mut splats = Splats::new(settings.sh_degree);
    points::append(&mut splats, &still, &sizes, points::OPACITY, flow::motion_at_rest(capture, settings));
    splats.append(moving);
    if splats.is_empty() {
        return Ok(at_random(capture, settings, "no frame has a point".to_owned()));
    }
    Ok(Initial { counts: Some(counts), ..Initial::new(splats, from, because) })
}

/// Dynamic Gaussians alone, by flow and by masks; none if the capture has neither.
fn moving(capture: &Capture, settings: &Settings, progress: &mut Progress) -> Result<Initial> {
    let (from, because) = if capture.has_frame_points() && has_flow(capture) {
        (Init::Flow, "of moving surfaces, by the flow")
    } else if marks_motion(capture) {
        (Init::Hull, "of what moves, by the masks")
    } else {
        let because = "the capture has neither flow nor masks of what moves".to_owned();
        return Ok(Initial::new(Splats::new(settings.sh_degree), Init::Hull, because));
    };
    let mut initial = from_pictures(capture, settings, from, because.to_owned(), progress)?;
    // The hull of a single frame is static.
    let moving: Vec<usize> = (initial.splats.n_static..initial.splats.len()).collect();
    initial.splats = initial.splats.in_order(&moving);
    Ok(initial)
}

fn at_random(capture: &Capture, settings: &Settings, because: String) -> Initial {
    let points = random_points(capture, settings.n_points, settings.seed);
    Initial::new(from_points(&points, capture, settings.sh_degree), Init::Random, because)
}

fn has_any(capture: &Capture, has: impl Fn(&Shot) -> bool) -> bool {
    capture.cameras.iter().filter(|camera| !camera.is_test).flat_map(|camera| &camera.shots).any(has)
}

fn has_flow(capture: &Capture) -> bool {
    has_any(capture, |shot| shot.flow.is_some())
}

fn has_foreground(capture: &Capture) -> bool {
    has_any(capture, |shot| shot.foreground.is_some())
}

/// True if masks, or the alpha of a rig's cut-out pictures, mark what moves.
fn marks_motion(capture: &Capture) -> bool {
    has_foreground(capture) || capture.is_rig_clip() && are_cut_out(capture)
}

/// Gaussians on the surfaces that the pictures show and, with [`Init::Auto`], at the capture's points. The dynamic
/// ones come from points and flow of all frames and the hulls of cameras that look inward ([`Init::Flow`]), or from
/// hulls alone ([`Init::Hull`]).
fn from_pictures(
    capture: &Capture,
    settings: &Settings,
    from: Init,
    because: String,
    progress: &mut Progress,
) -> Result<Initial> {
    let cameras = cameras(capture, false);
    let cut_out = are_cut_out(capture);
    let tells = has_foreground(capture) || cut_out && capture.is_rig_clip();
    let has_hulls = match from {
        Init::Flow => tells && cameras_look_inward(capture),
        _ => from == Init::Hull,
    };
    let hull_frames = if has_hulls { hull_frames(capture, &cameras) } else { Vec::new() };
    let mut n_looked_at = hull_frames.len();
    if settings.trains_static {
        // Every camera is swept, too.
        n_looked_at += 1 + usize::from(!hull_frames.contains(&capture.reference_frame));
    }
    let n_flow_frames = if from == Init::Flow { capture.n_frames as usize } else { 0 };
    let mut n_done = 0;
    let n_pieces = n_flow_frames + n_looked_at * cameras.len();
    let mut done = || {
        n_done += 1;
        progress(n_done, n_pieces);
    };
    let frames = match from {
        Init::Flow => Some(flow::from_frames(capture, settings, from, &mut |_, _| done())?),
        _ => None,
    };
    let sizing = Sizing::new(capture);
    let known = frames.as_ref().map(|frames| frames.still.0.as_slice());
    let points = if settings.init == Init::Auto { capture.points.as_slice() } else { &[] };
    let views = Views {
        capture,
        points,
        settings,
        cameras: &cameras,
        hull_frames: &hull_frames,
        finds_static: settings.trains_static,
        cut_out,
    };
    let Surfaces { still, moving, n_known, n_found } = views.surfaces(known, &sizing.lenses, &mut done)?;
    let n_hull = moving.iter().map(|(_, found)| found.len()).sum::<usize>();
    let n_flow = frames.as_ref().map_or(0, |frames| frames.moving.len());
    if settings.trains_static && n_found + n_hull == 0 && still.len() + n_flow < ENOUGH {
        return Ok(at_random(capture, settings, format!("{because}; no surface was found in the pictures")));
    }
    let mut splats = Splats::new(settings.sh_degree);
    let at_rest = match from {
        Init::Hull if n_hull > 0 => None,
        Init::Flow => flow::motion_at_rest(capture, settings),
        _ => points::throughout(capture),
    };
    let (still, sizes) = sizing.sized(still);
    points::append(&mut splats, &still, &sizes, SURFACE_OPACITY, at_rest);
    append_moving(&mut splats, moving, capture, &sizing)?;
    let counts = frames.as_ref().map(|frames| frames.counts);
    if let Some(frames) = frames {
        splats.append(frames.moving);
    }
    let joined = n_known > 0;
    // Without a hull the masks say nothing, and anything may move.
    let (from, because) = match from {
        Init::Hull if n_hull == 0 => (Init::Frustum, format!("{because}, but no hull of three cameras or more")),
        _ => (from, because),
    };
    let n_hulls = if n_hull > 0 { hull_frames.len() } else { 0 };
    Ok(Initial { joined, counts, n_hulls, ..Initial::new(splats, from, because) })
}

fn append_moving(
    splats: &mut Splats,
    moving: Vec<(u32, Vec<Found>)>,
    capture: &Capture,
    sizing: &Sizing,
) -> Result<()> {
    let n_frames = f64::from(capture.n_frames);
    let tau = HULL_TAU / moving.len().max(1) as f64;
    let hull = |(frame, found)| (f64::from(frame) / n_frames, sizing.sized(found));
    let hulls: Vec<_> = moving.into_iter().map(hull).collect();
    for (k, (time, (found, sizes))) in hulls.iter().enumerate() {
        let beside = [k.checked_sub(1), k.checked_add(1)].into_iter().flatten().filter_map(|k| hulls.get(k));
        let others: Vec<(f64, &[Found])> = beside.map(|(other, (found, _))| (other - time, found.as_slice())).collect();
        let Some(spacing) = median_high(sizes.iter().map(|size| size / SIZE)) else { continue };
        let velocities = follow::velocities(found, &others, spacing)?;
        for ((found, size), velocity) in found.iter().zip(sizes).zip(velocities) {
            let motion = Motion { velocity, t_center: *time as f32, t_scale: tau.ln() as f32 };
            points::push(splats, found, *size, SURFACE_OPACITY, (capture.n_frames > 1).then_some(motion));
        }
    }
    Ok(())
}

fn of_photos(capture: &Capture, settings: &Settings) -> Result<Splats> {
    let cameras = cameras(capture, true);
    let views = Views {
        capture,
        points: &capture.photo_points,
        settings,
        cameras: &cameras,
        hull_frames: &[],
        finds_static: true,
        cut_out: false,
    };
    let sizing = Sizing::new(capture);
    let (found, sizes) = sizing.sized(views.surfaces(None, &sizing.lenses, &mut || ())?.still);
    let mut splats = Splats::new(settings.sh_degree);
    points::append(&mut splats, &found, &sizes, SURFACE_OPACITY, None);
    Ok(splats)
}

/// True if most training cameras look at the space between them. Hulls of others are vague: three of eight cameras that
/// look around leave phantoms, which cost more than they add to the flow.
pub(crate) fn cameras_look_inward(capture: &Capture) -> bool {
    let axes: Vec<Axis> = views(capture).iter().map(|view| Axis::of(&view.pose)).collect();
    Cube::around(&axes).is_inward
}

/// Evenly spaced.
fn hull_frames(capture: &Capture, cameras: &[usize]) -> Vec<u32> {
    let per_frame: u64 = cameras.iter().map(|camera| capture.cameras[*camera].intrinsics.n_pixels()).sum();
    let n_frames = u64::from(capture.n_frames);
    let n = (HULL_PIXELS / per_frame.max(1)).max(4).min(u64::from(capture.n_frames.div_ceil(HULL_STRIDE)));
    (0..n).map(|i| ((2 * i + 1) * n_frames / (2 * n)) as u32).collect()
}
