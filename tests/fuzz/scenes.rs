//! Scenes, cameras, tensors and priors.

use super::engine::Seed;
use super::{file, mend};
use crate::capture::priors;
use crate::common::prelude::*;
use crate::common::random;
use crate::scene::formats;
use ivv::internals::files::{read_tensors, write_tensors};
use ivv::internals::formats::{FourDgsParts, Own, PlyParts, write_ftgs, write_parts, write_splat};
use ivv::internals::scene::{Part, Parts};

fn scene(sh_degree: u32) -> Splats {
    random::scene(3, 6, sh_degree)
}

/// As other projects' formats hold them.
fn still(sh_degree: u32) -> Splats {
    let scene = scene(sh_degree);
    Splats { n_static: scene.len(), motion: Vec::new(), ..scene }
}

/// Whether it was read; what was read must be whole.
fn whole(outcome: ivv::Result<Splats>) -> bool {
    outcome.is_ok_and(|splats| {
        splats.check().unwrap();
        let _ = splats.summary();
        true
    })
}

pub fn ply() -> Vec<Seed> {
    let read = |folder: &Path| whole(read_scene(&folder.join("a.ply")));
    let clock = Some(Clock { fps: 30.0, frames: 12 });
    // Static Gaussians, and each dynamic one as a part.
    let parts = file("a.ply", |path| {
        let splats = scene(1);
        let part = Part { from: f64::NEG_INFINITY, to: f64::INFINITY, n: 1 };
        let parts = vec![part; splats.motion.len()];
        write_parts(path, &mut OneByOne { splats, parts }, &Own::new())
    });
    let of_parts = |folder: &Path| all_parts(PlyParts::open(&folder.join("a.ply")));
    let own = [0, 2].map(|degree| Seed::of([("a.ply", file("a.ply", |path| write_ply(path, &scene(degree))))], read));
    let free_time = Seed::of([("a.ply", file("a.ply", |path| write_ftgs(path, &scene(1), clock)))], read);
    own.into_iter().chain([free_time, Seed::of([("a.ply", parts)], of_parts)]).collect()
}

/// A clip in parts of one Gaussian each.
struct OneByOne {
    splats: Splats,
    parts: Vec<Part>,
}

impl Parts for OneByOne {
    fn path(&self) -> &Path {
        Path::new("in memory")
    }

    fn sh_degree(&self) -> u32 {
        self.splats.sh_degree
    }

    fn parts(&self) -> &[Part] {
        &self.parts
    }

    fn still(&mut self) -> ivv::Result<Splats> {
        Ok(self.splats.in_order(&(0..self.splats.n_static).collect::<Vec<_>>()))
    }

    fn part(&mut self, index: usize) -> ivv::Result<Splats> {
        Ok(self.splats.in_order(&[self.splats.n_static + index]))
    }
}

/// Whether all of a clip in parts was read; what was read must be whole.
fn all_parts(opened: ivv::Result<Option<impl Parts>>) -> bool {
    let Ok(Some(mut clip)) = opened else { return false };
    (0..clip.parts().len()).all(|index| {
        let part = clip.part(index);
        assert!(part.as_ref().is_ok_and(|part| part.n_static == 0) || part.is_err());
        whole(part)
    }) && whole(clip.still())
}

pub fn compressed_ply() -> Vec<Seed> {
    let read = |folder: &Path| whole(read_scene(&folder.join("a.compressed.ply")));
    [true, false].map(|colors| Seed::of([("a.compressed.ply", formats::compressed(3, colors))], read)).into()
}

/// The bytes of an SPZ of this version, two Gaussians of degree 1, before they are compressed: header and attributes.
fn raw_spz(version: u32) -> (Vec<u8>, Vec<Vec<u8>>) {
    let mut header = b"NGSP".to_vec();
    header.extend(version.to_le_bytes());
    header.extend(2_u32.to_le_bytes());
    header.extend([1, 12, 0, if version == 4 { 6 } else { 0 }]);
    if version == 4 {
        header.extend(32_u32.to_le_bytes());
        header.resize(32, 0);
    }
    let rotation = if version == 2 { 3 } else { 4 };
    let streams = [9, 1, 3, 3, rotation, 9].map(|n: u8| (0..2 * n).map(|i| i.wrapping_mul(37)).collect());
    (header, streams.into())
}

pub fn spz() -> Vec<Seed> {
    let read = |folder: &Path| whole(read_scene(&folder.join("a.spz")));
    let seed = |version| {
        let (header, streams) = raw_spz(version);
        Seed { build: mend::gzip, ..Seed::of([("a.spz", [header, streams.concat()].concat())], read) }
    };
    let as_it_is = |bytes: Vec<u8>| Seed::of([("a.spz", bytes)], read);
    let written = file("a.spz", |path| write_spz(path, &still(1), SpzVersion::V3, None));
    vec![seed(2), seed(3), as_it_is(written)]
}

pub fn spz_4() -> Vec<Seed> {
    let (header, streams) = raw_spz(4);
    let named = streams.into_iter().enumerate().map(|(i, stream)| (i.to_string(), stream));
    let parts = named.chain([("header".to_owned(), header)]);
    let read = |folder: &Path| whole(read_scene(&folder.join("scene.spz")));
    vec![Seed { build: mend::spz4, ..Seed::of(parts, read) }]
}

