//! Gaussians of ours as a `.4dgs`.

use super::grades::Grades;
use super::harmonics::{HALF_STEP, Viewpoints};
use super::{RECORD, Sounds, VIEWS, World};
use crate::error::{Error, Result};
use crate::formats::clock::Clock;
use crate::scene::SH_C0;
use crate::scene::{ALWAYS, Splats, View};
use fourdgs::quantization::{Profile, SH_QUANT_HI, SH_QUANT_LO};
use fourdgs::{Attachment, GaussianSet, Metadata, SceneExtras, WriteOptions};
use std::collections::BTreeMap;
use std::path::Path;

/// Temporal factors below this are not told: no alpha reaches a pixel by it.
const CUTOFF: f64 = 1.0 / 255.0;
/// Chunks are at least this long, seconds, so that one is fetched in time; and hold at least so many Gaussians where they are
/// not whole windows, so that the description of a chunk costs little.
const SHORTEST_CHUNK: f64 = 0.5;
const LEAST_IN_CHUNK: usize = 256;

/// Level of deflate, 0 to 9, of a file that is soon done with.
const QUICK: u32 = 1;
/// A colour is off from here on.
const OFF: f64 = 2.0 / 255.0;

/// What a file holds beside its Gaussians.
#[derive(Clone, Debug)]
pub struct Contents<'a> {
    /// The clock of the clip.
    pub clock: Clock,
    /// Views to start from, in the scene's frame.
    pub views: &'a [View],
    /// What is this project's own, by name: how the scene is rendered.
    pub own: BTreeMap<String, String>,
    /// What is heard.
    pub sounds: &'a Sounds,
    /// Which way is up, and how large it is, where that is known.
    pub world: Option<World>,
    /// Whether the file is soon done with: it is made several times as fast, and larger.
    pub is_quick: bool,
}

/// A scene as it will be stored.
#[derive(Debug)]
pub struct Encoded {
    /// All but colours, which depend on where they are seen from.
    set: GaussianSet,
    /// Coefficients of the harmonics of those that are stored, as in [`Splats::sh`].
    sh: Vec<[f32; 3]>,
    /// Gaussians whose base colour lies beyond [0, 1] so that it shows, and is cut to that.
    pub n_clamped_colors: usize,
    /// Gaussians with a coefficient of higher harmonics beyond [-4, 4], which is cut to that.
    pub n_clamped_harmonics: usize,
}

impl Encoded {
    /// The Gaussians of `splats` in the format's numbers; those with a parameter that is not finite, which are never drawn, are
    /// left out.
    pub fn new(splats: &Splats, clock: Clock) -> Self {
        let seconds = clock.seconds();
        let k = splats.n_coefficients();
        let mut set =
            GaussianSet { sh_degree: splats.sh_degree as u8, sh_coefficients: k - 1, ..GaussianSet::default() };
        let (mut sh, mut n_clamped_colors, mut n_clamped_harmonics) = (Vec::new(), 0, 0);
        for i in (0..splats.len()).filter(|&i| splats.is_finite(i)) {
            set.positions.extend(splats.position[i]);
            set.scales.extend(splats.scale[i].map(f32::exp));
            let [w, x, y, z] = splats.rotation[i];
            set.rotations.extend([x, y, z, w]);
            let (base, rest) = (splats.sh[i * k], &splats.sh[i * k + 1..(i + 1) * k]);
            let color = base.map(|dc| 0.5 + SH_C0 * f64::from(dc));
            // Without higher harmonics what is below 0 is drawn as 0.
            let is_plain = rest.iter().all(|coefficient| *coefficient == [0.0; 3]);
            let shows = |c: &f64| *c > 1.0 + HALF_STEP || (*c < -HALF_STEP && !is_plain);
            n_clamped_colors += usize::from(color.iter().any(shows));
            set.colors.extend([0.0; 3]);
            set.colors.push((1.0 / (1.0 + (-f64::from(splats.opacity[i])).exp())) as f32);
            let beyond = |c: &f32| !(SH_QUANT_LO..=SH_QUANT_HI).contains(&f64::from(*c));
            n_clamped_harmonics += usize::from(rest.as_flattened().iter().any(beyond));
            sh.extend(&splats.sh[i * k..(i + 1) * k]);
            let motion = i.checked_sub(splats.n_static).map(|dynamic| &splats.motion[dynamic]);
            set.motions.extend(motion.map_or([0.0; 3], |m| m.velocity.map(|v| (f64::from(v) / seconds) as f32)));
            set.mu_t.push(motion.map_or(0.0, |m| (f64::from(m.t_center) * seconds) as f32));
            let sigma = |log_tau: f32| (f64::from(log_tau).exp() * seconds / std::f64::consts::SQRT_2) as f32;
            set.sigma_t.push(motion.map_or(f32::INFINITY, |m| sigma(m.t_scale)));
            // The end of a window is not in it, the end of the clip is in the clip.
            let end = (seconds as f32).next_up();
            let [from, to] =
                i.checked_sub(splats.n_static).and_then(|at| splats.span.get(at)).copied().unwrap_or(ALWAYS);
            let border = |time: f32| ((f64::from(time) * seconds) as f32).clamp(0.0, end);
            set.win_lo.push(border(from));
            set.win_hi.push(border(to));
        }
        Encoded { set, sh, n_clamped_colors, n_clamped_harmonics }
    }

