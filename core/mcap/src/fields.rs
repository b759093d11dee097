//! Fields of a record, one behind the other, little endian.

/// The fields that have not been read yet. Nothing is read if a length is longer than they are.
pub(crate) struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    /// A number of bytes.
    pub fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    pub fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Bytes behind their number, which has four bytes.
    pub fn counted(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()?;
        self.bytes(usize::try_from(count).ok()?)
    }

    /// A text behind its length.
    pub fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.counted()?).ok()
    }

    /// Pairs of texts behind their length in bytes. Of several values of a key the last one counts.
    pub fn pairs<C: Extend<(String, String)> + Default>(&mut self) -> Option<C> {
        let (mut fields, mut pairs) = (Fields(self.counted()?), C::default());
        while !fields.0.is_empty() {
            let (key, value) = (fields.text()?, fields.text()?);
            pairs.extend([(key.to_owned(), value.to_owned())]);
        }
        Some(pairs)
    }
}
