//! Message types that plugins of other programs declare: their layout travels as data.
//!
//! A program knows the messages of its own version ([`ALL`]) and those that were declared to it: by the description of a plugin, by
//! the manifest of a running robot, or by a recording. A declared message begins with `stamp_ns` and `sequence`.

use std::sync::{PoisonError, RwLock};

use serde::{Deserialize, Serialize};

use super::{ALL, Channel, Field, Layout, MessageType, StructLayout};
use crate::time::Time;

/// Maximum number of declared types in one program; a type is kept until its end.
const MAX_TYPES: usize = 256;
/// Maximum size of a header or an item, bytes.
const MAX_BYTES: usize = 64 * 1024;
/// Maximum number of fields of a struct, and of structs inside each other.
const MAX_FIELDS: usize = 256;
const MAX_DEPTH: usize = 4;
/// Maximum length of a name.
const MAX_NAME: usize = 100;

/// Types that were declared, in the order of their declaration.
static DECLARED: RwLock<Vec<&'static MessageType>> = RwLock::new(Vec::new());

/// Declaration of a message type, as JSON or TOML.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MessageDeclaration {
    /// Versioned name, such as `acme.Smell.v1`. A changed layout needs a new version.
    pub name: String,
    /// Delivery policy of its channels.
    pub channel: Channel,
    /// Fields of the header in memory order, without gaps; the first are `stamp_ns` and `sequence`, both `u64`.
    pub header: Vec<FieldDeclaration>,
    /// Fields of an item; empty for a message without a list.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub items: Vec<FieldDeclaration>,
}

/// Declaration of a field.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldDeclaration {
    /// Name.
    pub name: String,
    /// Type.
    #[serde(rename = "type")]
    pub kind: FieldType,
}

/// Type of a declared field.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum FieldType {
    /// `u8`, `u32`, `i32`, `u64` or `f64`; `f64[9]` for an array; `text[32]` for UTF-8 text of 32 bytes, padded with zeros.
    Plain(String),
    /// Struct.
    Struct(Vec<FieldDeclaration>),
}

impl MessageType {
    /// Returns the type with this versioned name, built in or declared; `None` if it is unknown.
    pub fn find(name: &str) -> Option<&'static MessageType> {
        let built_in = ALL.iter().find(|message| message.name == name);
        let declared = || DECLARED.read().unwrap_or_else(PoisonError::into_inner);
        built_in.or_else(|| declared().iter().copied().find(|message| message.name == name))
    }

    /// Returns true for a type of this version of the program, which needs no declaration.
    #[must_use]
    pub fn is_built_in(&self) -> bool {
        ALL.iter().any(|message| message.name == self.name)
    }

    /// Makes a type of this program's own plugins known by its name.
    ///
    /// # Errors
    /// Another type of this name is known, or there are too many.
    pub fn register(self) -> Result<&'static MessageType, String> {
        match MessageType::find(self.name) {
            Some(known) if known.declaration() == self.declaration() => Ok(known),
            Some(_) => Err(conflict(self.name)),
            None => keep(self),
        }
    }

    /// Makes a type that another program declares known by its name; the same declaration may come again.
    ///
    /// # Errors
    /// The declaration is invalid, another type of this name is known, or there are too many. The text begins with the name.
    pub fn declare(declaration: &MessageDeclaration) -> Result<&'static MessageType, String> {
        if let Some(known) = MessageType::find(&declaration.name) {
            return if known.declaration() == *declaration {
                Ok(known)
            } else {
                Err(conflict(&declaration.name))
            };
        }
        let refused = |problem: String| format!("message type `{}`: {problem}", declaration.name);
        check_name(&declaration.name).map_err(refused)?;
        let (header, header_align) = structure("header", &declaration.header, 1).map_err(refused)?;
        let begins = |i: usize, name: &str| {
            header.fields.get(i).is_some_and(|field| field.name == name && field.layout == Layout::U64)
        };
        if !begins(0, "stamp_ns") || !begins(1, "sequence") {
            return Err(refused("its header must begin with `stamp_ns` and `sequence`, both u64".to_owned()));
        }
        let item = match declaration.items.is_empty() {
            true => Layout::U8,
            false => Layout::Struct(structure("items", &declaration.items, 1).map_err(refused)?.0),
        };
        keep(MessageType {
            name: Box::leak(declaration.name.clone().into_boxed_str()),
            channel: declaration.channel,
            header_size: header.size,
            header_align,
            item_size: item.size(),
            header: Layout::Struct(header),
            item,
            stamps: |header| (Time(number(header, 0)), Time(number(header, 0))),
            sequence: |header| number(header, 1),
            json: |message, header, items| message.json_by_layout(header, items),
        })
    }

    /// Returns the declaration of this type, for other programs.
    #[must_use]
    pub fn declaration(&self) -> MessageDeclaration {
        let fields = |layout: Layout| match layout {
            Layout::Struct(layout) => declared(layout),
            _ => Vec::new(),
        };
        MessageDeclaration {
            name: self.name.to_owned(),
            channel: self.channel,
            header: fields(self.header),
            items: fields(self.item),
        }
    }
}

