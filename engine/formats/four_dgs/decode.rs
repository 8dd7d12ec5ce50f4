use super::ears::{EARS, Ears};
use super::{MAGIC, RECORD, SOUND, Sounds, VIEWS, World};
use crate::error::{Error, Result};
use crate::files::{cannot_read, open_file};
use crate::internals::formats::format::{Reader, first_bytes};
use crate::internals::formats::rendering::Own;
use crate::internals::formats::scene::{Clip, Clock, Scene};
use crate::scene::{ALWAYS, Motion, Splats, View, dc_of_color, parse_views};
use fourdgs::quantization::sh_coefficient;
use fourdgs::reader::OpenMode;
use fourdgs::{FileReadable, GaussianSet, SceneReader};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Frames per second of a file that does not say.
const FPS: f64 = 30.0;
/// Largest threshold of visibility that changes no picture: one step of 8 bits.
const INVISIBLE: f64 = 1.0 / 255.0;
/// Opacities are taken this far inside of 0 and 1, whose logits are infinite.
const EDGE: f64 = 1e-6;

pub(in crate::internals::formats) const READER: Reader =
    Reader { what: "a .4dgs", knows: |start| start.bytes == MAGIC, read: import };

fn import(path: &Path) -> Result<Scene> {
    let file = FourDgs::read(path)?;
    let scene = Scene::new(file.splats()?, file.notes(), file.own());
    let (clock, views, sounds) = (Some(file.clock()), file.views()?, file.sounds());
    let clip = Clip { clock, views, sounds, world: file.world(), cutoff: file.cutoff(), ..scene.clip };
    Ok(Scene { clip, ..scene })
}

/// A `.4dgs`, with or without its Gaussians.
#[derive(Debug)]
pub struct FourDgs {
    path: PathBuf,
    pub(super) scene: fourdgs::Scene,
    ears: Option<Ears>,
    has_gaussians: bool,
}

impl FourDgs {
    pub fn is(path: &Path) -> bool {
        first_bytes(path).is_ok_and(|bytes| bytes == MAGIC)
    }

    /// Reads a whole file: of the model `gaussian-birth`, deflated, at most half a gigabyte in memory.
    pub fn read(path: &Path) -> Result<Self> {
        let file = open_file(path).map_err(|fault| cannot_read(path, &fault))?;
        Self::of(path, std::io::BufReader::new(file))
    }

    /// As [`FourDgs::read`], from memory; errors name `path`.
    pub fn of_bytes(path: &Path, bytes: &[u8]) -> Result<Self> {
        Self::of(path, bytes)
    }

    /// Reads all but the Gaussians, which may be more than memory holds; everything where the file has no index of its chunks.
    pub fn open(path: &Path) -> Result<Self> {
        open_file(path).map_err(|fault| cannot_read(path, &fault))?;
        let opened = FileReadable::open(path).and_then(|file| SceneReader::open_with(file, OpenMode::Indexed));
        let mut reader = match opened {
            Ok(reader) if !reader.chunk_index().is_empty() => reader,
            // Reading it whole says what is wrong with it.
            _ => return Self::read(path),
        };
        let scene = front(&mut reader).map_err(|fault| not_read(path, &fault))?;
        Self::checked(path, scene, false)
    }

    fn of(path: &Path, source: impl Read) -> Result<Self> {
        let whole = fourdgs::ReadOptions { recover_truncated: false, ..Default::default() };
        let scene = fourdgs::read_from(source, &whole).map_err(|fault| not_read(path, &fault))?;
        Self::checked(path, scene, true)
    }

    fn checked(path: &Path, scene: fourdgs::Scene, has_gaussians: bool) -> Result<Self> {
        if scene.summary_crc_ok == Some(false) {
            return Err(Error::data(path, "index", "its checksum does not fit", "copy the file again"));
        }
        if !(scene.duration_sec.is_finite() && scene.duration_sec >= 0.0) {
            let reason = format!("expected a length in seconds, found {}", scene.duration_sec);
            return Err(Error::data(path, "header, field duration_sec", reason, "export the file again"));
        }
        if scene.gaussians.sh_degree > 3 || scene.header.sh_degree > 3 {
            let found = scene.gaussians.sh_degree.max(scene.header.sh_degree);
            let reason = format!("expected 0 to 3, found {found}");
            return Err(Error::data(path, "header, field sh_degree", reason, "export the file again, with degree 3"));
        }
        let ears = attachment(&scene, EARS).map(|data| Ears::parse(path, data)).transpose()?;
        Ok(FourDgs { path: path.to_owned(), scene, ears, has_gaussians })
    }

