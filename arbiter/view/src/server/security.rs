//! Rules: who may look, and who may command.
//!
//! A web page from elsewhere must not drive the robot. The browser names the page's site in `Origin`, which has to be the address
//! that it asked; a site whose name was bound to this machine's address afterwards (DNS rebinding) is found by `Host`, which has to
//! be an address, not a name. Programs that are no browsers send no `Origin`.

use std::net::{IpAddr, SocketAddr};

/// Length of a token, bytes.
const TOKEN_BYTES: usize = 16;

/// Rules of one server.
#[derive(Clone, Debug)]
pub(crate) struct Security {
    /// Names of this machine besides `localhost`.
    names: Vec<String>,
    token: Option<String>,
}

impl Security {
    /// Rules of a server for this machine only: commands need no token.
    pub fn local() -> Security {
        Security { names: Vec::new(), token: None }
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
        Ok(Security { names, token: Some(token) })
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

    /// Returns true if a request with this token may command; an emergency stop from this machine needs none.
    pub fn may_command(&self, token: Option<&str>, peer: SocketAddr, is_emergency_stop: bool) -> bool {
        let Some(expected) = &self.token else { return true };
        let is_right = token.is_some_and(|token| is_equal(token.as_bytes(), expected.as_bytes()));
        is_right || (is_emergency_stop && peer.ip().to_canonical().is_loopback())
    }

    fn is_known(&self, host: &str) -> bool {
        let host = host.to_ascii_lowercase();
        let is_port = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        let name = match host.rsplit_once(':') {
            Some((name, port)) if is_port(port) && (!name.contains(':') || name.ends_with(']')) => name,
            _ => &host,
        };
        let bare = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        bare.parse::<IpAddr>().is_ok() || name == "localhost" || self.names.iter().any(|known| known == name)
    }
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
        let security = Security { names: vec!["kame".to_owned()], token: None };
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
