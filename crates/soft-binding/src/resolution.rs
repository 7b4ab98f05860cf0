//! Questions and answers of the C2PA's Soft Binding Resolution API (version 1.0 of its OpenAPI document), without a
//! transport and without a store of manifests.
use percent_encoding::percent_decode_str;
use serde::{Deserialize, Serialize};

use crate::{ALGORITHM, Value};

/// Media type of answers that are JSON.
pub const JSON: &str = "application/json";
/// Media type of a sidecar.
pub const MANIFEST: &str = "application/c2pa";
/// Media type of refusals.
pub const TEXT: &str = "text/plain; charset=utf-8";
/// Most bytes of a question's body.
pub const MAX_BODY: usize = 1 << 16;

/// Which marks can be resolved.
pub const ALGORITHMS_PATH: &str = "/services/supportedAlgorithms";
/// Manifests by what names a mark.
pub const BY_BINDING_PATH: &str = "/matches/byBinding";
/// Manifests by a file, which is not answered.
pub const BY_CONTENT_PATH: &str = "/matches/byContent";
/// A manifest is below this.
pub const MANIFESTS_PATH: &str = "/manifests/";

/// Manifests that are named unless a caller says how many.
const DEFAULT_RESULTS: usize = 10;
/// Most that are named.
const MOST_RESULTS: usize = 1000;

/// What is asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Question {
    /// Which marks can be resolved: [`algorithms`].
    Algorithms,
    /// Which manifests name this mark, at most so many: [`matches`].
    ByBinding {
        /// What names the mark; none for a mark of others, which has no manifests here.
        value: Option<Value>,
        /// At least 1.
        most: usize,
    },
    /// A manifest store.
    Manifest {
        /// The identifier of its active manifest.
        id: String,
        /// Without those that it builds on.
        active_only: bool,
    },
}

/// Why a question is not answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The status of HTTP.
    pub status: u16,
    /// Why, as a line of text.
    pub told: String,
}

impl Refusal {
    fn new(status: u16, told: impl Into<String>) -> Self {
        let told = told.into();
        Self { status, told }
    }

    /// There is no manifest of an identifier.
    pub fn no_manifest() -> Self {
        Self::new(404, "there is no such manifest")
    }

    /// A manifest is in a store with others, and alone was wanted.
    pub fn not_alone() -> Self {
        Self::new(501, "the manifest is handed out with those that it builds on only")
    }
}

/// A query by binding, as the API's `c2pa.softBindingQuery`.
#[derive(Deserialize)]
struct Query {
    alg: String,
    value: String,
}

#[derive(Serialize)]
struct Matches<'a> {
    matches: Vec<Match<'a>>,
}

#[derive(Serialize)]
struct Match<'a> {
    #[serde(rename = "manifestId")]
    manifest_id: &'a str,
}

#[derive(Serialize)]
struct Algorithms {
    watermarks: [Algorithm; 1],
    fingerprints: [Algorithm; 0],
}

#[derive(Serialize)]
struct Algorithm {
    alg: &'static str,
}

/// Whether a path is one of this API.
pub fn is_of_api(path: &str) -> bool {
    [ALGORITHMS_PATH, BY_BINDING_PATH, BY_CONTENT_PATH].contains(&path) || path.starts_with(MANIFESTS_PATH)
}

/// What a request asks. `query` is as in the URL, `body` what came with it.
///
/// # Errors
/// [`Refusal`] with 400, 404, 405 or 501.
pub fn parse(method: &str, path: &str, query: &str, body: &[u8]) -> Result<Question, Refusal> {
    match (method, path) {
        ("GET", ALGORITHMS_PATH) => Ok(Question::Algorithms),
        ("GET", BY_BINDING_PATH) => match (parameter(query, "alg"), parameter(query, "value")) {
            (Some(alg), Some(value)) => by_binding(query, &Query { alg, value }),
            _ => Err(Refusal::new(400, "alg and value are wanted, each once")),
        },
        ("POST", BY_BINDING_PATH) => match serde_json::from_slice(body) {
            Ok(asked) => by_binding(query, &asked),
            Err(error) => Err(Refusal::new(400, format!("alg and value are wanted as JSON: {error}"))),
        },
        ("POST", BY_CONTENT_PATH) => Err(Refusal::new(
            501,
            "a mark is read with its key, which is not done here; guardsplat verify, or guardsplat-worker credentials \
             find, reads it",
        )),
        ("GET", path) if path.starts_with(MANIFESTS_PATH) => {
            let id = decoded(path.trim_start_matches(MANIFESTS_PATH)).ok_or_else(Refusal::no_manifest)?;
            let active_only = parameter(query, "returnActiveManifest").is_some_and(|text| text == "true");
            Ok(Question::Manifest { id, active_only })
        }
        (_, path) if is_of_api(path) => Err(Refusal::new(405, "there is no such method here")),
        _ => Err(Refusal::new(404, "there is nothing here")),
    }
}

