//! Messages from the JSON of a recording, without a tree of values in between: most of the time of a replay of decisions.

use std::fmt;

use serde::Deserializer;
use serde::de::value::StrDeserializer;
use serde::de::{
    Deserialize, DeserializeSeed, Error, IgnoredAny, IntoDeserializer, MapAccess, SeqAccess, Visitor,
};
use yamabico_core::message::{Axes, Field, Layout, MessageType};

use super::schema::{Bytes, HEADER_BYTES, ITEM_BYTES, bytes_of_hexadecimal};

/// Reads the text of [`to_json`](super::to_json); `None` if it does not fit. Gives the same as [`from_json`](super::from_json).
pub(super) fn read(message: &MessageType, text: &[u8]) -> Option<Bytes> {
    let mut parts = Parts::of(message);
    let mut json = serde_json::Deserializer::from_slice(text);
    json.deserialize_map(&mut parts).ok()?;
    json.end().ok()?;
    let bytes = match parts.exact {
        [Some(header), items] => Bytes { header, items: items? },
        [None, _] if !parts.has_header || parts.has_null => return None,
        [None, _] => {
            let has_items = message.item == Layout::U8 || parts.has_items;
            Bytes { header: parts.header, items: has_items.then_some(parts.items)? }
        }
    };
    let is_whole =
        bytes.header.len() == message.header_size && bytes.items.len() % message.item_size.max(1) == 0;
    is_whole.then_some(bytes)
}

/// Parts of a message, as far as they have been read.
struct Parts<'a> {
    message: &'a MessageType,
    header: Vec<u8>,
    items: Vec<u8>,
    has_header: bool,
    has_items: bool,
    /// Set if a number is not finite.
    has_null: bool,
    /// Header and items from their hexadecimal form.
    exact: [Option<Vec<u8>>; 2],
}

impl<'a> Parts<'a> {
    fn of(message: &'a MessageType) -> Parts<'a> {
        Parts {
            message,
            header: vec![0; message.header_size],
            items: Vec::new(),
            has_header: false,
            has_items: false,
            has_null: false,
            exact: [None, None],
        }
    }
}

impl<'de> Visitor<'de> for &mut Parts<'_> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "a {}", self.message.name)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let Layout::Struct(layout) = self.message.header else { return Err(A::Error::custom("no struct")) };
        let mut missing = layout.fields.len();
        while let Some(key) = map.next_key_seed(Key(layout.fields))? {
            match key {
                Found::Field(index) => {
                    let field = &layout.fields[index];
                    let end = field.offset + size(field.layout);
                    let out =
                        self.header.get_mut(field.offset..end).ok_or_else(|| A::Error::custom("size"))?;
                    map.next_value_seed(Reader { layout: field.layout, out, has_null: &mut self.has_null })?;
                    missing -= 1;
                }
                Found::Items if self.message.item != Layout::U8 => {
                    let (layout, items) = (self.message.item, &mut self.items);
                    map.next_value_seed(Items { layout, items, has_null: &mut self.has_null })?;
                    self.has_items = true;
                }
                Found::Text if self.message.item == Layout::U8 => {
                    self.items = map.next_value::<String>()?.into_bytes();
                }
                Found::Exact(part) => self.exact[part] = bytes_of_hexadecimal(&map.next_value::<String>()?),
                Found::Items | Found::Text | Found::Other => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        self.has_header = missing == 0;
        Ok(())
    }
}

/// Name of a field of a message, or of what stands beside them.
struct Key<'a>(&'a [Field]);

enum Found {
    Field(usize),
    Items,
    Text,
    Exact(usize),
    Other,
}

impl<'de> DeserializeSeed<'de> for Key<'_> {
    type Value = Found;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Found, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for Key<'_> {
    type Value = Found;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("the name of a field")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Found, E> {
        Ok(match self.0.iter().position(|field| field.name == name) {
            Some(index) => Found::Field(index),
            None if name == "items" => Found::Items,
            None if name == "text" => Found::Text,
            None if name == HEADER_BYTES => Found::Exact(0),
            None if name == ITEM_BYTES => Found::Exact(1),
            None => Found::Other,
        })
    }
}

