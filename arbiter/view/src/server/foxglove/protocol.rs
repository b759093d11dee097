//! Messages of the protocol: JSON as text, records and calls as bytes with a code in front, numbers in little endian.

use axum::extract::ws::Message;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;
use serde_json::{Value, json};
use yamabico_core::time::Time;
use yamabico_runtime::record::Channel;

use super::parameters::Parameter;

/// Encoding of what clients send.
pub(super) const JSON: &str = "json";
/// Abilities that the server announces.
const CAPABILITIES: [&str; 6] =
    ["clientPublish", "parameters", "parametersSubscribe", "services", "connectionGraph", "time"];
/// Codes of binary messages to clients.
const RECORD: u8 = 1;
const TIME: u8 = 2;
const SERVICE_RESPONSE: u8 = 3;
/// Codes of binary messages from clients.
const CLIENT_RECORD: u8 = 1;
const SERVICE_CALL: u8 = 2;

/// Severity of a status message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Level {
    Warning = 1,
    Error = 2,
}

/// A text message of a client.
#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(super) enum Request {
    Subscribe { subscriptions: Vec<Subscription> },
    Unsubscribe { subscription_ids: Vec<u32> },
    Advertise { channels: Vec<ClientChannel> },
    Unadvertise { channel_ids: Vec<u32> },
    GetParameters { parameter_names: Vec<String>, id: Option<String> },
    SetParameters { parameters: Vec<Assignment>, id: Option<String> },
    SubscribeParameterUpdates { parameter_names: Vec<String> },
    UnsubscribeParameterUpdates { parameter_names: Vec<String> },
    SubscribeConnectionGraph {},
    UnsubscribeConnectionGraph {},
}

/// Wish for the records of a channel.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    pub id: u32,
    pub channel_id: usize,
}

/// A channel on which a client publishes.
#[derive(Debug, Deserialize)]
pub(super) struct ClientChannel {
    pub id: u32,
    pub topic: String,
    pub encoding: String,
}

/// New value of a parameter.
#[derive(Debug, Deserialize)]
pub(super) struct Assignment {
    pub name: String,
    #[serde(default)]
    pub value: Value,
}

/// A binary message of a client.
#[derive(Debug, PartialEq)]
pub(super) enum Binary<'a> {
    /// A message on one of its channels.
    Record { channel: u32, data: &'a [u8] },
    /// Call of a service.
    Call { service: u32, call: u32, encoding: &'a [u8], data: &'a [u8] },
}

impl Binary<'_> {
    /// Reads a message; `None` if it is malformed.
    pub fn parse(bytes: &[u8]) -> Option<Binary<'_>> {
        let (&code, mut rest) = bytes.split_first()?;
        let mut number = || {
            let (number, after) = rest.split_first_chunk::<4>()?;
            rest = after;
            Some(u32::from_le_bytes(*number))
        };
        match code {
            CLIENT_RECORD => {
                let channel = number()?;
                Some(Binary::Record { channel, data: rest })
            }
            SERVICE_CALL => {
                let (service, call, length) = (number()?, number()?, number()?);
                let (encoding, data) = rest.split_at_checked(length as usize)?;
                Some(Binary::Call { service, call, encoding, data })
            }
            _ => None,
        }
    }
}

/// First message to a client.
pub(super) fn server_info(robot: &str, session: &str) -> Message {
    text(&json!({
        "op": "serverInfo",
        "name": format!("yamabico: {robot}"),
        "capabilities": CAPABILITIES,
        "supportedEncodings": [JSON],
        "sessionId": session,
    }))
}

/// Announcement of channels, whose identifiers are their indices.
pub(super) fn advertise(channels: &[Channel]) -> String {
    let channels = channels.iter().enumerate().map(|(id, channel)| {
        let format = &channel.format;
        let mut json = json!({ "id": id, "topic": channel.topic, "encoding": format.encoding });
        if let Some(schema) = &format.schema {
            json["schemaName"] = schema.name.as_str().into();
            json["schemaEncoding"] = schema.encoding.as_str().into();
            json["schema"] = match schema.encoding.as_str() {
                "jsonschema" => String::from_utf8_lossy(&schema.data).into(),
                _ => STANDARD.encode(&schema.data).into(),
            };
        }
        json
    });
    json!({ "op": "advertise", "channels": channels.collect::<Vec<_>>() }).to_string()
}

/// Values of parameters, as the answer to the request `id` if there is one.
pub(super) fn parameter_values<'a>(
    parameters: impl IntoIterator<Item = &'a Parameter>,
    id: Option<&str>,
) -> Message {
    let values: Vec<Value> = parameters.into_iter().map(Parameter::to_json).collect();
    let mut json = json!({ "op": "parameterValues", "parameters": values });
    if let Some(id) = id {
        json["id"] = id.into();
    }
    text(&json)
}

/// Sentence for the user.
pub(super) fn status(level: Level, sentence: &str) -> Message {
    text(&json!({ "op": "status", "level": level as u8, "message": sentence }))
}

/// A record of a subscription.
pub(super) fn record(subscription: u32, time: Time, data: &[u8]) -> Message {
    let head = [&[RECORD][..], &subscription.to_le_bytes(), &time.0.to_le_bytes()];
    Message::Binary([head.concat().as_slice(), data].concat().into())
}