fn by_binding(query: &str, asked: &Query) -> Result<Question, Refusal> {
    let most = match parameter(query, "maxResults").map(|text| text.parse()) {
        None => DEFAULT_RESULTS,
        Some(Ok(most @ 1..)) => MOST_RESULTS.min(most),
        Some(_) => return Err(Refusal::new(400, "maxResults must be a number from 1")),
    };
    let ours = (asked.alg == ALGORITHM).then(|| Value::parse(&asked.value));
    let value = ours.transpose().map_err(|error| Refusal::new(400, error.to_string()))?;
    Ok(Question::ByBinding { value, most })
}

/// The answer that names the algorithm, as JSON.
///
/// # Errors
/// None that is known of.
pub fn algorithms() -> serde_json::Result<Vec<u8>> {
    serde_json::to_vec(&Algorithms {
        watermarks: [Algorithm { alg: ALGORITHM }],
        fingerprints: [],
    })
}

/// The answer that names manifests, as JSON.
///
/// # Errors
/// None that is known of.
pub fn matches<'a>(manifests: impl IntoIterator<Item = &'a str>) -> serde_json::Result<Vec<u8>> {
    let matches = manifests.into_iter().map(|manifest_id| Match { manifest_id });
    serde_json::to_vec(&Matches {
        matches: matches.collect(),
    })
}

/// The value of a parameter that is there once. A plus sign is one, as in base64.
fn parameter(query: &str, name: &str) -> Option<String> {
    let mut values = query
        .split('&')
        .filter_map(|pair| pair.split_once('='))
        .filter(|(key, _)| *key == name);
    let (_, value) = values.next()?;
    if values.next().is_some() {
        return None;
    }
    decoded(value)
}

fn decoded(text: &str) -> Option<String> {
    let decoded = percent_decode_str(text).decode_utf8().ok()?;
    Some(decoded.into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALUE: &str = "ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FUnSul2";

    #[test]
    fn parameters_are_read_as_they_come() {
        let query = "alg=a&value=ABE%2F+x%3D&twice=1&twice=2&bad=%ff";
        assert_eq!(parameter(query, "value").as_deref(), Some("ABE/+x="));
        assert_eq!(parameter(query, "alg").as_deref(), Some("a"));
        for none in ["twice", "bad", "gone", "al"] {
            assert_eq!(parameter(query, none), None, "{none}");
        }
    }

    #[test]
    fn questions_are_understood() {
        let get = |path, query| parse("GET", path, query, b"");
        let asked = |value: Option<&str>, most| {
            let value = value.map(|text| Value::parse(text).unwrap());
            Ok(Question::ByBinding { value, most })
        };
        let encoded = VALUE.replace('/', "%2F");
        let query = format!("alg={ALGORITHM}&value={encoded}");
        assert_eq!(get(BY_BINDING_PATH, &query), asked(Some(VALUE), 10));
        let many = format!("{query}&maxResults=5000");
        assert_eq!(get(BY_BINDING_PATH, &many), asked(Some(VALUE), 1000));
        assert_eq!(get(BY_BINDING_PATH, "alg=com.example&value=c0ffee42"), asked(None, 10));
        let body = format!(r#"{{"alg": "{ALGORITHM}", "value": "{VALUE}"}}"#);
        assert_eq!(
            parse("POST", BY_BINDING_PATH, "maxResults=2", body.as_bytes()),
            asked(Some(VALUE), 2)
        );
        let manifest = |active_only| {
            let id = "urn:c2pa:1".into();
            Ok(Question::Manifest { id, active_only })
        };
        assert_eq!(get("/manifests/urn%3Ac2pa:1", ""), manifest(false));
        assert_eq!(
            get("/manifests/urn:c2pa:1", "returnActiveManifest=true"),
            manifest(true)
        );
        assert_eq!(get(ALGORITHMS_PATH, ""), Ok(Question::Algorithms));
        assert_eq!(
            algorithms().unwrap(),
            br#"{"watermarks":[{"alg":"org.guardsplat.sh.1"}],"fingerprints":[]}"#
        );
        assert_eq!(
            matches(["a", "b"]).unwrap(),
            br#"{"matches":[{"manifestId":"a"},{"manifestId":"b"}]}"#
        );
    }

    #[test]
    fn wrong_questions_are_told() {
        let refused = |method, path, query, body| parse(method, path, query, body).unwrap_err().status;
        for (query, status) in [
            ("alg=org.guardsplat.sh.1", 400),
            ("alg=org.guardsplat.sh.1&value=c0ffee42", 400),
            ("alg=com.example&value=x&maxResults=0", 400),
            ("alg=com.example&value=x&maxResults=x", 400),
        ] {
            assert_eq!(refused("GET", BY_BINDING_PATH, query, b""), status, "{query}");
        }
        assert_eq!(refused("POST", BY_BINDING_PATH, "", b"{}"), 400);
        assert_eq!(refused("POST", BY_CONTENT_PATH, "", b"ply"), 501);
        assert_eq!(refused("GET", BY_CONTENT_PATH, "", b""), 405);
        assert_eq!(refused("DELETE", "/manifests/urn:c2pa:1", "", b""), 405);
        assert_eq!(refused("GET", "/manifests/%ff", "", b""), 404);
        assert_eq!(refused("GET", "/", "", b""), 404);
    }
}
