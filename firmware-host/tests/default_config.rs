//! systemd/demeter.toml, the configuration that is installed: it changes nothing, and it tells of every key.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;

use demeter::config::{Config, LampConfig, SyncConfig};

const FILE: &str = include_str!("../../systemd/demeter.toml");

fn load(text: &str) -> Result<Config, String> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    Config::load(Some(file.path())).map_err(|error| error.to_string())
}

/// The file with the lines that are `wanted` taken out of their comments: keys and tables have no blank after the `#`.
fn uncommented(wanted: impl Fn(usize) -> bool) -> String {
    let line = |(index, line): (usize, &'static str)| match line.strip_prefix('#') {
        Some(key) if !key.is_empty() && !key.starts_with(' ') && wanted(index) => key,
        _ => line,
    };
    FILE.lines().enumerate().map(line).collect::<Vec<_>>().join("\n")
}

#[test]
fn as_it_is_installed_it_is_the_default() {
    assert_eq!(load(FILE), Ok(Config::default()));
}

#[test]
fn every_line_may_be_taken_out_of_its_comment_and_the_defaults_it_tells_are_true() {
    let all = load(&uncommented(|_| true)).unwrap();
    assert!(all.cameras.len() == 1 && all.source.is_some() && all.lamp.path.is_some() && all.lamp.buzzer.is_some());
    // What has no default is an example.
    let sync =
        SyncConfig { url: None, endpoint: None, user: None, secret_file: None, ca_file: None, brapi: None, ..all.sync };
    let examples = Config { source: None, cameras: Vec::new(), lamp: LampConfig::default(), sync, ..all };
    assert_eq!(examples, Config::default());
    // Each key alone, where its table is not a comment itself.
    let source = FILE.lines().position(|line| line == "#[source]").unwrap();
    for (index, line) in FILE.lines().enumerate().take(source) {
        load(&uncommented(|other| other == index)).unwrap_or_else(|error| panic!("{line}: {error}"));
    }
}

#[test]
fn it_names_every_key_that_there_is() {
    let full: toml::Table = uncommented(|_| true).parse().unwrap();
    let mut tables = vec![(String::new(), keys(&full))];
    for (name, value) in &full {
        let camera = value.as_array().and_then(|cameras| cameras.first()?.as_table());
        tables.extend(camera.map(|camera| (format!("[[{name}]]\n"), keys(camera))));
        tables.extend(value.as_table().map(|table| (format!("[{name}]\n"), keys(table))));
        for (below, table) in value.as_table().into_iter().flatten() {
            tables.extend(table.as_table().map(|table| (format!("[{name}.{below}]\n"), keys(table))));
        }
    }
    for (header, told) in tables {
        // The parser's own list of what it knows; a tagged table has none and is looked at above.
        let error = load(&format!("{header}no_such_key = 1")).unwrap_err();
        let known = error.split("expected ").nth(1).unwrap_or_default();
        let known: BTreeSet<_> = known.split('`').skip(1).step_by(2).map(str::to_owned).collect();
        if header != "[source]\n" {
            assert_eq!(told, known, "{header}{error}");
        }
    }
}

fn keys(table: &toml::Table) -> BTreeSet<String> {
    table.keys().cloned().collect()
}
