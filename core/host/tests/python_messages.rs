//! The messages of the Python package are generated from the Rust types.

use std::path::Path;

#[test]
fn the_python_messages_are_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(crate::generate::FILE);
    let written = std::fs::read_to_string(&path).unwrap();
    assert!(
        written == crate::generate::messages(),
        "{} is not up to date: cargo run -p yamabico-host --example python_messages",
        crate::generate::FILE
    );
}
