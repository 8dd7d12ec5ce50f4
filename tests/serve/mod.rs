//! `ivv serve`: the player and a scene over HTTP, nothing else, whatever is asked.

use crate::common::prelude::*;
use crate::common::random;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::Child;

const IVV: &str = env!("CARGO_BIN_EXE_ivv");

struct Server {
    child: Child,
    address: String,
}

impl Server {
    fn new(source: &Path, options: &[&str]) -> Self {
        Self::of(Command::new(IVV), source, options)
    }

    /// Started by `command`, which is `ivv` without arguments.
    fn of(mut command: Command, source: &Path, options: &[&str]) -> Self {
        command.args(["serve", "--port", "0", "--json"]).arg(source).args(options);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let url: serde_json::Value = serde_json::from_str(&line).unwrap_or_else(|_| panic!("no URL: {line}"));
        let address = url["url"].as_str().unwrap().trim_start_matches("http://").trim_end_matches('/').to_owned();
        Server { child, address }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        stream
    }

    /// What comes back on bytes that are sent, until the connection ends.
    fn raw(&self, request: &[u8]) -> Vec<u8> {
        let mut stream = self.connect();
        // The server may have answered and gone before everything is sent.
        let _ = stream.write_all(request);
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        answer
    }

    fn ask(&self, method: &str, path: &str, lines: &str) -> (u16, String, Vec<u8>) {
        let host = if lines.contains("Host:") { String::new() } else { format!("Host: {}\r\n", self.address) };
        let request = format!("{method} {path} HTTP/1.1\r\n{host}{lines}Connection: close\r\n\r\n");
        let answer = self.raw(request.as_bytes());
        let end = answer.windows(4).position(|end| end == b"\r\n\r\n").expect("no head");
        let head = String::from_utf8(answer[..end].to_vec()).unwrap().to_ascii_lowercase();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        (status, head, answer[end + 4..].to_vec())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn scene(folder: &Folder) -> std::path::PathBuf {
    let (splats, views) = demo();
    let [ply, cameras, path] = ["demo.ply", "cameras.json", "demo.4dgs"].map(|name| folder.file(name));
    write_ply(&ply, &splats).unwrap();
    write_views(&cameras, &views).unwrap();
    let arguments = ["export", ply.to_str().unwrap(), "-o", path.to_str().unwrap(), "--seconds", "2", "--cameras"];
    let done = ivv(&[&arguments[..], &[cameras.to_str().unwrap()]].concat());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    path
}

#[test]
fn the_page_its_files_and_the_scene_are_sent_whole_and_in_parts() {
    let folder = Folder::new("serve");
    let path = scene(&folder);
    let bytes = std::fs::read(&path).unwrap();
    let server = Server::new(&path, &[]);
    let (status, head, page) = server.ask("GET", "/", "");
    assert_eq!(status, 200);
    assert!(
        head.contains("content-type: text/html") && head.contains("content-security-policy: default-src 'self'"),
        "{head}"
    );
    // Every file that the page and its modules name is there.
    let mut names = vec!["index.html".to_owned(), "style.css".to_owned(), "icon.svg".to_owned(), "main.js".to_owned()];
    let mut at = 0;
    while let Some(name) = names.get(at).cloned() {
        let (status, head, text) = server.ask("GET", &format!("/{name}"), "");
        assert_eq!(status, 200, "{name}");
        assert!(head.contains("x-content-type-options: nosniff"), "{head}");
        let text = String::from_utf8(text).unwrap();
        for import in text.split("from './").skip(1) {
            let import = import.split('\'').next().unwrap().to_owned();
            if !names.contains(&import) {
                names.push(import);
            }
        }
        at += 1;
    }
    assert!(names.len() > 12, "{names:?}");
    assert_eq!(server.ask("GET", "/index.html?bench=1", "").2, page);

    let (status, head, body) = server.ask("GET", "/scene.4dgs", "");
    assert_eq!((status, body.as_slice()), (200, bytes.as_slice()));
    let tag = head.lines().find_map(|line| line.strip_prefix("etag: ")).unwrap().to_owned();
    let n = bytes.len();
    for (range, expected) in [
        ("0-99".to_owned(), 0..100),
        ("100-".to_owned(), 100..n),
        ("-37".to_owned(), n - 37..n),
        (format!("{}-{}", n - 5, n + 50), n - 5..n),
        (format!("-{}", 2 * n), 0..n),
    ] {
        let (status, head, body) = server.ask("GET", "/scene.4dgs", &format!("Range: bytes={range}\r\n"));
        assert_eq!((status, body.as_slice()), (206, &bytes[expected.clone()]), "{range}");
        let told = format!("content-range: bytes {}-{}/{n}", expected.start, expected.end - 1);
        assert!(head.contains(&told), "{head}");
    }
    for range in [format!("{n}-"), "-0".to_owned()] {
        let (status, head, _) = server.ask("GET", "/scene.4dgs", &format!("Range: bytes={range}\r\n"));
        assert!(status == 416 && head.contains(&format!("bytes */{n}")), "{range}: {head}");
    }
    for range in ["5-1", "0-1,4-5", "x-2", "+1-4", "18446744073709551616-"] {
        assert_eq!(server.ask("GET", "/scene.4dgs", &format!("Range: bytes={range}\r\n")).0, 200, "{range}");
    }
    assert_eq!(server.ask("GET", "/scene.4dgs", &format!("If-None-Match: {tag}\r\n")).0, 304);
    let older = "Range: bytes=0-9\r\nIf-Range: \"another\"\r\n";
    assert_eq!(server.ask("GET", "/scene.4dgs", older).0, 200);
    let (status, head, body) = server.ask("HEAD", "/scene.4dgs", "");
    assert!(status == 200 && head.contains(&format!("content-length: {n}")) && body.is_empty(), "{head}");
}

#[test]
fn a_file_that_is_written_anew_is_sent_as_it_is_now_and_two_never_in_one_answer() {
    let folder = Folder::new("serve-anew");
    let path = scene(&folder);
    let server = Server::new(&path, &[]);
    let tag = |head: &str| head.lines().find_map(|line| line.strip_prefix("etag: ")).unwrap().to_owned();
    let before = tag(&server.ask("GET", "/scene.4dgs", "").1);
    std::fs::write(&path, b"shorter").unwrap();
    let (status, head, body) = server.ask("GET", "/scene.4dgs", &format!("If-None-Match: {before}\r\n"));
    assert_eq!((status, body.as_slice()), (200, b"shorter".as_slice()));
    assert!(head.contains("content-length: 7") && tag(&head) != before, "{head}");
    // While it is sent: more than the system takes before somebody reads.
    let long = 64 << 20;
    std::fs::write(&path, vec![1_u8; long]).unwrap();
    let mut stream = server.connect();
    write!(stream, "GET /scene.4dgs HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", server.address).unwrap();
    let mut start = vec![0_u8; 1 << 16];
    stream.read_exact(&mut start).unwrap();
    std::thread::sleep(Duration::from_millis(50));
    let mut file = std::fs::File::options().write(true).open(&path).unwrap();
    file.write_all(&vec![2_u8; long]).unwrap();
    let mut rest = Vec::new();
    let _ = stream.read_to_end(&mut rest);
    assert!(start.len() + rest.len() < long && !rest.contains(&2), "{} bytes follow", rest.len());
    std::fs::remove_file(&path).unwrap();
    let (status, _, body) = server.ask("GET", "/scene.4dgs", "");
    assert!(status == 404 && body.starts_with(b"expected the file of the scene"));
}

/// The file that is sent has no name any more, so that whatever ends the server leaves nothing.
#[cfg(unix)]
#[test]
fn a_clip_in_parts_is_sent_and_nothing_of_it_is_left() {
    let folder = Folder::new("serve-parts");
    let path = folder.file("parts.ply");
    crate::render::parts::write(&path);
    let beside = folder.file("beside");
    std::fs::create_dir(&beside).unwrap();
    folder.write("beside/.ivv-serve-1.4dgs.1-0.tmp", "what a server left that was killed while it wrote");
    let mut command = Command::new(IVV);
    command.env("TMPDIR", &beside);
    let server = Server::of(command, &path, &["--seconds", "5"]);
    let left: Vec<_> = std::fs::read_dir(&beside).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(left.is_empty(), "{left:?}");
    let (status, _, body) = server.ask("GET", "/scene.4dgs", "");
    assert!(status == 200 && body.starts_with(b"\x894DGS1\r\n"), "{status}");
}

#[test]
fn nothing_else_is_sent_and_nobody_else_is_answered() {
    let folder = Folder::new("serve-safe");
    let path = scene(&folder);
    let server = Server::new(&path, &["--name", "Studio.Local"]);
    for path in
        ["/demo.ply", "/../demo.ply", "/%2e%2e/demo.ply", "//etc/passwd", "/etc/passwd", "/index.html/", "/README.md"]
    {
        let (status, head, body) = server.ask("GET", path, "");
        assert!(status == 404 && body.starts_with(b"expected a file"), "{path}: {head}");
    }
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "PATCH", "BREW"] {
        let (status, head, _) = server.ask(method, "/", "Content-Length: 0\r\n");
        assert!(status == 405 && head.contains("allow: get, head"), "{method}: {head}");
    }
    for host in ["evil.example", "127.0.0.1.evil.example", "", "localhost.", "192.168.0.1:80"] {
        assert_eq!(server.ask("GET", "/", &format!("Host: {host}\r\n")).0, 421, "{host}");
    }
    for host in ["localhost:1", "LOCALHOST", "127.0.0.1", "[::1]:80", "studio.local:8080"] {
        assert_eq!(server.ask("GET", "/", &format!("Host: {host}\r\n")).0, 200, "{host}");
    }
    // At all addresses of this machine any of them is asked for, but no other name.
    let everywhere = Server::new(&path, &["--bind", "0.0.0.0"]);
    for (host, status) in [("192.168.0.1:80", 200), ("[fe80::1]:80", 200), ("localhost", 200), ("evil.example", 421)] {
        assert_eq!(everywhere.ask("GET", "/", &format!("Host: {host}\r\n")).0, status, "{host}");
    }
    let long = format!("X-Long: {}\r\n", "a".repeat(64 << 10));
    assert!([400, 431].contains(&server.ask("GET", "/", &long).0));
    // More connections than it has places for, none of which says anything, do not keep it from going on once they end.
    let idle: Vec<TcpStream> = (0..80).map(|_| server.connect()).collect();
    drop(idle);
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(server.ask("GET", "/", "").0, 200);
}

/// What lies beside the scene and is nobody's business.
const SECRET: &[u8] = b"7a1d-secret-9c3e";
/// Requests between which the server is asked something sound and looked at.
const BATCH: u64 = 2000;

/// Kilobytes of memory and open files of a process, where the system tells.
fn held(child: &Child) -> Option<(u64, usize)> {
    let folder = Path::new("/proc").join(child.id().to_string());
    let status = std::fs::read_to_string(folder.join("status")).ok()?;
    let rss =
        status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?.trim().trim_end_matches(" kB").parse().ok()?;
    Some((rss, std::fs::read_dir(folder.join("fd")).ok()?.count()))
}

/// `IVV_REQUESTS` sets how many (400).
#[test]
fn damaged_requests_are_answered_or_refused_and_the_server_goes_on() {
    let n: u64 = std::env::var("IVV_REQUESTS").map_or(400, |n| n.parse().unwrap());
    let folder = Folder::new("serve-fuzz");
    let path = scene(&folder);
    folder.write("secret.txt", SECRET);
    let mut server = Server::new(&path, &[]);
    let name = folder.file("secret.txt").display().to_string();
    let paths = [
        "/scene.4dgs".to_owned(),
        "/".to_owned(),
        "/secret.txt".to_owned(),
        "/../secret.txt".to_owned(),
        "/%2e%2e/secret.txt".to_owned(),
        "/..%2Fsecret.txt".to_owned(),
        "/scene.4dgs/../secret.txt".to_owned(),
        "/./secret.txt?a=/scene.4dgs".to_owned(),
        "/..\\secret.txt".to_owned(),
        format!("/{name}"),
        format!("http://{}/../secret.txt", server.address),
    ];
    let good = |path: &str| {
        format!("GET {path} HTTP/1.1\r\nHost: {}\r\nRange: bytes=0-9\r\nAccept: */*\r\n\r\n", server.address)
    };
    let requests: Vec<Vec<u8>> = paths.iter().map(|path| good(path).into_bytes()).collect();
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut random = move |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below.max(1)
    };
    let mut statuses = std::collections::BTreeMap::new();
    let mut before = None;
    for at in 0..n {
        let mut request = requests[if random(2) == 0 { 0 } else { random(requests.len()) }].clone();
        for _ in 0..random(5) {
            let at = random(request.len());
            match random(5) {
                0 => request[at] = random(256) as u8,
                1 => request.truncate(at),
                2 => request.insert(at, random(256) as u8),
                3 => request.extend_from_within(at.min(request.len())..),
                _ => drop(request.drain(at..(at + random(20)).min(request.len()))),
            }
            if request.is_empty() {
                break;
            }
        }
        let answer = server.raw(&request);
        let said = String::from_utf8_lossy(&request);
        assert!(!answer.windows(SECRET.len()).any(|bytes| bytes == SECRET), "sent what is not served: {said:?}");
        let status = String::from_utf8_lossy(&answer).split(' ').nth(1).unwrap_or("none").to_owned();
        *statuses.entry(status).or_insert(0) += 1;
        if at % BATCH == 200 {
            assert!(server.child.try_wait().unwrap().is_none(), "the server ended");
            assert_eq!(server.ask("GET", "/", "").0, 200);
            before = before.or_else(|| held(&server.child));
        }
    }
    let after = held(&server.child);
    println!("{n} requests: {statuses:?}; kilobytes and open files first {before:?}, last {after:?}");
    assert!(server.child.try_wait().unwrap().is_none(), "the server ended");
    assert_eq!(server.ask("GET", "/", "").0, 200);
    assert!(statuses.len() > 3 && !statuses.contains_key("500"), "{statuses:?}");
    if let Some(((kilobytes, files), (more, opened))) = before.zip(after) {
        assert!(more < kilobytes + (32 << 10), "{kilobytes} kB grew to {more}");
        assert!(opened < files + 16, "{files} open files grew to {opened}");
    }
}

