use std::fmt::Write;

use demeter_recon::species::NAMES;

use super::show::Summary;
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;

pub(super) fn run(output: &Output) -> Result<Exit, CommandError> {
    let species = NAMES.iter().map(|name| files::species(name)).collect::<Result<Vec<_>, _>>()?;
    let summaries: Vec<Summary> = species.iter().map(Summary::of).collect();
    if output.json {
        output.json(&summaries)?;
        return Ok(Exit::Done);
    }
    let mut table = format!(
        "{:<10} {:<9} {:>5} {:>5} {:>5}  {:<8}  provenance\n",
        "name", "habit", "shape", "leaf", "stem", "hash"
    );
    for s in &summaries {
        let (habit, hash) = (format!("{:?}", s.habit).to_lowercase(), &s.hash[..8]);
        let [shape, leaf, stem] = [s.leaf_shape, s.leaf_deform, s.stem_deform];
        // Writing to a String cannot fail.
        writeln!(table, "{:<10} {habit:<9} {shape:>5} {leaf:>5} {stem:>5}  {hash}  {}", s.name, s.provenance)
            .unwrap_or_default();
    }
    output.text(&table)?;
    Ok(Exit::Done)
}
