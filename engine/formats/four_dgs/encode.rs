use super::decode::margin;
use super::grades::Grades;
use super::harmonics::{HALF_STEP, Viewpoints};
use super::write::{Measure, Writing};
use super::{RECORD, Sounds, VIEWS, World};
use crate::error::{Error, Result};
use crate::files::write_made;
use crate::internals::formats::scene::Clock;
use crate::scene::{ALWAYS, Part, Parts, SH_C0, Splats, View};
use fourdgs::quantization::{Profile, SH_QUANT_HI, SH_QUANT_LO, support_k};
use fourdgs::{Attachment, GaussianSet, Metadata, SceneExtras, WriteOptions};
use std::collections::BTreeMap;
use std::path::Path;

/// The default cutoff: a temporal factor below it contributes no alpha to any pixel.
const CUTOFF: f64 = 1.0 / 255.0;
/// Level of deflate of a quick file.
const QUICK: u32 = 1;
/// The error of a colour from which on it is counted as off.
const OFF: f64 = 2.0 / 255.0;

/// The contents of a file beside its Gaussians, see [`Clip`](super::super::Clip).
#[derive(Clone, Debug)]
pub struct Contents<'a> {
    pub clock: Clock,
    pub views: &'a [View],
    pub own: BTreeMap<String, String>,
    pub sounds: &'a Sounds,
    pub world: Option<World>,
    pub cutoff: Option<f64>,
    /// Made several times as fast, and larger.
    pub is_quick: bool,
}

/// A scene in the format's numbers.
#[derive(Debug)]
pub struct Encoded {
    /// All but colours, which depend on the views.
    set: GaussianSet,
    /// As [`Splats::sh`].
    sh: Vec<[f32; 3]>,
    pub n_dynamic: usize,
    /// Gaussians that are left out, since a parameter is not finite.
    pub n_left_out: usize,
    /// Gaussians whose base colour is cut to [0, 1], visibly.
    pub n_clamped_colors: usize,
    /// Gaussians with a harmonic that is cut to [-4, 4].
    pub n_clamped_harmonics: usize,
}

impl Encoded {
    /// Leaves out Gaussians with a parameter that is not finite.
    pub fn new(splats: &Splats, clock: Clock) -> Self {
        let seconds = clock.seconds();
        let k = splats.n_coefficients();
        let mut set =
            GaussianSet { sh_degree: splats.sh_degree as u8, sh_coefficients: k - 1, ..GaussianSet::default() };
        let (mut sh, mut n_dynamic, mut n_clamped_colors, mut n_clamped_harmonics) = (Vec::new(), 0, 0, 0);
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
            n_dynamic += usize::from(motion.is_some());
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
        let n_left_out = splats.len() - set.count();
        Encoded { set, sh, n_dynamic, n_left_out, n_clamped_colors, n_clamped_harmonics }
    }

    pub fn len(&self) -> usize {
        self.set.count()
    }

    pub fn is_empty(&self) -> bool {
        self.set.is_empty()
    }

    /// Gaussians whose colour is off by more than 2 levels of 255 (root mean square over `views`) at the finest grades.
    pub fn n_off(&self, views: &[View]) -> usize {
        let (viewpoints, k) = (Viewpoints::new(views), self.set.sh_coefficients + 1);
        let is_off = |(place, coefficients): &(&[f32], &[[f32; 3]])| {
            let place = std::array::from_fn(|axis| f64::from(place[axis]));
            let rounded = viewpoints.round(place, coefficients, &Grades::default());
            rounded.is_seen && rounded.off > OFF
        };
        self.set.positions.chunks_exact(3).zip(self.sh.chunks_exact(k)).filter(is_off).count()
    }

