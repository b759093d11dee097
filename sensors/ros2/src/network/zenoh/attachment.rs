//! Attachment of rmw_zenoh to each message.

use crate::graph::EndpointId;

/// Number of bytes.
pub(super) const SIZE: usize = 33;

/// Returns the attachment of the message number `sequence` of the publisher `id`, which was sent `sent_ns` after 1970. Integers are
/// little-endian; the identity is behind its length.
pub(super) fn attachment(sequence: i64, sent_ns: u64, id: &EndpointId) -> [u8; SIZE] {
    let mut bytes = [0; SIZE];
    bytes[..8].copy_from_slice(&sequence.to_le_bytes());
    bytes[8..16].copy_from_slice(&sent_ns.to_le_bytes());
    bytes[16] = id.len() as u8;
    bytes[17..].copy_from_slice(id);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_is_that_of_rmw_zenoh() {
        let bytes = attachment(7, 0x0102_0304_0506_0708, &[0xAB; 16]);
        assert_eq!(bytes[..9], [7, 0, 0, 0, 0, 0, 0, 0, 8]);
        assert_eq!(bytes[15..18], [1, 16, 0xAB]);
    }
}
