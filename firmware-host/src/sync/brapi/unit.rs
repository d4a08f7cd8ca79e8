use serde_json::{Map, Value, json};

use crate::config::BrapiConfig;
use crate::store::WholePlant;
use crate::tables::TRAITS;

/// Whose ids our external references are.
pub(super) const SOURCE: &str = "demeter";

/// What we know a plant by at every server: rigs may name their plants alike.
pub(super) fn reference(plant: &WholePlant) -> String {
    format!("{}/{}", plant.rig, plant.row.id)
}

/// A plant as a BrAPI observation unit; `number` is its place among the plants of its session.
pub(super) fn unit(plant: &WholePlant, number: u64, config: &BrapiConfig) -> Value {
    let reference = reference(plant);
    let mut position = json!({
        "observationLevel": {"levelName": "plant", "levelCode": plant.row.id},
        "positionCoordinateX": number.to_string(),
        "positionCoordinateXType": "PLANTED_INDIVIDUAL",
    });
    set(&mut position, "geoCoordinates", place(plant));
    let mut unit = json!({
        "observationUnitName": plant.row.id,
        "observationUnitPUI": reference,
        "studyDbId": config.study,
        "externalReferences": references(&reference),
        "observationUnitPosition": position,
        "additionalInfo": {"rig": plant.rig, "session": plant.row.session, "species": plant.row.species},
    });
    set(&mut unit, "germplasmDbId", config.germplasm.clone().map(Value::from));
    unit
}

/// A plant's traits as BrAPI observations of its unit, each with its external reference. Traits that no ontology has are
/// left out.
pub(super) fn observations(plant: &WholePlant, unit: &str, config: &BrapiConfig) -> Vec<(String, Value)> {
    let time = plant.row.time.parse::<jiff::Timestamp>().ok();
    let year = time.map(|time| time.to_zoned(jiff::tz::TimeZone::UTC).year());
    let observation = |column: &crate::tables::TraitColumn| {
        let quantity = plant.report.traits.get(column.key).filter(|_| column.plant)?;
        let variable = variable(column.ontology, &plant.row.species)?;
        let reference = format!("{}/{}", reference(plant), column.key);
        let mut observation = json!({
            "observationUnitDbId": unit,
            "observationVariableDbId": variable,
            "studyDbId": config.study,
            "value": quantity.value.to_string(),
            "collector": format!("{SOURCE} {}", plant.rig),
            "externalReferences": references(&reference),
            "additionalInfo": {
                "trait": column.key,
                "unit": column.unit.to_string(),
                "sigma": quantity.sigma,
                "timeTrusted": plant.row.time_trusted,
            },
        });
        set(&mut observation, "observationTimeStamp", time.map(|time| time.to_string().into()));
        set(&mut observation, "season", year.map(|year| json!({"seasonDbId": year.to_string(), "year": year})));
        set(&mut observation, "geoCoordinates", place(plant));
        set(&mut observation, "germplasmDbId", config.germplasm.clone().map(Value::from));
        Some((reference, observation))
    };
    TRAITS.iter().filter_map(observation).collect()
}

/// The Crop Ontology's id where it has the crop, else the Plant Trait Ontology's.
fn variable(ontology: &'static str, species: &str) -> Option<&'static str> {
    let crop = match species {
        "soybean" => "CO_336:",
        "maize" => "CO_322:",
        _ => "TO:",
    };
    let of = |prefix: &str| ontology.split(' ').find(|id| id.starts_with(prefix));
    of(crop).or_else(|| of("TO:"))
}

fn references(id: &str) -> Value {
    json!([{"referenceId": id, "referenceSource": SOURCE}])
}

/// Where the plant stands, as GeoJSON.
fn place(plant: &WholePlant) -> Option<Value> {
    let [latitude, longitude] = plant.row.geographic?;
    Some(json!({"type": "Feature", "geometry": {"type": "Point", "coordinates": [longitude, latitude]}}))
}

fn set(object: &mut Value, key: &str, value: Option<Value>) {
    if let (Some(object), Some(value)) = (object.as_object_mut().map(|object: &mut Map<_, _>| object), value) {
        object.insert(key.to_owned(), value);
    }
}