    pub(super) fn colored(&self, viewpoints: &Viewpoints, grades: &Grades) -> GaussianSet {
        let (mut set, k) = (self.set.clone(), self.set.sh_coefficients + 1);
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

    /// The file's bytes. Colours are rounded so that they are right in the views of `contents`.
    pub fn bytes(&self, path: &Path, contents: &Contents, grades: Grades) -> Result<Vec<u8>> {
        let mut colored = self.colored(&Viewpoints::new(contents.views), &grades);
        contents.forget_ends(&mut colored);
        let mut measure = Measure::new();
        measure.count(&colored, &grades);
        let (mut writing, mut bytes) = contents.begin(path, &measure, grades, self.set.sh_degree)?;
        bytes.extend(writing.chunks(&colored, [0.0, contents.clock.seconds()])?);
        bytes.extend(writing.end());
        Ok(bytes)
    }
}

impl Contents<'_> {
    /// The file that is begun, and the bytes before its chunks.
    fn begin<'a>(
        &'a self,
        path: &'a Path,
        measure: &Measure,
        grades: Grades,
        sh_degree: u8,
    ) -> Result<(Writing<'a>, Vec<u8>)> {
        let seconds = self.clock.seconds();
        let options = WriteOptions {
            profile: Profile::Fine,
            cutoff: self.cutoff.unwrap_or(CUTOFF),
            level: if self.is_quick { QUICK } else { 9 },
            library: concat!("ivv ", env!("CARGO_PKG_VERSION")).to_owned(),
            metadata: [("color_space", "srgb-rec709-display"), ("visibility_profile", "gaussian")]
                .map(|(key, value)| (key.to_owned(), value.to_owned()))
                .into(),
            ..WriteOptions::default()
        };
        let mut entries = self.own.clone();
        entries.insert("fps".to_owned(), self.clock.fps.to_string());
        entries.insert("frames".to_owned(), self.clock.frames.to_string());
        if grades != Grades::default() {
            entries.insert("grades".to_owned(), grades.to_string());
        }
        let mut extras = SceneExtras::default();
        if let Some(world) = &self.world {
            world.put_into(&mut entries, &mut extras);
        }
        extras.metadata.push(Metadata { name: RECORD.to_owned(), entries });
        self.sounds.put_into(&mut extras);
        if !self.views.is_empty() {
            let data = serde_json::to_vec(&serde_json::json!({ "views": self.views })).map_err(|fault| {
                Error::data(path, VIEWS, fault.to_string(), "this is a fault of the program that made the views")
            })?;
            let media_type = "application/json".to_owned();
            extras.attachments.push(Attachment { name: VIEWS.to_owned(), media_type, data });
        }
        let mut writing = Writing::new(path, measure, grades, sh_degree, seconds, &options);
        let front = writing.front(&options, &extras)?;
        Ok((writing, front))
    }

    /// Removes the ends of windows that the cutoff implies; each would need an entry of its own in the file's table.
    fn forget_ends(&self, set: &mut GaussianSet) {
        let Some(cutoff) = self.cutoff else { return };
        let seconds = self.clock.seconds();
        let (end, margin) = ((seconds as f32).next_up(), margin(seconds, self.clock.frames));
        for i in 0..set.count() {
            let (mu, half) = (f64::from(set.mu_t[i]), f64::from(set.sigma_t[i]) * support_k(cutoff));
            if f64::from(set.win_lo[i]) <= mu - half + margin {
                set.win_lo[i] = 0.0;
            }
            if f64::from(set.win_hi[i]) >= mu + half - margin {
                set.win_hi[i] = end;
            }
        }
    }

    /// Reads a clip part by part, for what its file needs to know before it begins; `look` receives each part.
    pub fn measure(&self, clip: &mut dyn Parts, mut look: impl FnMut(&Encoded)) -> Result<Measure> {
        let mut measure = Measure::new();
        let mut count = |splats: &Splats| {
            let mut encoded = Encoded::new(splats, self.clock);
            self.forget_ends(&mut encoded.set);
            measure.count(&encoded.set, &Grades::default());
            look(&encoded);
        };
        count(&clip.still()?);
        (0..clip.parts().len()).try_for_each(|index| clip.part(index).map(|splats| count(&splats)))?;
        Ok(measure)
    }

    /// Writes a clip that [`Contents::measure`] has read, at the finest grades, with one part at a time in memory.
    pub fn write(&self, path: &Path, clip: &mut dyn Parts, measure: &Measure) -> Result<()> {
        let (mut writing, front) = self.begin(path, measure, Grades::default(), clip.sh_degree() as u8)?;
        let seconds = self.clock.seconds();
        let (whole, viewpoints) = ([0.0, seconds], Viewpoints::new(self.views));
        let colored = |splats: &Splats| {
            let mut set = Encoded::new(splats, self.clock).colored(&viewpoints, &Grades::default());
            self.forget_ends(&mut set);
            set
        };
        write_made(path, |put| {
            put(&front)?;
            put(&writing.chunks(&colored(&clip.still()?), whole)?)?;
            for index in 0..clip.parts().len() {
                let Part { from, to, .. } = clip.parts()[index];
                // As the file has the times of its Gaussians.
                let there = [from, to].map(|time| f64::from((time * seconds) as f32).clamp(0.0, seconds));
                let stretch = if there[0] < there[1] { there } else { whole };
                put(&writing.chunks(&colored(&clip.part(index)?), stretch)?)?;
            }
            put(&writing.end())
        })
    }
}
