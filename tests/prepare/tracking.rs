//! Rigs of cameras that move, followed by a program in the place of COLMAP.

use super::{calls, ivv_prepare, program, settings, video};
use crate::capture::model::{Model, write_to};
use crate::capture::png;
use crate::common::prelude::*;
use ivv::internals::prepare::forecast;

/// Finds the model in `model/` for pictures without cameras. Beside the images of a model that is given, it places those of its
/// database: a unit further along x for each key frame, all but those in the file `lost`; where there is a file `fail` it fails at
/// key frame 5.
const COLMAP: &str = r#"#!/bin/sh
here=$(dirname "$0")/..
echo "$@" >>"$here/calls"
verb=$1
shift
while [ $# -gt 0 ]; do
    case $1 in
    --database_path) database=$2 ;;
    --image_list_path) list=$2 ;;
    --input_path) input=$2 ;;
    --output_path) output=$2 ;;
    esac
    shift 2
done
case $verb in
feature_extractor) [ -z "$list" ] || cat "$list" >>"$database.names" ;;
point_triangulator) cp "$input"/* "$output" ;;
mapper)
    if [ -z "$input" ]; then
        mkdir -p "$output/0"
        cp "$here"/model/* "$output/0"
        exit 0
    fi
    if [ -f "$here/fail" ] && grep -q /00005 "$database.names"; then exit 1; fi
    cp "$input/cameras.txt" "$output"
    awk -v lost="$(cat "$here/lost")" '
        FNR == NR && NF == 10 && !/^#/ { split($10, a, "[/.]"); pose[a[1]] = $0; at[a[1]] = a[2]; n++; print; print "" }
        FNR == NR { next }
        { split($1, a, "[/.]"); if (a[2] == at[a[1]] || index(lost, $1)) next
          split(pose[a[1]], f, " ")
          print ++n, f[2], f[3], f[4], f[5], f[6] - (a[2] - at[a[1]]), f[7], f[8], f[9], $1; print "" }
    ' "$input/images.txt" "$database.names" >"$output/images.txt"
    ;;
esac
"#;

const NAMES: [&str; 4] = ["a", "b", "c d", "e"];

/// Four videos, whose first pictures the program places side by side.
fn rig(test: &str, lost: &str) -> Folder {
    let folder = Folder::new(test);
    NAMES.iter().for_each(|name| video(&folder.0.join(format!("source/{name}.mp4")), 13));
    let pictures = ["a.jpg", "b.jpg", "c d.jpg", "e.jpg"];
    let camera = |k: u32| (k, 2, "SIMPLE_RADIAL", 64, 48, vec![60.0 + f64::from(k), 32.0, 24.0, -0.02]);
    let image = |k: u32| {
        let at = [-f64::from(k), 0.3 * f64::from(k % 2), 0.0];
        (k, [1.0, 0.0, 0.0, 0.0], at, k, pictures[k as usize - 1], vec![])
    };
    let points = vec![(5, [0.5, 0.0, 4.0], [9, 8, 7], 0.1, vec![(1, 0), (2, 0)])];
    let model = Model { cameras: (1..=4).map(camera).collect(), images: (1..=4).map(image).collect(), points };
    write_to(&folder, "model", &model);
    folder.write("lost", lost);
    program(&folder, "colmap", COLMAP);
    folder
}

fn prepare(folder: &Folder, options: &[&str]) -> Output {
    ivv_prepare(folder, &[&["--triangulate", "none"], options].concat())
}

fn fails(folder: &Folder, options: &[&str]) -> String {
    let output = prepare(folder, options);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{told}");
    told
}

fn n_blocks(folder: &Folder) -> usize {
    calls(folder).lines().filter(|call| call.starts_with("mapper") && call.contains("fix_existing_images 1")).count()
}

#[test]
fn a_rig_is_followed_and_an_interrupted_run_goes_on() {
    needs!("ffmpeg");
    let folder = rig("prepare-rig", "001/00003.jpg");
    folder.write("fail", "");
    let options = ["--moving", "2", "--frames", "1:12", "--shift", "b=1"];
    let output = prepare(&folder, &options);
    assert!(!output.status.success() && n_blocks(&folder) == 2);
    let calls = folder.0.join("calls");
    std::fs::remove_file(folder.0.join("fail")).unwrap();
    std::fs::remove_file(&calls).unwrap();
    let output = prepare(&folder, &options);
    let (said, told) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert!(output.status.success(), "{said}{told}");
    // Key frames 0 to 4 were there.
    assert_eq!(n_blocks(&folder), 1, "{told}");
    assert!(told.contains("cameras 6/6"), "{told}");
    assert!(said.contains("11 frames, 6 of them placed") && said.contains("b at 1"), "{said}");
    let capture = Capture::open(folder.0.join("out")).unwrap();
    assert_eq!((capture.cameras.len(), capture.n_frames), (4, 11));
    for (k, camera) in (1..).zip(&capture.cameras) {
        for shot in &camera.shots {
            let pose = shot.world_to_camera.unwrap();
            let x = f64::from(k) + 0.5 * f64::from(shot.frame);
            assert!((pose.center().x - x).abs() < 1e-6, "{} {}: {:?}", camera.name, shot.frame, pose.center());
        }
    }
    let project = folder.0.join("out/reconstruction");
    assert!(project.join("track/00011.json").is_file() && !project.join("block").exists());
    assert!(!project.join("frames").exists());
    // All is there.
    assert!(prepare(&folder, &options).status.success() && n_blocks(&folder) == 1);
    let told = fails(&folder, &["--moving", "1", "--frames", "1:12", "--shift", "b=1"]);
    assert!(told.contains("moving was 2 and is 1") && told.contains("--force"), "{told}");
}

/// COLMAP 3.13 has no more of the older names and tells of the first that it meets.
#[test]
fn a_newer_colmap_is_given_the_names_that_it_knows() {
    needs!("ffmpeg");
    let folder = rig("prepare-newer", "");
    std::fs::rename(folder.0.join("bin/colmap"), folder.0.join("bin/older")).unwrap();
    let newer = "#!/bin/sh\nfor word; do case $word in --Sift*.use_gpu | --Sift*.num_threads | --Sift*.guided_matching | *.max_image_size | \
        *.fix_existing_images) case $word in --Feature*) ;; *)\n\
        echo \"E20251114 1 option_manager.cc:976] Failed to parse options - unrecognised option '$word'.\" >&2\n\
        exit 1;; esac;; esac; done\nexec \"$(dirname \"$0\")/older\" \"$@\"\n";
    program(&folder, "colmap", newer);
    let output = prepare(&folder, &["--moving", "2", "--frames", "1:6"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let calls = calls(&folder);
    let given =
        ["--FeatureExtraction.use_gpu 0", "--FeatureExtraction.max_image_size", "--FeatureMatching.num_threads"];
    let all = given.into_iter().chain(["--SiftExtraction.max_num_features", "--Mapper.fix_existing_frames 1"]);
    all.for_each(|name| assert!(calls.contains(name), "{name}: {calls}"));
}

#[test]
fn a_rig_that_is_lost_is_told() {
    needs!("ffmpeg");
    let folder = rig("prepare-lost", "001/00002.jpg 003/00002.jpg");
    let told = fails(&folder, &["--moving", "3"]);
    assert!(told.contains("at frame 6: 2 of 4 cameras") && told.contains("smaller --moving"), "{told}");
    // It was looked for from the key frame before, too, which is kept.
    assert_eq!(n_blocks(&folder), 2);
    assert!(folder.0.join("out/reconstruction/track/00003.json").is_file());
    std::fs::remove_dir_all(folder.0.join("out")).unwrap();
    let told = fails(&folder, &["--moving", "1"]);
    assert!(told.contains("at frame 2: ") && told.contains("--frames :2"), "{told}");
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let folder = Folder::new("prepare-not-moving");
    folder.write("source/a.png", png(6, 4, 0));
    folder.write("source/b.png", png(6, 4, 0));
    let settings = PrepareSettings { moving: Some(1), ..settings(&folder) };
    let fault = |settings: &PrepareSettings| forecast(settings).unwrap_err().to_string();
    let told = fault(&settings);
    assert!(told.contains("expects a folder of videos without calibration, found photos"), "{told}");
    let told = fault(&PrepareSettings { moving: Some(0), ..settings.clone() });
    assert!(told.contains("--moving") && told.contains("give at least 1"), "{told}");
    folder.write("source/cameras.txt", "");
    folder.write("source/images.txt", "");
    let told = fault(&settings);
    assert!(told.contains("found a source with cameras"), "{told}");
    for name in ["cameras.txt", "images.txt", "a.png", "b.png"] {
        std::fs::remove_file(folder.0.join("source").join(name)).unwrap();
    }
    folder.write("source/a.mp4", "");
    needs!("ffmpeg", "colmap");
    ["a", "b", "c"].iter().for_each(|name| video(&folder.0.join(format!("source/{name}.mp4")), 8));
    let counted = forecast(&PrepareSettings { frames: Frames::first(7), ..settings }).unwrap().unwrap();
    // Blocks of 5 and 3 frames beside the first: pairs of cameras in each frame, and of frames of each camera.
    let pairs = 3 + (5 * 3 + 3 * 10) + (3 * 3 + 3 * 3);
    assert_eq!((counted.pictures, counted.pairs), (3 + 3 * 5 + 3 * 3, pairs));
}
