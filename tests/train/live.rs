//! A training that is watched in a browser.

use super::Tiny;
use crate::common::prelude::*;
use crate::common::program::command;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::Child;

struct Serving {
    child: Child,
    address: String,
}

impl Serving {
    fn new(arguments: &[&str]) -> Self {
        let mut child = command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (out, mut err) = (child.stdout.take().unwrap(), BufReader::new(child.stderr.take().unwrap()));
        let mut said = String::new();
        let find = |said: &str| Some(said.split_once("http://")?.1.split_once('/')?.0.to_owned());
        if arguments[0] == "serve" {
            BufReader::new(out).read_line(&mut said).unwrap();
        } else {
            while find(&said).is_none() && err.read_line(&mut said).unwrap() > 0 {}
        }
        // What it goes on to say is read, so that it is never kept waiting.
        std::thread::spawn(move || std::io::copy(&mut err, &mut std::io::sink()));
        let address = find(&said).unwrap_or_else(|| panic!("no address: {said}"));
        Serving { child, address }
    }

    fn send(&self, request: &str) -> TcpStream {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        stream
    }

    fn get(&self, path: &str) -> (u16, String, Vec<u8>) {
        let request = format!("GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.address);
        let mut answer = Vec::new();
        self.send(&request).read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|end| end == b"\r\n\r\n").expect("no head");
        let head = String::from_utf8(answer[..end].to_vec()).unwrap().to_ascii_lowercase();
        (head[9..12].parse().unwrap(), head, answer[end + 4..].to_vec())
    }