pub fn splat() -> Vec<Seed> {
    let bytes = file("a.splat", |path| write_splat(path, &still(0)));
    vec![Seed::of([("a.splat", bytes)], |folder| whole(read_scene(&folder.join("a.splat"))))]
}

pub fn sog() -> Vec<Seed> {
    let folder = Folder::new("fuzz-sog");
    let meta = crate::scene::sog::scene(&folder, |text| text);
    let files = super::files_of(meta.parent().unwrap());
    let read = |folder: &Path| whole(read_scene(&folder.join("meta.json")));
    let seed = Seed::of(files.clone(), read);
    let bundled = files.into_iter().map(|(name, bytes)| (format!("a.sog/{name}"), bytes));
    let bundle = Seed::of(bundled, |folder| whole(read_scene(&folder.join("a.sog"))));
    let bundle = Seed { build: mend::archives, ..bundle };
    let archive = Seed { build: mend::pictures, parts: mend::archives(&bundle.parts), ..bundle.clone() };
    // The text as often as all pictures.
    vec![seed.clone(), Seed { only: vec!["meta.json"], ..seed }, bundle, archive]
}

pub fn cameras() -> Vec<Seed> {
    let views = [random::view(), View { name: "b".to_owned(), ..random::view() }];
    let bytes = file("cameras.json", |path| write_views(path, &views));
    vec![Seed::of([("cameras.json", bytes)], |folder| {
        read_views(&folder.join("cameras.json")).is_ok_and(|views| {
            views.iter().for_each(|view| assert!(!view.cone([0.0; 3]).reach.is_sign_negative()));
            true
        })
    })]
}

pub fn tensors() -> Vec<Seed> {
    let values: Vec<f32> = (0..12).map(|i| i as f32).collect();
    let all: [(&str, &[usize], &[f32]); 2] = [("a", &[3, 4], &values), ("b", &[2, 1], &values[..2])];
    let bytes = file("a.safetensors", |path| write_tensors(path, &all));
    vec![Seed::of([("a.safetensors", bytes)], |folder| read_tensors(&folder.join("a.safetensors")).is_ok())]
}

fn any(folder: &Path, read: impl Fn(&Path) -> bool) -> bool {
    let all = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    all.filter(|path| read(path)).count() > 0
}

pub fn depth() -> Vec<Seed> {
    let read = |folder: &Path| any(folder, |path| read_depth(path, priors::WIDTH, priors::HEIGHT).is_ok());
    priors::depth_files("fuzz-depth").into_iter().map(|file| Seed::of([file], read)).collect()
}

pub fn flow() -> Vec<Seed> {
    let read = |folder: &Path| any(folder, |path| read_flow(path, priors::WIDTH, priors::HEIGHT).is_ok());
    priors::flow_files("fuzz-flow").into_iter().map(|file| Seed::of([file], read)).collect()
}

/// Files whose streams are stored as they are, so that a change is one of the numbers in them; with sound, views and an index.
pub fn four_dgs() -> Vec<Seed> {
    let read = |folder: &Path| {
        let file = FourDgs::read(&folder.join("a.4dgs"));
        file.is_ok_and(|file| {
            let _ = file.summary();
            all_parts(FourDgsParts::open(&folder.join("a.4dgs")));
            whole(file.splats())
        })
    };
    let seed = |sh_degree: u8| {
        let (n, width) = (6, [0, 3, 8, 15][usize::from(sh_degree)]);
        let spread =
            |of: usize, by: f32| -> Vec<f32> { (0..of * n).map(|i| by * ((i * 7 % 11) as f32 - 5.0)).collect() };
        let set = fourdgs::GaussianSet {
            positions: spread(3, 0.1),
            scales: (0..3 * n).map(|i| 0.01 + 0.01 * i as f32).collect(),
            rotations: [0.5, -0.5, 0.5, 0.5].repeat(n),
            colors: (0..4 * n).map(|i| i as f32 / 30.0).collect(),
            motions: spread(3, 0.01),
            mu_t: (0..n).map(|i| i as f32 / 6.0).collect(),
            sigma_t: (0..n).map(|i| if i == 0 { f32::INFINITY } else { 0.05 * i as f32 }).collect(),
            win_lo: vec![0.0; n],
            win_hi: vec![1.0; n],
            sh: (width > 0).then(|| (0..3 * width * n).map(|i| (i * 37) as u8).collect()),
            sh_coefficients: width,
            sh_degree,
            ..Default::default()
        };
        let options = fourdgs::WriteOptions { level: 0, write_statistics: true, ..Default::default() };
        let source = fourdgs::AudioSource {
            codec: "wav".to_owned(),
            duration_sec: 1.0,
            data: vec![1, 2, 3],
            ..Default::default()
        };
        let extras = fourdgs::SceneExtras { audio_sources: vec![source], ..Default::default() };
        let bytes = fourdgs::write_to_vec(&set, 1.0, &options, &extras).unwrap();
        Seed { build: mend::four_dgs, ..Seed::of([("a.4dgs", bytes)], read) }
    };
    vec![seed(0), seed(3)]
}
