//! Generates the message classes of the Python package from the Rust types. Run it after every change of a message:
//!
//!     cargo run -p yamabico-host --example python_messages

mod generate;

use std::path::Path;

fn main() -> std::io::Result<()> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(generate::FILE);
    std::fs::write(&path, generate::messages())
}
