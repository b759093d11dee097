//! Services: the commands for a robot that a viewer can call.

use serde_json::{Map, Value, json};

use crate::server::command::Command;

/// A service: its name is that of the command after a slash.
pub(super) struct Service {
    pub name: &'static str,
    /// Fields of the request with their JSON types.
    fields: &'static [(&'static str, &'static str)],
}

/// All services; the identifier of a service is its index.
pub(super) const SERVICES: [Service; 5] = [
    Service { name: "/estop", fields: &[] },
    Service { name: "/reset", fields: &[] },
    Service { name: "/enable", fields: &[("behavior", "string")] },
    Service { name: "/disable", fields: &[("behavior", "string")] },
    Service { name: "/goto", fields: &[("x_m", "number"), ("y_m", "number")] },
];

impl Service {
    /// Command of a call with this request, which is a JSON object or nothing.
    pub fn command(&self, request: &[u8]) -> Result<Command, String> {
        let fields: Map<String, Value> = match request.trim_ascii() {
            b"" => Map::new(),
            request => serde_json::from_slice(request).map_err(|error| format!("no request: {error}"))?,
        };
        let mut fields = fields;
        fields.insert("command".to_owned(), self.name.trim_start_matches('/').into());
        serde_json::from_value(fields.into()).map_err(|error| format!("{}: {error}", self.name))
    }

    fn to_json(&self, id: usize) -> Value {
        let schema = |fields: &[(&str, &str)]| {
            let properties =
                fields.iter().map(|(field, kind)| ((*field).to_owned(), json!({ "type": kind })));
            let properties: Map<String, Value> = properties.collect();
            json!({ "type": "object", "properties": properties }).to_string()
        };
        let side = |side: &str, fields: &[(&str, &str)]| {
            json!({
                "encoding": "json",
                "schemaName": format!("yamabico{}.{side}", self.name.replace('/', ".")),
                "schemaEncoding": "jsonschema",
                "schema": schema(fields),
            })
        };
        json!({
            "id": id,
            "name": self.name,
            "type": format!("yamabico{}", self.name.replace('/', ".")),
            "request": side("Request", self.fields),
            "response": side("Response", &[("done", "string")]),
        })
    }
}

/// Message that announces all services.
pub(super) fn advertisement() -> String {
    let services: Vec<Value> = SERVICES.iter().enumerate().map(|(id, service)| service.to_json(id)).collect();
    json!({ "op": "advertiseServices", "services": services }).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_is_a_command() {
        let [estop, .., goto] = &SERVICES;
        assert_eq!(estop.command(b""), Ok(Command::Estop));
        assert_eq!(goto.command(br#"{"x_m": 1, "y_m": 2}"#), Ok(Command::Goto { x_m: 1.0, y_m: 2.0 }));
        assert!(goto.command(b"{}").unwrap_err().contains("x_m"));
        assert!(estop.command(b"[1").is_err() && goto.command(br#"{"x_m": 1, "y_m": 2, "z_m": 3}"#).is_err());
        // A request cannot choose another command.
        assert_eq!(estop.command(br#"{"command": "reset"}"#), Ok(Command::Estop));
    }
}
