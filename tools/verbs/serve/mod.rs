//! `ivv serve`: the browser player with a scene, or with a run that trains, on this machine.

mod held;
mod live;
mod site;

pub use live::Said;

use crate::export_clip::ClipArgs;
use crate::interrupt::Stop;
use crate::screen::{alert, out, say};
use crate::shown::{Source, is_run, scene_of_end};
use anyhow::Context;
use held::{Removed, Scene};
use hyper::Request;
use hyper_util::rt::{TokioIo, TokioTimer};
use ivv::files::remove_temporaries;
use live::Live;
use site::{Shown, Site};
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
/// How often the end that was asked for is looked for.
const GLANCE: Duration = Duration::from_millis(100);

/// Options of `ivv serve`.
#[derive(clap::Args)]
pub struct Args {
    /// The folder of a run, or a scene file: a .4dgs is sent as it is, others are put into one first. Of a run that has not ended
    /// the page shows its course, its test views, and the scene as of its newest checkpoint.
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
    let Args { source, bind, names, clip, .. } = args;
    let is_live = is_run(source) && scene_of_end(source).is_none();
    let shown = if is_live { Shown::Run(Rc::new(Live::new(source, None, clip))) } else { scene(source, clip)? };
    let stop = Stop::listen()?;
    let listener = listen(*bind, args.port, "--port")?;
    let url = url(&listener)?;
    if json {
        out!("{}", serde_json::json!({ "url": url }));
    } else {
        out!("{url}  (Ctrl-C ends it)");
    }
    if !bind.is_loopback() {
        alert!("everyone who can reach {} can see this", url.trim_start_matches("http://").trim_end_matches('/'));
    }
    serve(listener, || Site::new(shown, *bind, names), &|| stop.is_asked())
}

/// The `.4dgs` that is sent.
fn scene(source: &Path, clip: &ClipArgs) -> anyhow::Result<Shown> {
    let source = Source::open(source)?;
    if clip.is_as_it_is(&source)? {
        return Ok(Shown::File(source.path.to_owned()));
    }
    say!("{}: put into a .4dgs", source.path.display());
    let folder = std::env::temp_dir();
    // Of servers that were killed while they wrote. A scene that is sent from memory needs no such folder.
    let _ = remove_temporaries(&folder, 0);
    let beside = Removed(folder.join(format!("ivv-serve-{}.4dgs", std::process::id())));
    if clip.write_parts(&source, &beside.0)?.is_some() {
        return Ok(Shown::Scene(Scene::of_file(&beside.0.clone(), Some(beside))?));
    }
    let splats = source.scene()?.splats;
    Ok(Shown::Scene(Scene::new(clip.bytes(&source, splats)?.into())))
}

/// A server of a training in this process, which ends with it.
pub struct Beside {
    is_over: Arc<AtomicBool>,
    server: Option<std::thread::JoinHandle<()>>,
}

impl Beside {
    /// Shows the run in `folder` at `port` of this machine; `said` is what its training says. Says where.
    pub fn new(folder: &Path, port: u16, said: Said) -> anyhow::Result<Self> {
        let bind = IpAddr::V4(Ipv4Addr::LOCALHOST);
        let listener = listen(bind, port, "--view")?;
        say!("watch it: {}", url(&listener)?);
        let is_over = Arc::new(AtomicBool::new(false));
        let (folder, over) = (folder.to_owned(), is_over.clone());
        let site = move || {
            let live = Live::new(&folder, Some(said), &ClipArgs::default());
            Site::new(Shown::Run(Rc::new(live)), bind, &[])
        };
        let server = std::thread::Builder::new().name("view".to_owned()).spawn(move || {
            if let Err(fault) = serve(listener, site, &|| over.load(Ordering::Relaxed)) {
                alert!("the run cannot be watched any more: {fault:#}");
            }
        });
        Ok(Beside { is_over, server: Some(server.context("no thread for a server")?) })
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.server.take().map(std::thread::JoinHandle::join);
    }
}

/// At an address and a port, which `option` gives.
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

/// Answers the requests of a connection until it ends.
async fn talk(stream: TcpStream, site: &Rc<Site>) {
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(PATIENCE));
    let answer = hyper::service::service_fn(|request: Request<hyper::body::Incoming>| {
        let site = site.clone();
        async move { Ok::<_, Infallible>(site.answer(&request).await) }
    });
    let mut server = hyper::server::conn::http1::Builder::new();
    server.timer(TokioTimer::new()).header_read_timeout(PATIENCE).max_buf_size(LONGEST_HEAD).half_close(true);
    // An error that ends a connection concerns its other side alone.
    let _ = server.serve_connection(TokioIo::new(Box::pin(stream)), answer).await;
}
