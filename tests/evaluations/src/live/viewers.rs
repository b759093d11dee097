//! Clients of a view: some that look, some that never read, and some that send nonsense.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket, connect};
use yamabico_host::Scheduling;

/// Longest wait for a message.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Addresses of a view.
#[derive(Clone, Debug)]
pub struct Addresses {
    /// Host and port of the page.
    pub page: String,
    /// Address for Foxglove.
    pub foxglove: String,
}

/// Clients on threads of their own, until they are stopped.
pub struct Viewers {
    is_over: Arc<AtomicBool>,
    received: Arc<AtomicU64>,
    threads: Vec<JoinHandle<()>>,
}

type Socket = WebSocket<MaybeTlsStream<TcpStream>>;

impl Viewers {
    /// No clients.
    pub fn none() -> Viewers {
        Viewers { is_over: Arc::default(), received: Arc::default(), threads: Vec::new() }
    }

    /// `count` clients that look, the even ones at the page with its pictures, the odd ones as Foxglove at everything.
    pub fn start(addresses: &Addresses, count: usize) -> Viewers {
        let mut viewers = Viewers::none();
        for number in 0..count {
            let (addresses, is_over) = (addresses.clone(), Arc::clone(&viewers.is_over));
            let received = Arc::clone(&viewers.received);
            viewers.threads.push(std::thread::spawn(move || {
                // It stands for another machine.
                Scheduling::BACKGROUND.apply();
                if number % 2 == 0 {
                    look_at_page(&addresses.page, &is_over, &received);
                } else {
                    look_as_foxglove(&addresses.foxglove, &is_over, &received);
                }
            }));
        }
        viewers
    }

    /// Stops the clients; returns the number of messages that they received.
    pub fn stop(self) -> u64 {
        self.is_over.store(true, Ordering::Relaxed);
        for thread in self.threads {
            let _ = thread.join();
        }
        self.received.load(Ordering::Relaxed)
    }
}

fn look_at_page(address: &str, is_over: &AtomicBool, received: &AtomicU64) {
    let Some(mut socket) = open(&format!("ws://{address}/ws"), None) else { return };
    let mut shown = String::new();
    while !is_over.load(Ordering::Relaxed) {
        let Ok(Message::Text(text)) = socket.read() else { return };
        received.fetch_add(1, Ordering::Relaxed);
        let state: Value = serde_json::from_str(&text).unwrap_or_default();
        let picture = &state["state"]["pictures"][0];
        let stamp = picture["overlaid"].as_str().or(picture["stamp"].as_str()).unwrap_or_default();
        if stamp != shown {
            shown = stamp.to_owned();
            let topic = picture["topic"].as_str().unwrap_or_default();
            for kind in ["picture", "overlay"] {
                let _ = exchange(address, &format!("GET /{kind}/{topic}?{stamp} HTTP/1.1"), "");
            }
        }
    }
}

fn look_as_foxglove(url: &str, is_over: &AtomicBool, received: &AtomicU64) {
    let Some(mut socket) = open(url, Some("foxglove.sdk.v1")) else { return };
    while !is_over.load(Ordering::Relaxed) {
        let Ok(message) = socket.read() else { return };
        received.fetch_add(1, Ordering::Relaxed);
        let Message::Text(text) = message else { continue };
        let message: Value = serde_json::from_str(&text).unwrap_or_default();
        if message["op"] == "advertise" {
            let channels = message["channels"].as_array().map_or(0, Vec::len);
            let all: Vec<Value> = (0..channels).map(|id| json!({ "id": id, "channelId": id })).collect();
            let subscribe = json!({ "op": "subscribe", "subscriptions": all });
            if socket.send(Message::text(subscribe.to_string())).is_err() {
                return;
            }
        }
    }
}

/// Opens `count` connections that ask for everything and never read, half of them as Foxglove.
pub fn deaf(addresses: &Addresses, count: usize) -> Vec<TcpStream> {
    let open = |number: usize| {
        let url = if number.is_multiple_of(2) {
            format!("ws://{}/ws", addresses.page)
        } else {
            addresses.foxglove.clone()
        };
        let protocol = (!number.is_multiple_of(2)).then_some("foxglove.sdk.v1");
        let mut socket = open(&url, protocol)?;
        let all: Vec<Value> = (0..40).map(|id| json!({ "id": id, "channelId": id })).collect();
        if protocol.is_some() {
            socket
                .send(Message::text(json!({ "op": "subscribe", "subscriptions": all }).to_string()))
                .ok()?;
        }
        match socket.get_ref() {
            MaybeTlsStream::Plain(stream) => stream.try_clone().ok(),
            _ => None,
        }
    };
    (0..count).filter_map(open).collect()
}

/// Sends `count` malformed messages: commands, texts and bytes over both web sockets; returns the number that were sent.
pub fn send_nonsense(addresses: &Addresses, count: usize) -> usize {
    Scheduling::BACKGROUND.apply();
    let page = format!("ws://{}/ws", addresses.page);
    let mut sockets: [Option<Socket>; 2] = [None, None];
    let mut sent = 0;
    // A dropped client connects again, with some patience.
    for number in 0..2 * count {
        if sent == count {
            break;
        }
        let kind = number % 3;
        if kind == 0 {
            sent +=
                usize::from(exchange(&addresses.page, "POST /command HTTP/1.1", "{\"command\":").is_some());
            continue;
        }
        let socket = &mut sockets[kind - 1];
        if socket.is_none() {
            *socket = match kind {
                1 => open(&page, None),
                _ => open(&addresses.foxglove, Some("foxglove.sdk.v1")),
            };
        }
        let Some(open) = socket else { continue };
        let message = match number % 2 {
            0 => Message::text("{\"op\":\"fly\""),
            _ => Message::binary(vec![2, 0xff, 0xff, 0xff, 0xff, 0xff]),
        };
        match open.send(message) {
            Ok(()) => sent += 1,
            // Dropped, as it should be: a new one goes on.
            Err(_) => *socket = None,
        }
    }
    sent
}

fn open(url: &str, protocol: Option<&str>) -> Option<Socket> {
    let mut request = url.into_client_request().ok()?;
    if let Some(protocol) = protocol {
        request.headers_mut().insert("sec-websocket-protocol", protocol.parse().ok()?);
    }
    let (mut socket, _) = connect(request).ok()?;
    if let MaybeTlsStream::Plain(stream) = socket.get_mut() {
        stream.set_read_timeout(Some(TIMEOUT)).ok()?;
        stream.set_write_timeout(Some(TIMEOUT)).ok()?;
    }
    Some(socket)
}

/// Sends one request and reads its answer to the end.
fn exchange(address: &str, line: &str, body: &str) -> Option<Vec<u8>> {
    let mut stream = TcpStream::connect(address).ok()?;
    stream.set_read_timeout(Some(TIMEOUT)).ok()?;
    let length = body.len();
    let head = format!("{line}\r\nhost: {address}\r\nconnection: close\r\ncontent-length: {length}\r\n\r\n");
    stream.write_all(head.as_bytes()).ok()?;
    stream.write_all(body.as_bytes()).ok()?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).ok()?;
    Some(answer)
}
