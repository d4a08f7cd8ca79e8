use std::fmt::Write;

use demeter_capture::{Device, OfferedMode, devices};
use serde::Serialize;

use crate::error::{CommandError, Exit, chain};
use crate::output::Output;

/// A camera that is plugged in.
#[derive(Serialize)]
struct Row {
    #[serde(flatten)]
    device: Device,
    modes: Vec<OfferedMode>,
}

pub(super) fn run(output: &Output) -> Result<Exit, CommandError> {
    let (mut rows, mut exit) = (Vec::new(), Exit::Done);
    for device in devices() {
        match device.modes() {
            Ok(modes) => rows.push(Row { device, modes }),
            Err(error) => {
                tracing::warn!("{}: {}", device.path, chain(&error));
                exit = Exit::Partial;
            }
        }
    }
    if output.json {
        output.json(&serde_json::json!({"cameras": rows}))?;
        return Ok(exit);
    }
    output.text(&table(&rows))?;
    Ok(exit)
}

fn table(rows: &[Row]) -> String {
    if rows.is_empty() {
        return "no camera is plugged in\n".into();
    }
    let mut text = String::new();
    for Row { device, modes } in rows {
        // Writing to a String cannot fail.
        writeln!(text, "{}  {} ({}, {})", device.path, device.name, device.driver, device.node.display())
            .unwrap_or_default();
        for OfferedMode { format, width, height, rates } in modes {
            let rates =
                rates.iter().map(|rate| format!("{rate:.4}").trim_end_matches(['0']).trim_end_matches('.').into());
            let rates = rates.collect::<Vec<String>>().join(", ");
            writeln!(text, "    {:<5} {width:>4} x {height:<4}  {rates} /s", format.name()).unwrap_or_default();
        }
    }
    text
}
