//! `.4dgs`: the format's own fixtures, and scenes of ours there and back.

use super::{Folder, fault};
use crate::common::prelude::*;
use crate::common::random;
use ivv::internals::formats::{Contents, Sounds, World};
use std::sync::LazyLock;

static SILENT: LazyLock<Sounds> = LazyLock::new(Sounds::default);

pub(super) fn contents(clock: Clock) -> Contents<'static> {
    Contents { clock, views: &[], own: BTreeMap::new(), sounds: &SILENT, world: None, cutoff: None, is_quick: false }
}

pub(super) fn there_and_back(path: &Path, splats: &Splats, clock: Clock, grades: Grades) -> Splats {
    std::fs::write(path, Encoded::new(splats, clock).bytes(path, &contents(clock), grades).unwrap()).unwrap();
    let read = read_scene(path).unwrap();
    read.check().unwrap();
    read
}

#[test]
fn a_scene_of_many_gaussians_is_in_several_chunks() {
    let folder = Folder::new("four-dgs-many");
    let n = (1 << 19) + 10;
    let mut splats = Splats::new(0);
    let at = |i: usize| [(i % 100) as f32, (i / 100 % 100) as f32, (i / 10_000) as f32];
    splats.position = (0..n).map(at).collect();
    (splats.rotation, splats.scale) = (vec![[1.0, 0.0, 0.0, 0.0]; n], vec![[-3.0; 3]; n]);
    (splats.opacity, splats.sh, splats.n_static) = (vec![1.0; n], vec![[0.2; 3]; n], n);
    splats.source_row = (0..n as u32).collect();
    let path = folder.file("many.4dgs");
    let read = there_and_back(&path, &splats, Clock { fps: 30.0, frames: 60 }, Grades::default());
    assert_eq!((read.len(), read.n_static), (n, n));
    assert_eq!(FourDgs::read(&path).unwrap().summary().chunk_intervals, [[0.0, 2.0]; 2]);
}

/// Whether `found` is `told`: numbers up to the six digits that the fixtures have, and a part in 1e5 of large sums.
fn agree(place: &str, told: &Value, found: &Value) {
    match (told, found) {
        (Value::Object(told), Value::Object(found)) => {
            told.iter().for_each(|(key, told)| {
                if let Some(found) = found.get(key) {
                    agree(&format!("{place}.{key}"), told, found);
                }
            });
        }
        (Value::Array(told), Value::Array(found)) => {
            assert_eq!(told.len(), found.len(), "{place}");
            told.iter().zip(found).for_each(|(told, found)| agree(place, told, found));
        }
        (Value::Number(told), Value::Number(found)) => {
            let [told, found] = [told, found].map(|number| number.as_f64().unwrap());
            assert!((told - found).abs() <= 2e-6 + 1e-5 * told.abs(), "{place}: {found} is not {told}");
        }
        _ => assert_eq!(told, found, "{place}"),
    }
}

#[test]
fn every_fixture_of_the_format_reads_as_its_description_says() {
    let Some(folder) = shared("data/4dgs_fixtures") else { return };
    let keys = "gaussianCount durationSec shDegree temporalModel cutoff chunkIntervals aggregate audioSources";
    let (mut n_read, mut n_refused) = (0, 0);
    for entry in std::fs::read_dir(&folder).unwrap().chain(std::fs::read_dir(folder.join("invalid")).unwrap()) {
        let file = entry.unwrap().path();
        if file.extension().is_none_or(|ending| ending != "4dgs") {
            continue;
        }
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let told = std::fs::read(file.with_extension("json")).ok();
        let told: Option<Value> = told.map(|text| serde_json::from_slice(&text).unwrap());
        match told {
            Some(told) if told.get("refused").is_none() => {
                let found = serde_json::to_value(FourDgs::read(&file).unwrap().summary()).unwrap();
                assert!(keys.split(' ').all(|key| found.get(key).is_some() && told.get(key).is_some()), "{name}");
                agree(&name, &told, &found);
                n_read += 1;
            }
            told => {
                let refused = fault(FourDgs::read(&file).and_then(|file| file.splats()), &file);
                println!("{name}: {refused}");
                n_refused += usize::from(told.is_some());
            }
        }
    }
    assert_eq!((n_read, n_refused), (31, 4));
}

