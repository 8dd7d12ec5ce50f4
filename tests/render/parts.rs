//! Clips of which one part at a time is in memory: pictures, files, and what a damaged file says.

use super::clip::{at, clip};
use crate::common::prelude::*;
use crate::common::program::{command, done};
use crate::scene::fault;
use ivv::Result;
use ivv::internals::formats::{Contents, FourDgsParts, Own, PlyParts, Sounds, write_parts};
use ivv::internals::scene::{Mapped, Part, Parts};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Frames per part, and parts.
const CLOCK: Clock = Clock { fps: 10.0, frames: 50 };
const N: usize = 5;
static SILENT: LazyLock<Sounds> = LazyLock::new(Sounds::default);

/// A clip whose parts are in memory, and how many were read.
struct Told {
    still: Splats,
    moving: Vec<Splats>,
    parts: Vec<Part>,
    n_read: Arc<AtomicUsize>,
}

impl Told {
    /// `n` Gaussians that live shortly in each of five parts, the first fifth of each a little into the part before.
    fn new(n: usize) -> Self {
        let whole = clip(N * n, 0.01);
        let keep = |from: usize, to: usize| whole.in_order(&(from..to).collect::<Vec<_>>());
        let moving: Vec<Splats> = (0..N)
            .map(|k| {
                let mut part = keep(500 + k * n, 500 + (k + 1) * n);
                let [from, to] = [k, k + 1].map(|k| k as f32 / N as f32);
                for (i, motion) in part.motion.iter_mut().enumerate() {
                    motion.t_center = from + motion.t_center * (to - from);
                    let early = if i < n / 5 && k > 0 { 0.02 } else { 0.0 };
                    part.span.push([from - early, to]);
                }
                part
            })
            .collect();
        let hull = |part: &Splats| Part {
            from: part.span.iter().map(|span| f64::from(span[0])).fold(f64::INFINITY, f64::min),
            to: part.span.iter().map(|span| f64::from(span[1])).fold(f64::NEG_INFINITY, f64::max),
            n: part.len(),
        };
        let parts = moving.iter().map(hull).collect();
        Told { still: keep(0, 500), moving, parts, n_read: Arc::default() }
    }

    fn whole(&self) -> Splats {
        let mut whole = self.still.clone();
        for part in &self.moving {
            whole.position.extend(&part.position);
            whole.rotation.extend(&part.rotation);
            whole.scale.extend(&part.scale);
            whole.opacity.extend(&part.opacity);
            whole.sh.extend(&part.sh);
            whole.motion.extend(&part.motion);
            whole.span.extend(&part.span);
        }
        whole.source_row = (0..whole.len() as u32).collect();
        whole
    }
}

impl Parts for Told {
    fn path(&self) -> &Path {
        Path::new("in memory")
    }

    fn sh_degree(&self) -> u32 {
        0
    }

    fn parts(&self) -> &[Part] {
        &self.parts
    }

    fn still(&mut self) -> Result<Splats> {
        Ok(self.still.clone())
    }

    fn part(&mut self, index: usize) -> Result<Splats> {
        self.n_read.fetch_add(1, Ordering::Relaxed);
        Ok(self.moving[index].clone())
    }
}

/// Writes a clip of 5 s as a PLY of parts.
pub fn write(path: &Path) {
    write_parts(path, &mut Told::new(300), &Own::new()).unwrap();
}

fn contents() -> Contents<'static> {
    Contents {
        clock: CLOCK,
        views: &[],
        own: BTreeMap::new(),
        sounds: &SILENT,
        world: None,
        cutoff: None,
        is_quick: true,
    }
}

/// Before and after the clip, about and at borders, back and forth.
const TIMES: [f64; 13] = [0.0, 0.1, 0.179, 0.19, 0.2, 0.21, 0.55, 0.6, 0.99, 1.0, 0.45, -0.5, 7.0];

fn shows(parts: Box<dyn Parts>, whole: &Splats) {
    let constants = Constants::default();
    let mut expected = Renderer::of_clip(gpu().clone(), Arc::new(whole.clone()), constants).unwrap();
    let mut found = Renderer::of_parts(gpu().clone(), parts, constants).unwrap();
    for time in TIMES {
        let [expected, found] = [&mut expected, &mut found].map(|r| r.render(&at(time), Outputs::All).unwrap());
        assert_same_frame(format_args!("at {time}"), &found.0, &expected.0);
        assert_eq!((found.1.active, found.1.visible), (expected.1.active, expected.1.visible), "at {time}");
    }
    let (cotangents, report) = found.render(&at(0.5), Outputs::All).unwrap();
    assert!(report.gaussians < whole.len() as u64 / 2, "{} on the device", report.gaussians);
    let refused = found.vjp(&at(0.5), &cotangents).map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("clip in parts"), "{refused}");
}

