//! ARCHITECTURE.md's rules, proved over the manifests and the sources.
#![allow(clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package};

/// Each product crate and exactly the crates of this workspace it builds on.
const ARROWS: [(&str, &[&str]); 5] = [
    ("demeter-frame", &[]),
    ("demeter-capture", &["demeter-frame"]),
    ("demeter-models", &["demeter-frame"]),
    ("demeter-recon", &["demeter-frame"]),
    ("demeter", &["demeter-capture", "demeter-frame", "demeter-models", "demeter-recon"]),
];

/// What the sources of recon must not name: files, the network, the environment, clocks, threads, logs, terminals.
const IMPURE: &str = "fs:: net:: env:: process:: thread:: time:: Instant SystemTime tokio rayon tracing:: log:: \
                      print! println! eprint! eprintln!";

/// Crates recon must not depend on, for the same reason.
const IMPURE_CRATES: [&str; 8] = ["jiff", "log", "metrics", "ort", "rayon", "rusqlite", "tokio", "tracing"];

/// Source files longer than [`LINES`], each with the reason why it stays in one piece.
const LONG: [(&str, &str); 1] =
    [("recon/src/record/compact.rs", "writing and reading are one walk over the plant: apart, they could disagree")];
const LINES: usize = 400;

/// Package registries and their mirrors, halved so that this list does not find itself.
const HOSTS: [(&str, &str); 8] = [
    ("crates", ".io"),
    ("pypi", ".org"),
    ("pythonhosted", ".org"),
    ("npmjs", ".org"),
    ("npmjs", ".com"),
    ("unpkg", ".com"),
    ("jsdelivr", ".net"),
    ("deb.debian", ".org"),
];

fn metadata() -> Metadata {
    MetadataCommand::new()
        .manifest_path(demeter_tests::root().join("Cargo.toml"))
        .no_deps()
        .other_options(["--offline".to_owned()])
        .exec()
        .unwrap()
}

fn package<'a>(metadata: &'a Metadata, name: &str) -> &'a Package {
    metadata.packages.iter().find(|package| package.name == name).unwrap_or_else(|| panic!("no crate {name}"))
}

fn dependencies(package: &Package) -> BTreeSet<&str> {
    package.dependencies.iter().map(|dependency| dependency.name.as_str()).collect()
}

/// Every file of the project with one of the extensions, by its path from the root. What tools write is left out.
fn files(extensions: &[&str]) -> BTreeMap<String, String> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        // Other programs at work in the checkout, such as Python's test runner, make folders and take them away again.
        let entries = match std::fs::read_dir(folder) {
            Err(gone) if gone.kind() == std::io::ErrorKind::NotFound => return,
            entries => entries.unwrap(),
        };
        for entry in entries {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap();
            if !path.is_dir() {
                found.push(path);
            } else if !["target", ".git", ".cache", "demo", "vendor", "__pycache__"].contains(&name) {
                walk(&path, found);
            }
        }
    }
    let (root, mut found) = (demeter_tests::root(), Vec::new());
    walk(&root, &mut found);
    let wanted = |path: &PathBuf| path.extension().is_some_and(|e| extensions.iter().any(|wanted| e == *wanted));
    let texts = found.into_iter().filter(wanted).filter_map(|path| {
        let text = match std::fs::read_to_string(&path) {
            Err(gone) if gone.kind() == std::io::ErrorKind::NotFound => return None,
            text => text.unwrap_or_else(|error| panic!("{}: {error}", path.display())),
        };
        Some((path.strip_prefix(&root).unwrap().to_str().unwrap().to_owned(), text))
    });
    texts.collect()
}

