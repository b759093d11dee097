//! The bus: zero-copy channels over iceoryx2, and the only module that names it.

pub use iceoryx2::prelude::ZeroCopySend;
