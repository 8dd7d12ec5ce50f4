//! Gaussians in the files of other programs: what is read, what is said, what is refused.

use super::formats::{compressed, gzip, raw_spz};
use super::ply::{NAMES, by_hand};
use super::{Folder, fault, sample, sog};
use crate::common::prelude::*;
use crate::sound::clip::run_of_some_frames;
use ivv::internals::formats::{Own, Scene, ply_own, read, write_ply_with};

/// The near plane of scenes that do not say theirs, as single precision has it.
const USUAL: f64 = 0.009_999_999_776_482_582;

/// A PLY of two Gaussians with the properties of 3DGS but those that `without` names, and others, all of whose values are `value`.
fn ply(folder: &Folder, without: &[&str], more: &[&str], value: f64) -> PathBuf {
    let kept = NAMES.iter().filter(|name| !without.contains(name));
    let names: Vec<&str> = kept.chain(more).copied().collect();
    let number = |i: usize, k: usize| if more.contains(&names[k]) { value } else { 0.25 * (i + k) as f64 - 1.0 };
    let rows: Vec<Vec<f64>> = (0..2).map(|i| (0..names.len()).map(|k| number(i, k)).collect()).collect();
    folder.write("a.ply", by_hand("binary_little_endian", &names, &vec!["float"; names.len()], &rows))
}

fn notes(path: &Path) -> Vec<String> {
    read(path).unwrap().notes
}

fn numbered(name: &str, n: usize) -> Vec<String> {
    (0..n).map(|k| format!("{name}_{k}")).collect()
}

/// The header with a comment.
fn commented(path: &Path, comment: &str) {
    let bytes = fs::read(path).unwrap();
    let at = bytes.windows(8).position(|w| w == b"element ").unwrap();
    fs::write(path, [&bytes[..at], format!("comment {comment}\n").as_bytes(), &bytes[at..]].concat()).unwrap();
}

#[test]
fn properties_that_change_what_is_seen_are_refused_by_name_and_number() {
    let folder = Folder::new("foreign-refused");
    for (groups, says) in [
        (&[("xyz_disp", 3)][..], "property `xyz_disp_0`: `xyz_disp_*` (3) move and fade"),
        (
            &[("xyz_disp", 3), ("opacity_c", 2), ("opacity_v", 2)],
            "`opacity_c_*` (2), `opacity_v_*` (2), `xyz_disp_*` (3)",
        ),
        (&[("motion_xyz_0", 3), ("motion_rot_0", 4)], "Ex4DGS"),
        (&[("t", 1), ("scale_t", 1), ("rot_r", 4)], "four-dimensional"),
        (&[("f_t", 3)], "Spacetime"),
        (&[("binding", 1)], "a mesh that moves"),
        (&[("beta", 1)], "no Gaussian"),
        (&[("roughness", 1), ("base_color", 3)], "`base_color_*` (3), `roughness_0` are materials"),
        // Of no method that is known by name.
        (&[("deform_coef", 12)], "`deform_coef_*` (12) move Gaussians"),
        (&[("tp_pos", 9)], "move Gaussians"),
        (&[("poly", 2)], "move Gaussians"),
        (&[("timestamp", 1)], "say when they are there"),
        (&[("f_latent", 8)], "have a part in colour"),
        (&[("opacity2", 1)], "have a part in colour"),
    ] {
        let more: Vec<String> = groups.iter().flat_map(|(name, n)| numbered(name, *n)).collect();
        let path = ply(&folder, &[], &more.iter().map(String::as_str).collect::<Vec<_>>(), 0.5);
        let told = fault(read_scene(&path), &path);
        assert!(told.contains(says), "{groups:?}: {told}");
        assert!(told.contains("; export") || told.contains("; train"), "{groups:?}: {told}");
    }
    // Anchors have no colours of their own: what they are is said, not that colours are missing.
    let more: Vec<String> = [numbered("f_offset", 30), numbered("f_anchor_feat", 32)].concat();
    let more: Vec<&str> = more.iter().map(String::as_str).collect();
    let path = ply(&folder, &["f_dc_0", "f_dc_1", "f_dc_2"], &more, 0.5);
    let told = fault(read_scene(&path), &path);
    assert!(told.contains("`f_anchor_feat_*` (32), `f_offset_*` (30) are of anchors"), "{told}");
    // A point cloud or a mesh is told of by what it lacks.
    let cloud = by_hand("ascii", &["x", "y", "z", "s", "t"], &["float"; 5], &[vec![0.0; 5]]);
    let path = folder.write("cloud.ply", cloud);
    assert!(fault(read_scene(&path), &path).contains("not a point cloud or a mesh"));
}