/// The lines of code (not of comment) before the file's test module, with their numbers, that name one of the words.
fn offences<'a>(source: &'a str, words: &str) -> Vec<(usize, &'a str)> {
    let named = |line: &str, word: &str| {
        line.match_indices(word).any(|(at, _)| !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_'))
    };
    let code = source.lines().enumerate().take_while(|(_, line)| !line.starts_with("#[cfg(test)]"));
    code.map(|(index, line)| (index + 1, line))
        .filter(|(_, line)| !line.trim_start().starts_with("//"))
        .filter(|(_, line)| words.split_whitespace().any(|word| named(line, word)))
        .collect()
}

#[test]
fn arrows_are_exactly_the_documented_ones() {
    let metadata = metadata();
    let ours: BTreeSet<_> = metadata.packages.iter().map(|package| package.name.as_str()).collect();
    let mut documented: BTreeSet<_> = ARROWS.iter().map(|(name, _)| *name).collect();
    for (name, allowed) in ARROWS {
        let found: BTreeSet<_> = dependencies(package(&metadata, name)).intersection(&ours).copied().collect();
        assert_eq!(found, allowed.iter().copied().collect(), "what {name} builds on");
    }
    // The tests crate may see every part; no part sees it, since the arrows above are exact.
    documented.insert("demeter-tests");
    assert_eq!(ours, documented, "a crate without a line in the table of layers");
}

#[test]
fn only_models_names_onnx_runtime() {
    let metadata = metadata();
    let with_ort = metadata.packages.iter().filter(|package| dependencies(package).contains("ort"));
    assert_eq!(with_ort.map(|package| package.name.as_str()).collect::<Vec<_>>(), ["demeter-models"]);
}

#[test]
fn only_capture_may_opt_out_of_safe_code() {
    let root = demeter_tests::root();
    let workspace = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let lint = concat!("unsafe", "_code");
    assert!(workspace.contains(&format!("{lint} = \"deny\"")), "the workspace denies unsafe code");
    for package in metadata().packages {
        let manifest = std::fs::read_to_string(&package.manifest_path).unwrap();
        assert!(manifest.contains("[lints]\nworkspace = true"), "{} takes the workspace's lints", package.name);
    }
    for (path, text) in files(&["rs"]) {
        assert!(!text.contains(lint) || path.starts_with("capture/src/"), "{path} touches the lint");
    }
}

#[test]
fn recon_is_pure() {
    let metadata = metadata();
    let recon = package(&metadata, "demeter-recon");
    let product = recon.dependencies.iter().filter(|dependency| dependency.kind != DependencyKind::Development);
    for dependency in product {
        assert!(!IMPURE_CRATES.contains(&dependency.name.as_str()), "recon depends on {}", dependency.name);
    }
    let sources: Vec<_> = files(&["rs"]).into_iter().filter(|(path, _)| path.starts_with("recon/src/")).collect();
    assert!(!sources.is_empty(), "no sources of recon were found");
    for (path, text) in sources {
        assert_eq!(offences(&text, IMPURE), [], "{path}");
    }
}

#[test]
fn the_purity_check_finds_planted_offences() {
    for bad in [
        "let bytes = std::fs::read(path);",
        "use std::thread::scope;",
        "    let now = Instant::now();",
        "println!(\"x\");",
        "use tokio::spawn;",
        "tracing::info!(\"x\");",
        "let seconds = std::time::UNIX_EPOCH;",
        "eprint!(\"\");fs::read(p)",
    ] {
        assert_eq!(offences(bad, IMPURE), [(1, bad)]);
    }
    for good in [
        "// std::fs is not used here.",
        "let offs = offs::new();",
        "let fingerprint = 1;",
        "#[cfg(test)]\nuse std::fs::read;",
    ] {
        assert_eq!(offences(good, IMPURE), []);
    }
}

#[test]
fn no_file_names_a_registry_host() {
    let files = files(&["rs", "toml", "sh", "py", "md", "json", "html", "js", "service", "txt"]);
    assert!(files.contains_key("deny.toml") && files.contains_key("tools/setup.sh"), "the search saw the project");
    for (path, text) in files {
        for (left, right) in HOSTS {
            assert!(!text.contains(&format!("{left}{right}")), "{path} names the host {left}{right}");
        }
    }
}

#[test]
fn source_files_stay_short() {
    let long: BTreeSet<_> =
        files(&["rs", "py", "sh"]).into_iter().filter(|(_, text)| text.lines().count() > LINES).collect();
    let found: Vec<_> = long.iter().map(|(path, _)| path.as_str()).collect();
    let listed: BTreeSet<_> = LONG.iter().map(|(path, _)| *path).collect();
    // Exact, so an entry leaves the list when its file has been cut up.
    assert_eq!(found, listed.into_iter().collect::<Vec<_>>(), "files of more than {LINES} lines, against LONG");
}
