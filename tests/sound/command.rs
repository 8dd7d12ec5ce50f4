//! The verbs, through the command line.

use super::simulate::{Motion, Simulated, simulate};
use super::sphere;
use crate::common::prelude::*;
use crate::common::program::json;
use ivv::internals::sound::wav::{Depth, read, write};

fn run(args: &[&str]) -> (i32, String, String) {
    let output = ivv(args);
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

fn ears(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let model = Sphere::default().measured(2);
    for (to, [left, right]) in model.directions.iter().zip(&model.irs) {
        let (az, el) = ivv::internals::sound::geometry::angles(*to);
        let frames: Vec<[f32; 2]> = left.iter().zip(right).map(|(l, r)| [0.2 * l, 0.2 * r]).collect();
        let name = format!("azi_{:.4}_ele_{:.4}.wav", az.to_degrees(), el.to_degrees());
        write(folder.join(name), &frames, Depth::Float32).unwrap();
    }
}

#[test]
fn a_scene_is_rendered() {
    let folder = Folder::new("sound-verbs");
    let name = |file: &str| folder.path(file);
    ears(&folder.file("ears"));
    let hrtf = name("ears");
    let Simulated { mut scene, recording, .. } = simulate(Motion::Still, 0.4, 1, sphere());
    scene.mic.wav = folder.file("mic.wav");
    write(&scene.mic.wav, &recording.iter().map(|x| [*x]).collect::<Vec<_>>(), Depth::Int24).unwrap();
    scene.write(&folder.file("scene.json")).unwrap();
    fs::write(folder.file("path.csv"), "t,x,y,z,qx,qy,qz,qw\n0,0.4,1,0,0,0,0.7071,0.7071\n").unwrap();
    for mode in ["paper3d", "physical"] {
        let (scene, path, out, more) = (name("scene.json"), name("path.csv"), name("out.wav"), name("ambix.wav"));
        let (code, report, error) = run(&[
            "sound", "render", &scene, "--path", &path, "-o", &out, "--hrtf", &hrtf, "--mode", mode, "--ambix", &more,
            "--json",
        ]);
        assert_eq!(code, 0, "{error}");
        let heard = read(Path::new(&out)).unwrap();
        assert_eq!((heard.channels.len(), heard.channels[0].len(), heard.fs), (2, 19_200, 48_000));
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        assert_eq!((report["mode"].as_str(), report["seconds"].as_f64()), (Some(mode), Some(0.4)));
        let ears = &report["hrtf"];
        assert!(ears["licence"] == "not stated" && ears["sha256"].as_str().unwrap().len() == 64, "{ears}");
    }
    assert_eq!(read(Path::new(&name("ambix.wav"))).unwrap().channels.len(), 4);
    // A source that is far too loud is lowered in both, and clips in none.
    let mut scene = json(&folder.file("scene.json"));
    scene["sources"][0]["gain_db"] = 40.0.into();
    fs::write(name("loud.json"), scene.to_string()).unwrap();
    let arguments = [&name("loud.json"), "--path", &name("path.csv"), "-o", &name("loud.wav"), "--hrtf", &hrtf];
    let ambix = name("loud-ambix.wav");
    let (code, said, error) = run(&[&["sound", "render"][..], &arguments, &["--ambix", &ambix]].concat());
    assert_eq!(code, 0, "{error}");
    assert!(said.contains("licence: not stated") && said.contains("sha256"), "{said}");
    for file in ["loud.wav", "loud-ambix.wav"] {
        let all = read(Path::new(&name(file))).unwrap().channels.concat();
        let peak = all.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
        assert!((0.1..0.9).contains(&peak), "{file}: {peak}");
    }
    // Bad data is exit 3, bad usage 2.
    let (scene, path) = (name("scene.json"), name("path.csv"));
    let wrong = |option, value| run(&["sound", "render", &scene, "--path", &path, "-o", "x.wav", option, value]);
    let mic = name("mic.wav");
    let (code, _, error) = wrong("--hrtf", &mic);
    assert!(code == 3 && error.contains("mic.wav"), "{error}");
    assert_eq!(wrong("--mode", "loud").0, 2);
}
