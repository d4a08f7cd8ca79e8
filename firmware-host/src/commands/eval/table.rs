//! A table of figures: as aligned Markdown for people and docs/evaluation.md, as objects for programs.

use std::fmt::Write;

use serde::Serialize;
use serde::ser::{SerializeMap, SerializeSeq, Serializer};

/// What stands in a cell.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell {
    /// Words.
    Text(String),
    /// A number of things.
    Count(usize),
    /// A figure with the digits it is shown with; programs get all of them.
    Figure(f64, usize),
    /// Nothing known.
    Nothing,
}

impl Cell {
    /// A figure that may be missing.
    pub(super) fn figure(value: Option<f64>, digits: usize) -> Self {
        value.map_or(Self::Nothing, |value| Self::Figure(value, digits))
    }

    fn shown(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Figure(value, digits) => format!("{value:.digits$}"),
            Self::Nothing => "-".into(),
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.into())
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Count(count) => serializer.serialize_u64(*count as u64),
            Self::Figure(value, _) => serializer.serialize_f64(*value),
            Self::Nothing => serializer.serialize_none(),
        }
    }
}

/// A table with the words that explain it.
#[derive(Clone, Debug)]
pub(super) struct Table {
    /// Its name: the subcommand's.
    pub name: &'static str,
    /// Names of the columns with their units, as in JSON.
    pub columns: Vec<&'static str>,
    /// Rows as long as `columns`.
    pub rows: Vec<Vec<Cell>>,
    /// What a reader must know: what was measured, left out, refused.
    pub notes: Vec<String>,
}

impl Serialize for Table {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(3))?;
        map.serialize_entry("table", self.name)?;
        map.serialize_entry("rows", &Rows(self))?;
        map.serialize_entry("notes", &self.notes)?;
        map.end()
    }
}

/// The rows as objects by column.
struct Rows<'a>(&'a Table);

impl Serialize for Rows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut rows = serializer.serialize_seq(Some(self.0.rows.len()))?;
        for row in &self.0.rows {
            let object: serde_json::Map<String, serde_json::Value> = (self.0.columns.iter())
                .zip(row)
                .map(|(column, cell)| ((*column).into(), serde_json::to_value(cell).unwrap_or_default()))
                .collect();
            rows.serialize_element(&object)?;
        }
        rows.end()
    }
}

impl Table {
    /// A table without rows.
    pub(super) fn new(name: &'static str, columns: &[&'static str]) -> Self {
        Self { name, columns: columns.to_vec(), rows: Vec::new(), notes: Vec::new() }
    }

    /// The table as Markdown whose columns line up, then its notes as a list.
    pub(super) fn markdown(&self) -> String {
        let header: Vec<String> = self.columns.iter().map(|c| (*c).to_owned()).collect();
        let mut lines = vec![header];
        lines.extend(self.rows.iter().map(|row| row.iter().map(Cell::shown).collect::<Vec<_>>()));
        let width = |i: usize| lines.iter().map(|line| line[i].chars().count()).max().unwrap_or(0).max(3);
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let mut text = String::new();
        // Writing to a String cannot fail.
        for (k, line) in lines.iter().enumerate() {
            let cells = line.iter().zip(&widths).enumerate().map(|(i, (cell, width))| {
                let words = self.rows.first().is_none_or(|row| matches!(row[i], Cell::Text(_)));
                if words { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
            });
            writeln!(text, "| {} |", cells.collect::<Vec<_>>().join(" | ")).unwrap_or_default();
            if k == 0 {
                let rule: Vec<String> = widths.iter().map(|width| "-".repeat(*width)).collect();
                writeln!(text, "| {} |", rule.join(" | ")).unwrap_or_default();
            }
        }
        if !self.notes.is_empty() {
            text.push('\n');
        }
        for note in &self.notes {
            writeln!(text, "- {note}").unwrap_or_default();
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_and_programs_read_the_same_figures() {
        let mut table = Table::new("fit", &["species", "clouds", "CD"]);
        table.rows.push(vec!["maize".into(), Cell::Count(17), Cell::Figure(0.003_14, 4)]);
        table.rows.push(vec!["sorghum".into(), Cell::Count(0), Cell::Nothing]);
        table.notes.push("one".into());
        let expected = "\
| species | clouds |     CD |
| ------- | ------ | ------ |
| maize   |     17 | 0.0031 |
| sorghum |      0 |      - |

- one
";
        assert_eq!(table.markdown(), expected);
        let json = serde_json::to_string(&table).unwrap();
        assert_eq!(
            json,
            concat!(
                r#"{"table":"fit","rows":[{"CD":0.00314,"clouds":17,"species":"maize"},"#,
                r#"{"CD":null,"clouds":0,"species":"sorghum"}],"notes":["one"]}"#
            )
        );
    }
}
