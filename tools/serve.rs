//! `ivv serve`: the browser player with a scene, on this machine.

use crate::export_clip::ClipArgs;
use crate::interrupt::Stop;
use crate::page::{self, POLICY, SCENE};
use crate::screen::{alert, out, say};
use crate::shown;
use anyhow::Context;
use bytes::Bytes;
use http_body_util::Full;
use hyper::header::{self, HeaderValue};
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use sha2::{Digest, Sha256};
use std::convert::Infallible;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::ops::Range;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_io_timeout::TimeoutStream;

/// Connections at a time; a browser opens six.
const MOST_CONNECTIONS: usize = 64;
/// Longest head of a request, bytes.
const LONGEST_HEAD: usize = 16 << 10;
/// How long a head may take, and how long a reader may take nothing.
const PATIENCE: Duration = Duration::from_secs(20);
/// How often the end that was asked for is looked for.
const GLANCE: Duration = Duration::from_millis(100);

/// Options of `ivv serve`.
#[derive(clap::Args)]
pub struct Args {
    /// The folder of a run, or a scene file: a .4dgs is sent as it is, others are put into one first.
    #[arg(value_name = "RUN|SCENE")]
    source: PathBuf,
    /// The port; 0 for any that is free.
    #[arg(long, default_value_t = 8080)]
    port: u16,
    /// The address to listen at. Everyone who can reach it can see the scene.
    #[arg(long, default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    bind: IpAddr,
    /// A name that others reach this machine by, for --bind; can be given several times. Requests for other names are refused.
    #[arg(long = "name", value_name = "HOST")]
    names: Vec<String>,
    #[command(flatten)]
    clip: ClipArgs,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let scene = scene(args)?;
    let stop = Stop::listen()?;
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_all().build().context("no thread for a server")?;
    tokio::task::LocalSet::new().block_on(&runtime, serve(args, scene, &stop, json))
}

/// The bytes of the `.4dgs` that is sent.
fn scene(args: &Args) -> anyhow::Result<Bytes> {
    if let Some(bytes) = args.clip.as_it_is(&args.source)? {
        return Ok(bytes.into());
    }
    let splats = shown::open(&args.source)?.splats;
    say!("{}: put into a .4dgs", args.source.display());
    Ok(args.clip.bytes(&args.source, &splats)?.into())
}

async fn serve(args: &Args, scene: Bytes, stop: &Stop, json: bool) -> anyhow::Result<()> {
    let listener = TcpListener::bind(SocketAddr::new(args.bind, args.port)).await.with_context(|| {
        format!("expected a free port, found {} of {} taken or refused; give --port 0", args.port, args.bind)
    })?;
    let address = listener.local_addr().context("the port is gone")?;
    let url = format!("http://{address}/");
    if json {
        out!("{}", serde_json::json!({ "url": url }));
    } else {
        out!("{url}  (Ctrl-C ends it)");
    }
    if !args.bind.is_loopback() {
        alert!("everyone who can reach {} can see this scene", args.bind);
    }
    let site = Rc::new(Site::new(args, scene));
    let places = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    while !stop.is_asked() {
        let Ok(accepted) = tokio::time::timeout(GLANCE, listener.accept()).await else { continue };
        // A connection that broke before it began is the other side's matter; so is one too many.
        let (Ok((stream, _)), Ok(place)) = (accepted, places.clone().try_acquire_owned()) else { continue };
        let site = site.clone();
        tokio::task::spawn_local(async move {
            talk(stream, &site).await;
            drop(place);
        });
    }
    Ok(())
}

/// Answers the requests of a connection until it ends.
async fn talk(stream: TcpStream, site: &Rc<Site>) {
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(PATIENCE));
    let answer = hyper::service::service_fn(|request: Request<hyper::body::Incoming>| {
        let site = site.clone();
        async move { Ok::<_, Infallible>(site.answer(&request)) }
    });
    let mut server = hyper::server::conn::http1::Builder::new();
    server.timer(TokioTimer::new()).header_read_timeout(PATIENCE).max_buf_size(LONGEST_HEAD).half_close(true);
    // What a connection ends with is told to its other side, if to anyone.
    let _ = server.serve_connection(TokioIo::new(Box::pin(stream)), answer).await;
}

/// What there is to see.
struct Site {
    scene: Bytes,
    /// Names the scene's bytes.
    tag: String,
    /// Names and addresses that a request may be for, without ports.
    hosts: Vec<String>,
}

impl Site {
    fn new(args: &Args, scene: Bytes) -> Self {
        let tag: String = Sha256::digest(&scene)[..16].iter().map(|byte| format!("{byte:02x}")).collect();
        let literal = |address: IpAddr| match address {
            IpAddr::V4(address) => address.to_string(),
            IpAddr::V6(address) => format!("[{address}]"),
        };
        let own = ["localhost", "127.0.0.1", "[::1]"].map(str::to_owned).into_iter().chain([literal(args.bind)]);
        let hosts = own.chain(args.names.iter().map(|name| name.to_ascii_lowercase())).collect();
        Site { scene, tag: format!("\"{tag}\""), hosts }
    }