#[test]
fn what_appears_at_once_is_there_when_the_file_says() {
    let Some(folder) = shared("data/4dgs_fixtures") else { return };
    let path = folder.join("TenWindows-UseChunkIndex-UseCrc.4dgs");
    let splats = read_scene(&path).unwrap();
    splats.check().unwrap();
    assert_eq!(splats.span.len(), splats.motion.len());
    let told = fourdgs::read_path(&path).unwrap();
    let mut counts = Vec::new();
    for k in 0..40 {
        let time = (f64::from(k) + 0.5) / 40.0;
        // The format's own account of the moment, in the same order: all of this file's Gaussians have windows.
        let expected = told.gaussians.state_at(time * told.duration_sec, told.header.cutoff);
        let found = splats.at(time, 1.1 / 255.0);
        assert_eq!(found.len(), expected.indices.len(), "at {time}");
        let near = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-4 * b.abs().max(1.0);
        assert!(found.position.as_flattened().iter().zip(&expected.centers).all(near), "at {time}");
        counts.push(found.len());
    }
    counts.dedup();
    assert!(counts.len() > 2, "{counts:?}");
}

/// Numbers of a Gaussian that both readers are asked for: place, standard deviations, colour and opacity, velocity, time and
/// sigma; then all bytes of its higher harmonics.
const PYTHON: &str = "
import fourdgs, json, sys
scene = fourdgs.read(sys.argv[1])
g = scene.gaussians
row = lambda values, i: [float(v) for v in (values[i] if getattr(values[i], '__len__', None) else [values[i]])]
json.dump([sum((row(v, i) for v in (g.positions, g.scales, g.colors, g.motions, g.mu_t, g.sigma_t)), [])
           + ([] if g.sh is None else [float(b) for b in g.sh[i]]) for i in range(len(g.mu_t))], sys.stdout)
";

#[test]
fn the_formats_own_python_package_reads_the_same_numbers() {
    let Some(python) = crate::common::python_with("fourdgs") else { return };
    let folder = Folder::new("four-dgs-python");
    let path = folder.file("a.4dgs");
    for sh_degree in [0, 3] {
        let mut splats = random::scene(3, 100, sh_degree);
        splats.sh.iter_mut().for_each(|c| *c = c.map(|c| 0.5 * c));
        let clock = Clock { fps: 25.0, frames: 50 };
        let read = there_and_back(&path, &splats, clock, Grades::default());
        let told = std::process::Command::new(&python).args(["-c", PYTHON]).arg(&path).output().unwrap();
        assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
        // Python writes infinity, which JSON has not.
        let text = String::from_utf8(told.stdout).unwrap().replace("Infinity", "1e999");
        let rows: Vec<Vec<f64>> = text
            .trim_matches(['[', ']'])
            .split("], [")
            .map(|row| row.split(", ").map(|number| number.parse().unwrap()).collect())
            .collect();
        assert_eq!(rows.len(), 100);
        let by_place = |rows: &mut Vec<Vec<f64>>| rows.sort_by(|a, b| a[..3].partial_cmp(&b[..3]).unwrap());
        let seconds = clock.seconds();
        let mut ours: Vec<Vec<f64>> = (0..read.len())
            .map(|i| {
                let of = |values: &[f32]| values.iter().map(|v| f64::from(*v)).collect::<Vec<f64>>();
                let motion = i.checked_sub(read.n_static).map(|dynamic| read.motion[dynamic]);
                let k = read.n_coefficients();
                let color = read.sh[i * k].map(|dc| 0.5 + 0.282_094_79 * f64::from(dc));
                let logit = f64::from(read.opacity[i]);
                let moved = motion.map_or([0.0; 3], |m| m.velocity.map(|v| f64::from(v) / seconds));
                let sigma = motion.map_or(f64::INFINITY, |m| f64::from(m.t_scale).exp() * seconds / 2f64.sqrt());
                let bytes = |channel: usize| {
                    read.sh[i * k + 1..(i + 1) * k]
                        .iter()
                        .map(move |c| ((f64::from(c[channel]) + 4.0) * 255.0 / 8.0).round())
                };
                let scales = read.scale[i].map(|s| f64::from(s).exp());
                [
                    of(&read.position[i]),
                    scales.to_vec(),
                    color.to_vec(),
                    vec![1.0 / (1.0 + (-logit).exp())],
                    moved.to_vec(),
                    vec![motion.map_or(0.0, |m| f64::from(m.t_center) * seconds), sigma],
                    (0..3).flat_map(bytes).collect(),
                ]
                .concat()
            })
            .collect();
        let mut theirs = rows;
        by_place(&mut ours);
        by_place(&mut theirs);
        for (ours, theirs) in ours.iter().zip(&theirs) {
            assert_eq!(ours.len(), theirs.len());
            for (at, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
                let is_same = ours == theirs || (ours - theirs).abs() <= 3e-6 * theirs.abs().max(1.0);
                assert!(is_same, "number {at}: {ours} is not {theirs}");
            }
        }
    }
}

