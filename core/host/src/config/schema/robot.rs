//! JSON Schema of robot files.

use serde_json::{Map, Value as Json, json};

use super::super::describe::{kinds_of_drives, kinds_of_sensors};
use super::super::exec::ExternalDriver;
use super::super::tables::{DeviceKeys, PartKeys, RobotKeys, SensorKeys};
use super::composite::{Composite, closed, free_with_exec, has_program, when};
use yamabico_core::plugins::Plugins;

/// Returns the JSON Schema of a robot file; `programs` are its external drivers.
pub(super) fn schema_of_robots(plugins: &Plugins, programs: &[ExternalDriver]) -> Json {
    let mut whole = Composite::new(schemars::schema_for!(RobotKeys).to_value(), "A robot of Yamabico");
    let device = whole.include("device", schemars::schema_for!(DeviceKeys).to_value());
    let sensor = whole.include("sensor", schemars::schema_for!(SensorKeys).to_value());
    let drive = whole.include("drive", schemars::schema_for!(PartKeys).to_value());
    let built_in = built_in(&mut whole, plugins);
    let external = external(&mut whole, programs);
    let named: Map<String, Json> =
        external.devices.into_iter().map(|(name, own)| (name, closed(vec![device.clone(), own]))).collect();
    let any = closed([vec![device, free_with_exec()], built_in.devices].concat());
    let devices = json!({ "type": "object", "properties": named, "additionalProperties": any });
    whole.set("devices", devices);
    let names: Vec<&str> = programs.iter().map(|(name, _)| name.as_str()).collect();
    let choice = |common: Json, built_in: Vec<Json>, external: Vec<Json>| match names.as_slice() {
        [] => closed([vec![common], built_in].concat()),
        names => {
            let is_external =
                json!({ "properties": { "device": { "enum": names } }, "required": ["device"] });
            let (external, built_in) = (json!({ "allOf": external }), json!({ "allOf": built_in }));
            closed(vec![common, json!({ "if": is_external, "then": external, "else": built_in })])
        }
    };
    let sensors = choice(sensor, built_in.sensors, external.sensors);
    let drive = choice(drive, built_in.drives, external.drives);
    let sensors = whole.define("sensor.any", sensors);
    let drive = whole.define("drive.any", drive);
    whole.set("sensors", json!({ "type": "object" }));
    whole.set("drive", json!({ "type": "object" }));
    // A robot file may get any table from the files that it includes.
    if let Some(required) = whole.json.as_object_mut().and_then(|object| object.remove("required")) {
        let alone = json!({ "not": { "required": ["include"] } });
        whole.json["allOf"] = json!([{ "if": alone, "then": { "required": required } }]);
    }
    // Sensors and the drive of an external program that was not asked may have unknown keys.
    let asked: Map<String, Json> = names.iter().map(|name| ((*name).to_owned(), json!(true))).collect();
    let no_other = json!({ "properties": asked, "additionalProperties": { "not": has_program() } });
    whole.json["if"] = json!({ "properties": { "devices": no_other } });
    whole.json["then"] = json!({
        "properties": { "sensors": { "additionalProperties": sensors }, "drive": drive }
    });
    whole.json
}

/// Returns the JSON Schema of a file that robot files include.
pub(super) fn robot_part(mut robot: Json) -> Json {
    robot["title"] = "A part of robots of Yamabico".into();
    if let Some(object) = robot.as_object_mut() {
        object.remove("allOf");
    }
    if let Some(properties) = robot["properties"].as_object_mut() {
        properties.remove("include");
    }
    robot
}

/// Schemas of the parameters of drivers.
struct DriverSchemas<Devices> {
    devices: Devices,
    sensors: Vec<Json>,
    drives: Vec<Json>,
}

/// Returns the parameters of the drivers of this program; each applies to a device of its driver, or a part of its kind.
fn built_in(whole: &mut Composite, plugins: &Plugins) -> DriverSchemas<Vec<Json>> {
    let mut schemas = DriverSchemas { devices: Vec::new(), sensors: Vec::new(), drives: Vec::new() };
    for driver in plugins.drivers.iter().map(|driver| driver.info()) {
        let own = whole.describe(&format!("device.{}", driver.name), &driver.parameters, &driver.summary);
        schemas.devices.push(when(&[("driver", &driver.name)], own));
    }
    for (kind, offers) in kinds_of_drives(plugins) {
        let any = offers.into_iter().map(|(driver, offer)| {
            whole.describe(&format!("drive.{driver}.{kind}"), &offer.parameters, &offer.summary)
        });
        let any: Vec<Json> = any.collect();
        schemas.drives.push(when(&[("kind", kind)], json!({ "anyOf": any })));
    }
    for (kind, offers) in kinds_of_sensors(plugins) {
        let any = offers.into_iter().map(|(driver, offer)| {
            whole.describe(&format!("sensor.{driver}.{kind}"), &offer.parameters, &offer.summary)
        });
        let any: Vec<Json> = any.collect();
        schemas.sensors.push(when(&[("kind", kind)], json!({ "anyOf": any })));
    }
    schemas
}

/// Returns the parameters of external programs, by device; each of the others applies to a part of its device and kind.
fn external(whole: &mut Composite, programs: &[ExternalDriver]) -> DriverSchemas<Vec<(String, Json)>> {
    let mut schemas = DriverSchemas { devices: Vec::new(), sensors: Vec::new(), drives: Vec::new() };
    for (device, driver) in programs {
        let driver = driver.info();
        let own = whole.describe(&format!("program.{device}"), &driver.parameters, &driver.summary);
        schemas.devices.push((device.clone(), own));
        for offer in &driver.sensors {
            let name = format!("program.{device}.sensor.{}", offer.kind);
            let own = whole.describe(&name, &offer.parameters, &offer.summary);
            schemas.sensors.push(when(&[("device", device), ("kind", &offer.kind)], own));
        }
        for offer in &driver.drives {
            let name = format!("program.{device}.drive.{}", offer.kind);
            let own = whole.describe(&name, &offer.parameters, &offer.summary);
            schemas.drives.push(when(&[("device", device), ("kind", &offer.kind)], own));
        }
    }
    schemas
}