#[test]
fn the_full_model_of_spacetime_gaussians_is_refused_and_so_is_motion_of_higher_orders() {
    let folder = Folder::new("foreign-spacetime");
    let lite: Vec<String> =
        [vec!["trbf_center".to_owned(), "trbf_scale".to_owned()], numbered("motion", 9), numbered("omega", 4)].concat();
    let names = |more: Vec<String>| [lite.clone(), more].concat();
    let of = |names: Vec<String>, value: f64| {
        ply(&folder, &[], &names.iter().map(String::as_str).collect::<Vec<_>>(), value)
    };
    let full: Vec<String> = (3..6).map(|k| format!("f_dc_{k}")).chain(numbered("f_t", 3)).collect();
    let path = of(names(full), 0.0);
    let told = fault(read_scene(&path), &path);
    assert!(told.contains("`f_dc_*` (3), `f_t_*` (3) go through a network") && told.contains("ours_lite"), "{told}");
    // Forks have more orders than nine numbers.
    let more: Vec<String> = (9..12).map(|k| format!("motion_{k}")).collect();
    assert_eq!(notes(&of(names(more.clone()), 0.0)), [""; 0]);
    let path = of(names(more), 0.5);
    assert!(fault(read_scene(&path), &path).contains("bends or turns"));
}

#[test]
fn properties_and_elements_that_change_no_picture_are_said_once_by_name_and_number() {
    let folder = Folder::new("foreign-harmless");
    let plain = read_scene(&ply(&folder, &[], &[], 0.0)).unwrap();
    assert_eq!(read(folder.file("a.ply")).unwrap(), Scene::from(plain.clone()));
    assert_eq!(notes(&ply(&folder, &[], &["nx", "ny", "nz", "red", "green", "blue"], 9.0)), [""; 0]);
    let labels: Vec<String> = [numbered("semantic", 16), numbered("obj_dc", 2)].concat();
    let more: Vec<&str> =
        labels.iter().map(String::as_str).chain(["label", "confidence", "language_feature", "extra"]).collect();
    let path = ply(&folder, &[], &more, 9.0);
    let read = read(&path).unwrap();
    assert_eq!(read.splats, plain);
    let listed = "`confidence`, `extra`, `label`, `language_feature`, `obj_dc_*` (2), `semantic_*` (16)";
    assert_eq!(read.notes, [format!("22 properties of its Gaussians are not read: {listed}")]);
    assert_eq!(notes(&ply(&folder, &[], &["state"], 1.0)), ["1 property of its Gaussians is not read: `state`"]);

    let with = |element: &str| {
        let file = by_hand("ascii", &NAMES, &["float"; 14], &[vec![0.0; 14]]);
        let at = file.windows(11).position(|w| w == b"end_header\n").unwrap();
        let more = format!("element {element} 1\nproperty float a\n");
        folder.write("b.ply", [&file[..at], more.as_bytes(), &file[at..], b"0.5\n"].concat())
    };
    assert_eq!(notes(&with("camera_pose")), ["1 element beside `vertex` is not read: `camera_pose`"]);
    let path = with("delta_vertex_0");
    assert!(fault(read_scene(&path), &path).contains("element `delta_vertex_0`: moves Gaussians"));
}

