//! Server for Foxglove and Lichtblick: the records of a recording, live, and the commands of the page as services.
//!
//! It speaks the subprotocol `foxglove.sdk.v1`, in text and binary messages over a web socket. The server of the crate `foxglove`
//! is not used: it checks neither `Origin` nor `Host` nor a token, so that any web page could drive the robot.

mod client;
mod feed;
mod graph;
mod parameters;
mod protocol;
mod services;
mod session;
mod teleop;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use axum::Router;
use axum::extract::ws::{WebSocketUpgrade, rejection::WebSocketUpgradeRejection};
use axum::extract::{Extension, Request, State};
use axum::http::{HeaderValue, StatusCode, Uri, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use tokio::sync::watch;

use super::routes::{Connection, Shared};
pub(super) use feed::Feed;
use parameters::Parameter;
use session::Session;
pub(super) use teleop::{Deflection, drive};

/// Port, unless another one is chosen: the one that Foxglove proposes.
pub const FOXGLOVE_PORT: u16 = 8765;
/// Subprotocols, the preferred one first; the second is an earlier name of the same protocol.
const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// Maximum size of a message of a client, bytes.
const MAX_MESSAGE_BYTES: usize = 64 * 1024;
/// Maximum number of deflections of the stick that wait.
const MAX_DEFLECTIONS: usize = 4;

/// Everything that the clients share.
pub(super) struct Foxglove {
    shared: Arc<Shared>,
    sessions: watch::Sender<Arc<Session>>,
    parameters: watch::Sender<Arc<Vec<Parameter>>>,
    stick: SyncSender<Deflection>,
}

impl Foxglove {
    /// Server without a robot; the receiver is for [`drive`].
    pub fn new(shared: Arc<Shared>) -> (Foxglove, Receiver<Deflection>) {
        let (stick, deflections) = sync_channel(MAX_DEFLECTIONS);
        let (sessions, parameters) = (watch::Sender::default(), watch::Sender::default());
        (Foxglove { shared, sessions, parameters, stick }, deflections)
    }
}

/// Addresses of the server: every path is the web socket.
pub(super) fn router(foxglove: Arc<Foxglove>) -> Router {
    Router::new()
        .fallback(connect)
        .layer(from_fn_with_state(Arc::clone(&foxglove), guard))
        .with_state(foxglove)
}

/// Refuses requests from elsewhere.
async fn guard(State(foxglove): State<Arc<Foxglove>>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let text = |name| headers.get(name).map(|value: &HeaderValue| value.to_str().unwrap_or(""));
    match foxglove.shared.security.check_viewer(text(header::HOST), text(header::ORIGIN)) {
        Ok(()) => next.run(request).await,
        Err(problem) => {
            tracing::warn!("a viewer was refused: {problem}");
            (StatusCode::FORBIDDEN, problem).into_response()
        }
    }
}

async fn connect(
    State(foxglove): State<Arc<Foxglove>>,
    Extension(connection): Extension<Connection>,
    uri: Uri,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let Ok(upgrade) = upgrade else {
        let hint =
            "this is no page: open this address, with ws:// instead of http://, in Foxglove or Lichtblick";
        return (StatusCode::UPGRADE_REQUIRED, hint).into_response();
    };
    let upgrade = upgrade.protocols(SUBPROTOCOLS);
    if upgrade.selected_protocol().is_none() {
        let problem = format!("the client speaks none of the subprotocols {}", SUBPROTOCOLS.join(", "));
        return (StatusCode::BAD_REQUEST, problem).into_response();
    }
    let token = uri.query().and_then(|query| query.strip_prefix("token=")).map(str::to_owned);
    let upgrade = upgrade.max_message_size(MAX_MESSAGE_BYTES).max_frame_size(MAX_MESSAGE_BYTES);
    // Nothing is gathered in memory: a message goes to the system at once, or waits.
    upgrade.write_buffer_size(0).on_upgrade(|socket| client::serve(socket, foxglove, connection, token))
}
