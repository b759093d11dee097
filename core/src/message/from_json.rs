//! Conversion of messages from JSON.

use serde_json::Value;

use super::{Axes, Layout, MessageType};

impl MessageType {
    /// Converts the JSON of [`MessageType::to_json`] back to the bytes of header and items; a frame comes without
    /// pixels. Returns `None` if a field is missing, has the wrong type, or is not finite.
    #[must_use]
    pub fn from_json(&self, json: &Value) -> Option<(Vec<u8>, Vec<u8>)> {
        let (mut header, mut items) = (Vec::new(), Vec::new());
        push(self.header, json, &mut header)?;
        if self.item != Layout::U8 {
            for item in json.get("items")?.as_array()? {
                push(self.item, item, &mut items)?;
            }
        } else if let Some(text) = json.get("text").and_then(Value::as_str) {
            items.extend(text.bytes());
        }
        Some((header, items))
    }
}

fn push(layout: Layout, value: &Value, bytes: &mut Vec<u8>) -> Option<()> {
    match layout {
        Layout::U8 => bytes.push(u8::try_from(value.as_u64()?).ok()?),
        Layout::U32 => bytes.extend(axes_or_integer(value)?.to_ne_bytes()),
        Layout::I32 => bytes.extend(i32::try_from(value.as_i64()?).ok()?.to_ne_bytes()),
        Layout::U64 => bytes.extend(value.as_u64()?.to_ne_bytes()),
        Layout::F64 => bytes.extend(value.as_f64()?.to_ne_bytes()),
        Layout::Text(size) => {
            let text = value.as_str().filter(|text| text.len() <= size)?;
            bytes.extend(text.bytes().chain(std::iter::repeat_n(0, size - text.len())));
        }
        Layout::Array(element, len) => {
            let elements = value.as_array().filter(|elements| elements.len() == len)?;
            elements.iter().try_for_each(|value| push(*element, value, bytes))?;
        }
        Layout::Struct(layout) => {
            layout.fields.iter().try_for_each(|field| push(field.layout, value.get(field.name)?, bytes))?;
        }
    }
    Some(())
}

/// Reads an integer, or a set of axes by their names.
fn axes_or_integer(value: &Value) -> Option<u32> {
    match value {
        Value::String(_) => serde_json::from_value::<Axes>(value.clone()).ok().map(Axes::bits),
        _ => u32::try_from(value.as_u64()?).ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{ALL, Beam, FailureHeader, Proposal, RangeScanHeader, Reason};

    /// Fills every field with a distinct value.
    fn fill(layout: Layout, bytes: &mut Vec<u8>) {
        let n = bytes.len();
        match layout {
            Layout::U8 => bytes.push(n as u8),
            Layout::U32 => bytes.extend((n as u32 % 8).to_ne_bytes()),
            Layout::I32 => bytes.extend((-(n as i32)).to_ne_bytes()),
            Layout::U64 => bytes.extend((u64::MAX - n as u64).to_ne_bytes()),
            Layout::F64 => bytes.extend((1e3 * (n as f64 + 0.1).sin()).to_ne_bytes()),
            Layout::Text(size) => {
                bytes.extend((0..size).map(|i| if i < size / 2 { b'a' + (i % 26) as u8 } else { 0 }));
            }
            Layout::Array(element, len) => (0..len).for_each(|_| fill(*element, bytes)),
            Layout::Struct(layout) => layout.fields.iter().for_each(|field| fill(field.layout, bytes)),
        }
    }

    #[test]
    fn every_message_survives_the_round_trip_byte_for_byte() {
        for message in ALL {
            let (mut header, mut items) = (Vec::new(), Vec::new());
            fill(message.header, &mut header);
            if message.item != Layout::U8 {
                (0..3).for_each(|_| fill(message.item, &mut items));
            }
            let json = message.to_json(&header, &items);
            assert_eq!(message.from_json(&json), Some((header, items)), "{}: {json}", message.name);
        }
    }

    #[test]
    fn text_survives_the_round_trip() {
        let failure = MessageType::of::<FailureHeader>();
        let header = bytemuck::bytes_of(&FailureHeader::default()).to_vec();
        let json = failure.to_json(&header, b"the lens is gone");
        assert_eq!(failure.from_json(&json), Some((header, b"the lens is gone".to_vec())));
    }

    #[test]
    fn missing_or_wrong_fields_are_refused() {
        let scan = MessageType::of::<RangeScanHeader>();
        let header = RangeScanHeader { max_m: 3.0, ..Default::default() };
        let json = scan.to_json(bytemuck::bytes_of(&header), bytemuck::bytes_of(&Beam::default()));
        let with = |change: &dyn Fn(&mut Value)| {
            let mut json = json.clone();
            change(&mut json);
            scan.from_json(&json)
        };
        assert!(with(&|_| ()).is_some());
        assert!(with(&|json| json["max_m"] = Value::Null).is_none());
        assert!(with(&|json| json["sequence"] = (-1).into()).is_none());
        assert!(with(&|json| json["items"][0]["range_m"] = "far".into()).is_none());
        assert!(with(&|json| drop(json.as_object_mut().unwrap().remove("items"))).is_none());
        let proposal = MessageType::of::<Proposal>();
        let abstain = Proposal::abstain(Reason::Clear);
        let mut json = proposal.to_json(bytemuck::bytes_of(&abstain), &[]);
        json["axes"] = "sideways".into();
        assert!(proposal.from_json(&json).is_none());
    }
}