#[test]
fn a_clip_in_parts_shows_every_bit_of_the_whole_scene_and_reads_a_part_once_while_it_is_needed() {
    let _device = gpu();
    // With windows within parts, and without.
    for n in [6_000, 300] {
        let told = Told::new(n);
        let whole = told.whole();
        shows(Box::new(told), &whole);
    }
    let told = Told::new(300);
    let n_read = told.n_read.clone();
    let turned = Mapped::new(Box::new(told), |mut splats: Splats| {
        splats.sh.iter_mut().for_each(|sh| sh.reverse());
        splats
    });
    let mut renderer = Renderer::of_parts(gpu().clone(), Box::new(turned), Constants::default()).unwrap();
    (0..50).for_each(|frame| drop(renderer.render(&at(f64::from(frame) / 50.0), Outputs::Color).unwrap()));
    assert_eq!(n_read.load(Ordering::Relaxed), N);
    // What was left is read again.
    renderer.render(&at(0.1), Outputs::Color).unwrap();
    assert_eq!(n_read.load(Ordering::Relaxed), N + 1);
}

#[test]
fn a_ply_of_parts_is_the_whole_scene_to_every_reader_and_each_part_alone() {
    let _device = gpu();
    let folder = Folder::new("ply-parts");
    let path = folder.file("a.ply");
    let mut told = Told::new(300);
    let whole = told.whole();
    write_parts(&path, &mut told, &Own::new()).unwrap();
    assert_eq!(read_ply(&path).unwrap(), whole);
    let mut read = PlyParts::open(&path).unwrap().unwrap();
    assert_eq!((read.parts(), read.n_static()), (&told.parts[..], 500));
    let numbers = |splats: Splats| Splats { source_row: Vec::new(), ..splats };
    assert_eq!(numbers(read.still().unwrap()), numbers(told.still.clone()));
    for index in [3, 0, 4] {
        let part = read.part(index).unwrap();
        assert_eq!(part.source_row[0], 500 + 300 * index as u32);
        assert_eq!(numbers(part), numbers(told.moving[index].clone()));
    }
    shows(Box::new(read), &whole);
    // What is no such file is none, whatever it is.
    ivv::internals::formats::write_ply(&folder.file("whole.ply"), &whole).unwrap();
    let other = folder.write("other.bin", b"pl");
    assert!(PlyParts::open(&folder.file("whole.ply")).unwrap().is_none() && PlyParts::open(&other).unwrap().is_none());

    let bytes = std::fs::read(&path).unwrap();
    let end = bytes.windows(11).position(|line| line == b"end_header\n").unwrap();
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let line = |k: usize| header.lines().filter(|line| line.contains("ivv_part")).nth(k).unwrap();
    let changed = |from: &str, to: &str| {
        assert_eq!(header.matches(from).count(), 1, "{from}");
        folder.write("changed.ply", [header.replace(from, to).as_bytes(), &bytes[end..]].concat())
    };
    for (from, to, says) in [
        ("ivv_static 500", "ivv_static 501", "do not tell of the 2000 Gaussians"),
        ("ivv_static 500", "ivv_static many", "expected a number of Gaussians, found `many`"),
        (line(1), "comment ivv_part 300 0.4 0.2", "expected number, begin and end of a part"),
        (line(1), "comment ivv_part 300 0.4", "expected number, begin and end of a part"),
        (line(1), "comment ivv_part 18446744073709551615 0.1 0.2", "expected number, begin and end of a part"),
    ] {
        let path = changed(from, to);
        let told = fault(PlyParts::open(&path).map(drop), &path);
        assert!(told.contains(says) && told.contains("join the segments again"), "{told}");
    }
    // Rows that are not what the header says of them.
    let path = changed(line(1), "comment ivv_part 300 0.19 0.4");
    let told = fault(PlyParts::open(&path).and_then(|read| read.unwrap().part(1)), &path);
    assert!(told.contains("part 1") && told.contains("not those of the part"), "{told}");
    let path = changed("ivv_static 500\n", "ivv_static 499\ncomment ivv_part 1 -inf inf\n");
    let told = fault(PlyParts::open(&path).and_then(|read| read.unwrap().part(0)), &path);
    assert!(told.contains("part 0"), "{told}");
    let shifted = header.replace(line(0), &line(0).replace(" 300 ", " 299 ")).replace("static 500", "static 501");
    let path = folder.write("changed.ply", [shifted.as_bytes(), &bytes[end..]].concat());
    let told = fault(PlyParts::open(&path).and_then(|read| read.unwrap().still()), &path);
    assert!(told.contains("1 Gaussians move that should rest"), "{told}");
}

