//! The session of Zenoh: its configuration, and whether it has a router.

use std::time::{Duration, Instant};

use ::zenoh::{Config, Session, Wait};

/// Variable of the environment with a configuration file, as for rmw_zenoh.
const FILE_VARIABLE: &str = "ZENOH_SESSION_CONFIG_URI";
/// Variable of the environment with single keys, as for rmw_zenoh: `KEY=VALUE;KEY=VALUE`.
const KEYS_VARIABLE: &str = "ZENOH_CONFIG_OVERRIDE";
/// Default of rmw_zenoh: a peer that finds others through the router on this machine, and is reached by those on this
/// machine only.
const DEFAULT: &str = r#"{
    mode: "peer",
    connect: {
        endpoints: ["tcp/localhost:7447"],
        timeout_ms: { router: -1, peer: -1, client: 0 },
        exit_on_failure: { router: false, peer: false, client: true },
    },
    listen: { endpoints: ["tcp/localhost:0"] },
    scouting: {
        multicast: { enabled: false },
        gossip: {
            enabled: true,
            target: { router: ["router", "peer"], peer: ["router"] },
            autoconnect_strategy: { peer: { to_router: "always", to_peer: "greater-zid" } },
        },
    },
}"#;
/// Time between two looks for the router.
const LOOK_PERIOD: Duration = Duration::from_millis(500);
/// Time without a router, after the start, after which the log says so.
const PATIENCE: Duration = Duration::from_secs(2);

/// A session, and how it was opened.
pub(super) struct Opened {
    /// The session.
    pub session: Session,
    /// Endpoints that it connects to, as JSON.
    pub endpoints: String,
    /// `peer`, `client` or `router`.
    pub mode: String,
}

/// Opens a session as a client of `router`, or as the environment says.
///
/// # Errors
/// The cause in words: an invalid configuration, or, as a client, no router.
pub(super) fn open(router: Option<&str>) -> Result<Opened, String> {
    let variable = |name: &str| std::env::var(name).ok().filter(|text| !text.trim().is_empty());
    let config =
        configuration(router, variable(FILE_VARIABLE).as_deref(), variable(KEYS_VARIABLE).as_deref())?;
    let text = |key: &str| config.get_json(key).unwrap_or_default();
    let (endpoints, mode) = (text("connect/endpoints"), text("mode").trim_matches('"').to_owned());
    let opened = ::zenoh::open(config.clone()).wait();
    let session = opened.map_err(|error| match mode.as_str() {
        "client" => format!("no Zenoh router at {endpoints}: {}", remedy()),
        _ => format!("no session of Zenoh ({}): look at {FILE_VARIABLE} and {KEYS_VARIABLE}", words(&error)),
    })?;
    Ok(Opened { session, endpoints, mode })
}

/// Text of an error of Zenoh without its place in the sources.
fn words(error: &dyn std::fmt::Display) -> String {
    let text = error.to_string();
    text.split(" at /").next().unwrap_or_default().trim().to_owned()
}

fn remedy() -> &'static str {
    "start one there with `ros2 run rmw_zenoh_cpp rmw_zenohd`, or name another with `router`"
}

