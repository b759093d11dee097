//! Motion JPEG over HTTP, as network cameras, phones and `mjpg-streamer` send it.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use yamabico_core::behavior::ParameterError;

use crate::grabber::{Source, Stream};
use crate::jpeg_stream::JpegStream;
use crate::live_config::live_camera;

/// Maximum length of a response's head, bytes.
const MAX_HEAD: u64 = 16 * 1024;

live_camera! {
    /// Parameters of a camera that sends motion JPEG over HTTP.
    pub struct HttpCameraConfig {
        /// Address of the stream, `http://HOST:PORT/PATH`; with a name and password as `http://NAME:PASSWORD@HOST/PATH`.
        #[schemars(extend("examples" = ["http://camera.local:8080/?action=stream"]))]
        pub url: String,
        /// Silence after which the connection is opened again.
        #[serde_inline_default(2000.0)]
        #[schemars(range(min = 100.0, max = 60000.0))]
        pub timeout_ms: f64,
    }
}

/// Stream of a camera at an address.
#[derive(Clone, Debug)]
pub(crate) struct HttpSource {
    address: Address,
    timeout: Duration,
}

/// Parts of an address.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Address {
    host: String,
    port: u16,
    path: String,
    /// Name and password, `NAME:PASSWORD`.
    login: Option<String>,
}

impl HttpSource {
    /// Returns the source of these parameters.
    ///
    /// # Errors
    /// An address that is none.
    pub fn new(config: &HttpCameraConfig) -> Result<HttpSource, ParameterError> {
        let address = Address::of(&config.url).map_err(|problem| ParameterError::new("url", problem))?;
        Ok(HttpSource { address, timeout: Duration::from_secs_f64(1e-3 * config.timeout_ms) })
    }
}

impl Source for HttpSource {
    fn name(&self) -> String {
        format!("http://{}:{}{}", self.address.host, self.address.port, self.address.path)
    }

    fn open(&mut self) -> io::Result<Box<dyn Stream>> {
        let mut failed = io::Error::new(io::ErrorKind::NotFound, "the host has no address");
        for address in (self.address.host.as_str(), self.address.port).to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, self.timeout) {
                Ok(stream) => {
                    stream.set_read_timeout(Some(self.timeout))?;
                    stream.set_write_timeout(Some(self.timeout))?;
                    return self.ask(stream);
                }
                Err(error) => failed = error,
            }
        }
        Err(failed)
    }
}

impl HttpSource {
    /// Sends the request, and returns the stream behind the response's head. HTTP 1.0: a server must not cut the body into chunks.
    fn ask(&self, mut stream: TcpStream) -> io::Result<Box<dyn Stream>> {
        let Address { host, path, login, .. } = &self.address;
        let login =
            login.as_ref().map(|login| format!("Authorization: Basic {}\r\n", base64(login.as_bytes())));
        let login = login.unwrap_or_default();
        write!(stream, "GET {path} HTTP/1.0\r\nHost: {host}\r\nAccept: */*\r\n{login}\r\n")?;
        let mut reader = BufReader::new(stream);
        let mut head = reader.by_ref().take(MAX_HEAD);
        let mut status = String::new();
        head.read_line(&mut status)?;
        let code = status.split_whitespace().nth(1).unwrap_or_default();
        if !status.starts_with("HTTP/") || code != "200" {
            let hint = if code == "401" { ": write http://NAME:PASSWORD@HOST/PATH in `url`" } else { "" };
            return Err(io::Error::other(format!("the server answers `{}`{hint}", status.trim())));
        }
        let mut line = String::new();
        while head.read_line(&mut line)? > 2 {
            line.clear();
        }
        Ok(Box::new(JpegStream::new(reader)))
    }
}

impl Address {
    fn of(url: &str) -> Result<Address, String> {
        let form = "must be http://HOST/PATH, such as http://camera.local:8080/?action=stream";
        let Some(rest) = url.strip_prefix("http://") else {
            let is_encrypted = url.starts_with("https://");
            let hint = if is_encrypted { "; for https use `command` with ffmpeg" } else { "" };
            return Err(format!("{form}{hint}"));
        };
        let (authority, path) = rest.find('/').map_or((rest, ""), |at| rest.split_at(at));
        let (login, host) = match authority.rsplit_once('@') {
            Some((login, host)) => (Some(login.to_owned()), host),
            None => (None, authority),
        };
        let (host, port) = match host.rsplit_once(':').filter(|(_, port)| !port.ends_with(']')) {
            Some((host, port)) => {
                (host, port.parse().map_err(|_| format!("the port `{port}` is no number"))?)
            }
            None => (host, 80),
        };
        let host = host.trim_matches(['[', ']']);
        if host.is_empty() || url.contains(|c: char| c.is_control() || c == ' ') {
            return Err(form.to_owned());
        }
        let path = if path.is_empty() { "/" } else { path };
        Ok(Address { host: host.to_owned(), port, path: path.to_owned(), login })
    }
}

/// Returns the text of bytes in base 64 (RFC 4648), as HTTP sends names and passwords.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let word =
            three.iter().fold(0_u32, |word, byte| word << 8 | u32::from(*byte)) << (8 * (3 - three.len()));
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= three.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_have_their_parts() {
        let address = Address::of("http://me:s@cret@cam:8080/?a=b").unwrap();
        assert_eq!((address.host.as_str(), address.port, address.path.as_str()), ("cam", 8080, "/?a=b"));
        assert_eq!(address.login.as_deref(), Some("me:s@cret"));
        let plain = Address::of("http://10.0.0.7").unwrap();
        assert_eq!((plain.host.as_str(), plain.port, plain.path.as_str()), ("10.0.0.7", 80, "/"));
        assert_eq!(Address::of("http://[::1]:81/x").unwrap().host, "::1");
        for wrong in [
            "cam/stream",
            "https://cam",
            "http://",
            "http://cam:x/",
            "http://cam/a b",
            "http://cam/a\r\nX: y",
        ] {
            assert!(Address::of(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn base64_has_its_known_answers() {
        // RFC 4648, section 10.
        for (plain, coded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }
}