#[test]
fn the_same_scene_gives_the_same_bytes_and_what_cannot_be_held_is_counted() {
    let folder = Folder::new("four-dgs-bytes");
    let clock = Clock { fps: 30.0, frames: 30 };
    let path = folder.file("a.4dgs");
    let mut splats = super::sample(1, 5, 5);
    splats.sh.fill([0.2; 3]);
    let clean = Encoded::new(&splats, clock);
    assert_eq!((clean.len(), clean.n_clamped_colors, clean.n_clamped_harmonics), (10, 0, 0));
    let bytes = |encoded: &Encoded| encoded.bytes(&path, &contents(clock), Grades::default()).unwrap();
    assert_eq!(bytes(&clean), bytes(&Encoded::new(&splats, clock)));
    // Too bright; too dark with harmonics that may brighten it; too dark without, which is black all the same.
    splats.sh[0] = [3.0, 0.0, 0.0];
    splats.sh[4] = [-3.0; 3];
    splats.sh[8] = [-3.0; 3];
    splats.sh[9..12].fill([0.0; 3]);
    splats.sh[13] = [0.0, 4.5, 0.0];
    splats.position[9][1] = f32::NAN;
    let dirty = Encoded::new(&splats, clock);
    assert_eq!((dirty.len(), dirty.n_clamped_colors, dirty.n_clamped_harmonics), (9, 2, 1));
    std::fs::write(&path, bytes(&dirty)).unwrap();
    let read = FourDgs::read(&path).unwrap();
    assert_eq!((read.splats().unwrap().len(), read.clock()), (9, clock));
}

/// Found by an hour of damaged files.
#[test]
fn a_degree_that_there_is_not_is_refused_before_anything_is_made_of_it() {
    let folder = Folder::new("four-dgs-degree");
    let path = folder.file("a.4dgs");
    let clock = Clock { fps: 30.0, frames: 30 };
    for sh_degree in [0, 1] {
        let splats = random::scene(3, 5, sh_degree);
        let mut bytes = Encoded::new(&splats, clock).bytes(&path, &contents(clock), Grades::default()).unwrap();
        // Magic, the header's opcode and length, flags; the writer's name; length, count, cutoff; the model's name; the box.
        let text =
            |bytes: &[u8], at: usize| at + 4 + u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let at = text(&bytes, text(&bytes, 21) + 24) + 48;
        assert_eq!(u32::from(bytes[at]), sh_degree);
        for degree in [4, 127, 255] {
            bytes[at] = degree;
            let told = fault(FourDgs::of_bytes(&path, &bytes), &path);
            assert!(told.contains("sh_degree") && told.contains(&degree.to_string()), "{told}");
        }
    }
}

