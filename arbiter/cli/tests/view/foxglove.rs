//! `yamabico view` as Foxglove and Lichtblick see it: a client of the subprotocol `foxglove.sdk.v1`.

use std::collections::{BTreeMap, VecDeque};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use foxglove::Decode;
use foxglove::messages::{
    CameraCalibration, CompressedImage, FrameTransforms, ImageAnnotations, Log, PosesInFrame, SceneUpdate,
};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket, connect};
use yamabico_live_robot::venv;
use yamabico_testkit::config;

use super::View;
use crate::live_control::Robot;
use crate::program::{TIMEOUT, TestFolder, binary, text};

/// A viewer.
struct Viewer {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    /// Channels: identifier and schema by topic.
    channels: BTreeMap<String, (u64, String)>,
    services: BTreeMap<String, u64>,
    /// Messages that no test has asked for yet.
    waiting: VecDeque<Message>,
    calls: u32,
}

/// Opens a web socket as a viewer of this site.
fn open(
    url: &str,
    origin: Option<&str>,
    protocols: &str,
) -> Result<WebSocket<MaybeTlsStream<TcpStream>>, Box<tungstenite::Error>> {
    let mut request = url.into_client_request().unwrap();
    request.headers_mut().insert("sec-websocket-protocol", protocols.parse().unwrap());
    if let Some(origin) = origin {
        request.headers_mut().insert("origin", origin.parse().unwrap());
    }
    let (mut socket, response) = connect(request)?;
    assert_eq!(response.headers()["sec-websocket-protocol"], "foxglove.sdk.v1");
    if let MaybeTlsStream::Plain(stream) = socket.get_mut() {
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
    }
    Ok(socket)
}

impl Viewer {
    fn connect(url: &str) -> Viewer {
        let socket = open(url, Some("file://"), "foxglove.websocket.v1, foxglove.sdk.v1").unwrap();
        let (channels, services) = Default::default();
        let mut viewer = Viewer { socket, channels, services, waiting: VecDeque::new(), calls: 0 };
        let info = viewer.text("serverInfo");
        assert!(info["capabilities"].as_array().unwrap().contains(&"services".into()), "{info}");
        for channel in viewer.text("advertise")["channels"].as_array().unwrap() {
            let name = |key: &str| channel[key].as_str().unwrap().to_owned();
            viewer.channels.insert(name("topic"), (channel["id"].as_u64().unwrap(), name("schemaName")));
        }
        for service in viewer.text("advertiseServices")["services"].as_array().unwrap() {
            let name = service["name"].as_str().unwrap().to_owned();
            viewer.services.insert(name, service["id"].as_u64().unwrap());
        }
        viewer
    }

    fn send(&mut self, message: &Value) {
        self.socket.send(Message::text(message.to_string())).unwrap();
    }

    /// First message that `choose` takes; the others wait.
    fn find<T>(&mut self, what: &str, mut choose: impl FnMut(&Message) -> Option<T>) -> T {
        let found = self.waiting.iter().enumerate().find_map(|(i, message)| Some((i, choose(message)?)));
        if let Some((index, found)) = found {
            self.waiting.remove(index);
            return found;
        }
        let begun = Instant::now();
        loop {
            assert!(begun.elapsed() < TIMEOUT, "no {what}");
            let message = self.socket.read().unwrap();
            if let Some(found) = choose(&message) {
                return found;
            }
            // Records are many; answers wait.
            if message.is_text() {
                self.waiting.push_back(message);
            }
        }
    }

    /// Next text message with this operation.
    fn text(&mut self, operation: &str) -> Value {
        self.find(operation, |message| {
            let Message::Text(text) = message else { return None };
            let json: Value = serde_json::from_str(text).unwrap();
            (json["op"] == operation).then_some(json)
        })
    }

    /// Subscribes to a topic; the subscription has the channel's number plus 1000.
    fn subscribe(&mut self, topic: &str) -> u32 {
        let (channel, _) = *self
            .channels
            .get(topic)
            .as_ref()
            .unwrap_or_else(|| panic!("no {topic}: {:?}", self.channels.keys()));
        let id = channel + 1000;
        self.send(&json!({ "op": "subscribe", "subscriptions": [{ "id": id, "channelId": channel }] }));
        u32::try_from(id).unwrap()
    }

