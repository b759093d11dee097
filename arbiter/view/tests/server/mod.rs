//! The server: its page and its state, who may look and command, and hostile clients.

mod client;

use std::io::Write;
use std::net::{IpAddr, Ipv4Addr, TcpStream};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use yamabico_view::recording::{Player, Recording};
use yamabico_view::server::{FoxglovePort, Server, ServerSettings, Source, TOKEN_HEADER};

use crate::fixture::Folder;
use client::{Answer, WebSocket, connect, get, request};

/// Serves a recording.
fn serve(folder: &Folder, listen: Option<IpAddr>) -> Server {
    let player = Player::new(Recording::open(&folder.record()).unwrap()).unwrap();
    let settings = ServerSettings {
        listen,
        port: 0,
        folder: folder.0.clone(),
        foxglove: FoxglovePort::Off,
        viewers: Vec::new(),
    };
    Server::start(Source::Recording(Box::new(player)), &settings).unwrap()
}

fn command(server: &Server, body: &str, headers: &[(&str, &str)]) -> Answer {
    request(server.address(), "POST", "/command", headers, body.as_bytes())
}

#[test]
fn the_page_the_state_and_the_pictures_are_served() {
    let folder = Folder::new("served");
    let server = serve(&folder, None);
    let page = get(server.address(), "/");
    assert!(page.status == 200 && page.text().contains("E-STOP"), "{}", page.status);
    let policy = page.header("content-security-policy").unwrap();
    assert!(
        policy.contains("frame-ancestors 'none'") && page.header("referrer-policy") == Some("no-referrer")
    );
    for file in ["/page.js", "/page.css", "/map.js", "/strips.js", "/panels.js", "/uplot.js", "/uplot.css"] {
        assert_eq!(get(server.address(), file).status, 200, "{file}");
    }
    assert_eq!(get(server.address(), "/etc/passwd").status, 404);

    let state: Value = serde_json::from_slice(&get(server.address(), "/state").body).unwrap();
    assert_eq!(state["state"]["source"]["source"], "recording");
    assert_eq!(
        (state["events"].as_array().unwrap().len(), &state["setup"]["duration_s"]),
        (5, &json!(19.98))
    );
    assert_eq!(command(&server, r#"{"command":"seek","at_s":10}"#, &[]).status, 200);
    let state: Value = serde_json::from_slice(&get(server.address(), "/state").body).unwrap();
    assert_eq!(state["state"]["behaviors"][1]["outcome"], "won");
    let stamp = state["state"]["pictures"][0]["stamp"].as_str().unwrap();
    let picture = get(server.address(), &format!("/picture/sensors/front?{stamp}"));
    assert_eq!((picture.status, picture.header("x-stamp")), (200, Some(stamp)));
    assert!(picture.header("content-type") == Some("image/png") && picture.body.starts_with(b"\x89PNG"));
    assert_eq!(get(server.address(), "/picture/sensors/none").status, 404);
    assert_eq!(get(server.address(), "/overlay/sensors/front?1").text(), "[]");
    let refused = command(&server, r#"{"command":"estop"}"#, &[]);
    assert!(refused.text().contains("not a running robot"), "{}", refused.text());
}

#[test]
fn other_sites_neither_look_nor_command() {
    let folder = Folder::new("sites");
    let server = serve(&folder, None);
    let host = server.address().to_string();
    let (own, evil) = (format!("http://{host}"), "http://evil.example");
    let pause = r#"{"command":"pause"}"#;
    assert_eq!(command(&server, pause, &[("origin", &own)]).status, 200);
    assert_eq!(command(&server, pause, &[("origin", evil)]).status, 403);
    assert_eq!(command(&server, pause, &[("origin", "null")]).status, 403);
    let rebound = format!("evil.example:{}", server.address().port());
    let from_rebound = format!("http://{rebound}");
    let headers: &[(&str, &str)] = &[("host", &rebound), ("origin", &from_rebound)];
    assert_eq!(command(&server, pause, headers).status, 403);
    for path in ["/", "/state", "/picture/sensors/front", "/ws"] {
        assert_eq!(request(server.address(), "GET", path, &[("host", &rebound)], b"").status, 403, "{path}");
    }
    assert!(WebSocket::open(server.address(), &[("origin", evil)]).is_none());
    assert!(WebSocket::open(server.address(), &[("origin", &own)]).is_some());
}

#[test]
fn commands_of_an_open_server_need_its_token() {
    let folder = Folder::new("token");
    let server = serve(&folder, Some(Ipv4Addr::LOCALHOST.into()));
    let token = server.token().unwrap().to_owned();
    assert!(server.url().contains(&token));
    let pause = r#"{"command":"pause"}"#;
    assert_eq!(command(&server, pause, &[]).status, 403);
    assert_eq!(command(&server, pause, &[(TOKEN_HEADER, "0123")]).status, 403);
    assert_eq!(command(&server, pause, &[(TOKEN_HEADER, &token)]).status, 200);
    // An emergency stop from this machine needs none; that this is no robot is found only afterwards.
    assert_eq!(command(&server, r#"{"command":"estop"}"#, &[]).status, 503);
    assert_eq!(get(server.address(), "/state").status, 200);
}

#[test]
fn malformed_commands_and_requests_do_no_harm() {
    let folder = Folder::new("malformed");
    let server = serve(&folder, None);
    let bodies =
        ["", "{}", "nonsense", "[1,2", r#"{"command":"seek"}"#, r#"{"command":"seek","at_s":"x"}"#, "\u{0}"];
    let mut stream = connect(server.address());
    for i in 0..2000 {
        if i % 100 == 0 {
            // The server closes a connection after a minute, which a busy machine may need.
            stream = connect(server.address());
        }
        let body = bodies[i % bodies.len()];
        let answer = client::exchange(&mut stream, "POST", "/command", &[], body.as_bytes());
        assert_eq!(answer.status, 400, "{body}");
    }
    assert_eq!(command(&server, &"x".repeat(20_000), &[]).status, 413);
    for garbage in
        [&b"\x00\xff\xfe\r\n\r\n"[..], b"GET / HTTP/9.9\r\n\r\n", b"POST /command HTTP/1.1\r\n\r\n"]
    {
        let mut stream = connect(server.address());
        stream.write_all(garbage).unwrap();
        drop(stream);
    }
    assert_eq!(get(server.address(), "/").status, 200);
    let mut socket = WebSocket::open(server.address(), &[]).unwrap();
    assert!(socket.next().unwrap().contains("\"state\""));
    // Nothing is expected over the web socket: the client that sends is dropped.
    let dropped = (0..10_000).any(|_| socket.send(b"{\"command\":\"estop\"}").is_err());
    assert!(dropped || socket.ends_within(Duration::from_secs(5)));
}

#[test]
fn clients_that_do_not_read_disturb_nobody() {
    let folder = Folder::alone("slow");
    let server = serve(&folder, None);
    assert_eq!(command(&server, r#"{"command":"play","pace":0.5}"#, &[]).status, 200);
    let before = memory_bytes();
    let mut deaf: Vec<_> = (0..10).map(|_| WebSocket::open(server.address(), &[]).unwrap()).collect();
    // Connections that never send a request, and one that sends it byte by byte.
    let silent: Vec<TcpStream> = (0..20).map(|_| connect(server.address())).collect();
    let mut readers: Vec<_> = (0..40).map(|_| WebSocket::open(server.address(), &[]).unwrap()).collect();
    let begun = Instant::now();
    let mut received = 0;
    while begun.elapsed() < Duration::from_secs(8) {
        for reader in &mut readers {
            received += u32::from(reader.next().is_some());
        }
    }
    // Ten messages a second for each, on a machine that is busy with other tests.
    assert!(received > 40 * 8 * 2, "{received} messages");
    let grown = memory_bytes().saturating_sub(before);
    assert!(grown < 64 << 20, "{grown} bytes more");
    assert_eq!(get(server.address(), "/").status, 200);
    // More connections than the server takes are closed; those that are there go on.
    let many: Vec<TcpStream> = (0..200).map(|_| connect(server.address())).collect();
    assert!(readers.iter_mut().all(|reader| reader.next().is_some()));
    drop((many, silent));
    drop(readers);
    // Within the time for a request's header, the places are free again.
    std::thread::sleep(Duration::from_secs(6));
    assert_eq!(get(server.address(), "/").status, 200);
    deaf.clear();
}

/// Memory of this process, bytes.
fn memory_bytes() -> usize {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap();
    text.split(' ').nth(1).unwrap().parse::<usize>().unwrap() * 4096
}