#[test]
fn which_way_is_up_and_how_large_a_clip_is_are_kept_and_told_in_the_formats_own_words() {
    let folder = Folder::new("four-dgs-world");
    let (path, clock) = (folder.file("a.4dgs"), Clock { fps: 30.0, frames: 30 });
    let encoded = Encoded::new(&random::scene(3, 5, 0), clock);
    let write =
        |world: Option<World>| encoded.bytes(&path, &Contents { world, ..contents(clock) }, Grades::default()).unwrap();
    assert_eq!(FourDgs::of_bytes(&path, &write(None)).unwrap().world(), None);
    let down = [0.1, -0.97, 0.2];
    for (up, axis, forward) in
        [(down, 4, 2), ([0.0, 0.0, 2.0], 2, 0), ([-1.0, 0.5, 0.5], 3, 2), ([3.0, 1.0, 0.0], 0, 2)]
    {
        for metres_per_unit in [None, Some(1.0), Some(0.37)] {
            let world = World { up, metres_per_unit };
            let bytes = write(Some(world));
            assert_eq!(FourDgs::of_bytes(&path, &bytes).unwrap().world(), Some(world));
            let scene = fourdgs::read_from(&bytes[..], &fourdgs::ReadOptions::default()).unwrap();
            let frame = scene.provenance.frame().unwrap();
            assert_eq!((frame.handedness, frame.up_axis, frame.forward_axis), (1, axis, forward), "{up:?}");
            assert_eq!(
                (frame.metres_per_unit, frame.length_unit),
                match metres_per_unit {
                    None => (0.0, 0),
                    Some(1.0) => (1.0, 1),
                    Some(metres) => (metres, 0),
                }
            );
        }
    }
}

/// A file of no Gaussian with a frame of handedness, unit and metres, y up, or none; and with what its header says of the axes.
fn framed(frame: Option<(u8, u8, f64)>, axes: Option<&str>) -> Vec<u8> {
    let mut extras = fourdgs::SceneExtras::default();
    extras.provenance.frames.extend(frame.map(|(handedness, length_unit, metres_per_unit)| fourdgs::CoordinateFrame {
        name: String::new(),
        handedness,
        up_axis: 1,
        forward_axis: 2,
        length_unit,
        metres_per_unit,
    }));
    let metadata = axes.map(|axes| ("coordinate_system".to_owned(), axes.to_owned())).into_iter().collect();
    let options = fourdgs::WriteOptions { metadata, ..fourdgs::WriteOptions::default() };
    fourdgs::write_to_vec(&fourdgs::GaussianSet::default(), 1.0, &options, &extras).unwrap()
}

#[test]
fn a_unit_of_another_programs_clip_is_as_long_as_its_number_says_or_else_its_name() {
    let path = Path::new("framed.4dgs");
    for (unit, metres, expected) in
        [(0, 0.0, None), (1, 0.0, Some(1.0)), (2, 0.0, Some(0.01)), (5, 0.0, Some(0.3048)), (2, 0.5, Some(0.5))]
    {
        let world = FourDgs::of_bytes(path, &framed(Some((1, unit, metres)), None)).unwrap().world();
        assert_eq!(world, Some(World { up: [0.0, 1.0, 0.0], metres_per_unit: expected }), "unit {unit}, {metres} m");
    }
}

#[test]
fn which_way_is_up_is_told_by_the_text_of_the_axes_where_there_is_no_frame() {
    let path = Path::new("framed.4dgs");
    let up = |bytes: &[u8]| FourDgs::of_bytes(path, bytes).unwrap().world();
    for (text, expected) in [
        ("y-up-right-handed", Some([0.0, 1.0, 0.0])),
        ("-y-up", Some([0.0, -1.0, 0.0])),
        ("z-up-right-handed", Some([0.0, 0.0, 1.0])),
        ("-x-up-right-handed", Some([-1.0, 0.0, 0.0])),
        ("right-handed-y-up", None),
        ("up", None),
    ] {
        let expected = expected.map(|up| World { up, metres_per_unit: None });
        assert_eq!(up(&framed(None, Some(text))), expected, "{text}");
    }
    let world = up(&framed(Some((1, 0, 0.0)), Some("z-up-right-handed")));
    assert_eq!(world.map(|world| world.up), Some([0.0, 1.0, 0.0]), "the frame goes before");
}