    /// The answer to a request, whatever its body.
    fn answer<B>(&self, request: &Request<B>) -> Response<Full<Bytes>> {
        let is_head = request.method() == Method::HEAD;
        let mut answer = self.found(request);
        let headers = answer.headers_mut();
        for (name, value) in [
            (header::CONTENT_SECURITY_POLICY, POLICY),
            (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
            (header::REFERRER_POLICY, "no-referrer"),
            (header::CACHE_CONTROL, "no-cache"),
            (header::HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        ] {
            headers.insert(name, HeaderValue::from_static(value));
        }
        if is_head { answer.map(|_| Full::default()) } else { answer }
    }

    fn found<B>(&self, request: &Request<B>) -> Response<Full<Bytes>> {
        if !matches!(*request.method(), Method::GET | Method::HEAD) {
            let mut answer = told(StatusCode::METHOD_NOT_ALLOWED, "expected GET or HEAD");
            answer.headers_mut().insert(header::ALLOW, HeaderValue::from_static("GET, HEAD"));
            return answer;
        }
        // A page of another site that had its name lead here could otherwise read the scene.
        if !self.is_ours(request) {
            return told(
                StatusCode::MISDIRECTED_REQUEST,
                "expected a request for this machine; --name allows another name",
            );
        }
        match request.uri().path().trim_start_matches('/') {
            SCENE => self.scene(request),
            "" => of_part("index.html"),
            name => of_part(name),
        }
    }

    fn is_ours<B>(&self, request: &Request<B>) -> bool {
        let named = request.headers().get(header::HOST).and_then(|host| host.to_str().ok());
        let host = named.or(request.uri().authority().map(hyper::http::uri::Authority::as_str)).unwrap_or_default();
        let name = match host.rsplit_once(':') {
            Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
            _ => host,
        };
        self.hosts.iter().any(|ours| *ours == name.to_ascii_lowercase())
    }

    /// The scene, or the part of it that is asked for.
    fn scene<B>(&self, request: &Request<B>) -> Response<Full<Bytes>> {
        let asked = |name: header::HeaderName| request.headers().get(name).and_then(|value| value.to_str().ok());
        let length = self.scene.len();
        let tagged = |mut answer: Response<Full<Bytes>>| {
            let headers = answer.headers_mut();
            headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
            headers.extend(HeaderValue::from_str(&self.tag).ok().map(|tag| (header::ETAG, tag)));
            answer
        };
        if asked(header::IF_NONE_MATCH).is_some_and(|tags| tags.split(',').any(|tag| tag.trim() == self.tag)) {
            return tagged(empty(StatusCode::NOT_MODIFIED));
        }
        // A part of what the browser has is of no use once that is another scene.
        let is_same = asked(header::IF_RANGE).is_none_or(|tag| tag == self.tag);
        let (status, range) = match asked(header::RANGE).filter(|_| is_same).map(|range| part_of(range, length)) {
            None | Some(Asked::Whole) => (StatusCode::OK, 0..length),
            Some(Asked::Range(range)) => (StatusCode::PARTIAL_CONTENT, range),
            Some(Asked::Beyond) => {
                let mut answer = empty(StatusCode::RANGE_NOT_SATISFIABLE);
                let value = HeaderValue::from_str(&format!("bytes */{length}"));
                answer.headers_mut().extend(value.ok().map(|value| (header::CONTENT_RANGE, value)));
                return tagged(answer);
            }
        };
        let mut answer = of_bytes(status, "application/octet-stream", self.scene.slice(range.clone()));
        if status == StatusCode::PARTIAL_CONTENT {
            let value = HeaderValue::from_str(&format!("bytes {}-{}/{length}", range.start, range.end - 1));
            answer.headers_mut().extend(value.ok().map(|value| (header::CONTENT_RANGE, value)));
        }
        tagged(answer)
    }
}

/// What a `Range` asks for.
#[derive(Debug, PartialEq)]
enum Asked {
    /// Everything: it asks for nothing that is understood, or for several parts.
    Whole,
    /// These bytes, at least one.
    Range(Range<usize>),
    /// None that there are.
    Beyond,
}

fn part_of(asked: &str, length: usize) -> Asked {
    let Some((from, to)) = asked.strip_prefix("bytes=").and_then(|range| range.split_once('-')) else {
        return Asked::Whole;
    };
    let number = |text: &str| text.parse::<usize>().ok().filter(|_| text.bytes().all(|byte| byte.is_ascii_digit()));
    let range = match (from, to) {
        ("", last) => number(last).map(|last| length.saturating_sub(last)..length),
        (from, "") => number(from).map(|from| from..length),
        (from, to) => number(from)
            .zip(number(to))
            .filter(|(from, to)| from <= to)
            .map(|(from, to)| from..to.saturating_add(1).min(length)),
    };
    match range {
        None => Asked::Whole,
        Some(range) if range.is_empty() => Asked::Beyond,
        Some(range) => Asked::Range(range),
    }
}

/// A file of the player.
fn of_part(name: &str) -> Response<Full<Bytes>> {
    page::part(name).map_or_else(
        || told(StatusCode::NOT_FOUND, "expected a file of the player, found none of this name"),
        |part| of_bytes(StatusCode::OK, part.media_type, Bytes::from_static(part.text.as_bytes())),
    )
}

fn told(status: StatusCode, text: &'static str) -> Response<Full<Bytes>> {
    of_bytes(status, "text/plain; charset=utf-8", Bytes::from_static(text.as_bytes()))
}

fn empty(status: StatusCode) -> Response<Full<Bytes>> {
    let mut answer = Response::new(Full::default());
    *answer.status_mut() = status;
    answer
}

fn of_bytes(status: StatusCode, media_type: &'static str, bytes: Bytes) -> Response<Full<Bytes>> {
    let mut answer = empty(status);
    let headers = answer.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type));
    headers.insert(header::CONTENT_LENGTH, HeaderValue::from(bytes.len()));
    answer.map(|_| Full::new(bytes))
}
