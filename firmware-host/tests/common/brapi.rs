//! A breeding database that speaks as much BrAPI 2.1 as a plant needs, and is strict about it.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use reqwest::Url;
use serde_json::{Map, Value, json};

use super::depot::Request;

/// The study that it knows.
pub(crate) const STUDY: &str = "field-7";

/// What it holds, by its own ids.
#[derive(Clone, Default)]
pub(crate) struct Database {
    pub(crate) units: Arc<Mutex<BTreeMap<String, Value>>>,
    pub(crate) observations: Arc<Mutex<BTreeMap<String, Value>>>,
}

impl Database {
    /// Answers a request: status and body. With `deaf` it says that all is well and does nothing.
    pub(crate) fn answer(&self, request: &Request, body: &[u8], deaf: bool) -> (u16, Vec<u8>) {
        let url = Url::parse(&format!("http://localhost{}", request.path)).unwrap();
        let path: Vec<_> = url.path_segments().unwrap().skip(2).map(str::to_owned).collect();
        let body: Value = serde_json::from_slice(body).unwrap_or_default();
        let (table, id) = match path[0].as_str() {
            "observationunits" => (&self.units, "observationUnitDbId"),
            "observations" => (&self.observations, "observationDbId"),
            _ => return (404, Vec::new()),
        };
        let mut table = table.lock().unwrap();
        let list = |rows: Vec<Value>| (200, json!({"metadata": {}, "result": {"data": rows}}).to_string().into_bytes());
        match (request.method.as_str(), path.get(1)) {
            ("GET", None) => {
                let wanted = |row: &&Value| url.query_pairs().all(|(key, value)| matches(row, &key, &value));
                list(table.values().filter(wanted).cloned().collect())
            }
            ("POST" | "PUT", _) if deaf => list(Vec::new()),
            ("POST", None) => {
                let rows = body.as_array().cloned().unwrap_or_default();
                if rows.is_empty() || !rows.iter().all(|row| self.valid(row, id)) {
                    return (400, Vec::new());
                }
                let rows = rows.into_iter().map(|mut row| {
                    let new = format!("{id} {}", table.len());
                    row[id] = new.clone().into();
                    table.insert(new, row.clone());
                    row
                });
                list(rows.collect())
            }
            ("PUT", one) => {
                let all = match one {
                    Some(id) => Map::from_iter([(id.replace("%20", " "), body)]),
                    None => body.as_object().cloned().unwrap_or_default(),
                };
                if all.is_empty() || !all.iter().all(|(key, row)| table.contains_key(key) && self.valid(row, id)) {
                    return (400, Vec::new());
                }
                for (key, mut row) in all {
                    row[id] = key.clone().into();
                    table.insert(key, row);
                }
                list(Vec::new())
            }
            _ => (405, Vec::new()),
        }
    }

    fn valid(&self, row: &Value, id: &str) -> bool {
        let text = |key: &str| row[key].is_string();
        let referenced = row["externalReferences"][0]["referenceId"].is_string();
        let known = row["studyDbId"] == STUDY && referenced;
        known
            && match id {
                "observationUnitDbId" => {
                    text("observationUnitName")
                        && row["observationUnitPosition"]["observationLevel"]["levelName"] == "plant"
                }
                _ => {
                    text("value") && text("observationVariableDbId") && text("observationUnitDbId") && text("collector")
                }
            }
    }
}

/// The filters of BrAPI; a page is as long as it takes.
fn matches(row: &Value, key: &str, value: &str) -> bool {
    let references = || row["externalReferences"].as_array().into_iter().flatten();
    match key {
        "externalReferenceId" => references().any(|reference| reference["referenceId"] == value),
        "externalReferenceSource" => references().any(|reference| reference["referenceSource"] == value),
        "pageSize" => true,
        _ => row[key] == value,
    }
}