#[test]
fn a_folder_and_a_page_for_any_host_of_files() {
    let folder = Folder::new("serve-web");
    let path = scene(&folder);
    let (web, page) = (folder.file("web/"), folder.file("page.html"));
    for to in [&web, &page] {
        let done = ivv(&["export", path.to_str().unwrap(), "-o", to.to_str().unwrap()]);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    }
    let again = FourDgs::read(&web.join("scene.4dgs")).unwrap();
    assert_eq!(again.summary(), FourDgs::read(&path).unwrap().summary());
    let names: Vec<String> =
        std::fs::read_dir(&web).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    assert!(names.contains(&"index.html".to_owned()) && !names.iter().any(|name| name.ends_with(".tmp")), "{names:?}");
    let text = std::fs::read_to_string(&page).unwrap();
    // Nothing of it is elsewhere, and no module is left that a page of one file could not import.
    for outside in ["src=\"", "href=\"style", "\nimport ", "\nexport ", "http://", "https://"] {
        let found = text.find(outside).map(|at| &text[at..(at + 60).min(text.len())]);
        assert!(found.is_none(), "{found:?}");
    }
    assert!(text.contains("Content-Security-Policy") && text.contains("sha256-"));
}

#[test]
fn what_cannot_be_served_is_told_at_once() {
    let folder = Folder::new("serve-told");
    let moving = folder.file("moving.ply");
    write_ply(&moving, &random::scene(1, 8, 0)).unwrap();
    let done = ivv(&["serve", moving.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(!done.status.success() && said.contains("--seconds"), "{said}");
    let broken = folder.write("broken.4dgs", b"\x894DGS1\r\n0123456789");
    let done = ivv(&["serve", broken.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.code() == Some(3) && said.contains("broken.4dgs"), "{said}");
    let path = scene(&folder);
    let server = Server::new(&path, &[]);
    let port = server.address.rsplit(':').next().unwrap();
    let done = ivv(&["serve", path.to_str().unwrap(), "--port", port]);
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(!done.status.success() && said.contains("--port 0"), "{said}");
}
