//! The answers of the server of a scene or a run.

use super::live::{Events, LiveRun};
use super::scene::{FilePart, ServedScene};
use crate::run::player::{LIVE_PAGE, PLAYER_FILES, POLICY, PlayerFile, SCENE};
use bytes::Bytes;
use http_body_util::{Either, Full};
use hyper::header::{self, HeaderValue};
use hyper::{Method, Request, Response, StatusCode};
use std::net::IpAddr;
use std::ops::Range;
use std::path::PathBuf;
use std::rc::Rc;

/// The scene or run that is served.
pub enum Content {
    Scene(ServedScene),
    /// The scene in this file, which others may replace.
    File(PathBuf),
    Run(Rc<LiveRun>),
}

pub struct Site {
    content: Content,
    /// Names and addresses that a request may be for, without ports.
    hosts: Vec<String>,
    /// True if it listens at every address of this machine, so that a request may be for any address.
    is_everywhere: bool,
}

type StaticBody = Either<Full<Bytes>, FilePart>;
type AnyBody = Either<StaticBody, Events>;

impl Site {
    /// At an address, to requests for that and for `names`.
    pub fn new(content: Content, bind: IpAddr, names: &[String]) -> Self {
        let literal = |address: IpAddr| match address {
            IpAddr::V4(address) => address.to_string(),
            IpAddr::V6(address) => format!("[{address}]"),
        };
        let own = ["localhost", "127.0.0.1", "[::1]"].map(str::to_owned).into_iter().chain([literal(bind)]);
        let hosts = own.chain(names.iter().map(|name| name.to_ascii_lowercase())).collect();
        Site { content, hosts, is_everywhere: bind.is_unspecified() }
    }

