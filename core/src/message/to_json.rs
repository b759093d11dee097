//! Conversion of messages to JSON by their layout.

use serde_json::{Map, Value};

use super::{Layout, MessageType};

impl MessageType {
    /// Converts header and items to JSON, without the pixels of a frame; text becomes the field `text`. Null if a size is wrong.
    #[must_use]
    pub fn to_json(&self, header: &[u8], items: &[u8]) -> Value {
        (self.json)(self, header, items)
    }

    /// Same as [`MessageType::to_json`], for a type whose Rust type this program does not have.
    pub(super) fn json_by_layout(&self, header: &[u8], items: &[u8]) -> Value {
        if header.len() != self.header_size {
            return Value::Null;
        }
        let mut value = read(self.header, header);
        if self.item != Layout::U8
            && let Some(object) = value.as_object_mut()
        {
            let items = items.chunks_exact(self.item_size).map(|item| read(self.item, item));
            object.insert("items".into(), items.collect());
        }
        value
    }
}

/// Reads a value from bytes of its size; null where a number is not finite.
fn read(layout: Layout, bytes: &[u8]) -> Value {
    match layout {
        Layout::U8 => bytes.first().copied().into(),
        Layout::U32 => bytes.try_into().map(u32::from_ne_bytes).ok().into(),
        Layout::I32 => bytes.try_into().map(i32::from_ne_bytes).ok().into(),
        Layout::U64 => bytes.try_into().map(u64::from_ne_bytes).ok().into(),
        Layout::F64 => bytes.try_into().map(f64::from_ne_bytes).ok().into(),
        Layout::Text(_) => {
            let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
            String::from_utf8_lossy(&bytes[..end]).into()
        }
        Layout::Array(element, _) => {
            bytes.chunks_exact(element.size()).map(|bytes| read(*element, bytes)).collect()
        }
        Layout::Struct(layout) => {
            let field = |field: &super::Field| {
                let part = bytes.get(field.offset..field.offset + field.layout.size()).unwrap_or_default();
                (field.name.to_owned(), read(field.layout, part))
            };
            layout.fields.iter().map(field).collect::<Map<_, _>>().into()
        }
    }
}