    /// Gaussians that are stored.
    pub fn len(&self) -> usize {
        self.set.count()
    }

    /// Whether none is.
    pub fn is_empty(&self) -> bool {
        self.set.is_empty()
    }

    /// Gaussians whose colour is off by more than 2 levels of 255, root mean square, as `views` see them, at the finest grades.
    pub fn n_off(&self, views: &[View]) -> usize {
        let (viewpoints, k) = (Viewpoints::new(views), self.set.sh_coefficients + 1);
        let is_off = |(place, coefficients): &(&[f32], &[[f32; 3]])| {
            let place = std::array::from_fn(|axis| f64::from(place[axis]));
            let rounded = viewpoints.round(place, coefficients, &Grades::default());
            rounded.is_seen && rounded.off > OFF
        };
        self.set.positions.chunks_exact(3).zip(self.sh.chunks_exact(k)).filter(is_off).count()
    }

    /// The Gaussians with the colours that `grades` allows, as `views` see them.
    fn colored(&self, views: &[View], grades: &Grades) -> GaussianSet {
        let (mut set, viewpoints, k) = (self.set.clone(), Viewpoints::new(views), self.set.sh_coefficients + 1);
        // The crate's writer tells of the bands that it is given, also of those that it leaves out.
        set.sh_degree = grades.degree(set.sh_degree);
        let stored = (usize::from(set.sh_degree) + 1).pow(2);
        set.sh_coefficients = stored - 1;
        let mut bytes = Vec::with_capacity(3 * set.sh_coefficients * set.count());
        for (i, coefficients) in self.sh.chunks_exact(k).enumerate() {
            let place = std::array::from_fn(|axis| f64::from(set.positions[3 * i + axis]));
            let rounded = viewpoints.round(place, coefficients, grades);
            set.colors[4 * i..4 * i + 3].copy_from_slice(&rounded.base.map(|c| c as f32));
            (0..3).for_each(|channel| bytes.extend(rounded.bytes[1..stored].iter().map(|harmonic| harmonic[channel])));
        }
        set.sh = (stored > 1).then_some(bytes);
        set
    }

    /// The file's bytes with attributes as fine as `grades` says. Colours are rounded so that they are right as the views of
    /// `contents` see them. The same scene, contents and grades give the same bytes.
    ///
    /// # Errors
    /// [`Error::Data`] naming `path` where a number has no place on the format's grids.
    pub fn bytes(&self, path: &Path, contents: &Contents, grades: Grades) -> Result<Vec<u8>> {
        let clock = contents.clock;
        let set = grades.on(&self.colored(contents.views, &grades), CUTOFF);
        let bits = grades.bits(set.sh_degree);
        let options = WriteOptions {
            profile: Profile::Fine,
            cutoff: CUTOFF,
            level: 9,
            max_depth: (clock.seconds() / SHORTEST_CHUNK).max(1.0).log2().floor() as u32,
            min_chunk_gaussians: LEAST_IN_CHUNK,
            write_statistics: true,
            // Its own check leaves no room for the rounding of decoded numbers to single precision, so a place half way between
            // two steps and far from the origin would be refused.
            verify: false,
            sh_bands: set.sh_degree,
            sh_bit_depths: bits.iter().any(|bits| *bits < 8).then_some(bits),
            library: concat!("ivv ", env!("CARGO_PKG_VERSION")).to_owned(),
            metadata: [("color_space", "srgb-rec709-display"), ("visibility_profile", "gaussian")]
                .map(|(key, value)| (key.to_owned(), value.to_owned()))
                .into(),
            ..WriteOptions::default()
        };
        let options = if contents.is_quick { WriteOptions { level: QUICK, ..options } } else { options };
        let mut entries = contents.own.clone();
        entries.insert("fps".to_owned(), clock.fps.to_string());
        entries.insert("frames".to_owned(), clock.frames.to_string());
        if grades != Grades::default() {
            entries.insert("grades".to_owned(), grades.to_string());
        }
        let mut extras = SceneExtras::default();
        if let Some(world) = &contents.world {
            world.put_into(&mut entries, &mut extras);
        }
        extras.metadata.push(Metadata { name: RECORD.to_owned(), entries });
        contents.sounds.put_into(&mut extras);
        if !contents.views.is_empty() {
            let data = serde_json::to_vec(&serde_json::json!({ "views": contents.views })).map_err(|fault| {
                Error::data(path, VIEWS, fault.to_string(), "this is a fault of the program that made the views")
            })?;
            let media_type = "application/json".to_owned();
            extras.attachments.push(Attachment { name: VIEWS.to_owned(), media_type, data });
        }
        fourdgs::write_to_vec(&set, clock.seconds(), &options, &extras).map_err(|fault| {
            let remedy = "a Gaussian lies or reaches too far for the format: leave it out, or export the scene as PLY";
            Error::data(path, "", format!("cannot be stored: {fault}"), remedy)
        })
    }
}
