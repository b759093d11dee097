//! The parts that the binary `yamabico` brings along; its commands are beside `main.rs`.

pub mod building;
pub mod plugins;
