//! Rules: who may look, and who may command.
//!
//! A web page from elsewhere must not drive the robot. The browser names the page's site in `Origin`, which has to be the address
//! that it asked; a site whose name was bound to this machine's address afterwards (DNS rebinding) is found by `Host`, which has to
//! be an address, not a name. Programs that are no browsers send no `Origin`.

use std::net::{IpAddr, SocketAddr};

/// Sites of viewers: the web application of Foxglove, and applications on the desktop, whose pages are files.
const VIEWERS: [&str; 2] = ["https://app.foxglove.dev", "file://"];
/// Length of a token, bytes.
const TOKEN_BYTES: usize = 16;

/// Rules of one server.
#[derive(Clone, Debug)]
pub(crate) struct Security {
    /// Names of this machine besides `localhost`.
    names: Vec<String>,
    /// Sites of more viewers.
    viewers: Vec<String>,
    token: Option<String>,
}

impl Security {
    /// Rules of a server for this machine only: commands need no token.
    pub fn local() -> Security {
        Security { names: Vec::new(), viewers: Vec::new(), token: None }
    }

    /// Rules of a server for other machines: commands need a token.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub fn open() -> std::io::Result<Security> {
        let mut bytes = [0; TOKEN_BYTES];
        std::io::Read::read_exact(&mut std::fs::File::open("/dev/urandom")?, &mut bytes)?;
        let token = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        let name = name.trim().to_lowercase();
        let names = if name.is_empty() { Vec::new() } else { vec![format!("{name}.local"), name] };
        Ok(Security { names, viewers: Vec::new(), token: Some(token) })
    }

    /// Admits viewers from these sites, such as `http://lichtblick.lan`.
    #[must_use]
    pub fn with_viewers(self, viewers: &[String]) -> Security {
        let viewers = viewers.iter().map(|site| site.trim_end_matches('/').to_owned()).collect();
        Security { viewers, ..self }
    }

    /// Token for commands; `None` if they need none.
    pub fn token(&self) -> Option<&str> {
        self.token.as_deref()
    }

    /// Checks the site that a request comes from and the one that it asks.
    pub fn check_site(&self, host: Option<&str>, origin: Option<&str>) -> Result<(), &'static str> {
        let Some(host) = host else { return Err("the request has no Host") };
        if !self.is_known(host) {
            return Err("the Host is not an address of this machine: open the page by its address");
        }
        let is_same = |origin: &str| {
            let site = origin.get(..7).filter(|scheme| scheme.eq_ignore_ascii_case("http://"));
            site.is_some() && origin[7..].eq_ignore_ascii_case(host)
        };
        match origin {
            Some(origin) if !is_same(origin) => Err("the request comes from another site"),
            _ => Ok(()),
        }
    }

    /// Checks the site of a viewer's request, and the one that it asks. A viewer is a program, or a page of its maker, of this
    /// machine, or of the site that it asks.
    pub fn check_viewer(&self, host: Option<&str>, origin: Option<&str>) -> Result<(), String> {
        let Some(origin) = origin else { return self.check_site(host, None).map_err(str::to_owned) };
        self.check_site(host, None)?;
        let is_same = || {
            let site = origin.split_once("://").map(|(_, site)| name_of(site).to_ascii_lowercase());
            let (site, asked) = (site.unwrap_or_default(), name_of(host.unwrap_or_default()));
            site == "localhost" || site == asked.to_ascii_lowercase() || is_loopback(&site)
        };
        let is_known = VIEWERS.contains(&origin) || self.viewers.iter().any(|known| known == origin);
        if is_known || is_same() {
            return Ok(());
        }
        Err(format!("it comes from the site {origin}; `yamabico view --viewer {origin}` would admit it"))
    }

    /// Returns true if a request with this token may command; an emergency stop from this machine needs none.
    pub fn may_command(&self, token: Option<&str>, peer: SocketAddr, is_emergency_stop: bool) -> bool {
        let Some(expected) = &self.token else { return true };
        let is_right = token.is_some_and(|token| is_equal(token.as_bytes(), expected.as_bytes()));
        is_right || (is_emergency_stop && peer.ip().to_canonical().is_loopback())
    }

    fn is_known(&self, host: &str) -> bool {
        let host = host.to_ascii_lowercase();
        let name = name_of(&host);
        let is_address = bare(name).parse::<IpAddr>().is_ok();
        is_address || name == "localhost" || self.names.iter().any(|known| known == name)
    }
}