#[test]
fn harmonics_of_degree_4_are_cut_and_counted() {
    let folder = Folder::new("foreign-degree");
    let names: Vec<String> = NAMES.iter().map(|name| (*name).to_owned()).chain(numbered("f_rest", 72)).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut rows: Vec<Vec<f64>> =
        (0..3).map(|i| (0..86).map(|k| f64::from(i) + 0.25 * f64::from(k)).collect()).collect();
    // The second has nothing in the last band: coefficients 16 to 24 of each channel.
    (0..72).filter(|k| k % 24 >= 15).for_each(|k| rows[1][14 + k] = 0.0);
    let path = folder.write("a.ply", by_hand("binary_little_endian", &names, &["float"; 86], &rows));
    let Scene { splats, notes, .. } = read(&path).unwrap();
    splats.check().unwrap();
    assert_eq!((splats.sh_degree, splats.sh.len()), (3, 48));
    for k in 0..15 {
        assert_eq!(splats.sh[1 + k], [0, 24, 48].map(|channel| 0.25 * (14 + channel + k) as f32), "{k}");
    }
    assert_eq!(notes, ["harmonics of degree 4 are cut to degree 3, of 2 of 3 Gaussians"]);

    let rest: Vec<u8> = (0..72).map(|k| 56 + k).collect();
    let of = |degree: u8, rest: &[u8]| folder.write("a.spz", gzip(&raw_spz(degree, 3 << 30, rest)));
    let cut = read(of(4, &rest)).unwrap();
    assert_eq!(cut.notes, ["harmonics of degree 4 are cut to degree 3, of 1 of 1 Gaussians"]);
    assert_eq!(cut.splats, read_scene(&of(3, &rest[..45])).unwrap());
    let path = of(5, &[0; 105]);
    assert!(fault(read_scene(&path), &path).contains("degree 5"));
    // No degree has 48.
    let names: Vec<String> = NAMES.iter().map(|name| (*name).to_owned()).chain(numbered("f_rest", 48)).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let path = folder.write("b.ply", by_hand("ascii", &names, &["float"; 62], &[vec![0.0; 62]]));
    assert!(fault(read_scene(&path), &path).contains("48 properties"));
}

#[test]
fn the_3d_filter_of_mip_splatting_is_worked_in_as_its_own_fused_export_does() {
    let folder = Folder::new("foreign-filter");
    let mut rows = vec![vec![0.0; 15], vec![0.0; 15]];
    for (row, (opacity, scales, filter)) in
        rows.iter_mut().zip([(1.5, [-2.0, -3.0, -4.0], 0.05), (-1.0, [0.0, -9.0, -1.0], 0.0)])
    {
        row[6] = opacity;
        row[7..10].copy_from_slice(&scales);
        row[10] = 1.0;
        row[14] = filter;
    }
    let names: Vec<&str> = NAMES.iter().copied().chain(["filter_3D"]).collect();
    let path = folder.write("a.ply", by_hand("binary_little_endian", &names, &["float"; 15], &rows));
    let Scene { splats, notes, .. } = read(&path).unwrap();
    for (i, row) in rows.iter().enumerate() {
        let squares: Vec<f64> = row[7..10].iter().map(|s| s.exp().powi(2)).collect();
        let filtered: Vec<f64> = squares.iter().map(|s| s + row[14] * row[14]).collect();
        for (scale, square) in splats.scale[i].iter().zip(&filtered) {
            assert!((f64::from(*scale).exp() - square.sqrt()).abs() < 1e-6, "{i}");
        }
        let factor = (squares.iter().product::<f64>() / filtered.iter().product::<f64>()).sqrt();
        let opacity = factor / (1.0 + (-row[6]).exp());
        assert!((1.0 / (1.0 + (-f64::from(splats.opacity[i])).exp()) - opacity).abs() < 1e-6, "{i}: {opacity}");
    }
    assert!(notes.len() == 1 && notes[0].contains("2 Gaussians") && notes[0].contains("`filter_3D`"), "{notes:?}");
}