/// Configuration of a session: of the file `file` or the default, with the keys `keys`, and as a client of `router`.
fn configuration(router: Option<&str>, file: Option<&str>, keys: Option<&str>) -> Result<Config, String> {
    let mut config = match file {
        Some(file) => Config::from_file(file.trim()).map_err(|error| {
            format!("{FILE_VARIABLE}={file} is no configuration of Zenoh: {}", words(&error))
        })?,
        None => Config::from_json5(DEFAULT).map_err(|error| words(&error))?,
    };
    for entry in keys.unwrap_or_default().split(';').map(str::trim).filter(|entry| !entry.is_empty()) {
        let wrong = |what: &str| format!("{KEYS_VARIABLE}: `{entry}` {what}");
        let (key, value) = entry.split_once('=').ok_or_else(|| wrong("is not KEY=VALUE"))?;
        config
            .insert_json5(key.trim(), value.trim())
            .map_err(|error| wrong(&format!("is refused: {}", words(&error))))?;
    }
    if let Some(router) = router {
        let endpoint = serde_json::json!([router]).to_string();
        let wrong = |error| {
            format!(
                "the router `{router}` is no endpoint of Zenoh ({error}): write it as tcp/192.168.1.5:7447"
            )
        };
        config.insert_json5("connect/endpoints", &endpoint).map_err(|error| wrong(words(&error)))?;
        if !router.starts_with("tcp/") {
            return Err(wrong("this program speaks TCP only".to_owned()));
        }
        for (key, value) in [("mode", "\"client\""), ("listen/endpoints", "[]"), ("connect/timeout_ms", "0")]
        {
            config.insert_json5(key, value).map_err(|error| words(&error))?;
        }
    }
    Ok(config)
}

/// Watches whether a session has a router.
pub(super) struct RouterWatch {
    session: Session,
    endpoints: String,
    since: Instant,
    looked: Instant,
    /// State that was logged last.
    is_there: Option<bool>,
}

impl RouterWatch {
    pub fn new(session: Session, endpoints: String) -> RouterWatch {
        let now = Instant::now();
        RouterWatch { session, endpoints, since: now, looked: now, is_there: None }
    }

    /// Returns a text when the router is lost, or still missing, and when it is back.
    pub fn look(&mut self) -> Option<String> {
        if self.looked.elapsed() < LOOK_PERIOD {
            return None;
        }
        self.looked = Instant::now();
        let is_there = self.session.info().routers_zid().wait().next().is_some();
        let endpoints = &self.endpoints;
        let text = match (self.is_there, is_there) {
            (None, false) if self.since.elapsed() < PATIENCE => return None,
            (None, false) => Some(format!("no Zenoh router at {endpoints}: {}; trying on", remedy())),
            (Some(true), false) => Some(format!(
                "the Zenoh router at {endpoints} is lost: others are not found until it is back"
            )),
            (Some(false), true) => Some(format!("the Zenoh router at {endpoints} is there")),
            _ => None,
        };
        self.is_there = Some(is_there);
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(config: &Config, key: &str) -> String {
        config.get_json(key).unwrap()
    }

    #[test]
    fn the_default_is_that_of_rmw_zenoh() {
        let config = configuration(None, None, None).unwrap();
        assert_eq!(of(&config, "mode"), r#""peer""#);
        assert_eq!(of(&config, "connect/endpoints"), r#"["tcp/localhost:7447"]"#);
        assert_eq!(of(&config, "scouting/multicast/enabled"), "false");
    }

    #[test]
    fn a_router_makes_a_client_and_wins_over_the_environment() {
        let keys = r#" mode="peer"; connect/endpoints=["tcp/10.0.0.1:7447"] ;"#;
        let config = configuration(None, None, Some(keys)).unwrap();
        assert_eq!(of(&config, "connect/endpoints"), r#"["tcp/10.0.0.1:7447"]"#);
        let config = configuration(Some("tcp/robot:7447"), None, Some(keys)).unwrap();
        assert_eq!(of(&config, "mode"), r#""client""#);
        assert_eq!(of(&config, "connect/endpoints"), r#"["tcp/robot:7447"]"#);
    }

    #[test]
    fn wrong_endpoints_files_and_keys_are_errors() {
        let error = |router, file, keys| configuration(router, file, keys).err().unwrap();
        for router in ["robot", "robot:7447", "udp/robot:7447", ""] {
            let text = error(Some(router), None, None);
            assert!(text.contains("tcp/192.168.1.5:7447"), "{text}");
        }
        assert!(error(None, Some("/no/such/file.json5"), None).contains("ZENOH_SESSION_CONFIG_URI"));
        assert!(error(None, None, Some("mode")).contains("KEY=VALUE"));
        assert!(error(None, None, Some("mode=\"boat\"")).contains("refused"));
    }
}
