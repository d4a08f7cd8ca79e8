//! The program as its users and scripts see it: exit codes, standard output, standard error.
#![allow(clippy::unwrap_used)]

use std::process::{Command, Output};

fn demeter(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_demeter")).args(arguments).output().unwrap()
}

#[test]
fn help_and_version_are_no_errors() {
    for flag in ["--help", "--version"] {
        let output = demeter(&[flag]);
        assert_eq!(output.status.code(), Some(0), "{flag}");
        assert!(String::from_utf8(output.stdout).unwrap().contains("demeter"), "{flag}");
    }
}

#[test]
fn bad_use_ends_with_2_names_the_argument_and_stays_json_when_asked() {
    let output = demeter(&["doctor", "--jsn"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty());
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("--jsn") && message.contains("--json"), "{message}");

    let output = demeter(&["--json", "harvest"]);
    assert_eq!(output.status.code(), Some(2));
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["error"]["kind"], "usage");
    assert!(answer["error"]["message"].as_str().unwrap().contains("harvest"));
}