#[test]
fn the_flat_discs_of_2dgs_are_thin_gaussians() {
    let folder = Folder::new("foreign-flat");
    let path = ply(&folder, &["scale_2"], &[], 0.0);
    let Scene { splats, notes, .. } = read(&path).unwrap();
    for [a, b, c] in &splats.scale {
        assert!((c - (a.min(*b) + 0.001_f32.ln())).abs() < 1e-6, "{c}");
    }
    assert!(notes.len() == 1 && notes[0].contains("2DGS"), "{notes:?}");
    let path = ply(&folder, &["scale_2", "opacity"], &[], 0.0);
    assert!(fault(read_scene(&path), &path).contains("is missing"));
}

#[test]
fn colours_of_bytes_are_read_where_there_are_no_harmonics() {
    let folder = Folder::new("foreign-bytes");
    let names: Vec<&str> =
        NAMES.iter().copied().filter(|name| !name.starts_with("f_dc")).chain(["red", "green", "blue"]).collect();
    let types = |color: &'static str| -> Vec<&str> { [["float"; 11].as_slice(), &[color; 3]].concat() };
    let row = [vec![0.5; 11], vec![0.0, 51.0, 102.0]].concat();
    let rows = [row];
    let path = folder.write("a.ply", by_hand("binary_little_endian", &names, &types("uchar"), &rows));
    let Scene { splats, notes, .. } = read(&path).unwrap();
    let color = splats.sh[0].map(|dc| 0.5 + 0.282_094_79 * dc);
    assert!(color.iter().zip([0.0, 0.2, 0.4]).all(|(a, b)| (a - b).abs() < 1e-6), "{color:?}");
    assert!(notes.len() == 1 && notes[0].contains("`red`"), "{notes:?}");
    let path = folder.write("a.ply", by_hand("binary_little_endian", &names, &types("ushort"), &rows));
    assert!(fault(read_scene(&path), &path).contains("`f_dc_0`: is missing"));
}

