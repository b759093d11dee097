//! Facts and attached files of a recording.

use std::collections::BTreeMap;

use crate::fields::Fields;

/// Record of facts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Metadata {
    /// Name.
    pub name: String,
    /// Facts by their keys.
    pub facts: BTreeMap<String, String>,
}

impl Metadata {
    /// Reads the body of a record; `None` if a length in it lies, or a text is none.
    #[must_use]
    pub fn read(body: &[u8]) -> Option<Metadata> {
        let mut fields = Fields(body);
        Some(Metadata { name: fields.text()?.to_owned(), facts: fields.pairs()? })
    }
}

/// File in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment<'a> {
    /// Name.
    pub name: &'a str,
    /// Contents.
    pub data: &'a [u8],
}

impl Attachment<'_> {
    /// Reads the body of a record; `None` if a length in it lies, or the name is no text.
    #[must_use]
    pub fn read(body: &[u8]) -> Option<Attachment<'_>> {
        let mut fields = Fields(body);
        let _log_time = fields.u64()?;
        let _create_time = fields.u64()?;
        let name = fields.text()?;
        let _media_type = fields.text()?;
        let length = usize::try_from(fields.u64()?).ok()?;
        Some(Attachment { name, data: fields.bytes(length)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_that_lie_are_refused() {
        let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
        let pair = [text("seed"), text("7")].concat();
        let whole = [text("run"), (pair.len() as u32).to_le_bytes().to_vec(), pair.clone()].concat();
        assert_eq!(Metadata::read(&whole).unwrap().facts["seed"], "7");
        for end in 0..whole.len() {
            assert!(Metadata::read(&whole[..end]).is_none(), "{end}");
        }
        let long = [text("run"), u32::MAX.to_le_bytes().to_vec(), pair].concat();
        assert!(Metadata::read(&long).is_none());
        let head = [vec![0; 16], text("a.toml"), text("")].concat();
        let file = [head.clone(), 2_u64.to_le_bytes().to_vec(), b"ok".to_vec(), vec![0; 4]].concat();
        assert_eq!(Attachment::read(&file).unwrap(), Attachment { name: "a.toml", data: b"ok" });
        let lie = [head, u64::MAX.to_le_bytes().to_vec(), b"ok".to_vec()].concat();
        assert!(Attachment::read(&lie).is_none() && Attachment::read(&[]).is_none());
    }
}