    /// Next record of a subscription that `choose` takes.
    fn record<T>(&mut self, subscription: u32, mut choose: impl FnMut(&[u8]) -> Option<T>) -> T {
        self.find(&format!("record {subscription}"), |message| {
            let Message::Binary(bytes) = message else { return None };
            let is_it = bytes[0] == 1 && bytes[1..5] == subscription.to_le_bytes();
            is_it.then(|| choose(&bytes[13..])).flatten()
        })
    }

    /// A record of a topic in its standard schema that `choose` takes.
    fn message<T: Decode>(&mut self, topic: &str, schema: &str, choose: impl Fn(&T) -> bool) -> T {
        assert_eq!(self.channels[topic].1, schema, "{topic}");
        let subscription = self.subscribe(topic);
        let found =
            self.record(subscription, |bytes| T::decode(bytes).ok().filter(|message| choose(message)));
        self.send(&json!({ "op": "unsubscribe", "subscriptionIds": [subscription] }));
        found
    }

    /// Waits for a decision; returns the time that it took.
    fn decision(&mut self, subscription: u32, is_it: impl Fn(&Value) -> bool) -> Duration {
        let begun = Instant::now();
        self.record(subscription, |bytes| is_it(&serde_json::from_slice(bytes).unwrap()).then_some(()));
        begun.elapsed()
    }

    /// Requests a service; returns the number of the call.
    fn request(&mut self, service: &str, request: &str) -> u32 {
        self.calls += 1;
        let numbers = [self.services[service] as u32, self.calls, 4].map(u32::to_le_bytes).concat();
        let bytes = [&[2], &*numbers, b"json", request.as_bytes()].concat();
        self.socket.send(Message::binary(bytes)).unwrap();
        self.calls
    }

    /// Calls a service; returns the answer, or the cause of its failure.
    fn call(&mut self, service: &str, request: &str) -> Result<String, String> {
        let call = self.request(service, request);
        self.find("answer of a service", |message| match message {
            Message::Binary(bytes) if bytes[0] == 3 && bytes[5..9] == call.to_le_bytes() => {
                let json: Value = serde_json::from_slice(&bytes[17..]).unwrap();
                Some(Ok(json["done"].as_str().unwrap().to_owned()))
            }
            Message::Text(text) => {
                let json: Value = serde_json::from_str(text).unwrap();
                let is_it = json["op"] == "serviceCallFailure" && json["callId"] == call;
                is_it.then(|| Err(json["message"].as_str().unwrap().to_owned()))
            }
            _ => None,
        })
    }

    fn parameter(&mut self, name: &str) -> Value {
        self.send(&json!({ "op": "getParameters", "parameterNames": [name], "id": "get" }));
        self.text("parameterValues")["parameters"][0].clone()
    }
}

/// The task of the hallway, with a teleop behavior.
fn hallway_with_teleop(folder: &TestFolder) -> PathBuf {
    let hallway = config("hallway.toml");
    let configs = hallway.parent().unwrap().canonicalize().unwrap();
    let text = std::fs::read_to_string(&hallway).unwrap();
    let text = text.replace("\"robots/", &format!("\"{}/robots/", configs.display()));
    let text = text.replace("\"maps/", &format!("\"{}/maps/", configs.display()));
    let task = folder.file("hallway-teleop.toml");
    std::fs::write(&task, text + "\n[behaviors.teleop]\npriority = 90\nperiod_ms = 50\n").unwrap();
    task
}

