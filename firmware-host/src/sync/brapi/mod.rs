//! Plants as observation units of a breeding database that speaks BrAPI 2.1, and their traits as its observations.
//!
//! Each has our id as its external reference, by which it is looked for before it is made. So however often a plant is
//! sent it is one unit, and it counts as sent when all of it was read back.

mod unit;

use std::collections::BTreeMap;

use reqwest::header::{CONTENT_TYPE, HeaderValue};
use reqwest::{Method, RequestBuilder, StatusCode, Url};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::answer::{Unanswered, answer};
use super::error::{SendError, SyncError};
use super::secret::{Secret, authorization};
use super::wire::{Wire, encrypted};
use crate::config::BrapiConfig;
use crate::store::WholePlant;
use unit::{SOURCE, observations, reference, unit};

/// More than a plant has observations, and more than its reference has units.
const PAGE: &str = "100";

/// A BrAPI server.
#[derive(Debug)]
pub struct Brapi {
    config: BrapiConfig,
    root: Url,
    wire: Wire,
}

/// What every answer looks like; its metadata is not needed.
#[derive(Deserialize)]
struct Answer {
    result: Data,
}

#[derive(Deserialize)]
struct Data {
    data: Vec<Value>,
}

impl Brapi {
    /// Makes the client; nothing is sent yet.
    ///
    /// # Errors
    /// [`SyncError`] naming the key or the file.
    pub fn open(config: &BrapiConfig) -> Result<Self, SyncError> {
        let wrong = |found: String| SyncError::Config {
            key: "brapi.url",
            expected: "https://HOST/PATH without user, password or query",
            found,
        };
        let root = Url::parse(&config.url).map_err(|error| wrong(error.to_string()))?;
        if !root.username().is_empty() || root.password().is_some() {
            return Err(wrong("a user in the url".into()));
        }
        if root.query().is_some() || root.fragment().is_some() || !matches!(root.scheme(), "http" | "https") {
            return Err(wrong(format!("`{}`", config.url)));
        }
        encrypted("brapi.url", &root)?;
        let token = Secret::load(config.secret_file.as_deref(), &config.credential)?;
        let token = token.map(|token| authorization("Bearer", &token)).transpose()?;
        Ok(Self { config: config.clone(), root, wire: Wire::new(config.ca_file.as_deref(), token)? })
    }

    /// What the store knows it by.
    #[must_use]
    pub fn name(&self) -> String {
        self.config.name()
    }

    /// Sends a plant, the `number`th of its session, and reads it back; the server's id of its unit.
    ///
    /// # Errors
    /// [`SendError`] unless unit and observations came back as they were sent.
    pub async fn send(&self, plant: &WholePlant, number: u64) -> Result<String, SendError> {
        let reference = reference(plant);
        let body = unit(plant, number, &self.config);
        match self.unit(&reference).await? {
            Some(id) => self.write(Method::PUT, &["observationunits", &id], &body).await?,
            None => self.write(Method::POST, &["observationunits"], &json!([body])).await?,
        }
        let lost = || SendError::Differs { key: reference.clone(), expected: "its unit", found: "none".into() };
        let id = self.unit(&reference).await?.ok_or_else(lost)?;

        let wanted = observations(plant, &id, &self.config);
        let there = self.observations(&id).await?;
        let (mut new, mut changed) = (Vec::new(), Map::new());
        for (reference, observation) in &wanted {
            match there.get(reference) {
                None => new.push(observation.clone()),
                Some(found) if is_as(found, observation) => {}
                Some(found) => drop(changed.insert(text(found, "observationDbId"), observation.clone())),
            }
        }
        if !new.is_empty() {
            self.write(Method::POST, &["observations"], &new.into()).await?;
        }
        if !changed.is_empty() {
            self.write(Method::PUT, &["observations"], &changed.into()).await?;
        }
        let there = self.observations(&id).await?;
        let missing = |(reference, observation): &&(String, Value)| {
            !there.get(reference).is_some_and(|found| is_as(found, observation))
        };
        match wanted.iter().find(missing) {
            None => Ok(id),
            Some((reference, observation)) => Err(SendError::Differs {
                key: reference.clone(),
                expected: "to read back what was sent",
                found: there.get(reference).map_or("nothing".into(), |found| {
                    format!("{} in place of {}", text(found, "value"), text(observation, "value"))
                }),
            }),
        }
    }

    /// The id of the unit with that reference. Servers that do not know the filter give others, too.
    async fn unit(&self, reference: &str) -> Result<Option<String>, SendError> {
        let filter = [("externalReferenceId", reference), ("externalReferenceSource", SOURCE)];
        let units = self.read("observationunits", &filter).await?;
        let ours = units.iter().filter(|unit| ours(unit).is_some_and(|found| found == reference));
        // Were there two, made at once by two programs, it is always the same one.
        Ok(ours.map(|unit| text(unit, "observationUnitDbId")).filter(|id| !id.is_empty()).min())
    }

    /// The observations of a unit that are ours, by their references.
    async fn observations(&self, unit: &str) -> Result<BTreeMap<String, Value>, SendError> {
        let observations = self.read("observations", &[("observationUnitDbId", unit)]).await?;
        let with = |observation: Value| Some((ours(&observation)?.to_owned(), observation));
        Ok(observations.into_iter().filter_map(with).collect())
    }

    async fn read(&self, what: &str, filter: &[(&str, &str)]) -> Result<Vec<Value>, SendError> {
        let mut url = self.url(&[what]);
        url.query_pairs_mut().extend_pairs(filter).append_pair("pageSize", PAGE);
        let read: Answer = self.answer(self.wire.client().get(url), what).await?;
        Ok(read.result.data)
    }

    async fn write(&self, method: Method, path: &[&str], body: &Value) -> Result<(), SendError> {
        let request = self.wire.client().request(method, self.url(path)).body(body.to_string());
        let request = request.header(CONTENT_TYPE, HeaderValue::from_static("application/json"));
        // What it says is looked for by reading, whatever it answers here.
        self.answer::<Value>(request, path[0]).await.map(drop)
    }

    /// Plants that the server refuses are told apart from a server that refuses everything.
    async fn answer<T: serde::de::DeserializeOwned>(
        &self,
        request: RequestBuilder,
        what: &str,
    ) -> Result<T, SendError> {
        answer(request).await.map_err(|error| match error {
            Unanswered::Status(status @ (StatusCode::BAD_REQUEST | StatusCode::UNPROCESSABLE_ENTITY)) => {
                SendError::Differs {
                    key: what.to_owned(),
                    expected: "it to be taken",
                    found: format!("status {status}"),
                }
            }
            error => SendError::Server { doing: "brapi", message: error.to_string() },
        })
    }

    fn url(&self, path: &[&str]) -> Url {
        let mut url = self.root.clone();
        // Both schemes have paths.
        if let Ok(mut segments) = url.path_segments_mut() {
            segments.pop_if_empty().extend(path);
        }
        url
    }
}

/// Our reference of a unit or an observation.
fn ours(object: &Value) -> Option<&str> {
    let references = object.get("externalReferences")?.as_array()?.iter();
    references
        .filter(|reference| text(reference, "referenceSource") == SOURCE)
        .find_map(|r| r.get("referenceId")?.as_str())
}

/// Whether an observation is there as it was sent.
fn is_as(found: &Value, sent: &Value) -> bool {
    ["observationVariableDbId", "value"].iter().all(|key| found.get(key) == sent.get(key))
}

fn text(object: &Value, key: &str) -> String {
    object.get(key).and_then(Value::as_str).unwrap_or_default().to_owned()
}