    pub fn clock(&self) -> Clock {
        let seconds = self.scene.duration_sec;
        if seconds <= 0.0 {
            return Clock { fps: FPS, frames: 1 };
        }
        let said = self.own().and_then(|own| {
            let clock = Clock { fps: own.get("fps")?.parse().ok()?, frames: own.get("frames")?.parse().ok()? };
            ((clock.seconds() - seconds).abs() <= 1e-6 * seconds).then_some(clock)
        });
        said.unwrap_or_else(|| {
            let frames = (seconds * FPS).round().clamp(1.0, f64::from(u32::MAX));
            Clock { fps: frames / seconds, frames: frames as u32 }
        })
    }

    /// How the scene is rendered; `None` in a file of another program.
    pub fn own(&self) -> Option<&Own> {
        self.scene.metadata.iter().find(|record| record.name == RECORD).map(|record| &record.entries)
    }

    /// A sentence for each part of the file that is not read.
    pub fn notes(&self) -> Vec<String> {
        let records = self.scene.metadata.iter().map(|record| &record.name);
        let attachments = self.scene.attachments.iter().map(|attachment| &attachment.name);
        let path = self.scene.camera.is_some().then(|| "its camera path is not read".to_owned());
        let mut notes: Vec<String> = path.into_iter().collect();
        for (what, names) in [
            ("metadata record", others(records, &[RECORD, SOUND])),
            ("attachment", others(attachments, &[VIEWS, EARS])),
        ] {
            match &names[..] {
                [] => {}
                [name] => notes.push(format!("1 {what} is not read: {name}")),
                names => notes.push(format!("{} {what}s are not read: {}", names.len(), names.join(", "))),
            }
        }
        notes
    }

    /// Views to start from.
    pub fn views(&self) -> Result<Vec<View>> {
        attachment(&self.scene, VIEWS).map_or(Ok(Vec::new()), |data| parse_views(&self.path, data))
    }

    pub fn world(&self) -> Option<World> {
        World::of(&self.scene, self.own())
    }

    pub fn sounds(&self) -> Sounds {
        Sounds::of(&self.scene, self.ears.clone())
    }

    /// The Gaussians, read again where they are not in memory. Time 0 to 1 is the file's length.
    pub fn splats(&self) -> Result<Splats> {
        if !self.has_gaussians {
            return Self::read(&self.path)?.splats();
        }
        self.check_shown()?;
        let set = &self.scene.gaussians;
        let stored = self.stored(set);
        let (still, moving) = stored.populations();
        let mut splats = Splats::new(u32::from(set.sh_degree));
        stored.push_all(&mut splats, &still, false);
        stored.push_all(&mut splats, &moving, true);
        if splats.span.iter().all(|span| *span == ALWAYS) {
            splats.span.clear();
        }
        Ok(splats)
    }

    /// The temporal factor below which a Gaussian is hidden, where that shows.
    pub fn cutoff(&self) -> Option<f64> {
        Some(self.scene.header.cutoff).filter(|cutoff| *cutoff > INVISIBLE * (1.0 + 1e-9) && *cutoff <= 1.0)
    }

    pub(super) fn stored<'a>(&self, set: &'a GaussianSet) -> Stored<'a> {
        let clock = self.clock();
        Stored { set, seconds: clock.seconds(), frames: clock.frames, cutoff: self.cutoff() }
    }

    /// Refuses what would be drawn wrong: tracks of objects that move Gaussians, and left-handed axes, which mirror pictures.
    pub fn check_shown(&self) -> Result<()> {
        let refuse = |reason: &str, remedy: &str| Err(Error::data(&self.path, "", reason, remedy));
        let n = self.scene.objects.tracks.iter().filter(|track| track.sample_count() > 0).count();
        if n > 0 {
            let reason = format!("{n} of its objects move their Gaussians along tracks, which is not supported");
            return refuse(&reason, "save it without tracks of objects");
        }
        if World::is_left_handed(&self.scene) {
            let reason = "expected right-handed axes, found left-handed ones, with which pictures would be mirrored";
            return refuse(reason, "save it with right-handed axes");
        }
        Ok(())
    }
}

fn attachment<'a>(scene: &'a fourdgs::Scene, name: &str) -> Option<&'a [u8]> {
    scene.attachments.iter().find(|attachment| attachment.name == name).map(|attachment| &attachment.data[..])
}

fn others<'a>(all: impl Iterator<Item = &'a String>, known: &[&str]) -> Vec<String> {
    all.filter(|name| !known.contains(&name.as_str())).map(|name| format!("`{}`", name.escape_debug())).collect()
}

/// A Gaussian may be hidden for this long at the clip's ends, seconds: no frame falls there.
pub(super) fn margin(seconds: f64, frames: u32) -> f64 {
    1e-3 * seconds / f64::from(frames)
}

pub(super) fn not_read(path: &Path, fault: &fourdgs::Error) -> Error {
    let remedy = match fault {
        fault if fault.is_unsupported_feature() => "save it with the model gaussian-birth and the codec deflate",
        fault if fault.is_unsupported_version() => "save it as version 1 of the format",
        fourdgs::Error::UnsupportedOperation(_) => {
            "unless the file is damaged, as a whole it takes more than half a gigabyte of memory: give the run or a PLY of it, or export fewer Gaussians"
        }
        _ => "the file is damaged, cut short or of another format: copy or export it again",
    };
    Error::data(path, "", format!("not read: {fault}"), remedy)
}

