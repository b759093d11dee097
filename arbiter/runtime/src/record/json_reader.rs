//! Messages from the JSON of a recording, in one pass over its text: most of the time of a replay of decisions.

use std::borrow::Cow;

use yamabico_core::message::{Axes, Layout, MessageType, StructLayout};

use super::schema::{Bytes, HEADER_BYTES, ITEM_BYTES, bytes_of_hexadecimal};

/// Reads the text of [`to_json`](super::to_json); `None` if it does not fit. Gives the same as [`from_json`](super::from_json).
pub(super) fn read(message: &MessageType, text: &[u8]) -> Option<Bytes> {
    let Layout::Struct(layout) = message.header else { return None };
    let is_list = message.item != Layout::U8;
    let mut reader = Reader { json: Json(text), has_null: false };
    let (mut header, mut items, mut has_items) = (vec![0; message.header_size], Vec::new(), !is_list);
    // Header and items from their hexadecimal form.
    let mut exact = [None, None];
    let has_header = reader.table(layout, &mut header, &mut |reader, key| {
        match key {
            b"items" if is_list => {
                reader.items(message.item, &mut items)?;
                has_items = true;
            }
            b"text" if !is_list => items = reader.json.string()?.into_owned().into_bytes(),
            key if key == HEADER_BYTES.as_bytes() => exact[0] = bytes_of_hexadecimal(&reader.json.string()?),
            key if key == ITEM_BYTES.as_bytes() => exact[1] = bytes_of_hexadecimal(&reader.json.string()?),
            _ => reader.json.skip()?,
        }
        Some(())
    })?;
    reader.json.is_over().then_some(())?;
    let bytes = match exact {
        [Some(header), items] => Bytes { header, items: items? },
        [None, _] => (has_header && has_items && !reader.has_null).then_some(Bytes { header, items })?,
    };
    let is_whole =
        bytes.header.len() == message.header_size && bytes.items.len() % message.item_size.max(1) == 0;
    is_whole.then_some(bytes)
}

/// Receives what stands in a table besides the fields of its layout.
type Others<'a, 't> = &'a mut dyn FnMut(&mut Reader<'t>, &[u8]) -> Option<()>;

/// Reads values of known layouts.
struct Reader<'t> {
    json: Json<'t>,
    /// Set if a number is not finite, which JSON writes as null.
    has_null: bool,
}

impl<'t> Reader<'t> {
    /// Reads a value to `out`, which has its size.
    fn value(&mut self, layout: Layout, out: &mut [u8]) -> Option<()> {
        if self.json.next()? == b'n' {
            self.has_null = true;
            return self.json.word("null");
        }
        match layout {
            Layout::U8 => put(out, &[self.json.number()?.parse().ok()?]),
            Layout::U32 if self.json.next()? == b'"' => {
                put(out, &Axes::from_names(&self.json.string()?)?.bits().to_ne_bytes())
            }
            Layout::U32 => put(out, &self.json.number()?.parse::<u32>().ok()?.to_ne_bytes()),
            Layout::I32 => put(out, &self.json.number()?.parse::<i32>().ok()?.to_ne_bytes()),
            Layout::U64 => put(out, &self.json.number()?.parse::<u64>().ok()?.to_ne_bytes()),
            Layout::F64 => {
                let number: f64 = self.json.number()?.parse().ok()?;
                put(out, &number.is_finite().then_some(number)?.to_ne_bytes())
            }
            Layout::Text(_) => {
                let text = self.json.string()?;
                put(out.get_mut(..text.len())?, text.as_bytes())
            }
            Layout::Array(element, len) => self.array(*element, len, out),
            Layout::Struct(layout) => {
                self.table(layout, out, &mut |reader, _| reader.json.skip())?.then_some(())
            }
        }
    }

    fn array(&mut self, element: Layout, len: usize, out: &mut [u8]) -> Option<()> {
        self.json.take(b'[')?;
        for (index, out) in out.chunks_exact_mut(element.size().max(1)).take(len).enumerate() {
            if index > 0 {
                self.json.take(b',')?;
            }
            self.value(element, out)?;
        }
        self.json.take(b']')
    }

    /// Reads a list of items.
    fn items(&mut self, layout: Layout, items: &mut Vec<u8>) -> Option<()> {
        self.json.take(b'[')?;
        if self.json.next()? == b']' {
            return self.json.take(b']');
        }
        loop {
            let begin = items.len();
            items.resize(begin + layout.size(), 0);
            self.value(layout, items.get_mut(begin..)?)?;
            if self.json.next()? == b']' {
                return self.json.take(b']');
            }
            self.json.take(b',')?;
        }
    }