#[test]
fn scenes_of_renderers_that_make_up_for_blur_are_warned_of_in_every_format() {
    let folder = Folder::new("foreign-mip");
    let is_warned = |path: &Path| match &notes(path)[..] {
        [] => false,
        [note] => note.contains("makes Gaussians fainter") && note.contains("--blur"),
        more => panic!("{more:?}"),
    };
    for (comments, expected) in [
        (&["SplatRenderMode: mip"][..], true),
        (&["splatrendermode:  MIP"], true),
        (&["antialiased 1"], true),
        (&["antialiased 0"], false),
        (&["SplatRenderMode: default"], false),
        (&["Exported from Brush", "SH degree: 0"], false),
        // The last one counts.
        (&["antialiased 1", "SplatRenderMode: default"], false),
        (&["SplatRenderMode: default", "antialiased 1"], true),
    ] {
        let path = ply(&folder, &[], &[], 0.0);
        comments.iter().for_each(|comment| commented(&path, comment));
        assert_eq!(is_warned(&path), expected, "{comments:?}");
        let path = folder.write("a.compressed.ply", compressed(2, true));
        comments.iter().for_each(|comment| commented(&path, comment));
        assert_eq!(is_warned(&path), expected, "{comments:?}");
    }
    for flag in [0, 1] {
        let mut raw = raw_spz(0, 3 << 30, &[]);
        raw[14] = flag;
        assert_eq!(is_warned(&folder.write("a.spz", gzip(&raw))), flag == 1);
    }
    for (added, expected) in [
        ("", false),
        (r#""antialias": false,"#, false),
        (r#""antialias": true,"#, true),
        (r#""model": "antialiased","#, true),
    ] {
        let path = sog::scene(&folder, |text| text.replacen('{', &format!("{{{added}"), 1));
        assert_eq!(is_warned(&path), expected, "{added}");
    }
    let path = sog::scene(&folder, |text| text.replacen('{', r#"{"model": "2dgs","#, 1));
    assert_eq!(notes(&path), ["it is of the model `2dgs`, and is read as one of 3DGS"]);
}

#[test]
fn a_scene_whose_network_lies_beside_it_is_said_to_be_at_rest() {
    let folder = Folder::new("foreign-network");
    let plain = fs::read(ply(&folder, &[], &[], 0.0)).unwrap();
    let scene = folder.file("point_cloud/iteration_7/point_cloud.ply");
    fs::create_dir_all(scene.parent().unwrap()).unwrap();
    fs::write(&scene, plain).unwrap();
    assert_eq!(notes(&scene), [""; 0]);
    for network in ["point_cloud/iteration_7/deformation.pth", "deform/iteration_7/deform.pth"] {
        let network = folder.file(network);
        fs::create_dir_all(network.parent().unwrap()).unwrap();
        fs::write(&network, "").unwrap();
        let told = notes(&scene);
        assert!(told.len() == 1 && told[0].contains("moved by a network"), "{told:?}");
        fs::remove_file(&network).unwrap();
    }
}

#[test]
fn what_a_4dgs_holds_beside_what_is_read_is_said() {
    let folder = Folder::new("foreign-clip");
    let path = folder.file("a.4dgs");
    let written = |names: &[&str], camera| {
        let attachment = |name: &&str| fourdgs::Attachment {
            name: (*name).to_owned(),
            media_type: "text/plain".to_owned(),
            data: b"?".to_vec(),
        };
        let attachments = names.iter().map(attachment).collect();
        let extras = fourdgs::SceneExtras { attachments, camera, ..fourdgs::SceneExtras::default() };
        let (none, options) = (fourdgs::GaussianSet::default(), fourdgs::WriteOptions::default());
        let bytes = fourdgs::write_to_vec(&none, 1.0, &options, &extras).unwrap();
        fs::write(&path, &bytes).unwrap();
        let notes = FourDgs::of_bytes(&path, &bytes).unwrap().notes();
        assert_eq!(FourDgs::open(&path).unwrap().notes(), notes);
        notes
    };
    assert_eq!(written(&[], None), [""; 0]);
    assert_eq!(written(&["poster"], None), ["1 attachment is not read: `poster`"]);
    let told = written(&["poster", "notes"], Some(fourdgs::Camera::default()));
    assert_eq!(told, ["its camera path is not read", "2 attachments are not read: `poster`, `notes`"]);
}

fn ivv(arguments: &[&str]) -> (String, String) {
    let done = Command::new(env!("CARGO_BIN_EXE_ivv")).args(arguments).output().unwrap();
    let [out, told] = [done.stdout, done.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(done.status.success(), "{arguments:?}: {told}");
    (out, told)
}

#[test]
fn notes_reach_whoever_inspects_exports_and_renders_a_scene_once() {
    let folder = Folder::new("foreign-told");
    let path = ply(&folder, &[], &["label"], 1.0);
    let (scene, out) = (path.to_str().unwrap(), folder.file("b.ply"));
    let note = "1 property of its Gaussians is not read: `label`";
    let (json, _) = ivv(&["inspect", scene, "--json"]);
    assert_eq!(serde_json::from_str::<Value>(&json).unwrap()["notes"], serde_json::json!([note]));
    for arguments in [vec!["inspect", scene], vec!["export", scene, "-o", out.to_str().unwrap()]] {
        let (_, told) = ivv(&arguments);
        assert_eq!(told.matches(&format!("a.ply: {note}\n")).count(), 1, "{arguments:?}: {told}");
    }
}

fn own(pairs: &[(&str, &str)]) -> Own {
    pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
}

#[test]
fn how_a_scene_is_rendered_travels_in_a_ply_and_leaves_the_usual_one_as_it_was() {
    let folder = Folder::new("foreign-own");
    let (usual, path) = (folder.file("usual.ply"), folder.file("a.ply"));
    // Its colours fit into a .4dgs.
    let mut scene = sample(0, 3, 2);
    scene.sh.fill([0.2; 3]);
    write_ply(&usual, &scene).unwrap();
    write_ply_with(&path, &scene, &Own::new()).unwrap();
    assert_same("bytes", &fs::read(&path).unwrap(), &fs::read(&usual).unwrap());
    assert_eq!(ply_own(&path).unwrap(), None);
    let near = own(&[("near", "0.375"), ("background", "1 0.5 0")]);
    write_ply_with(&path, &scene, &near).unwrap();
    assert_eq!(ply_own(&path).unwrap(), Some(near.clone()));
    let scene_read = read(&path).unwrap();
    assert_eq!((scene_read.clip.constants.near, scene_read.clip.background), (0.375, Some([1.0, 0.5, 0.0])));
    assert_eq!((scene_read.splats, scene_read.notes), (scene, vec![]));
    let told = folder.write("a.splat", [0; 32]);
    assert_eq!(ply_own(&told).unwrap(), None);

    // From file to file, and into formats that have no place for it.
    let of = |name: &str| folder.file(name).to_str().unwrap().to_owned();
    ivv(&["export", &of("a.ply"), "-o", &of("b.4dgs"), "--seconds", "1"]);
    ivv(&["export", &of("b.4dgs"), "-o", &of("c.ftgs.ply")]);
    ivv(&["export", &of("c.ftgs.ply"), "-o", &of("d.ply")]);
    for name in ["c.ftgs.ply", "d.ply"] {
        assert_eq!(ply_own(&folder.file(name)).unwrap(), ply_own(&path).unwrap(), "{name}");
    }
    let (_, told) = ivv(&["export", &of("a.ply"), "-o", &of("e.spz"), "--time", "0.5"]);
    assert!(told.contains("no place for background 1 0.5 0, near 0.375"), "{told}");
    ivv(&["export", &usual.to_string_lossy(), "-o", &of("b.4dgs"), "--seconds", "1"]);
    ivv(&["export", &of("b.4dgs"), "-o", &of("c.ply")]);
    assert_eq!(ply_own(&folder.file("c.ply")).unwrap(), None);
    // What cannot be is not taken, and said.
    write_ply_with(&path, &sample(0, 3, 2), &own(&[("near", "-1")])).unwrap();
    let (_, told) = ivv(&["export", &of("a.ply"), "-o", &of("b.ply")]);
    assert!(told.contains("its `near` is `-1`, which cannot be"), "{told}");
    assert_eq!(ply_own(&folder.file("b.ply")).unwrap(), None);
}

#[test]
fn a_scene_alone_is_rendered_as_its_header_says_or_as_the_run_beside_it() {
    let folder = Folder::new("foreign-near");
    let of = |name: &str| folder.file(name).to_str().unwrap().to_owned();
    let (scene, views) = ivv::internals::scene::demo();
    let small = views[0].reduced(8);
    ivv::internals::scene::write_views(&folder.file("one.json"), &[small]).unwrap();
    let near = |scene: &str, more: &[&str]| {
        let (cameras, out) = (of("one.json"), of("out"));
        let (json, told) = ivv(&[&["render", scene, "--cameras", &cameras, "-o", &out, "--json"], more].concat());
        let report: Value = serde_json::from_str(&json).unwrap();
        (report["constants"]["near"].as_f64().unwrap(), told.contains("run.json beside it"))
    };
    write_ply(&folder.file("usual.ply"), &scene).unwrap();
    assert_eq!(near(&of("usual.ply"), &[]), (USUAL, false));
    write_ply_with(&folder.file("a.ply"), &scene, &own(&[("near", "0.375")])).unwrap();
    assert_eq!(near(&of("a.ply"), &[]), (0.375, false));
    assert_eq!(near(&of("a.ply"), &["--near", "0.5"]), (0.5, false));

    // A run of before, whose file says nothing.
    run_of_some_frames(&folder, ivv::Constants { near: 0.5, ..ivv::Constants::default() });
    let at = folder.file("run");
    write_ply(&at.join("scene.ply"), &scene).unwrap();
    assert_eq!(near(&of("run/scene.ply"), &[]), (0.5, true));
    fs::copy(at.join("scene.ply"), at.join("other.ply")).unwrap();
    assert_eq!(near(&of("run/other.ply"), &[]), (USUAL, false), "not of the run");
    write_ply_with(&at.join("scene.ply"), &scene, &own(&[("near", "0.25")])).unwrap();
    assert_eq!(near(&of("run/scene.ply"), &[]), (0.25, false));
}