/// Name or address of a host, without its port.
fn name_of(host: &str) -> &str {
    let is_port = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    match host.rsplit_once(':') {
        Some((name, port)) if is_port(port) && (!name.contains(':') || name.ends_with(']')) => name,
        _ => host,
    }
}

/// Address without the brackets of IPv6.
fn bare(name: &str) -> &str {
    name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name)
}

fn is_loopback(name: &str) -> bool {
    bare(name).parse::<IpAddr>().is_ok_and(|address| address.to_canonical().is_loopback())
}

/// Compares in a time that does not depend on the first difference.
fn is_equal(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |differing, (a, b)| differing | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_addresses_of_this_machine_are_asked() {
        let security = Security { names: vec!["kame".to_owned()], ..Security::local() };
        let known = ["127.0.0.1:8080", "localhost:8080", "LOCALHOST", "[::1]:8080", "192.168.1.7", "kame:1"];
        let unknown =
            ["evil.example:8080", "127.0.0.1.evil.example", "", "localhost.evil.example:8080", "kame.evil"];
        for host in known {
            assert_eq!(security.check_site(Some(host), None), Ok(()), "{host}");
        }
        for host in unknown {
            assert!(security.check_site(Some(host), None).is_err(), "{host}");
        }
        assert!(security.check_site(None, None).is_err());
    }

    #[test]
    fn only_its_own_page_may_ask() {
        let security = Security::local();
        let check = |origin| security.check_site(Some("127.0.0.1:8080"), Some(origin)).is_ok();
        assert!(check("http://127.0.0.1:8080") && check("HTTP://127.0.0.1:8080"));
        let foreign = [
            "http://evil.example",
            "http://127.0.0.1:9999",
            "https://127.0.0.1:8080",
            "null",
            "",
            "http:/\u{e9}",
        ];
        assert!(foreign.iter().all(|origin| !check(origin)));
    }

    #[test]
    fn viewers_of_this_machine_and_of_their_makers_may_ask() {
        let security = Security::local().with_viewers(&["http://lichtblick.lan/".to_owned()]);
        let check = |host: &str, origin: Option<&str>| security.check_viewer(Some(host), origin);
        let here = "127.0.0.1:8765";
        assert_eq!(check(here, None), Ok(()));
        let known = [
            "https://app.foxglove.dev",
            "file://",
            "http://localhost:8080",
            "http://[::1]:80",
            "http://lichtblick.lan",
        ];
        assert!(known.iter().all(|origin| check(here, Some(origin)).is_ok()));
        assert_eq!(check("192.168.1.7:8765", Some("http://192.168.1.7:8080")), Ok(()));
        let foreign = [
            "http://evil.example",
            "null",
            "",
            "https://app.foxglove.dev.evil.example",
            "http://192.168.1.8",
            "evil",
            "http://localhost.evil.example",
        ];
        assert!(foreign.iter().all(|origin| check(here, Some(origin)).is_err()));
        let rebound = "evil.example:8765";
        assert!(check(rebound, Some("http://evil.example:8765")).is_err() && check(rebound, None).is_err());
    }

    #[test]
    fn commands_need_the_token_but_for_an_emergency_stop_from_here() {
        let security = Security::open().unwrap();
        let token = security.token().unwrap().to_owned();
        let (here, mapped) = ("127.0.0.1:9".parse().unwrap(), "[::ffff:127.0.0.1]:9".parse().unwrap());
        let there = "192.168.1.7:9".parse().unwrap();
        assert_eq!(token.len(), 2 * TOKEN_BYTES);
        assert!(security.may_command(Some(&token), there, false));
        assert!(!security.may_command(Some("x"), here, false) && !security.may_command(None, here, false));
        assert!(security.may_command(None, here, true) && security.may_command(None, mapped, true));
        assert!(!security.may_command(None, there, true));
        assert!(Security::local().may_command(None, here, false));
    }
}