fn conflict(name: &str) -> String {
    format!(
        "message type `{name}` is declared twice with different layouts: a changed layout needs a new version"
    )
}

fn keep(message: MessageType) -> Result<&'static MessageType, String> {
    let mut declared = DECLARED.write().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = declared.iter().copied().find(|known| known.name == message.name) {
        return Ok(known);
    }
    if declared.len() >= MAX_TYPES {
        return Err(format!("message type `{}`: more than {MAX_TYPES} types are declared", message.name));
    }
    let message: &'static MessageType = Box::leak(Box::new(message));
    declared.push(message);
    Ok(message)
}

/// Reads the u64 field with this index at the beginning of a header; zero if it is too short.
fn number(header: &[u8], index: usize) -> u64 {
    let bytes = header.get(8 * index..8 * index + 8).and_then(|bytes| bytes.try_into().ok());
    bytes.map_or(0, u64::from_ne_bytes)
}

fn check_name(name: &str) -> Result<(), String> {
    let (family, version) = name.rsplit_once(".v").unwrap_or((name, ""));
    let is_letter = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    let is_valid = name.len() <= MAX_NAME
        && family.contains('.')
        && family.chars().all(is_letter)
        && version.parse::<u32>().is_ok()
        && !family.starts_with("yamabico.");
    if is_valid {
        return Ok(());
    }
    Err("its name must have a family of its own and a version, such as `acme.Smell.v1`".to_owned())
}

/// Lays out the fields one behind the other; returns the alignment, too.
fn structure(
    name: &str,
    fields: &[FieldDeclaration],
    depth: usize,
) -> Result<(&'static StructLayout, usize), String> {
    if fields.is_empty() || fields.len() > MAX_FIELDS || depth > MAX_DEPTH {
        return Err(format!("`{name}` has {} fields in depth {depth}", fields.len()));
    }
    let (mut offset, mut align) = (0, 1);
    let mut laid_out: Vec<Field> = Vec::with_capacity(fields.len());
    for field in fields {
        let is_letter = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        let is_name =
            !field.name.is_empty() && field.name.len() <= MAX_NAME && field.name.chars().all(is_letter);
        if !is_name || laid_out.iter().any(|other| other.name == field.name) {
            return Err(format!("`{name}.{}` is no name of a field, or comes twice", field.name));
        }
        let (layout, field_align) = match &field.kind {
            FieldType::Plain(kind) => plain(kind).ok_or_else(|| {
                format!(
                    "`{name}.{}` has the type `{kind}`: use u8, u32, i32, u64, f64, f64[3] or text[32]",
                    field.name
                )
            })?,
            FieldType::Struct(fields) => {
                let (layout, align) = structure(&field.name, fields, depth + 1)?;
                (Layout::Struct(layout), align)
            }
        };
        if offset % field_align != 0 {
            return Err(format!(
                "`{name}.{}` leaves a gap before it: sort the fields by size, or fill it with a field `reserved`",
                field.name
            ));
        }
        laid_out.push(Field { name: leaked(&field.name), docs: "", offset, layout });
        offset += layout.size();
        align = align.max(field_align);
        if offset > MAX_BYTES {
            return Err(format!("`{name}` is larger than {MAX_BYTES} bytes"));
        }
    }
    if offset % align != 0 {
        return Err(format!("`{name}` leaves a gap at its end: fill it with a field `reserved`"));
    }
    let layout = StructLayout { name: leaked(name), docs: "", size: offset, fields: laid_out.leak() };
    Ok((Box::leak(Box::new(layout)), align))
}

fn leaked(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

/// Layout and alignment of a plain type.
fn plain(kind: &str) -> Option<(Layout, usize)> {
    let (name, count) = match kind.strip_suffix(']').and_then(|kind| kind.split_once('[')) {
        Some((name, count)) => {
            (name, Some(count.parse::<usize>().ok().filter(|count| (1..=MAX_BYTES).contains(count))?))
        }
        None => (kind, None),
    };
    let element: &'static Layout = match name {
        "text" => return count.map(|bytes| (Layout::Text(bytes), 1)),
        "u8" => &Layout::U8,
        "u32" => &Layout::U32,
        "i32" => &Layout::I32,
        "u64" => &Layout::U64,
        "f64" => &Layout::F64,
        _ => return None,
    };
    let layout = count.map_or(*element, |count| Layout::Array(element, count));
    Some((layout, element.size()))
}

fn declared(layout: &StructLayout) -> Vec<FieldDeclaration> {
    let field = |field: &Field| FieldDeclaration { name: field.name.to_owned(), kind: kind_of(field.layout) };
    layout.fields.iter().map(field).collect()
}

