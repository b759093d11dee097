//! Suggestions for misspelled commands.

use clap::Command;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};
use yamabico_parameters::nearest;

/// Adds the most similar name to the error of an unknown subcommand of `command`, unless `clap` has found one.
pub fn with_suggestion(mut error: Error, command: Command) -> Error {
    if error.kind() != ErrorKind::InvalidSubcommand || error.get(ContextKind::SuggestedSubcommand).is_some() {
        return error;
    }
    let Some(ContextValue::String(wrong)) = error.get(ContextKind::InvalidSubcommand) else { return error };
    let before = std::env::args().skip(1).take_while(|argument| argument != wrong);
    let parent = before.fold(&command, |parent, name| parent.find_subcommand(name).unwrap_or(parent));
    let names = parent.get_subcommands().filter(|command| !command.is_hide_set()).map(Command::get_name);
    if let Some(name) = nearest(wrong, names) {
        let name = ContextValue::Strings(vec![name.to_owned()]);
        error.insert(ContextKind::SuggestedSubcommand, name);
    }
    error
}
