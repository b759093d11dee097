//! Suggestions for misspelled commands.

use clap::Command;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};
use yamabico_parameters::nearest;

/// Replaces the suggestion of `clap` for an unknown subcommand of `command` by the most similar name, if there is one.
pub fn with_suggestion(mut error: Error, mut command: Command) -> Error {
    let Some(ContextValue::String(wrong)) = error.get(ContextKind::InvalidSubcommand) else { return error };
    let before = std::env::args().skip(1).take_while(|argument| argument != wrong);
    let parent = before.fold(&command, |parent, name| parent.find_subcommand(name).unwrap_or(parent));
    let names = parent.get_subcommands().filter(|command| !command.is_hide_set()).map(Command::get_name);
    match nearest(wrong, names) {
        Some(name) => {
            let name = ContextValue::Strings(vec![name.to_owned()]);
            error.insert(ContextKind::SuggestedSubcommand, name);
            error
        }
        None => command.error(ErrorKind::InvalidSubcommand, format!("unrecognized subcommand '{wrong}'")),
    }
}