    /// Reads the fields of a struct to `out`; returns true if each is there once.
    fn table(&mut self, layout: &StructLayout, out: &mut [u8], others: Others<'_, 't>) -> Option<bool> {
        let (mut is_first, mut found, mut seen) = (true, 0, [0_u64; 4]);
        self.json.take(b'{')?;
        while self.json.next()? != b'}' {
            if !std::mem::replace(&mut is_first, false) {
                self.json.take(b',')?;
            }
            let key = self.json.quoted()?;
            self.json.take(b':')?;
            match layout.fields.iter().position(|field| field.name.as_bytes() == &*key) {
                Some(index) => {
                    let field = &layout.fields[index];
                    let part = out.get_mut(field.offset..field.offset + field.layout.size())?;
                    self.value(field.layout, part)?;
                    let word = seen.get_mut(index / 64)?;
                    (*word & (1 << (index % 64)) == 0).then_some(())?;
                    *word |= 1 << (index % 64);
                    found += 1;
                }
                None => others(self, &key)?,
            }
        }
        self.json.take(b'}')?;
        Some(found == layout.fields.len())
    }
}

fn put(out: &mut [u8], bytes: &[u8]) -> Option<()> {
    (out.len() == bytes.len()).then(|| out.copy_from_slice(bytes))
}

/// Text that has not been read yet.
struct Json<'t>(&'t [u8]);

impl<'t> Json<'t> {
    /// Next byte that is no space.
    fn next(&mut self) -> Option<u8> {
        loop {
            match self.0 {
                [b' ' | b'\t' | b'\n' | b'\r', rest @ ..] => self.0 = rest,
                rest => return rest.first().copied(),
            }
        }
    }

    fn is_over(&mut self) -> bool {
        self.next().is_none()
    }

    /// Takes this byte.
    fn take(&mut self, byte: u8) -> Option<()> {
        (self.next()? == byte).then(|| self.0 = &self.0[1..])
    }

    fn word(&mut self, word: &str) -> Option<()> {
        self.next()?;
        self.0 = self.0.strip_prefix(word.as_bytes())?;
        Some(())
    }

    /// Takes the bytes at the beginning that fit.
    fn while_of(&mut self, fits: impl Fn(&u8) -> bool) -> &'t [u8] {
        let length = self.0.iter().position(|byte| !fits(byte)).unwrap_or(self.0.len());
        let (taken, rest) = self.0.split_at(length);
        self.0 = rest;
        taken
    }

    fn number(&mut self) -> Option<&'t str> {
        self.next()?;
        let number = self.while_of(|byte| matches!(byte, b'0'..=b'9' | b'-' | b'+' | b'.' | b'e' | b'E'));
        std::str::from_utf8(number).ok()
    }

    fn string(&mut self) -> Option<Cow<'t, str>> {
        match self.quoted()? {
            Cow::Borrowed(text) => std::str::from_utf8(text).ok().map(Cow::Borrowed),
            Cow::Owned(text) => String::from_utf8(text).ok().map(Cow::Owned),
        }
    }

    /// Takes a text, which need not be UTF-8.
    fn quoted(&mut self) -> Option<Cow<'t, [u8]>> {
        self.take(b'"')?;
        let begin = self.0;
        let plain = self.while_of(|byte| !matches!(byte, b'"' | b'\\' | ..b' '));
        if self.0.first() == Some(&b'"') {
            self.0 = &self.0[1..];
            return Some(Cow::Borrowed(plain));
        }
        // Escapes are rare.
        while let [b'\\', _, rest @ ..] = self.0 {
            self.0 = rest;
            self.while_of(|byte| !matches!(byte, b'"' | b'\\'));
        }
        self.take(b'"')?;
        let text = begin.get(..begin.len() - self.0.len() - 1)?;
        let quoted = [&b"\""[..], text, b"\""].concat();
        serde_json::from_slice::<String>(&quoted).ok().map(|text| Cow::Owned(text.into_bytes()))
    }

    /// Passes over a value.
    fn skip(&mut self) -> Option<()> {
        let mut depth = 0_usize;
        loop {
            match self.next()? {
                b'"' => drop(self.quoted()?),
                open @ (b'{' | b'[') => {
                    self.take(open)?;
                    depth += 1;
                }
                close @ (b'}' | b']') => {
                    self.take(close)?;
                    depth = depth.checked_sub(1)?;
                }
                between @ (b',' | b':') if depth > 0 => {
                    self.take(between)?;
                    continue;
                }
                _ => {
                    let word = self.while_of(|byte| byte.is_ascii_alphanumeric() || b"+-.".contains(byte));
                    (!word.is_empty()).then_some(())?;
                }
            }
            if depth == 0 {
                return Some(());
            }
        }
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
                out.chunks_exact_mut(element.size()).for_each(|out| fill(*element, out, next));
            }
            Layout::Struct(layout) => layout.fields.iter().for_each(|field| {
                fill(field.layout, &mut out[field.offset..field.offset + field.layout.size()], next);
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
