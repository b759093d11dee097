//! The page at `http://127.0.0.1:8080`: a web server for a running robot or a recording; and the server for Foxglove and
//! Lichtblick at `ws://127.0.0.1:8765` for a running robot.
//!
//! The state goes to each client as fast as it takes it, newest only: a slow client skips, one that does not read is dropped.
//! Nothing that a client does reaches the robot except through the commands, which a few workers carry out.

mod command;
mod feeder;
mod foxglove;
mod hub;
mod operator;
mod page;
mod routes;
mod security;

use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{sleep, timeout};

use crate::live::LiveRobot;
use crate::recording::Player;
use command::{Commander, Job, Line};
pub use foxglove::FOXGLOVE_PORT;
use foxglove::{Deflection, Foxglove};
use hub::{Hub, Title};
pub use routes::TOKEN_HEADER;
use routes::{Connection, Shared};
use security::Security;

/// Port, unless another one is chosen.
pub const DEFAULT_PORT: u16 = 8080;
/// Maximum number of connections from this machine, and again from all others.
const MAX_CONNECTIONS: usize = 128;
/// Time within which a client sends the header of a request.
const HEADER_TIMEOUT: Duration = Duration::from_secs(5);
/// Time after which a connection that is no web socket is closed; browsers open a new one.
const CONNECTION_TIME: Duration = Duration::from_secs(60);
/// Time for a request in progress when its connection is closed.
const CLOSING_TIME: Duration = Duration::from_secs(5);
/// Pause after a connection that could not be accepted.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);
/// Time between two looks whether the server is to end.
const END_CHECK: Duration = Duration::from_millis(50);

/// The robot that is shown.
pub enum Source {
    /// A running robot.
    Robot(Box<LiveRobot>),
    /// A recording.
    Recording(Box<Player>),
}

/// Settings of a server.
#[derive(Clone, Debug)]
pub struct ServerSettings {
    /// Address of this machine to serve other machines at; `None` serves this machine only.
    pub listen: Option<IpAddr>,
    /// Port; zero takes a free one.
    pub port: u16,
    /// Folder for recordings of the last minute.
    pub folder: PathBuf,
    /// Server for Foxglove and Lichtblick; there is none for a recording, which they open themselves.
    pub foxglove: FoxglovePort,
    /// Sites whose pages are admitted as viewers besides the known ones, such as `http://lichtblick.lan`.
    pub viewers: Vec<String>,
}

/// Port for Foxglove and Lichtblick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FoxglovePort {
    /// No server.
    Off,
    /// The one that Foxglove proposes; if it is taken, no server.
    #[default]
    IfFree,
    /// This port; zero takes a free one.
    At(u16),
}

/// Failure to start a server.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The address is taken, or is none of this machine.
    #[error("cannot serve at {address}: {source}; choose another with --port, --foxglove or --listen")]
    Address {
        /// Address.
        address: SocketAddr,
        /// Cause.
        source: std::io::Error,
    },
    /// The system refused something.
    #[error("the server did not start: {0}")]
    System(#[from] std::io::Error),
}

