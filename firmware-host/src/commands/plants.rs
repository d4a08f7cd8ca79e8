//! `demeter plants`: what is in a store, as tables, files and pictures.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::{Subcommand, ValueEnum};
use serde_json::json;

use crate::error::{CommandError, Exit};
use crate::files;
use crate::mesh_file::MeshFormat;
use crate::output::Output;
use crate::report::{Document, PlantReport, columns, word};
use crate::store::{PlantRow, Reader};
use crate::tables;

/// Arguments of `demeter plants`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
    /// The store.
    #[arg(long, global = true, default_value = "demeter.sqlite")]
    db: PathBuf,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Every plant, oldest first.
    List,
    /// One plant with its traits.
    Show {
        /// The plant's id; `first` is the oldest.
        id: String,
        /// Write the photo's crop beside the fitted plant to this PNG.
        #[arg(long)]
        picture: Option<PathBuf>,
    },
    /// Every plant, or those named, as a table or as meshes.
    Export {
        /// Only these plants.
        ids: Vec<String>,
        /// The format.
        #[arg(long)]
        format: Format,
        /// The file for csv and geojson (else standard output) and parquet, the folder for meshes (else the current one).
        #[arg(short, long)]
        output: Option<PathBuf>,
    },
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// A table; units in the column names.
    Csv,
    /// A feature a plant; those without a position fix have no geometry.
    Geojson,
    /// The table that the sync sends; needs --output.
    Parquet,
    /// One binary PLY mesh a plant.
    Ply,
    /// One OBJ mesh a plant.
    Obj,
    /// One GLB mesh a plant.
    Glb,
}

/// Lists, shows or exports plants.
///
/// # Errors
/// [`CommandError`]: 2 where the store or the id is not there.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let reader = Reader::open(&args.db)?;
    match &args.action {
        Action::List => {
            let ids = reader.all()?.into_iter().map(|row| row.id);
            let plants = ids.map(|id| plant(&reader, &id)).collect::<Result<_, _>>()?;
            output.plants(&Document { plants, ..Document::default() })?;
        }
        Action::Show { id, picture } => show(&reader, id, picture.as_deref(), output)?,
        Action::Export { ids, format, output: target } => {
            for id in ids {
                plant(&reader, id)?;
            }
            let rows: Vec<_> =
                reader.all()?.into_iter().filter(|row| ids.is_empty() || ids.contains(&row.id)).collect();
            match format {
                Format::Csv => table(&csv(&rows), target.as_deref(), output)?,
                Format::Geojson => table(&geojson(&rows), target.as_deref(), output)?,
                Format::Parquet => parquet(&reader, &rows, target.as_deref())?,
                Format::Ply => meshes(&reader, &rows, MeshFormat::Ply, target.as_deref())?,
                Format::Obj => meshes(&reader, &rows, MeshFormat::Obj, target.as_deref())?,
                Format::Glb => meshes(&reader, &rows, MeshFormat::Glb, target.as_deref())?,
            }
        }
    }
    Ok(Exit::Done)
}

fn plant(reader: &Reader, id: &str) -> Result<PlantReport, CommandError> {
    let missing = || CommandError::usage("no_such_plant", format!("no plant `{id}` in the store"));
    reader.plant(id)?.ok_or_else(missing)
}

fn show(reader: &Reader, id: &str, picture: Option<&Path>, output: &Output) -> Result<(), CommandError> {
    let empty = || CommandError { exit: Exit::Failed, ..CommandError::usage("no_plant", "the store has no plants") };
    let id = if id == "first" { reader.first()?.ok_or_else(empty)? } else { id.to_owned() };
    let plant = plant(reader, &id)?;
    if let Some(path) = picture {
        let none = || CommandError {
            exit: Exit::Failed,
            ..CommandError::usage("no_picture", format!("plant `{id}` was stored without a picture"))
        };
        files::write(path, &reader.thumbnail(&id)?.ok_or_else(none)?)?;
    }
    let traits: Vec<_> = plant
        .traits
        .iter()
        .map(|(key, q)| {
            let sigma = q.sigma.map_or_else(|| "-".into(), |sigma| format!("{sigma:.4}"));
            [key.clone(), word(&q.unit), format!("{:.4}", q.value), sigma]
        })
        .collect();
    output.plants(&Document { plants: vec![plant], ..Document::default() })?;
    if output.json {
        return Ok(());
    }
    output.text(&format!("\n{}", columns(&["trait", "unit", "value", "sigma"], &traits, output.color)))
}

fn table(text: &str, target: Option<&Path>, output: &Output) -> Result<(), CommandError> {
    match target {
        Some(path) => files::write(path, text.as_bytes()),
        None => output.text(text),
    }
}

fn parquet(reader: &Reader, rows: &[PlantRow], target: Option<&Path>) -> Result<(), CommandError> {
    let target = target.ok_or_else(|| CommandError::usage("usage", "--format parquet: expected --output FILE"))?;
    let seqs: Vec<_> = rows.iter().map(|row| row.seq).collect();
    let table = tables::plants(&reader.whole(&seqs)?).map_err(|error| CommandError::failed("parquet", &error))?;
    files::write(target, &table)
}

fn meshes(reader: &Reader, rows: &[PlantRow], format: MeshFormat, target: Option<&Path>) -> Result<(), CommandError> {
    let folder = target.unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|error| CommandError {
        message: format!("{}: {error}", folder.display()),
        ..CommandError::failed("file", &error)
    })?;
    for row in rows {
        let Some(stored) = reader.record(&row.id)? else { continue };
        let mesh = format.encode_stored(&stored).map_err(|error| CommandError::failed("record", &error))?;
        // Ids hold no path separators: the store refuses them.
        files::write(&folder.join(format!("{}.{}", row.id, format.extension())), &mesh)?;
    }
    Ok(())
}

fn csv(rows: &[PlantRow]) -> String {
    let mut text = String::from(
        "id,session,species,time,time_trusted,scale_source,x_m,y_m,z_m,latitude_deg,longitude_deg,\
         height_m,leaf_count,blade_count,leaf_area_m2,cd,bytes\n",
    );
    for row in rows {
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        let at = |i: usize| number(row.position.map(|p| p[i]));
        let on_earth = |i: usize| number(row.geographic.map(|g| g[i]));
        let cells = [
            quoted(&row.id),
            quoted(&row.session),
            quoted(&row.species),
            quoted(&row.time),
            row.time_trusted.to_string(),
            word(&row.scale_source),
            at(0),
            at(1),
            at(2),
            on_earth(0),
            on_earth(1),
            number(row.height),
            number(row.leaf_count),
            number(row.blade_count),
            number(row.leaf_area),
            number(row.cd),
            row.bytes.to_string(),
        ];
        // Writing to a String cannot fail.
        writeln!(text, "{}", cells.join(",")).unwrap_or_default();
    }
    text
}

/// A CSV cell (RFC 4180).
fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.to_owned() }
}

fn geojson(rows: &[PlantRow]) -> String {
    let feature = |row: &PlantRow| {
        // GeoJSON (RFC 7946) puts the longitude first.
        let geometry = row.geographic.map(|[lat, lon]| json!({"type": "Point", "coordinates": [lon, lat]}));
        json!({"type": "Feature", "id": row.id, "geometry": geometry, "properties": row})
    };
    let features: Vec<_> = rows.iter().map(feature).collect();
    json!({"type": "FeatureCollection", "features": features}).to_string() + "\n"
}
