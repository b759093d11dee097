//! The addresses of the server: the page, the pictures, the state and the commands.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Bytes;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{DefaultBodyLimit, Extension, Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use serde_json::json;
use tokio::sync::OwnedSemaphorePermit;
use tokio::time::timeout;

use super::command::{Command, Commander, Line};
use super::hub::{Cursor, Hub};
use super::page::PAGE;
use super::security::Security;

/// Header with the token.
pub const TOKEN_HEADER: &str = "x-yamabico-token";
/// Maximum size of a command, bytes.
const MAX_COMMAND_BYTES: usize = 16 * 1024;
/// Maximum size of a message that a client sends over its web socket, bytes; none is expected.
const MAX_SOCKET_BYTES: usize = 4 * 1024;
/// Number of unexpected messages after which a client is dropped.
const MAX_UNEXPECTED: u32 = 100;
/// Time within which a client takes a message; a slower one is dropped.
pub(super) const CLIENT_TIMEOUT: Duration = Duration::from_secs(5);
/// Longest wait for the answer to a command.
pub(super) const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);

/// Headers of every answer: the page loads nothing from elsewhere, is shown in no other page's frame, and its address, which
/// may hold the token, is sent to no other site.
const HEADERS: [(header::HeaderName, &str); 5] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'self'; img-src 'self' blob: data:; connect-src 'self' ws:; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
];

/// Everything that a request needs.
pub(super) struct Shared {
    pub hub: Arc<Hub>,
    pub commander: Commander,
    pub security: Security,
}

/// The connection that a request came over.
#[derive(Clone)]
pub(super) struct Connection {
    pub peer: SocketAddr,
    /// Held until the connection ends, also after it has become a web socket.
    pub permit: Arc<OwnedSemaphorePermit>,
}

/// All addresses of the server.
pub(super) fn router(shared: Arc<Shared>) -> Router {
    let pages = PAGE.iter().fold(Router::new(), |router, file| {
        let headers = [(header::CONTENT_TYPE, file.media_type)];
        router.route(file.path, get(move || async move { (headers, file.contents) }))
    });
    pages
        .route("/ws", get(web_socket))
        .route("/state", get(state))
        .route("/picture/{*topic}", get(picture))
        .route("/overlay/{*topic}", get(overlay))
        .route("/command", post(command))
        .layer(DefaultBodyLimit::max(MAX_COMMAND_BYTES))
        .layer(from_fn_with_state(Arc::clone(&shared), guard))
        .with_state(shared)
}

/// Refuses requests from elsewhere, and adds the headers of every answer.
async fn guard(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let checked = {
        let headers = request.headers();
        let text = |name| headers.get(name).map(|value: &HeaderValue| value.to_str().unwrap_or(""));
        shared.security.check_site(text(header::HOST), text(header::ORIGIN))
    };
    let mut response = match checked {
        Ok(()) => next.run(request).await,
        Err(problem) => (StatusCode::FORBIDDEN, problem).into_response(),
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// The newest state once, as the first message of the web socket.
async fn state(State(shared): State<Arc<Shared>>) -> Response {
    let mut updates = shared.hub.subscribe();
    match timeout(CLIENT_TIMEOUT, updates.changed()).await {
        Ok(Ok(())) => {
            let update = Arc::clone(&updates.borrow_and_update());
            let text = shared.hub.message(&update, &mut Cursor::default());
            ([(header::CONTENT_TYPE, "application/json")], text).into_response()
        }
        _ => StatusCode::SERVICE_UNAVAILABLE.into_response(),
    }
}

/// A picture of the camera `topic`: with the stamp of the query, or the newest.
async fn picture(State(shared): State<Arc<Shared>>, Path(topic): Path<String>, uri: Uri) -> Response {
    let stamp_ns = uri.query().and_then(|query| query.parse().ok());
    match shared.hub.picture(&topic, stamp_ns) {
        Some(picture) => {
            let headers = [
                (header::CONTENT_TYPE.as_str(), picture.media_type.to_owned()),
                ("x-stamp", picture.header.stamp_ns.to_string()),
            ];
            (headers, Bytes::copy_from_slice(&picture.data)).into_response()
        }
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

/// Overlays over the picture of the camera `topic` with the stamp of the query.
async fn overlay(State(shared): State<Arc<Shared>>, Path(topic): Path<String>, uri: Uri) -> Response {
    let stamp_ns = uri.query().and_then(|query| query.parse().ok()).unwrap_or_default();
    let overlays = json!(shared.hub.overlays(&topic, stamp_ns)).to_string();
    ([(header::CONTENT_TYPE, "application/json")], overlays).into_response()
}

/// Carries out a command and answers with its effect, or with the cause why it had none.
async fn command(
    State(shared): State<Arc<Shared>>,
    Extension(connection): Extension<Connection>,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    let refusal = |status: StatusCode, problem: &str| {
        (status, [(header::CONTENT_TYPE, "application/json")], json!({ "error": problem }).to_string())
            .into_response()
    };
    let command: Command = match serde_json::from_slice(&body) {
        Ok(command) => command,
        Err(error) => return refusal(StatusCode::BAD_REQUEST, &format!("no command: {error}")),
    };
    let token = headers.get(TOKEN_HEADER).and_then(|token| token.to_str().ok());
    if !shared.security.may_command(token, connection.peer, command.line() == Line::Stop) {
        let problem = "commands need the token: open the address that `yamabico view` printed";
        return refusal(StatusCode::FORBIDDEN, problem);
    }
    let answer = match shared.commander.send(command) {
        Ok(answer) => answer,
        Err(problem) => return refusal(StatusCode::SERVICE_UNAVAILABLE, &problem),
    };
    match timeout(ANSWER_TIMEOUT, answer).await {
        Ok(Ok(Ok(text))) => {
            ([(header::CONTENT_TYPE, "application/json")], json!({ "done": text }).to_string())
                .into_response()
        }
        Ok(Ok(Err(problem))) => refusal(StatusCode::CONFLICT, &problem),
        _ => refusal(StatusCode::GATEWAY_TIMEOUT, "no answer"),
    }
}

async fn web_socket(
    State(shared): State<Arc<Shared>>,
    Extension(connection): Extension<Connection>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let upgrade = upgrade.max_message_size(MAX_SOCKET_BYTES).max_frame_size(MAX_SOCKET_BYTES);
    // Nothing is gathered in memory: a message goes to the system at once, or waits.
    upgrade.write_buffer_size(0).on_upgrade(|socket| serve(socket, shared, connection))
}

/// Sends a client the newest state whenever it has taken the one before.
async fn serve(mut socket: WebSocket, shared: Arc<Shared>, connection: Connection) {
    let mut updates = shared.hub.subscribe();
    let mut cursor = Cursor::default();
    let mut unexpected = 0;
    loop {
        tokio::select! {
            changed = updates.changed() => {
                if changed.is_err() {
                    break;
                }
                let update = Arc::clone(&updates.borrow_and_update());
                let text = shared.hub.message(&update, &mut cursor);
                match timeout(CLIENT_TIMEOUT, socket.send(Message::Text(text.into()))).await {
                    Ok(Ok(())) => {}
                    _ => break,
                }
            }
            received = socket.recv() => match received {
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                Some(Ok(Message::Text(_) | Message::Binary(_))) if unexpected < MAX_UNEXPECTED => unexpected += 1,
                _ => break,
            },
        }
    }
    drop(connection.permit);
}
