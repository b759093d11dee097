//! The Python package has the messages that the Rust types are.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../examples/python_messages/generate.rs"]
mod generate;

use std::path::Path;

#[test]
fn the_classes_of_the_python_package_are_those_of_the_rust_types() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(generate::FILE);
    let written = std::fs::read_to_string(&path).unwrap();
    assert!(
        written == generate::messages(),
        "{} is not up to date: cargo run -p yamabico-core --example python_messages",
        generate::FILE
    );
}
