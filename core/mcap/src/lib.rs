//! MCAP files, record by record, in bounded memory.
//!
//! A length in a file is a claim: it is compared with what the file has left, and with [`MAX_RECORD_BYTES`], before memory is
//! reserved for it. The crate `mcap`, which writes such files, reserves up to 4 GB for the length of a text.
//!
//! | file | contents |
//! |---|---|
//! | `records` | the records of a file, of which most are passed over |
//! | `chunk` | the compressed records in one of them |
//! | `definitions` | channels and schemas |
//! | `blocks` | unpacked chunks, and other records with messages or definitions |
//! | `messages` | messages with their channels, in the order of the file |
//! | `ahead` | the same, unpacked by a thread of its own, for some channels |
//! | `metadata` | facts and attached files |

mod ahead;
mod blocks;
mod chunk;
mod definitions;
mod error;
mod fields;
mod messages;
mod metadata;
mod records;

pub use ahead::MessagesAhead;
pub use definitions::{Channel, Schema};
pub use error::ReadError;
pub use messages::{Message, Messages};
pub use metadata::{Attachment, Metadata};
pub use records::{Opcode, Record, Records};

/// First and last bytes of a file.
pub const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Maximum length of a record, compressed or not, bytes.
pub const MAX_RECORD_BYTES: usize = 128 << 20;