#[test]
fn foxglove_sees_and_commands_a_running_robot() {
    // On a busy machine late pictures make the avoider halt.
    let avoider = ["--set", "behaviors.stationary-obstacle-avoider.enabled=false"];
    let folder = TestFolder::new("foxglove");
    let robot = Robot::start_task("foxglove", &hallway_with_teleop(&folder), &avoider);
    let view = View::start(robot.name(), &folder);
    let mut viewer = Viewer::connect(&view.foxglove);

    let image: CompressedImage = viewer.message("/sensors/front/image", "foxglove.CompressedImage", |_| true);
    assert!(image.format == "jpeg" && image::load_from_memory(&image.data).is_ok());
    let lens: CameraCalibration =
        viewer.message("/sensors/front/calibration", "foxglove.CameraCalibration", |_| true);
    assert!(lens.k[0] > 0.0 && lens.width > 0 && lens.frame_id == image.frame_id);
    // The mounts are known before the pose.
    let is_whole = |frames: &FrameTransforms| frames.transforms.len() > 1;
    let frames: FrameTransforms = viewer.message("/tf", "foxglove.FrameTransforms", is_whole);
    let children: Vec<_> = frames.transforms.iter().map(|frame| frame.child_frame_id.as_str()).collect();
    assert_eq!(children, ["odom", "base", "sensors/front"]);
    let map: SceneUpdate = viewer.message("/map/scene", "foxglove.SceneUpdate", |_| true);
    assert!(map.entities[0].lines[0].points.len() > 20);
    let path: PosesInFrame =
        viewer.message("/behaviors/map-localizer/path/path", "foxglove.PosesInFrame", |_| true);
    assert!(path.poses.len() >= 2);
    // Behaviors draw only while overlays are viewed.
    let drawn: ImageAnnotations = viewer.message(
        "/behaviors/map-localizer/overlay/annotations",
        "foxglove.ImageAnnotations",
        |drawn: &ImageAnnotations| !drawn.points.is_empty(),
    );
    let stamp = drawn.points[0].timestamp.unwrap();
    let now_s = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_secs_f64();
    assert!((now_s - f64::from(stamp.sec())).abs() < 60.0, "stamps are on the wall clock: {stamp:?}");

    // Parameters.
    viewer.send(&json!({ "op": "subscribeParameterUpdates", "parameterNames": ["map-localizer.speed_mps"] }));
    let set = |value: f64| {
        let parameter = json!({ "name": "map-localizer.speed_mps", "type": "float64", "value": value });
        json!({ "op": "setParameters", "parameters": [parameter], "id": "set" })
    };
    viewer.send(&set(0.35));
    let values = viewer.text("parameterValues");
    assert_eq!(values["parameters"][0]["value"], 0.35, "{values}");
    while viewer.parameter("map-localizer.speed_mps")["value"] != 0.35 {}
    viewer.send(&set(99.0));
    let refused = viewer.text("status");
    assert!(refused["message"].as_str().unwrap().contains("speed_mps"), "{refused}");
    assert_eq!(viewer.parameter("map-localizer.speed_mps")["value"], 0.35);

    // Services.
    let decisions = viewer.subscribe("decision");
    viewer.decision(decisions, |decision| decision["mode_text"] == "driving");
    let begun = Instant::now();
    assert!(viewer.call("/estop", "").unwrap().contains("stopped"));
    viewer.decision(decisions, |decision| decision["commanded"]["linear"] == 0.0);
    println!("stopped {:.2} s after the call", begun.elapsed().as_secs_f64());
    viewer.decision(decisions, |decision| decision["mode_text"] == "emergency stop");
    viewer.call("/reset", "{}").unwrap();
    viewer.decision(decisions, |decision| decision["mode_text"] != "emergency stop");
    let name = json!({ "behavior": "wall-follower" }).to_string();
    assert_eq!(viewer.call("/disable", &name).unwrap(), "wall-follower is disabled");
    assert_eq!(viewer.call("/enable", &name).unwrap(), "wall-follower is enabled");
    assert!(viewer.call("/enable", r#"{"behavior":"nobody"}"#).unwrap_err().contains("nobody"));
    assert!(viewer.call("/goto", r#"{"x_m":1}"#).unwrap_err().contains("y_m"));
    assert!(viewer.call("/goto", r#"{"x_m":6,"y_m":0}"#).unwrap().contains("(6.00, 0.00)"));
    // A goal holds until the next one, so that a later subscriber receives it.
    let goal: SceneUpdate = viewer.message("/goal/scene", "foxglove.SceneUpdate", |_| true);
    let at = goal.entities[0].lines[0].pose.unwrap().position.unwrap();
    assert_eq!((goal.entities[0].frame_id.as_str(), at.x), ("map", 6.0));

    // The teleop panel drives through the behavior, as long as it publishes.
    viewer.send(&json!({ "op": "advertise", "channels":
        [{ "id": 7, "topic": "/cmd_vel", "encoding": "json", "schemaName": "geometry_msgs/Twist" }] }));
    let twist = br#"{"linear":{"x":0.15,"y":0,"z":0},"angular":{"x":0,"y":0,"z":0}}"#;
    let packet = [&[1][..], &7_u32.to_le_bytes(), twist].concat();
    let proposals = viewer.subscribe("behaviors/teleop/proposal");
    let begun = Instant::now();
    let proposed = loop {
        assert!(begun.elapsed() < TIMEOUT, "teleop proposes nothing");
        viewer.socket.send(Message::binary(packet.clone())).unwrap();
        let proposal: Value = viewer.record(proposals, |bytes| serde_json::from_slice(bytes).ok());
        if proposal["kind_text"] == "drive" {
            break proposal;
        }
    };
    assert_eq!(proposed["twist"]["linear"], 0.15, "{proposed}");
    viewer.record(proposals, |bytes| {
        let proposal: Value = serde_json::from_slice(bytes).unwrap();
        (proposal["kind_text"] == "abstain").then_some(())
    });

    viewer.send(&json!({ "op": "subscribeConnectionGraph" }));
    let graph = viewer.text("connectionGraphUpdate");
    let of = |list: &str, topic: &str| {
        let list = graph[list].as_array().unwrap();
        list.iter().find(|entry| entry["name"] == topic).unwrap_or_else(|| panic!("no {topic}")).clone()
    };
    assert_eq!(of("publishedTopics", "/sensors/front/image")["publisherIds"][0], "sim");
    let readers = of("subscribedTopics", "sensors/front");
    assert!(readers["subscriberIds"].as_array().unwrap().contains(&"map-localizer".into()), "{readers}");
    // The log has a line for each change, and a robot that only drives changes nothing.
    assert_eq!(viewer.channels["/log"].1, "foxglove.Log");
    let log = viewer.subscribe("/log");
    viewer.request("/disable", &name);
    let is_it = |line: &Log| line.name == "wall-follower" && line.message.starts_with("disable");
    viewer.record(log, |bytes| Log::decode(bytes).ok().filter(is_it));

    for (origin, protocols) in [(Some("http://evil.example"), "foxglove.sdk.v1"), (None, "other")] {
        assert!(open(&view.foxglove, origin, protocols).is_err(), "{origin:?} {protocols}");
    }
    // Whoever sends nonsense is dropped; the others go on.
    let mut hostile = open(&view.foxglove, None, "foxglove.sdk.v1").unwrap();
    while hostile.send(Message::text("{\"op\":\"fly\"}")).is_ok() && hostile.read().is_ok() {}
    viewer.decision(decisions, |_| true);
}

#[test]
fn foxglove_is_served_in_python() {
    let test = "foxglove_is_served_in_python";
    let Some(python) = venv::interpreter(binary()) else { return };
    let runs = |arguments: &[&str]| {
        Command::new(&python).args(arguments).output().is_ok_and(|output| output.status.success())
    };
    let pip = ["-m", "pip", "install", "--quiet", "--retries", "0", "--timeout", "5", "websockets"];
    if !runs(&["-c", "import websockets"]) && !runs(&pip) {
        println!("skipped {test}: the Python package websockets is missing");
        return;
    }
    let robot = Robot::start("foxglove-python", &[]);
    let folder = TestFolder::new("foxglove-python");
    let view = View::start(robot.name(), &folder);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/view/foxglove_client.py");
    let output = Command::new(&python).args([script, &view.foxglove]).output().unwrap();
    assert!(output.status.success(), "{}", text(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("{report}");
    assert_eq!((&report["speed_mps"], &report["mode"]), (&json!(0.35), &json!("emergency stop")), "{report}");
    for topic in ["/sensors/front/image", "/sensors/front/calibration", "/tf", "/map/scene", "decision"] {
        assert!(report["received"][topic].as_u64() > Some(0), "{topic}: {report}");
    }
}
