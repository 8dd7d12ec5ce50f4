//! `ivv serve`: the browser player with a scene, or with a run that trains, on this machine.

mod live;
mod scene;
mod site;

pub use live::LatestLine;

use crate::run::export_clip::ClipArgs;
use crate::run::source::{Source, final_scene, is_run};
use crate::ui::interrupt::Stop;
use crate::ui::screen::{alert, answer, say};
use anyhow::Context;
use hyper::Request;
use hyper_util::rt::{TokioIo, TokioTimer};
use ivv::internals::files::remove_temporaries;
use live::LiveRun;
use scene::{ServedScene, TemporaryFile};
use site::{Content, Site};
use std::convert::Infallible;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::sync::Semaphore;
use tokio_io_timeout::TimeoutStream;

/// Connections at a time; a browser opens six.
const MOST_CONNECTIONS: usize = 64;
/// Longest head of a request, bytes.
const LONGEST_HEAD: usize = 16 << 10;
/// How long a head may take, and how long a reader may take nothing.
const PATIENCE: Duration = Duration::from_secs(20);
/// How often a request to end is checked for.
const GLANCE: Duration = Duration::from_millis(100);

#[derive(clap::Args)]
pub struct Args {
    /// A scene file, or the folder of a run, whose page shows curves, test views and the newest checkpoint until it has ended.
    #[arg(value_name = "RUN|SCENE")]
    source: PathBuf,
    /// The port; 0 for any that is free.
    #[arg(long, default_value_t = 8080)]
    port: u16,
    /// The address to listen at. Anyone who can reach it can view the scene.
    #[arg(long, default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    bind: IpAddr,
    /// A name of this machine for others, with --bind; may be given several times. Requests for other names are refused.
    #[arg(long = "name", value_name = "HOST")]
    names: Vec<String>,
    #[command(flatten)]
    clip: ClipArgs,
}

pub fn run(args: &Args, json: bool) -> anyhow::Result<()> {
    let Args { source, bind, names, clip, .. } = args;
    let is_live = is_run(source) && final_scene(source).is_none();
    let content = if is_live { Content::Run(Rc::new(LiveRun::new(source, None, clip))) } else { scene(source, clip)? };
    let stop = Stop::listen()?;
    let listener = listen(*bind, args.port, "--port")?;
    let url = url(&listener)?;
    answer(json, &serde_json::json!({ "url": url }), format_args!("{url}  (Ctrl-C ends it)"));
    if !bind.is_loopback() {
        let address = url.trim_start_matches("http://").trim_end_matches('/');
        alert!("warning: anyone who can reach {address} can view the scene");
    }
    serve(listener, || Site::new(content, *bind, names), &|| stop.is_asked())
}

/// The `.4dgs` that is sent.
fn scene(source: &Path, clip: &ClipArgs) -> anyhow::Result<Content> {
    let source = Source::open(source)?;
    if clip.is_as_it_is(&source)? {
        return Ok(Content::File(source.path.to_owned()));
    }
    say!("{}: put into a .4dgs", source.path.display());
    let folder = std::env::temp_dir();
    // Of servers that were killed while they wrote. A scene that is sent from memory needs no such folder.
    let _ = remove_temporaries(&folder, 0);
    let file = TemporaryFile(folder.join(format!("ivv-serve-{}.4dgs", std::process::id())));
    if clip.write_parts(&source, &file.0)?.is_some() {
        return Ok(Content::Scene(ServedScene::of_file(&file.0.clone(), Some(file))?));
    }
    let splats = source.scene()?.splats;
    Ok(Content::Scene(ServedScene::new(clip.bytes(&source, splats)?.into())))
}

/// A server beside a training in this process.
pub struct BackgroundServer {
    is_over: Arc<AtomicBool>,
    server: Option<std::thread::JoinHandle<()>>,
}

impl BackgroundServer {
    /// Shows the run in `folder` at `port` of this machine; its training writes to `latest_line`. Prints the address.
    pub fn new(folder: &Path, port: u16, latest_line: LatestLine) -> anyhow::Result<Self> {
        let bind = IpAddr::V4(Ipv4Addr::LOCALHOST);
        let listener = listen(bind, port, "--view")?;
        say!("watch it: {}", url(&listener)?);
        let is_over = Arc::new(AtomicBool::new(false));
        let (folder, over) = (folder.to_owned(), is_over.clone());
        let site = move || {
            let live = LiveRun::new(&folder, Some(latest_line), &ClipArgs::default());
            Site::new(Content::Run(Rc::new(live)), bind, &[])
        };
        let server = std::thread::Builder::new().name("view".to_owned()).spawn(move || {
            if let Err(fault) = serve(listener, site, &|| over.load(Ordering::Relaxed)) {
                alert!("the page of the run has stopped: {fault:#}");
            }
        });
        Ok(BackgroundServer { is_over, server: Some(server.context("no thread for a server")?) })
    }
}

impl Drop for BackgroundServer {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.server.take().map(std::thread::JoinHandle::join);
    }
}

/// Listens at an address and the port of `option`.
fn listen(bind: IpAddr, port: u16, option: &str) -> anyhow::Result<TcpListener> {
    TcpListener::bind(SocketAddr::new(bind, port))
        .with_context(|| format!("expected a free port, found {port} of {bind} taken or refused; give {option} 0"))
}

fn url(listener: &TcpListener) -> anyhow::Result<String> {
    Ok(format!("http://{}/", listener.local_addr().context("the port is gone")?))
}

/// Answers until `is_over`.
fn serve(listener: TcpListener, site: impl FnOnce() -> Site, is_over: &dyn Fn() -> bool) -> anyhow::Result<()> {
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_all().build().context("no thread for a server")?;
    tokio::task::LocalSet::new().block_on(&runtime, async {
        listener.set_nonblocking(true)?;
        let listener = tokio::net::TcpListener::from_std(listener)?;
        let site = Rc::new(site());
        let places = Arc::new(Semaphore::new(MOST_CONNECTIONS));
        while !is_over() {
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
    })
}

async fn talk(stream: TcpStream, site: &Rc<Site>) {
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(PATIENCE));
    let answer = hyper::service::service_fn(|request: Request<hyper::body::Incoming>| {
        let site = site.clone();
        async move { Ok::<_, Infallible>(site.answer(&request).await) }
    });
    let mut server = hyper::server::conn::http1::Builder::new();
    server.timer(TokioTimer::new()).header_read_timeout(PATIENCE).max_buf_size(LONGEST_HEAD).half_close(true);
    // An error of a connection concerns only its other side.
    let _ = server.serve_connection(TokioIo::new(Box::pin(stream)), answer).await;
}
