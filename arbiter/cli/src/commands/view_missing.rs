//! `yamabico view` and `yamabico top` in a program that was built without them, so that its first build takes less time.

use clap::Args;

use crate::output::Failure;

/// Any arguments.
#[derive(Args)]
pub struct Arguments {
    /// Arguments of the command.
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    _arguments: Vec<String>,
}

/// Explains where the command is.
pub fn failure() -> Failure {
    Failure::usage(
        "this program was built without `view` and `top`: install it with `cargo install --path arbiter/cli --features view`",
    )
}