    fn says(&self, is_enough: impl Fn(&Value) -> bool) -> Value {
        let stream = self.send(&format!("GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", self.address));
        let begun = Instant::now();
        for line in BufReader::new(stream).lines() {
            assert!(begun.elapsed() < Duration::from_secs(120), "the run never says it");
            if let Some(text) = line.unwrap().strip_prefix("data: ") {
                let state = serde_json::from_str(text).unwrap();
                if is_enough(&state) {
                    return state;
                }
            }
        }
        panic!("the run says no more");
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn scene(serving: &Serving, name: &str) -> FourDgs {
    let (status, head, bytes) = serving.get(&format!("/at/{name}/scene.4dgs"));
    assert!(status == 200 && head.contains("etag") && head.contains("accept-ranges: bytes"), "{head}");
    FourDgs::of_bytes(Path::new("served.4dgs"), &bytes).unwrap()
}

#[test]
fn a_training_is_watched_as_it_goes_and_by_another_process() {
    let tiny = Tiny::new("live");
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let path = run.to_str().unwrap();
    let sizes =
        ["--steps", "100000", "--sh-degree", "1", "--max-gaussians", "400", "--view", "0", "--eval-every", "30"];
    let often = ["--checkpoint-every", "20", "--log-every", "5"];
    let training = Serving::new(&[&["train", capture, "-o", path][..], &sizes, &often].concat());
    let (status, head, page) = training.get("/");
    assert!(status == 200 && head.contains("content-security-policy: default-src 'self'"), "{head}");
    for name in ["live.js", "live.css", "icon.svg"] {
        assert!(String::from_utf8_lossy(&page).contains(name));
        assert_eq!(training.get(&format!("/{name}")).0, 200, "{name}");
    }
    let state = training.says(|state| state["step"].as_u64() > Some(35) && !state["report"].is_null());
    assert_eq!((&state["total"], &state["name"], &state["ended"]), (&100_000.into(), &"run".into(), &false.into()));
    assert!(state["loss"].as_f64() > Some(0.0) && state["gaussians"].as_u64() > Some(0), "{state}");
    // Its report so far, a page of its own; its scene, in the player.
    let (status, head, report) = training.get("/report.html");
    assert!(status == 200 && head.contains("default-src 'none'; style-src 'unsafe-inline'; img-src data:"), "{head}");
    assert!(String::from_utf8(report).unwrap().contains("plot-psnr"));
    let first = training.says(|state| state["scene"].is_string())["scene"].as_str().unwrap().to_owned();
    let (status, _, player) = training.get(&format!("/at/{first}/"));
    assert!(status == 200 && String::from_utf8(player).unwrap().contains("main.js"));
    assert_eq!(training.get(&format!("/at/{first}/main.js")).0, 200);
    let number = |state: &Value| state["scene"].as_str().and_then(|name| name.parse::<u64>().ok()).unwrap_or(0);
    let next = training.says(|state| number(state) > first.parse().unwrap());
    let shown = scene(&training, next["scene"].as_str().unwrap());
    assert!(shown.splats().unwrap().len() > 50 && !shown.views().unwrap().is_empty());
    // Nothing else of the run, and no scene that there is not.
    for other in
        ["/config.json", "/at/1/scene.4dgs", "/at/../scene.4dgs", "/at/x/scene.4dgs", "/at/1/../../run.json", "/at"]
    {
        assert_eq!(training.get(other).0, 404, "{other}");
    }
    let mut foreign = String::new();
    training
        .send("GET /events HTTP/1.1\r\nHost: example.org\r\nConnection: close\r\n\r\n")
        .read_to_string(&mut foreign)
        .unwrap();
    assert!(foreign.starts_with("HTTP/1.1 421"), "{foreign}");
    drop(training);

    // The same of a run that another process trains, or trained until it was lost: what is on the disk.
    let serving = Serving::new(&["serve", path, "--port", "0"]);
    let state = serving.says(|_| true);
    let step = number(&state);
    // It was killed, perhaps after a checkpoint and before the lines of the log that belong to it.
    assert!(step >= number(&next) && state["step"].as_u64().is_some_and(|at| at <= step && at + 20 >= step), "{state}");
    assert!(!scene(&serving, &step.to_string()).splats().unwrap().is_empty());
}

#[test]
fn a_run_that_goes_on_after_its_end_is_served_with_its_new_length_and_scene() {
    let tiny = Tiny::new("live-on");
    let (capture, run) = (tiny.folder.to_str().unwrap(), tiny.folder.join("run"));
    let path = run.to_str().unwrap();
    let train = |more: &[&str]| {
        let quick = ["train", "-o", path, "--eval-every", "0", "--checkpoint-every", "10", "-q"];
        works(&[&quick[..], more].concat());
    };
    // Served from before its end on.
    let ply = (run.join("scene.ply"), tiny.folder.join("kept.ply"));
    train(&[capture, "--steps", "20", "--sh-degree", "1", "--max-gaussians", "400"]);
    std::fs::rename(&ply.0, &ply.1).unwrap();
    let serving = Serving::new(&["serve", path, "--port", "0"]);
    assert_eq!(serving.says(|_| true)["ended"], false);
    std::fs::rename(&ply.1, &ply.0).unwrap();
    let before = serving.says(|state| state["ended"] == true);
    assert_eq!((&before["step"], &before["total"]), (&20.into(), &20.into()));
    let name = |state: &Value| state["scene"].as_str().unwrap().to_owned();
    let (status, _, old) = serving.get(&format!("/at/{}/scene.4dgs", name(&before)));
    assert_eq!(status, 200);

    let first_end = ["scene.ply", "train.json"].map(|name| (run.join(name), std::fs::read(run.join(name)).unwrap()));
    train(&["--resume", "--steps", "40"]);
    let after = serving.says(|state| state["ended"] == true && state["step"] == 40);
    assert_eq!(after["total"], 40);
    assert_ne!(name(&after), name(&before));
    let (status, _, new) = serving.get(&format!("/at/{}/scene.4dgs", name(&after)));
    assert!(status == 200 && new != old, "the scene of the end before");
    assert_eq!(serving.get("/at/end-1/scene.4dgs").0, 404);
    drop(serving);

    // As a run is left that was lost before it wrote its second scene, and then one that was stopped on its way there.
    first_end.iter().for_each(|(file, bytes)| std::fs::write(file, bytes).unwrap());
    for newest in ["40", "30"] {
        for entry in std::fs::read_dir(run.join("checkpoints")).unwrap() {
            let file = entry.unwrap().path();
            if newest == "30" && file.file_name().unwrap().to_string_lossy().contains("00040") {
                std::fs::remove_file(file).unwrap();
            } else {
                let open = std::fs::File::options().write(true).open(file).unwrap();
                open.set_modified(std::time::SystemTime::now()).unwrap();
            }
        }
        let serving = Serving::new(&["serve", path, "--port", "0"]);
        let state = serving.says(|_| true);
        assert_eq!((&state["ended"], &state["scene"], &state["total"]), (&false.into(), &newest.into(), &40.into()));
    }
}
