//! Fixed-size text.

use std::fmt;

use bytemuck::{Pod, Zeroable};
use serde::{Serialize, Serializer};

/// UTF-8 text of at most `N` bytes, padded with zeros.
#[repr(transparent)]
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct Text<const N: usize>([u8; N]);

/// Name of a behavior, sensor or other part.
pub type Name = Text<32>;
/// Short explanation.
pub type Note = Text<64>;

impl<const N: usize> Text<N> {
    /// Creates a text, truncated at the last whole character that fits.
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(N);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; N];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Text(bytes)
    }

    /// Returns the text up to the first zero, truncated at the first byte that is not UTF-8.
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|&b| b == 0).unwrap_or(N);
        let bytes = &self.0[..end];
        match std::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or(""),
        }
    }

    /// Returns true if the text is empty.
    pub fn is_empty(&self) -> bool {
        self.as_str().is_empty()
    }
}

impl<const N: usize> Default for Text<N> {
    fn default() -> Self {
        Text([0; N])
    }
}

impl<const N: usize> From<&str> for Text<N> {
    fn from(text: &str) -> Self {
        Text::new(text)
    }
}

impl<const N: usize> fmt::Write for Text<N> {
    /// Appends text, truncated to the free space.
    fn write_str(&mut self, more: &str) -> fmt::Result {
        let used = self.as_str().len();
        let mut end = more.len().min(N - used);
        while !more.is_char_boundary(end) {
            end -= 1;
        }
        self.0[used..used + end].copy_from_slice(&more.as_bytes()[..end]);
        Ok(())
    }
}

impl<const N: usize> fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

impl<const N: usize> fmt::Display for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl<const N: usize> Serialize for Text<N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;

    #[test]
    fn cuts_at_whole_characters() {
        assert_eq!(Text::<4>::new("abcé").as_str(), "abc");
        assert_eq!(Text::<5>::new("abcé").as_str(), "abcé");
        let mut text = Text::<6>::new("ab");
        write!(text, "{}", 12345).unwrap();
        assert_eq!(text.as_str(), "ab1234");
    }

    #[test]
    fn invalid_utf8_is_cut_at_its_first_wrong_byte() {
        let text: Text<4> = bytemuck::cast([b'o', b'k', 0xff, b'x']);
        assert_eq!(text.as_str(), "ok");
    }
}