#[test]
fn a_4dgs_written_part_by_part_holds_what_one_of_the_whole_scene_holds_and_is_read_chunk_by_chunk() {
    let _device = gpu();
    let folder = Folder::new("four-dgs-parts");
    let path = folder.file("a.4dgs");
    let mut told = Told::new(3_000);
    let whole = told.whole();
    let (contents, mut n) = (contents(), 0);
    let measure = contents.measure(&mut told, |encoded| n += encoded.len()).unwrap();
    assert_eq!(n, whole.len());
    contents.write(&path, &mut told, &measure).unwrap();
    let written = read_scene(&path).unwrap();
    written.check().unwrap();
    let bytes = Encoded::new(&whole, CLOCK).bytes(&path, &contents, Grades::default()).unwrap();
    let expected = FourDgs::of_bytes(&path, &bytes).unwrap().splats().unwrap();
    assert_eq!(sorted(&written), sorted(&expected));
    let size = std::fs::metadata(&path).unwrap().len() as f64;
    assert!(size < 1.05 * bytes.len() as f64, "{size} of {}", bytes.len());
    // The crate's own reader agrees with its index.
    let mut reader = fourdgs::SceneReader::open(fourdgs::FileReadable::open(&path).unwrap()).unwrap();
    assert_eq!(reader.summary_crc_ok(), Some(true));
    for time in [0.05, 0.95, 2.7, 4.99] {
        let seen = reader.state_at(time, 3).unwrap().count();
        let all = fourdgs::read_from(&std::fs::read(&path).unwrap()[..], &fourdgs::ReadOptions::default()).unwrap();
        assert_eq!(seen, all.gaussians.state_at(time, all.header.cutoff).count(), "at {time}");
        let loaded = reader.loaded().count();
        assert!(loaded < whole.len() / 2, "{loaded} loaded");
    }
    // Nothing of the Gaussians is read for what the file says beside them.
    let opened = FourDgs::open(&path).unwrap();
    assert_eq!((opened.clock(), opened.splats().unwrap().len()), (CLOCK, whole.len()));
    let read = FourDgsParts::open(&path).unwrap().unwrap();
    assert_eq!(read.parts().iter().map(|part| part.n).sum::<usize>(), written.motion.len());
    shows(Box::new(read), &written);
    // Where most are needed at one time, it is read whole; and one that is cut is not read.
    let brief = Clock { fps: 10.0, frames: 2 };
    let lasting = Encoded::new(&Splats { span: Vec::new(), ..whole }, brief);
    let bytes = lasting.bytes(&path, &Contents { clock: brief, ..contents }, Grades::default()).unwrap();
    std::fs::write(&path, bytes).unwrap();
    assert!(FourDgsParts::open(&path).unwrap().is_none());
    let cut = folder.write("cut.4dgs", &std::fs::read(&path).unwrap()[..4000]);
    assert!(fault(FourDgs::open(&cut), &cut).contains("not read"));
}

#[test]
fn the_last_part_of_a_clip_is_there_at_its_end_whatever_its_length() {
    let _device = gpu();
    let folder = Folder::new("four-dgs-end");
    let path = folder.file("a.4dgs");
    // The nearest single of 3.3 s, where the last windows and chunks end, is less.
    let clock = Clock { fps: 10.0, frames: 33 };
    let (mut told, contents) = (Told::new(3_000), Contents { clock, ..contents() });
    let measure = contents.measure(&mut told, |_| ()).unwrap();
    contents.write(&path, &mut told, &measure).unwrap();
    let ends: Vec<f64> = FourDgs::open(&path).unwrap().summary().chunk_intervals.iter().map(|[_, end]| *end).collect();
    assert!(ends.contains(&f64::from(3.3_f32)) && clock.seconds() > f64::from(3.3_f32), "{ends:?}");
    let read = FourDgsParts::open(&path).unwrap().unwrap();
    assert!(read.parts().iter().any(|part| part.n > 0 && part.to == f64::INFINITY), "{:?}", read.parts());
    shows(Box::new(read), &read_scene(&path).unwrap());
}

#[test]
fn an_export_in_parts_tells_how_many_gaussians_it_wrote() {
    let folder = Folder::new("four-dgs-parts-told");
    let mut told = Told::new(300);
    told.still.scale[0][1] = f32::NAN;
    told.moving[1].opacity[7] = f32::NAN;
    write_parts(&folder.file("a.ply"), &mut told, &Own::new()).unwrap();
    let export = |more: &[&str]| {
        let export = ["export", "a.ply", "-o", "a.4dgs", "--seconds", "5"];
        done(command(&[&export[..], more].concat()).current_dir(&folder.0))
    };
    let text = export(&[]);
    assert!(text.contains("1998 of 2000 Gaussians, 1499 of them dynamic"), "{text}");
    let report: serde_json::Value = serde_json::from_str(&export(&["--json"])).unwrap();
    assert_eq!([&report["gaussians"], &report["dynamic_gaussians"]].map(|n| n.as_u64()), [Some(1998), Some(1499)]);
    assert_eq!(read_scene(&folder.file("a.4dgs")).unwrap().len(), 1998);
}

/// Every number of each dynamic Gaussian, in an order that does not depend on the file's.
fn sorted(splats: &Splats) -> Vec<Vec<u32>> {
    let row = |i: usize| {
        let motion = splats.motion[i - splats.n_static];
        let time = [motion.t_center, motion.t_scale];
        let all = splats.position[i].into_iter().chain(splats.rotation[i]).chain(splats.scale[i]).chain(splats.sh[i]);
        let all = all.chain([splats.opacity[i]]).chain(motion.velocity).chain(time);
        all.chain(splats.span[i - splats.n_static]).map(f32::to_bits).collect()
    };
    let mut rows: Vec<Vec<u32>> = (splats.n_static..splats.len()).map(row).collect();
    rows.sort();
    rows
}
