//! The network that a part joins: its domain, its middleware, and its router.

use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::ParameterError;

/// Variable of the environment with the domain.
pub const DOMAIN_VARIABLE: &str = "ROS_DOMAIN_ID";
/// Variable of the environment with the middleware.
pub const MIDDLEWARE_VARIABLE: &str = "RMW_IMPLEMENTATION";
/// Highest domain whose ports exist.
pub const MAX_DOMAIN: u16 = 232;

/// Middleware under ROS 2, which both sides must have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Middleware {
    /// DDS: Fast DDS, Cyclone DDS, Connext.
    Dds,
    /// Zenoh, as rmw_zenoh.
    Zenoh,
}

impl Middleware {
    /// Returns all that this program was built with, the preferred first.
    #[must_use]
    pub fn built() -> &'static [Middleware] {
        match (cfg!(feature = "dds"), cfg!(feature = "zenoh")) {
            (true, true) => &[Middleware::Dds, Middleware::Zenoh],
            (true, false) => &[Middleware::Dds],
            (false, true) => &[Middleware::Zenoh],
            (false, false) => &[],
        }
    }

    /// Returns the cargo feature that brings it.
    #[must_use]
    pub fn feature(self) -> &'static str {
        match self {
            Middleware::Dds => "dds",
            Middleware::Zenoh => "zenoh",
        }
    }
}

/// Keys of the network of a device or of a behavior. What is not set comes from the environment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NetworkConfig {
    /// Domain.
    pub domain: Option<u16>,
    /// Middleware.
    pub middleware: Option<Middleware>,
    /// Endpoint of a Zenoh router, such as `tcp/192.168.1.5:7447`.
    pub router: Option<String>,
}

/// Returns the domain: `configured`, or that of the variable whose value is `environment`, or 0.
///
/// # Errors
/// The variable is no domain.
pub fn domain(configured: Option<u16>, environment: Option<&str>) -> Result<u16, ParameterError> {
    match (configured, environment.map(str::trim).filter(|text| !text.is_empty())) {
        (Some(domain), _) => Ok(domain),
        (None, None) => Ok(0),
        (None, Some(text)) => text.parse().ok().filter(|domain| *domain <= MAX_DOMAIN).ok_or_else(|| {
            let problem = format!("{DOMAIN_VARIABLE} is `{text}`, and not a number from 0 to {MAX_DOMAIN}");
            ParameterError::new("domain", problem)
        }),
    }
}

/// Returns the middleware: that of the configuration, or that of the variable whose value is `environment`, or the first of those
/// that were `built`.
///
/// # Errors
/// The variable names none that is known, this program was built without the one that is asked for, or a router goes with DDS.
pub fn middleware(
    config: &NetworkConfig,
    environment: Option<&str>,
    built: &[Middleware],
) -> Result<Middleware, ParameterError> {
    let variable = environment.map(str::trim).filter(|text| !text.is_empty());
    let (wanted, origin) = match (config.middleware, &config.router, variable) {
        (Some(configured), _, _) => (configured, "the configuration".to_owned()),
        // DDS has none.
        (None, Some(router), _) => (Middleware::Zenoh, format!("the router `{router}`")),
        (None, None, Some(text)) => (named(text)?, format!("{MIDDLEWARE_VARIABLE}={text}")),
        (None, None, None) => {
            let default = built.first().copied().unwrap_or(Middleware::Dds);
            (default, "its default".to_owned())
        }
    };
    if !built.contains(&wanted) {
        let feature = wanted.feature();
        let problem = format!(
            "{origin} asks for {feature}, but this yamabico-ros2 was built without it: install it with \
             `cargo install --path sensors/ros2 --features {feature}`"
        );
        return Err(ParameterError::new("middleware", problem));
    }
    if let (Middleware::Dds, Some(_)) = (wanted, &config.router) {
        let problem = "DDS has no router: remove it, or set middleware = \"zenoh\"";
        return Err(ParameterError::new("router", problem));
    }
    Ok(wanted)
}

/// Middleware of the RMW implementation `text`.
fn named(text: &str) -> Result<Middleware, ParameterError> {
    let dds = ["rmw_fastrtps", "rmw_cyclonedds", "rmw_connextdds"];
    if text.starts_with("rmw_zenoh") {
        Ok(Middleware::Zenoh)
    } else if dds.iter().any(|name| text.starts_with(name)) {
        Ok(Middleware::Dds)
    } else {
        let problem = format!(
            "{MIDDLEWARE_VARIABLE} is `{text}`, which is unknown here: rmw_zenoh_cpp, rmw_fastrtps_cpp and rmw_cyclonedds_cpp are \
             known; or set `middleware` to dds or zenoh"
        );
        Err(ParameterError::new("middleware", problem))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_environment_sets_the_domain() {
        assert_eq!(domain(None, None).ok(), Some(0));
        assert_eq!(domain(None, Some("")).ok(), Some(0));
        assert_eq!(domain(None, Some("42")).ok(), Some(42));
        assert_eq!(domain(Some(7), Some("42")).ok(), Some(7));
        for wrong in ["-1", "233", "robot"] {
            assert!(domain(None, Some(wrong)).unwrap_err().problem.contains("ROS_DOMAIN_ID"));
        }
    }

    #[test]
    fn the_configuration_sets_the_middleware_and_then_the_environment() {
        use Middleware::{Dds, Zenoh};
        let both = [Dds, Zenoh];
        let none = NetworkConfig::default();
        let of = |config: &NetworkConfig, variable| middleware(config, variable, &both).unwrap();
        assert_eq!(of(&none, None), Dds);
        assert_eq!(of(&none, Some(" ")), Dds);
        assert_eq!(of(&none, Some("rmw_zenoh_cpp")), Zenoh);
        assert_eq!(of(&none, Some("rmw_fastrtps_dynamic_cpp")), Dds);
        let zenoh = NetworkConfig { middleware: Some(Zenoh), ..NetworkConfig::default() };
        assert_eq!(of(&zenoh, Some("rmw_cyclonedds_cpp")), Zenoh);
        let router = NetworkConfig { router: Some("tcp/robot:7447".to_owned()), ..NetworkConfig::default() };
        assert_eq!(of(&router, Some("rmw_cyclonedds_cpp")), Zenoh);
        assert_eq!(middleware(&none, None, &[Zenoh]).unwrap(), Zenoh);
    }

    #[test]
    fn a_missing_or_unknown_middleware_is_an_error_with_its_remedy() {
        let none = NetworkConfig::default();
        let error = middleware(&none, Some("rmw_zenoh_cpp"), &[Middleware::Dds]).unwrap_err();
        assert!(error.problem.contains("RMW_IMPLEMENTATION=rmw_zenoh_cpp"), "{error}");
        assert!(error.problem.contains("--features zenoh"), "{error}");
        let error = middleware(&none, Some("rmw_email"), &[Middleware::Dds]).unwrap_err();
        assert!(error.problem.contains("`rmw_email`"), "{error}");
        let both = [Middleware::Dds, Middleware::Zenoh];
        let router = NetworkConfig {
            middleware: Some(Middleware::Dds),
            router: Some("tcp/robot:7447".to_owned()),
            ..NetworkConfig::default()
        };
        assert_eq!(middleware(&router, None, &both).unwrap_err().key, "router");
    }
}