fn front(reader: &mut SceneReader<FileReadable>) -> fourdgs::Result<fourdgs::Scene> {
    Ok(fourdgs::Scene {
        header: reader.header().clone(),
        duration_sec: reader.header().duration_sec,
        audio_sources: reader.read_audio_sources()?,
        camera: reader.camera()?,
        metadata: reader.metadata()?,
        attachments: reader.attachments()?,
        provenance: reader.provenance()?,
        objects: reader.objects()?,
        chunk_index: reader.chunk_index().to_vec(),
        summary_crc_ok: reader.summary_crc_ok(),
        ..fourdgs::Scene::default()
    })
}

#[derive(Clone, Copy)]
pub(super) struct Stored<'a> {
    set: &'a GaussianSet,
    seconds: f64,
    frames: u32,
    cutoff: Option<f64>,
}

impl Stored<'_> {
    /// Static Gaussians, dynamic ones.
    pub(super) fn populations(&self) -> (Vec<usize>, Vec<usize>) {
        let Stored { set, .. } = self;
        (0..set.count()).partition(|i| {
            set.sigma_t[*i].is_infinite() && set.motions[3 * i..3 * i + 3] == [0.0; 3] && self.span(*i) == ALWAYS
        })
    }

    /// The normalised times between which Gaussian `i` exists, where the file hides it at times when it could be seen.
    fn span(&self, i: usize) -> [f32; 2] {
        let Stored { set, seconds, frames, cutoff } = *self;
        let [mu, sigma, from, to] =
            [&set.mu_t, &set.sigma_t, &set.win_lo, &set.win_hi].map(|values| f64::from(values[i]));
        let half = |threshold: f64| sigma * fourdgs::quantization::support_k(threshold);
        let (from, to) = match cutoff.filter(|_| sigma.is_finite()) {
            Some(cutoff) => (from.max(mu - half(cutoff)), to.min(mu + half(cutoff))),
            None => (from, to),
        };
        let (first, last) = ((mu - half(INVISIBLE)).max(0.0), (mu + half(INVISIBLE)).min(seconds));
        let margin = margin(seconds, frames);
        let border = |is_seen_beyond: bool, at: f64, otherwise: f32| {
            if first < last && is_seen_beyond { (at / seconds) as f32 } else { otherwise }
        };
        [border(from > first + margin, from, f32::NEG_INFINITY), border(to < last - margin, to, f32::INFINITY)]
    }

    fn motion(&self, i: usize) -> Motion {
        let Stored { set, seconds, .. } = self;
        let tau = f64::from(set.sigma_t[i]) * std::f64::consts::SQRT_2 / seconds;
        Motion {
            velocity: std::array::from_fn(|k| (f64::from(set.motions[3 * i + k]) * seconds) as f32),
            t_center: (f64::from(set.mu_t[i]) / seconds) as f32,
            t_scale: tau.ln() as f32,
        }
    }

    /// Appends Gaussians; the static ones come first.
    pub(super) fn push_all(&self, to: &mut Splats, members: &[usize], are_dynamic: bool) {
        members.iter().for_each(|i| self.push(to, *i));
        if are_dynamic {
            to.motion.extend(members.iter().map(|i| self.motion(*i)));
            to.span.extend(members.iter().map(|i| self.span(*i)));
        } else {
            to.n_static = to.len();
        }
    }

    fn push(&self, to: &mut Splats, i: usize) {
        let set = self.set;
        let [x, y, z, w]: [f32; 4] = std::array::from_fn(|k| set.rotations[4 * i + k]);
        let opacity = f64::from(set.colors[4 * i + 3]).clamp(EDGE, 1.0 - EDGE);
        to.source_row.push(to.len() as u32);
        to.position.push(std::array::from_fn(|k| set.positions[3 * i + k]));
        to.rotation.push([w, x, y, z]);
        to.scale.push(std::array::from_fn(|k| set.scales[3 * i + k].ln()));
        to.opacity.push((opacity / (1.0 - opacity)).ln() as f32);
        to.sh.push(std::array::from_fn(|k| dc_of_color(f64::from(set.colors[4 * i + k]))));
        let n = set.sh_coefficients;
        if let Some(bytes) = &set.sh {
            let row = &bytes[3 * n * i..3 * n * (i + 1)];
            let harmonics = (0..n).map(|c| std::array::from_fn(|k| sh_coefficient(row[k * n + c]) as f32));
            to.sh.extend(harmonics.take(to.n_coefficients() - 1));
        }
        // A file can hold fewer bands than it says.
        to.sh.resize(to.len() * to.n_coefficients(), [0.0; 3]);
    }
}