fn kind_of(layout: Layout) -> FieldType {
    FieldType::Plain(match layout {
        Layout::U8 => "u8".to_owned(),
        Layout::U32 => "u32".to_owned(),
        Layout::I32 => "i32".to_owned(),
        Layout::U64 => "u64".to_owned(),
        Layout::F64 => "f64".to_owned(),
        Layout::Text(bytes) => format!("text[{bytes}]"),
        Layout::Struct(layout) => return FieldType::Struct(declared(layout)),
        Layout::Array(element, count) => match kind_of(*element) {
            FieldType::Plain(name) => format!("{name}[{count}]"),
            // Only built-in messages have arrays of structs; they need no declaration.
            FieldType::Struct(_) => format!("struct[{count}]"),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn smell(name: &str) -> MessageDeclaration {
        let declared = json!({
            "name": name,
            "channel": "stream",
            "header": [
                { "name": "stamp_ns", "type": "u64" },
                { "name": "sequence", "type": "u64" },
                { "name": "place", "type": [{ "name": "x", "type": "f64" }, { "name": "y", "type": "f64" }] },
                { "name": "kind", "type": "text[8]" },
                { "name": "level", "type": "i32" },
                { "name": "reserved", "type": "u32" },
            ],
            "items": [{ "name": "ppm", "type": "f64[2]" }],
        });
        serde_json::from_value(declared).unwrap()
    }

    #[test]
    fn a_declared_message_is_read_and_written_by_its_layout() {
        let declaration = smell("test.Smell.v1");
        let message = MessageType::declare(&declaration).unwrap();
        assert_eq!((message.header_size, message.header_align, message.item_size), (48, 8, 16));
        assert!(!message.is_built_in() && MessageType::find("test.Smell.v1") == Some(message));
        assert_eq!(message.declaration(), declaration);
        assert_eq!(MessageType::declare(&declaration), Ok(message), "the same again");
        let value = json!({
            "stamp_ns": 7, "sequence": 3, "place": { "x": 0.5, "y": -1.0 }, "kind": "gas", "level": -2, "reserved": 0,
            "items": [{ "ppm": [1.0, 2.0] }, { "ppm": [3.0, 4.5] }],
        });
        let (header, items) = message.from_json(&value).unwrap();
        assert_eq!((header.len(), items.len()), (48, 32));
        assert_eq!(message.to_json(&header, &items), value);
        assert_eq!(((message.stamps)(&header).0, (message.sequence)(&header)), (Time(7), 3));
        assert!(message.to_json(&header[1..], &items).is_null());
        assert_eq!(((message.stamps)(&[]).0, (message.sequence)(&[1])), (Time::ZERO, 0));
    }

    #[test]
    fn a_changed_layout_needs_a_new_version() {
        let declaration = smell("test.Changed.v1");
        MessageType::declare(&declaration).unwrap();
        let mut changed = declaration.clone();
        changed.header.truncate(4);
        let problem = MessageType::declare(&changed).unwrap_err();
        assert!(problem.contains("declared twice") && problem.contains("test.Changed.v1"), "{problem}");
    }

    #[test]
    fn declarations_that_cannot_be_laid_out_are_refused() {
        let refused = |change: &dyn Fn(&mut MessageDeclaration)| {
            let mut declaration = smell("test.Refused.v1");
            change(&mut declaration);
            MessageType::declare(&declaration).unwrap_err()
        };
        for name in ["yamabico.Smell.v1", "Smell.v1", "test.Smell", "test.Smell.vx", "test.S mell.v1"] {
            let problem = refused(&|declaration| declaration.name = name.to_owned());
            assert!(problem.contains("family of its own"), "{problem}");
        }
        let first = refused(&|declaration| drop(declaration.header.remove(0)));
        assert!(first.contains("must begin with"), "{first}");
        let gap = refused(&|declaration| declaration.header[4].kind = FieldType::Plain("u8".into()));
        assert!(gap.contains("leaves a gap"), "{gap}");
        for kind in ["f32", "f64[0]", "text", "f64[99999999]", "u64[", "struct[2]"] {
            let problem =
                refused(&|declaration| declaration.items[0].kind = FieldType::Plain(kind.to_owned()));
            assert!(problem.contains(kind) || problem.contains("larger"), "{problem}");
        }
        let twice = refused(&|declaration| declaration.header[3].name = "place".into());
        assert!(twice.contains("twice"), "{twice}");
        let deep = refused(&|declaration| {
            for _ in 0..8 {
                let fields = std::mem::take(&mut declaration.items);
                declaration.items =
                    vec![FieldDeclaration { name: "a".into(), kind: FieldType::Struct(fields) }];
            }
        });
        assert!(deep.contains("depth"), "{deep}");
    }
}
