//! Standard output: JSON or a table; everything else goes to standard error.

use std::io::{ErrorKind, IsTerminal, Write};

use serde::Serialize;

use crate::error::{CommandError, Exit};
use crate::report::{Document, ErrorDocument, table};

/// How results are printed.
#[derive(Clone, Copy, Debug)]
pub struct Output {
    /// JSON instead of text.
    pub json: bool,
    /// Escape codes are welcome: a terminal, and NO_COLOR is not set.
    pub color: bool,
}

impl Output {
    /// Output to this process's standard output.
    #[must_use]
    pub fn new(json: bool) -> Self {
        let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        Self { json, color: !json && !no_color && std::io::stdout().is_terminal() }
    }

    /// Prints plants as the contract's JSON or as a table; warnings of the table go to standard error.
    ///
    /// # Errors
    /// [`CommandError`] when standard output cannot be written.
    pub fn plants(&self, document: &Document) -> Result<(), CommandError> {
        if self.json {
            return self.json(document);
        }
        for warning in document.all_warnings() {
            tracing::warn!("{warning}");
        }
        self.text(&table(&document.plants, self.color))
    }

    /// Prints any value as one line of JSON.
    ///
    /// # Errors
    /// [`CommandError`] when it cannot be written.
    pub fn json(&self, value: &impl Serialize) -> Result<(), CommandError> {
        let mut line = serde_json::to_string(value).map_err(|error| CommandError::failed("output", &error))?;
        line.push('\n');
        self.text(&line)
    }

    /// Prints text as it is.
    ///
    /// # Errors
    /// [`CommandError`] when standard output cannot be written; a reader that went away (`| head`) is no error.
    pub fn text(&self, text: &str) -> Result<(), CommandError> {
        let mut out = std::io::stdout().lock();
        match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(CommandError {
                exit: Exit::Failed,
                kind: "output",
                message: format!("standard output: {error}"),
                expected: None,
                found: None,
            }),
            _ => Ok(()),
        }
    }

    /// Reports a failure: the message to standard error and, with --json, the error object to standard output.
    pub fn error(&self, error: &CommandError) {
        // clap's messages already begin with `error:`.
        let prefix = if error.message.starts_with("error:") { "" } else { "error: " };
        // When even standard error is closed there is nobody left to tell.
        writeln!(std::io::stderr(), "{prefix}{}", error.message.trim_end()).unwrap_or_default();
        if self.json
            && let Err(second) = self.json(&ErrorDocument::from(error))
        {
            tracing::error!("{second}");
        }
    }
}
