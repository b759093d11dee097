//! A camera that serves motion JPEG over HTTP.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Newest picture, as a JPEG, with its number.
pub type NewestPicture = Arc<Mutex<(u64, Vec<u8>)>>;

/// Serves the newest picture to each client as soon as it is new, until the process ends; returns the port on the loopback.
pub fn serve(newest: NewestPicture) -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let newest = Arc::clone(&newest);
            std::thread::spawn(move || send(stream, &newest));
        }
    });
    port
}

fn send(mut stream: TcpStream, newest: &NewestPicture) -> std::io::Result<()> {
    let (mut request, mut part) = (Vec::new(), [0; 1024]);
    while !request.ends_with(b"\r\n\r\n") {
        match stream.read(&mut part)? {
            0 => return Ok(()),
            len => request.extend_from_slice(&part[..len]),
        }
    }
    stream.write_all(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=part\r\n\r\n")?;
    let mut sent = 0;
    loop {
        let (number, picture) = newest.lock().unwrap().clone();
        if number == sent {
            std::thread::sleep(Duration::from_millis(2));
            continue;
        }
        sent = number;
        let head = format!("--part\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", picture.len());
        stream.write_all(head.as_bytes())?;
        stream.write_all(&picture)?;
        stream.write_all(b"\r\n")?;
    }
}