/// A running server; it ends when it is dropped.
pub struct Server {
    address: SocketAddr,
    foxglove: Option<SocketAddr>,
    token: Option<String>,
    is_over: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Server {
    /// Starts a server for `source`.
    ///
    /// # Errors
    /// The address is taken, or the system refused something.
    pub fn start(source: Source, settings: &ServerSettings) -> Result<Server, ServerError> {
        let ip = settings.listen.unwrap_or(Ipv4Addr::LOCALHOST.into());
        let (listener, address) = listen(ip, settings.port)?;
        let security = if settings.listen.is_some() { Security::open()? } else { Security::local() };
        let security = security.with_viewers(&settings.viewers);
        let token = security.token().map(str::to_owned);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
        let (hub, is_over) = (Arc::new(Hub::new(title(&source))), Arc::new(AtomicBool::new(false)));
        let threads = Vec::new();
        let mut server = Server { address, foxglove: None, token, is_over: Arc::clone(&is_over), threads };
        let (shared, viewers) = match source {
            Source::Robot(robot) => {
                let (commander, lines) = Commander::open([Line::Stop, Line::Robot]);
                let shared = Arc::new(Shared { hub, commander, security });
                let for_viewers = listen_for_viewers(ip, settings.foxglove)?;
                server.foxglove = for_viewers.as_ref().map(|(_, address)| *address);
                let foxglove = for_viewers.as_ref().map(|_| Foxglove::new(Arc::clone(&shared)));
                let foxglove = server.start_robot(*robot, &shared, lines, &settings.folder, foxglove)?;
                (shared, for_viewers.map(|(listener, _)| listener).zip(foxglove))
            }
            Source::Recording(player) => {
                let (commander, [jobs]) = Commander::open([Line::Playback]);
                let shared = Arc::new(Shared { hub, commander, security });
                let (hub, is_over) = (Arc::clone(&shared.hub), Arc::clone(&is_over));
                server.start_thread("playback", move || feeder::play(*player, &hub, &jobs, &is_over))?;
                (shared, None)
            }
        };
        let router = routes::router(shared);
        server.start_thread("server", move || {
            runtime.block_on(async {
                if let Some((listener, viewers)) = viewers {
                    tokio::spawn(accept(listener, foxglove::router(viewers)));
                }
                tokio::select! {
                    () = accept(listener, router) => {}
                    () = end(&is_over) => {}
                }
            });
            runtime.shutdown_background();
        })?;
        Ok(server)
    }

    /// Starts the threads of a running robot.
    fn start_robot(
        &mut self,
        robot: LiveRobot,
        shared: &Arc<Shared>,
        [stops, jobs]: [Receiver<Job>; 2],
        folder: &Path,
        foxglove: Option<(Foxglove, Receiver<Deflection>)>,
    ) -> Result<Option<Arc<Foxglove>>, ServerError> {
        let (name, recent) = (robot.robot().to_owned(), robot.recent());
        let (for_stops, for_teleop, folder) = (name.clone(), name.clone(), folder.to_owned());
        self.start_thread("stops", move || operator::stop(&for_stops, &stops))?;
        self.start_thread("operator", move || operator::operate(&name, &recent, &folder, &jobs))?;
        let foxglove = match foxglove {
            Some((foxglove, deflections)) => {
                self.start_thread("teleop", move || foxglove::drive(&for_teleop, &deflections))?;
                Some(Arc::new(foxglove))
            }
            None => None,
        };
        let (hub, is_over) = (Arc::clone(&shared.hub), Arc::clone(&self.is_over));
        let viewers = foxglove.clone();
        self.start_thread("robot", move || feeder::follow(robot, &hub, viewers, &is_over))?;
        Ok(foxglove)
    }

    fn start_thread(&mut self, name: &str, work: impl FnOnce() + Send + 'static) -> std::io::Result<()> {
        self.threads.push(std::thread::Builder::new().name(name.to_owned()).spawn(work)?);
        Ok(())
    }

    /// Address that it serves at.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Address for Foxglove and Lichtblick, with the token; `None` if there is none.
    pub fn foxglove_url(&self) -> Option<String> {
        self.foxglove.map(|address| format!("ws://{address}/{}", self.query()))
    }

    /// Token that commands need; `None` if they need none.
    pub fn token(&self) -> Option<&str> {
        self.token.as_deref()
    }

    /// Address of the page, with the token.
    pub fn url(&self) -> String {
        format!("http://{}/{}", self.address, self.query())
    }

    fn query(&self) -> String {
        self.token.as_ref().map_or(String::new(), |token| format!("?token={token}"))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        // In the reverse order: the workers end when the server has dropped their channels.
        while let Some(thread) = self.threads.pop() {
            let _ = thread.join();
        }
    }
}

fn listen(ip: IpAddr, port: u16) -> Result<(TcpListener, SocketAddr), ServerError> {
    let address = SocketAddr::new(ip, port);
    let listener = TcpListener::bind(address).map_err(|source| ServerError::Address { address, source })?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    Ok((listener, address))
}

/// Listener for Foxglove and Lichtblick, if there is to be one.
fn listen_for_viewers(
    ip: IpAddr,
    port: FoxglovePort,
) -> Result<Option<(TcpListener, SocketAddr)>, ServerError> {
    match port {
        FoxglovePort::Off => Ok(None),
        FoxglovePort::At(port) => listen(ip, port).map(Some),
        FoxglovePort::IfFree => {
            let problem = |error: &ServerError| tracing::warn!("not served for Foxglove: {error}");
            Ok(listen(ip, FOXGLOVE_PORT).inspect_err(problem).ok())
        }
    }
}

fn title(source: &Source) -> Title {
    match source {
        Source::Robot(robot) => Title { title: robot.robot().to_owned(), duration_s: None },
        Source::Recording(player) => {
            let recording = player.recording();
            let duration_s = Some(recording.duration_s());
            Title { title: recording.path().display().to_string(), duration_s }
        }
    }
}

/// Serves connections for ever.
async fn accept(listener: TcpListener, router: Router) {
    let listener = match tokio::net::TcpListener::from_std(listener) {
        Ok(listener) => listener,
        Err(error) => return tracing::error!("the server failed: {error}"),
    };
    let (here, elsewhere) =
        (Arc::new(Semaphore::new(MAX_CONNECTIONS)), Arc::new(Semaphore::new(MAX_CONNECTIONS)));
    loop {
        let Ok((stream, peer)) = listener.accept().await else {
            sleep(ACCEPT_PAUSE).await;
            continue;
        };
        let permits = if peer.ip().to_canonical().is_loopback() { &here } else { &elsewhere };
        // Without a permit the connection is closed.
        if let Ok(permit) = Arc::clone(permits).try_acquire_owned() {
            tokio::spawn(serve(stream, peer, permit, router.clone()));
        }
    }
}

async fn serve(stream: TcpStream, peer: SocketAddr, permit: OwnedSemaphorePermit, router: Router) {
    let _ = stream.set_nodelay(true);
    let connection = Connection { peer, permit: Arc::new(permit) };
    let service = TowerToHyperService::new(router.layer(Extension(connection)));
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEADER_TIMEOUT)
        .max_buf_size(64 * 1024)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades();
    tokio::pin!(served);
    tokio::select! {
        _ = served.as_mut() => {}
        () = sleep(CONNECTION_TIME) => {
            served.as_mut().graceful_shutdown();
            let _ = timeout(CLOSING_TIME, served).await;
        }
    }
}

async fn end(is_over: &AtomicBool) {
    while !is_over.load(Ordering::Relaxed) {
        sleep(END_CHECK).await;
    }
}