/// The time.
pub(super) fn time(time: Time) -> Message {
    Message::Binary([&[TIME][..], &time.0.to_le_bytes()].concat().into())
}

/// Effect of the call of a service, or the cause why it had none.
pub(super) fn service_response(service: u32, call: u32, answer: Result<&str, &str>) -> Message {
    match answer {
        Ok(done) => {
            let numbers = [service, call, JSON.len() as u32].map(u32::to_le_bytes).concat();
            let body = json!({ "done": done }).to_string();
            Message::Binary(
                [&[SERVICE_RESPONSE], &*numbers, JSON.as_bytes(), body.as_bytes()].concat().into(),
            )
        }
        Err(problem) => text(&json!({
            "op": "serviceCallFailure", "serviceId": service, "callId": call, "message": problem,
        })),
    }
}

fn text(json: &Value) -> Message {
    Message::Text(json.to_string().into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::MessageType;
    use yamabico_runtime::record::channels;

    #[test]
    fn requests_are_read() {
        let parse = |text: &str| serde_json::from_str::<Request>(text);
        let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":10}]}"#;
        assert!(
            matches!(parse(subscribe), Ok(Request::Subscribe { subscriptions }) if subscriptions[0].channel_id == 10)
        );
        let get = r#"{"op":"getParameters","parameterNames":[],"id":"all"}"#;
        assert!(matches!(parse(get), Ok(Request::GetParameters { id: Some(id), .. }) if id == "all"));
        let set = r#"{"op":"setParameters","parameters":[{"name":"a.b","type":"float64","value":1}]}"#;
        assert!(
            matches!(parse(set), Ok(Request::SetParameters { parameters, id: None }) if parameters[0].value == 1)
        );
        let advertise = r#"{"op":"advertise","channels":[{"id":3,"topic":"/cmd_vel","encoding":"json","schemaName":"geometry_msgs/Twist"}]}"#;
        assert!(matches!(parse(advertise), Ok(Request::Advertise { channels }) if channels[0].id == 3));
        assert!(matches!(
            parse(r#"{"op":"subscribeConnectionGraph"}"#),
            Ok(Request::SubscribeConnectionGraph {})
        ));
        for text in [
            "",
            "{}",
            "[]",
            r#"{"op":"fly"}"#,
            r#"{"op":"subscribe"}"#,
            r#"{"op":"unsubscribe","subscriptionIds":[-1]}"#,
        ] {
            assert!(parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn calls_and_records_of_clients_are_read() {
        let call = [&[2][..], &10_u32.to_le_bytes(), &12_u32.to_le_bytes(), &4_u32.to_le_bytes(), b"json{}"]
            .concat();
        assert_eq!(
            Binary::parse(&call),
            Some(Binary::Call { service: 10, call: 12, encoding: b"json", data: b"{}" })
        );
        assert_eq!(Binary::parse(&[1, 30, 0, 0, 0, 7]), Some(Binary::Record { channel: 30, data: &[7] }));
        for end in 0..17 {
            assert_eq!(Binary::parse(&call[..end]), None, "{end}");
        }
        let lie = [&[2][..], &[0; 8], &u32::MAX.to_le_bytes(), b"json"].concat();
        assert!(Binary::parse(&lie).is_none() && Binary::parse(&[9, 0, 0, 0, 0]).is_none());
    }

    #[test]
    fn messages_to_clients_have_the_form_of_the_protocol() {
        let Message::Binary(record) = record(30, Time(1234), b"{}") else { panic!("no bytes") };
        assert_eq!(&record[..], [1, 30, 0, 0, 0, 0xd2, 4, 0, 0, 0, 0, 0, 0, b'{', b'}']);
        let Message::Binary(time) = time(Time(1_234_567_890)) else { panic!("no bytes") };
        assert_eq!(&time[..], [2, 0xd2, 2, 0x96, 0x49, 0, 0, 0, 0]);
        let Message::Binary(answer) = service_response(10, 12, Ok("it")) else { panic!("no bytes") };
        assert_eq!(&answer[..13], [3, 10, 0, 0, 0, 12, 0, 0, 0, 4, 0, 0, 0]);
        assert_eq!(&answer[13..], br#"json{"done":"it"}"#);
        let Message::Text(failure) = service_response(1, 2, Err("no")) else { panic!("no text") };
        assert!(failure.contains("serviceCallFailure") && failure.contains("\"callId\":2"));
        let frame = MessageType::find("yamabico.FrameHeader.v1").unwrap();
        let channels: Value = serde_json::from_str(&advertise(&channels([("front", frame)]))).unwrap();
        let of = |topic: &str| {
            let channels = channels["channels"].as_array().unwrap();
            channels.iter().find(|channel| channel["topic"] == topic).unwrap().clone()
        };
        assert_eq!(of("front")["schemaEncoding"], "jsonschema");
        let image = of("/front/image");
        assert_eq!(
            (&image["encoding"], &image["schemaName"]),
            (&"protobuf".into(), &"foxglove.CompressedImage".into())
        );
        assert!(STANDARD.decode(image["schema"].as_str().unwrap()).unwrap().len() > 100);
    }
}
