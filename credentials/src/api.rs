//! The C2PA's Soft Binding Resolution API (version 1.0 of its OpenAPI document): from a request to a response.
use guardsplat_soft_binding::{ALGORITHM, Value};
use hyper::body::Bytes;
use hyper::{Method, StatusCode};
use serde::{Deserialize, Serialize};

use crate::store::Store;

/// Manifests that are named unless a caller says how many.
const DEFAULT_RESULTS: usize = 10;
/// Most that are named.
const MOST_RESULTS: usize = 1000;

/// An answer: status, media type, body.
pub type Answer = (StatusCode, &'static str, Bytes);

const JSON: &str = "application/json";
const TEXT: &str = "text/plain; charset=utf-8";

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

/// Answers from a store. `query` is as in the URL.
pub fn answer(store: &Store, method: &Method, path: &str, query: &str, body: &[u8]) -> Answer {
    match (method, path) {
        (&Method::GET, "/services/supportedAlgorithms") => {
            json(&serde_json::json!({ "watermarks": [{ "alg": ALGORITHM }], "fingerprints": [] }))
        }
        (&Method::GET, "/matches/byBinding") => match (parameter(query, "alg"), parameter(query, "value")) {
            (Some(alg), Some(value)) => by_binding(store, query, &Query { alg, value }),
            _ => text(StatusCode::BAD_REQUEST, "alg and value are wanted, each once"),
        },
        (&Method::POST, "/matches/byBinding") => match serde_json::from_slice(body) {
            Ok(asked) => by_binding(store, query, &asked),
            Err(error) => text(
                StatusCode::BAD_REQUEST,
                &format!("alg and value are wanted as JSON: {error}"),
            ),
        },
        (&Method::POST, "/matches/byContent") => text(
            StatusCode::NOT_IMPLEMENTED,
            "a mark is read with its key, which is not here; guardsplat-worker credentials find reads it",
        ),
        (&Method::GET, path) if path.starts_with("/manifests/") => manifest(store, path, query),
        (_, "/services/supportedAlgorithms" | "/matches/byBinding" | "/matches/byContent") => {
            text(StatusCode::METHOD_NOT_ALLOWED, "there is no such method here")
        }
        _ => text(StatusCode::NOT_FOUND, "there is nothing here"),
    }
}

fn by_binding(store: &Store, query: &str, asked: &Query) -> Answer {
    let most = match parameter(query, "maxResults").map(|text| text.parse()) {
        None => DEFAULT_RESULTS,
        Some(Ok(most @ 1..)) => MOST_RESULTS.min(most),
        Some(_) => return text(StatusCode::BAD_REQUEST, "maxResults must be a number from 1"),
    };
    // Marks of others are none of ours, and so have no manifests here.
    let found = if asked.alg == ALGORITHM {
        match Value::parse(&asked.value) {
            Ok(value) => store.manifests_of(&value.text(), most),
            Err(error) => return text(StatusCode::BAD_REQUEST, &error.to_string()),
        }
    } else {
        Vec::new()
    };
    json(&Matches {
        matches: found.into_iter().map(|manifest_id| Match { manifest_id }).collect(),
    })
}

/// Our sidecars have one manifest, so that the active one is all of the store.
fn manifest(store: &Store, path: &str, query: &str) -> Answer {
    let id = decoded(path.trim_start_matches("/manifests/"));
    let Some(sidecar) = id.as_deref().and_then(|id| store.sidecar(id)) else {
        return text(StatusCode::NOT_FOUND, "there is no such manifest");
    };
    if parameter(query, "returnActiveManifest").is_some_and(|text| text == "true") && sidecar.manifests > 1 {
        return text(
            StatusCode::NOT_IMPLEMENTED,
            "the manifest is handed out with those that it builds on only",
        );
    }
    match crate::sidecar::read(&sidecar.path) {
        Ok(bytes) => (StatusCode::OK, "application/c2pa", bytes.into()),
        // Taken away since it was listed; the path is nobody's business.
        Err(_) => text(StatusCode::NOT_FOUND, "there is no such manifest any more"),
    }
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
    let decoded = percent_encoding::percent_decode_str(text).decode_utf8().ok()?;
    Some(decoded.into_owned())
}

fn text(status: StatusCode, text: &str) -> Answer {
    (status, TEXT, format!("{text}\n").into())
}

fn json(value: &impl Serialize) -> Answer {
    match serde_json::to_vec(value) {
        Ok(bytes) => (StatusCode::OK, JSON, bytes.into()),
        Err(error) => text(StatusCode::INTERNAL_SERVER_ERROR, &error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn wrong_questions_are_told() {
        let store = Store::default();
        let get = |path, query| answer(&store, &Method::GET, path, query, b"").0.as_u16();
        assert_eq!(get("/matches/byBinding", "alg=org.guardsplat.sh.1"), 400);
        assert_eq!(get("/matches/byBinding", "alg=org.guardsplat.sh.1&value=c0ffee42"), 400);
        assert_eq!(get("/matches/byBinding", "alg=com.example&value=c0ffee42"), 200);
        assert_eq!(get("/matches/byBinding", "alg=com.example&value=x&maxResults=0"), 400);
        assert_eq!(get("/manifests/urn:c2pa:gone", ""), 404);
        assert_eq!(get("/manifests/../../etc/passwd", ""), 404);
        assert_eq!(get("/matches/byContent", ""), 405);
        assert_eq!(get("/", ""), 404);
        let post = |path, body| answer(&store, &Method::POST, path, "", body).0.as_u16();
        assert_eq!(post("/matches/byContent", &b"ply"[..]), 501);
        assert_eq!(post("/matches/byBinding", b"{}"), 400);
        assert_eq!(
            post("/matches/byBinding", br#"{"alg": "com.example", "value": ""}"#),
            200
        );
    }
}
