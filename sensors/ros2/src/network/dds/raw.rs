//! Messages as bytes: decoding and encoding are ours.

use std::convert::Infallible;

use rustdds::RepresentationIdentifier;
use rustdds::bytes::Bytes;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};

/// A message in CDR. A received one is behind its encapsulation header of four bytes; one that is sent has none.
pub(super) struct Raw(pub Vec<u8>);

/// Link between [`Raw`] and the library.
pub(super) struct RawAdapter;

#[derive(Clone)]
pub(super) struct RawDecoder;

impl DeserializerAdapter<Raw> for RawAdapter {
    type Error = Infallible;
    type Decoded = Raw;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        const ENCODINGS: [RepresentationIdentifier; 2] =
            [RepresentationIdentifier::CDR_LE, RepresentationIdentifier::CDR_BE];
        &ENCODINGS
    }

    fn transform_decoded(decoded: Raw) -> Raw {
        decoded
    }
}

impl DefaultDecoder<Raw> for RawAdapter {
    type Decoder = RawDecoder;
    const DECODER: RawDecoder = RawDecoder;
}

impl Decode<'_, Raw> for RawDecoder {
    type Error = Infallible;

    fn decode_bytes(self, body: &[u8], encoding: RepresentationIdentifier) -> Result<Raw, Infallible> {
        let is_little = u8::from(encoding == RepresentationIdentifier::CDR_LE);
        let mut message = Vec::with_capacity(4 + body.len());
        message.extend_from_slice(&[0, is_little, 0, 0]);
        message.extend_from_slice(body);
        Ok(Raw(message))
    }
}

impl SerializerAdapter<Raw> for RawAdapter {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(message: &Raw) -> Result<Bytes, Infallible> {
        Ok(Bytes::copy_from_slice(&message.0))
    }
}
