//! How a command ends.

use std::fmt::{Display, Write};
use std::path::Path;
use std::process::ExitCode;

/// The exit codes of the contract (spec/appliance.md "Command line").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// Everything asked for was done.
    Done = 0,
    /// It could not be done.
    Failed = 1,
    /// The arguments or the configuration are wrong.
    BadUse = 2,
    /// Some of it was done.
    Partial = 3,
    /// Refused: the store was written by a newer program.
    NewerSchema = 78,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Why a command failed: the message for people, kind, expected and found for programs (plant.schema.json).
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct CommandError {
    /// How the program ends.
    pub exit: Exit,
    /// A stable word for programs, such as `no_plant`.
    pub kind: &'static str,
    /// One clear message with its causes.
    pub message: String,
    /// What was expected, where that is known apart from the message.
    pub expected: Option<String>,
    /// What was found instead.
    pub found: Option<String>,
}

impl CommandError {
    /// A failure (exit 1) with the error's whole chain of causes in its message.
    #[must_use]
    pub fn failed(kind: &'static str, error: &dyn std::error::Error) -> Self {
        Self { exit: Exit::Failed, kind, message: chain(error), expected: None, found: None }
    }

    /// Bad use or bad configuration (exit 2).
    #[must_use]
    pub fn usage(kind: &'static str, message: impl Display) -> Self {
        Self { exit: Exit::BadUse, kind, message: message.to_string(), expected: None, found: None }
    }

    /// The same, the message naming the file it is about.
    #[must_use]
    pub fn of(mut self, file: &Path) -> Self {
        self.message = format!("{}: {}", file.display(), self.message);
        self
    }

    /// The same with what was expected and what was found.
    #[must_use]
    pub fn with(mut self, expected: impl Display, found: impl Display) -> Self {
        (self.expected, self.found) = (Some(expected.to_string()), Some(found.to_string()));
        self
    }
}

/// An error and its causes on one line; a cause that its parent already quotes is not said twice.
#[must_use]
pub fn chain(error: &dyn std::error::Error) -> String {
    let mut message = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let text = error.to_string();
        if !message.contains(&text) {
            // Writing to a String cannot fail.
            write!(message, ": {text}").unwrap_or_default();
        }
        cause = error.source();
    }
    message
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    enum Sample {
        #[error("reading `a.ply`")]
        Outer(#[source] std::io::Error),
        #[error("reading `a.ply`: {0}")]
        Quoting(#[source] std::io::Error),
    }

    #[test]
    fn the_chain_names_every_cause_once() {
        let cause = || std::io::Error::other("disk on fire");
        assert_eq!(chain(&Sample::Outer(cause())), "reading `a.ply`: disk on fire");
        assert_eq!(chain(&Sample::Quoting(cause())), "reading `a.ply`: disk on fire");
    }
}