    pub async fn answer<B>(&self, request: &Request<B>) -> Response<AnyBody> {
        let is_head = request.method() == Method::HEAD;
        let mut answer = match &self.content {
            Content::Run(live) if request.uri().path() == "/events" && self.refused(request).is_none() && !is_head => {
                let mut answer = Response::new(Either::Right(Events::new(live.clone())));
                answer.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("text/event-stream"));
                answer
            }
            _ => self.found(request).await.map(Either::Left),
        };
        let headers = answer.headers_mut();
        for (name, value) in [
            (header::CONTENT_SECURITY_POLICY, POLICY),
            (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
            (header::REFERRER_POLICY, "no-referrer"),
            (header::CACHE_CONTROL, "no-cache"),
            (header::HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        ] {
            headers.entry(name).or_insert(HeaderValue::from_static(value));
        }
        if is_head { answer.map(|_| Either::Left(Either::Left(Full::default()))) } else { answer }
    }

    fn refused<B>(&self, request: &Request<B>) -> Option<Response<Full<Bytes>>> {
        if !matches!(*request.method(), Method::GET | Method::HEAD) {
            let mut answer = plain_text(StatusCode::METHOD_NOT_ALLOWED, "expected GET or HEAD");
            answer.headers_mut().insert(header::ALLOW, HeaderValue::from_static("GET, HEAD"));
            return Some(answer);
        }
        // A page of another site that had its name lead here could otherwise read the scene.
        if !self.is_ours(request) {
            let text = "expected a request for this machine; --name allows another name";
            return Some(plain_text(StatusCode::MISDIRECTED_REQUEST, text));
        }
        None
    }

    async fn found<B>(&self, request: &Request<B>) -> Response<StaticBody> {
        if let Some(refused) = self.refused(request) {
            return refused.map(Either::Left);
        }
        let path = request.uri().path().trim_start_matches('/');
        let other = match &self.content {
            Content::Scene(scene) if path == SCENE => return of_scene(scene, request),
            Content::File(file) if path == SCENE => match ServedScene::of_file(file, None) {
                Ok(scene) => return of_scene(&scene, request),
                Err(_) => not_found("expected the file of the scene, found none that can be read"),
            },
            Content::Scene(_) | Content::File(_) => of_part(PLAYER_FILES, path),
            Content::Run(live) => match path.strip_prefix("at/").and_then(|rest| rest.split_once('/')) {
                Some((name, SCENE)) => match live.scene(name).await {
                    Some(scene) => return of_scene(&scene, request),
                    None => not_found("expected one of the newest scenes, found none of this name"),
                },
                Some((_, rest)) => of_part(PLAYER_FILES, rest),
                None if path == "report.html" => of_report(live),
                None if path == "icon.svg" => of_part(PLAYER_FILES, path),
                None => of_part(LIVE_PAGE, path),
            },
        };
        other.map(Either::Left)
    }

    fn is_ours<B>(&self, request: &Request<B>) -> bool {
        let named = request.headers().get(header::HOST).and_then(|host| host.to_str().ok());
        let host = named.or(request.uri().authority().map(hyper::http::uri::Authority::as_str)).unwrap_or_default();
        let name = match host.rsplit_once(':') {
            Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
            _ => host,
        };
        // Another site can make a name lead here, never an address.
        let is_address = || name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>().is_ok();
        self.hosts.iter().any(|ours| *ours == name.to_ascii_lowercase()) || (self.is_everywhere && is_address())
    }
}

fn of_scene<B>(scene: &ServedScene, request: &Request<B>) -> Response<StaticBody> {
    let tag = &scene.tag;
    let asked = |name: header::HeaderName| request.headers().get(name).and_then(|value| value.to_str().ok());
    let length = scene.len();
    let tagged = |mut answer: Response<StaticBody>| {
        let headers = answer.headers_mut();
        headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        headers.extend(HeaderValue::from_str(tag).ok().map(|tag| (header::ETAG, tag)));
        answer
    };
    if asked(header::IF_NONE_MATCH).is_some_and(|tags| tags.split(',').any(|known| known.trim() == tag)) {
        return tagged(empty(StatusCode::NOT_MODIFIED).map(Either::Left));
    }
    // A part of an older scene is of no use to the browser.
    let is_same = asked(header::IF_RANGE).is_none_or(|known| known == tag);
    let (status, range) = match asked(header::RANGE).filter(|_| is_same).map(|range| part_of(range, length)) {
        None | Some(ByteRange::Whole) => (StatusCode::OK, 0..length),
        Some(ByteRange::Part(range)) => (StatusCode::PARTIAL_CONTENT, range),
        Some(ByteRange::Beyond) => {
            let mut answer = empty(StatusCode::RANGE_NOT_SATISFIABLE);
            let value = HeaderValue::from_str(&format!("bytes */{length}"));
            answer.headers_mut().extend(value.ok().map(|value| (header::CONTENT_RANGE, value)));
            return tagged(answer.map(Either::Left));
        }
    };
    let mut answer = of_length(status, "application/octet-stream", range.len());
    if status == StatusCode::PARTIAL_CONTENT {
        let value = HeaderValue::from_str(&format!("bytes {}-{}/{length}", range.start, range.end - 1));
        answer.headers_mut().extend(value.ok().map(|value| (header::CONTENT_RANGE, value)));
    }
    tagged(answer.map(|_| scene.part(range)))
}

/// The report so far. It is a page of its own, without scripts.
fn of_report(live: &LiveRun) -> Response<Full<Bytes>> {
    let Some(report) = live.report() else {
        return not_found("expected a report, found none yet: it comes with the first evaluation");
    };
    let mut answer = of_bytes(StatusCode::OK, "text/html; charset=utf-8", report.into());
    let policy = HeaderValue::from_static("default-src 'none'; style-src 'unsafe-inline'; img-src data:");
    answer.headers_mut().insert(header::CONTENT_SECURITY_POLICY, policy);
    answer
}

/// The bytes that a `Range` header requests.
#[derive(Debug, PartialEq)]
enum ByteRange {
    /// Everything: the header is not understood, or asks for several parts.
    Whole,
    Part(Range<usize>),
    /// Beyond the end.
    Beyond,
}

fn part_of(asked: &str, length: usize) -> ByteRange {
    let Some((from, to)) = asked.strip_prefix("bytes=").and_then(|range| range.split_once('-')) else {
        return ByteRange::Whole;
    };
    let number = |text: &str| text.parse::<usize>().ok().filter(|_| text.bytes().all(|byte| byte.is_ascii_digit()));
    let range = match (number(from), number(to)) {
        (None, Some(last)) if from.is_empty() => length.saturating_sub(last)..length,
        (Some(from), None) if to.is_empty() => from..length,
        (Some(from), Some(to)) if from <= to => from..to.saturating_add(1).min(length),
        _ => return ByteRange::Whole,
    };
    if range.is_empty() { ByteRange::Beyond } else { ByteRange::Part(range) }
}

/// A file of the page; its first one where none is named.
fn of_part(parts: &'static [PlayerFile], name: &str) -> Response<Full<Bytes>> {
    let name = if name.is_empty() { "index.html" } else { name };
    parts.iter().find(|part| part.name == name).map_or_else(
        || not_found("expected a file of the page, found none of this name"),
        |part| of_bytes(StatusCode::OK, part.media_type(), Bytes::from_static(part.text.as_bytes())),
    )
}

fn not_found(text: &'static str) -> Response<Full<Bytes>> {
    plain_text(StatusCode::NOT_FOUND, text)
}

fn plain_text(status: StatusCode, text: &'static str) -> Response<Full<Bytes>> {
    of_bytes(status, "text/plain; charset=utf-8", Bytes::from_static(text.as_bytes()))
}

fn empty(status: StatusCode) -> Response<Full<Bytes>> {
    let mut answer = Response::new(Full::default());
    *answer.status_mut() = status;
    answer
}

fn of_bytes(status: StatusCode, media_type: &'static str, bytes: Bytes) -> Response<Full<Bytes>> {
    of_length(status, media_type, bytes.len()).map(|_| Full::new(bytes))
}

/// The head of an answer whose body is still to come.
fn of_length(status: StatusCode, media_type: &'static str, length: usize) -> Response<Full<Bytes>> {
    let mut answer = empty(status);
    let headers = answer.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type));
    headers.insert(header::CONTENT_LENGTH, HeaderValue::from(length));
    answer
}