#[test]
fn a_cutoff_that_shows_is_kept_instead_of_a_window_for_each_gaussian() {
    let folder = Folder::new("four-dgs-cutoff");
    let [from, to] = ["a.4dgs", "b.4dgs"].map(|name| folder.file(name));
    let clock = Clock { fps: 30.0, frames: 60 };
    let mut splats = super::sample(0, 0, 200);
    splats.sh.fill([0.2; 3]);
    splats.opacity.fill(2.0);
    for (i, motion) in splats.motion.iter_mut().enumerate() {
        (motion.t_center, motion.t_scale) = (0.2 + 0.003 * i as f32, (0.05 + 0.0003 * i as f32).ln());
    }
    let n_windows = |bytes: &[u8]| {
        let scene = fourdgs::read_from(bytes, &fourdgs::ReadOptions::default()).unwrap();
        scene.gaussians.window_table().0.len()
    };
    let write = |splats: &Splats, cutoff| {
        let contents = Contents { cutoff, ..contents(clock) };
        Encoded::new(splats, clock).bytes(&from, &contents, Grades::default()).unwrap()
    };
    std::fs::write(&from, write(&splats, Some(0.05))).unwrap();
    let file = FourDgs::read(&from).unwrap();
    let read = file.splats().unwrap();
    assert_eq!((file.cutoff(), read.span.len()), (Some(0.05), 200));
    assert!(n_windows(&write(&read, None)) > 100);
    // A window that says more than the cutoff is kept.
    let mut cut = read.clone();
    cut.span[100][1] = cut.motion[100].t_center;
    assert_eq!([&read, &cut].map(|splats| n_windows(&write(splats, file.cutoff()))), [1, 2]);

    works(&["export", text(&from), "-o", text(&to), "--seconds", "2"]);
    let again = FourDgs::read(&to).unwrap();
    assert_eq!((again.cutoff(), n_windows(&std::fs::read(&to).unwrap())), (Some(0.05), 1));
    let again = again.splats().unwrap();
    for k in 0..40 {
        let time = (f64::from(k) + 0.5) / 40.0;
        let [before, after] = [&read, &again].map(|splats| splats.at(time, 1.0 / 255.0).len());
        // One may come or go by rounding.
        assert!(before.abs_diff(after) <= 1, "{before} and {after} at {time}");
    }
}

fn refused_export(folder: &Folder, file: &Path) -> String {
    let copy = folder.file("copy.4dgs");
    let told = fails(&["export", text(file), "-o", text(&copy)], 3);
    assert!(!copy.exists(), "{told}");
    told
}

#[test]
fn left_handed_axes_are_refused_by_the_frame_or_by_the_text_where_there_is_none() {
    let folder = Folder::new("four-dgs-axes");
    let path = folder.file("a.4dgs");
    let (left, right) = (Some("y-up-left-handed"), Some("y-up-right-handed"));
    for bytes in [framed(Some((2, 0, 0.0)), None), framed(Some((2, 0, 0.0)), right), framed(None, left)] {
        let told = fault(FourDgs::of_bytes(&path, &bytes).and_then(|file| file.splats()), &path);
        assert!(told.contains("found left-handed ones"), "{told}");
        // Also where the file would be handed on as it is.
        std::fs::write(&path, bytes).unwrap();
        let told = refused_export(&folder, &path);
        assert!(told.contains("found left-handed ones"), "{told}");
    }
    for bytes in [framed(Some((1, 0, 0.0)), left), framed(Some((0, 0, 0.0)), left), framed(None, right)] {
        assert!(FourDgs::of_bytes(&path, &bytes).unwrap().splats().unwrap().is_empty());
    }
}

#[test]
fn objects_that_tracks_move_are_refused_also_where_a_file_would_be_handed_on_as_it_is() {
    let Some(fixtures) = shared("data/4dgs_fixtures") else { return };
    let folder = Folder::new("four-dgs-tracks");
    let told = refused_export(&folder, &fixtures.join("ObjectTrackComposed-UseChunkIndex-UseCrc.4dgs"));
    assert!(told.contains("along tracks") && told.contains("save it without tracks of objects"), "{told}");
}

#[test]
fn a_quick_file_holds_the_same_in_more_bytes() {
    let folder = Folder::new("four-dgs-quick");
    let (path, clock) = (folder.file("a.4dgs"), Clock { fps: 30.0, frames: 30 });
    let encoded = Encoded::new(&random::scene(3, 3000, 1), clock);
    let write = |is_quick| encoded.bytes(&path, &Contents { is_quick, ..contents(clock) }, Grades::default()).unwrap();
    let (small, quick) = (write(false), write(true));
    assert!(quick.len() > small.len() && quick.len() < 2 * small.len(), "{} and {}", quick.len(), small.len());
    let [small, quick] = [small, quick].map(|bytes| FourDgs::of_bytes(&path, &bytes).unwrap().splats().unwrap());
    assert_eq!(quick, small);
}
