//! The command line of Yamabico.
fn main() {}