/// Items of a message, one after the other.
struct Items<'a> {
    layout: Layout,
    items: &'a mut Vec<u8>,
    has_null: &'a mut bool,
}

impl<'de> DeserializeSeed<'de> for Items<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Items<'_> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a list of items")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let Items { layout, items, has_null } = self;
        let size = size(layout);
        loop {
            let begin = items.len();
            items.resize(begin + size, 0);
            let out = &mut items[begin..];
            if list.next_element_seed(Reader { layout, out, has_null: &mut *has_null })?.is_none() {
                items.truncate(begin);
                return Ok(());
            }
        }
    }
}

/// One value of a known layout, written to `out`.
struct Reader<'a> {
    layout: Layout,
    out: &'a mut [u8],
    has_null: &'a mut bool,
}

impl Reader<'_> {
    fn put<E: Error>(self, bytes: &[u8]) -> Result<(), E> {
        if self.out.len() != bytes.len() {
            return Err(E::custom("size"));
        }
        self.out.copy_from_slice(bytes);
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for Reader<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Reader<'_> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:?}", self.layout)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<(), E> {
        let too_large = |_| E::custom("too large");
        match self.layout {
            Layout::U8 => self.put(&[u8::try_from(value).map_err(too_large)?]),
            Layout::U32 => self.put(&u32::try_from(value).map_err(too_large)?.to_ne_bytes()),
            Layout::I32 => self.put(&i32::try_from(value).map_err(too_large)?.to_ne_bytes()),
            Layout::U64 => self.put(&value.to_ne_bytes()),
            Layout::F64 => self.put(&(value as f64).to_ne_bytes()),
            _ => Err(E::custom("a number")),
        }
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<(), E> {
        match self.layout {
            Layout::I32 => self.put(&i32::try_from(value).map_err(|_| E::custom("too large"))?.to_ne_bytes()),
            Layout::F64 => self.put(&(value as f64).to_ne_bytes()),
            _ => match u64::try_from(value) {
                Ok(value) => self.visit_u64(value),
                Err(_) => Err(E::custom("negative")),
            },
        }
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<(), E> {
        if self.layout != Layout::F64 {
            return Err(E::custom("not an integer"));
        }
        self.put(&value.to_ne_bytes())
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        *self.has_null = true;
        Ok(())
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<(), E> {
        match self.layout {
            Layout::Text(size) if text.len() <= size => {
                self.out[..text.len()].copy_from_slice(text.as_bytes());
                Ok(())
            }
            Layout::U32 => {
                let text: StrDeserializer<'_, E> = text.into_deserializer();
                let axes = Axes::deserialize(text)?;
                self.put(&axes.bits().to_ne_bytes())
            }
            _ => Err(E::custom("a text")),
        }
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let Layout::Array(element, len) = self.layout else { return Err(A::Error::custom("a list")) };
        for out in self.out.chunks_exact_mut(size(*element).max(1)).take(len) {
            let read =
                list.next_element_seed(Reader { layout: *element, out, has_null: &mut *self.has_null })?;
            read.ok_or_else(|| A::Error::custom("too short"))?;
        }
        match list.next_element::<IgnoredAny>()? {
            None => Ok(()),
            Some(_) => Err(A::Error::custom("too long")),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let Layout::Struct(layout) = self.layout else { return Err(A::Error::custom("a table")) };
        let mut missing = layout.fields.len();
        while let Some(key) = map.next_key_seed(Key(layout.fields))? {
            let Found::Field(index) = key else {
                map.next_value::<IgnoredAny>()?;
                continue;
            };
            let field = &layout.fields[index];
            let out = self.out.get_mut(field.offset..field.offset + size(field.layout));
            let out = out.ok_or_else(|| A::Error::custom("size"))?;
            map.next_value_seed(Reader { layout: field.layout, out, has_null: &mut *self.has_null })?;
            missing = missing.saturating_sub(1);
        }
        if missing == 0 { Ok(()) } else { Err(A::Error::custom("fields are missing")) }
    }
}

fn size(layout: Layout) -> usize {
    match layout {
        Layout::U8 => 1,
        Layout::U32 | Layout::I32 => 4,
        Layout::U64 | Layout::F64 => 8,
        Layout::Text(size) => size,
        Layout::Array(element, len) => size(*element) * len,
        Layout::Struct(layout) => layout.size,
    }
}

#[cfg(test)]
mod tests {
    use super::super::schema::{from_json, to_json};
    use super::*;
    use yamabico_core::message::ALL;

    /// Fills a message with different finite numbers and short texts.
    fn fill(layout: Layout, out: &mut [u8], next: &mut u32) {
        *next += 7;
        match layout {
            Layout::U8 => out[0] = *next as u8,
            Layout::U32 => out.copy_from_slice(&(*next % 8).to_ne_bytes()),
            Layout::I32 => out.copy_from_slice(&(-(*next as i32)).to_ne_bytes()),
            Layout::U64 => out.copy_from_slice(&(u64::MAX - u64::from(*next)).to_ne_bytes()),
            Layout::F64 => out.copy_from_slice(&(0.1 + f64::from(*next)).sin().to_ne_bytes()),
            Layout::Text(size) => out[..size / 3].fill(b'a' + (*next % 26) as u8),
            Layout::Array(element, _) => {
                out.chunks_exact_mut(size(*element)).for_each(|out| fill(*element, out, next));
            }
            Layout::Struct(layout) => layout.fields.iter().for_each(|field| {
                fill(field.layout, &mut out[field.offset..field.offset + size(field.layout)], next);
            }),
        }
    }

    fn pair(bytes: Option<Bytes>) -> Option<(Vec<u8>, Vec<u8>)> {
        bytes.map(|bytes| (bytes.header, bytes.items))
    }

    #[test]
    fn every_message_is_read_as_by_way_of_a_tree() {
        for message in ALL {
            let (mut header, mut items) = (vec![0; message.header_size], Vec::new());
            fill(message.header, &mut header, &mut 0);
            if message.item != Layout::U8 {
                items = vec![0; 3 * message.item_size];
                items.chunks_exact_mut(message.item_size).for_each(|item| fill(message.item, item, &mut 1));
            }
            let json = to_json(message, &header, &items);
            let text = json.to_string();
            assert_eq!(pair(read(message, text.as_bytes())), Some((header, items)), "{}", message.name);
            // Every field is needed, and of its type.
            for name in json.as_object().unwrap().keys().filter(|name| *name != "text") {
                for change in [
                    None,
                    Some(serde_json::json!([1])),
                    Some(serde_json::json!("x")),
                    Some(serde_json::Value::Null),
                ] {
                    let mut other = json.clone();
                    match change {
                        None => drop(other.as_object_mut().unwrap().remove(name)),
                        Some(change) => other[name] = change,
                    }
                    let text = other.to_string();
                    let (direct, tree) =
                        (pair(read(message, text.as_bytes())), pair(from_json(message, &other)));
                    assert_eq!(direct, tree, "{}: {text}", message.name);
                }
            }
            for end in (0..text.len()).step_by(7) {
                assert!(read(message, &text.as_bytes()[..end]).is_none());
            }
        }
    }

    #[test]
    fn numbers_that_are_not_finite_come_from_their_bytes() {
        for message in ALL {
            let header = vec![0xff; message.header_size];
            let items = if message.item == Layout::U8 { Vec::new() } else { vec![0xff; message.item_size] };
            let json = to_json(message, &header, &items);
            let (direct, tree) = (read(message, json.to_string().as_bytes()), from_json(message, &json));
            assert_eq!(pair(direct), pair(tree), "{}", message.name);
        }
    }
}
