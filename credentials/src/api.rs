//! The C2PA's Soft Binding Resolution API, answered from a folder: from a request to a response.
use guardsplat_soft_binding::resolution::{self, JSON, MANIFEST, Question, Refusal, TEXT};
use hyper::body::Bytes;
use hyper::{Method, StatusCode};

use crate::store::Store;

/// An answer: status, media type, body.
pub type Answer = (StatusCode, &'static str, Bytes);

/// Answers from a store. `query` is as in the URL.
pub fn answer(store: &Store, method: &Method, path: &str, query: &str, body: &[u8]) -> Answer {
    let answered = resolution::parse(method.as_str(), path, query, body).and_then(|question| found(store, &question));
    answered.unwrap_or_else(|Refusal { status, told }| {
        let status = StatusCode::from_u16(status).unwrap_or(StatusCode::BAD_REQUEST);
        text(status, &told)
    })
}

fn found(store: &Store, question: &Question) -> Result<Answer, Refusal> {
    match question {
        Question::Algorithms => Ok(json(resolution::algorithms())),
        Question::ByBinding { value, most } => {
            let manifests = value.as_ref().map(|value| store.manifests_of(&value.text(), *most));
            Ok(json(resolution::matches(manifests.unwrap_or_default())))
        }
        Question::Manifest { id, active_only } => {
            // Our sidecars have one manifest, so that the active one is all of the store.
            let sidecar = store.sidecar(id).ok_or_else(Refusal::no_manifest)?;
            if *active_only && sidecar.manifests > 1 {
                return Err(Refusal::not_alone());
            }
            // One may have been taken away since it was listed; the path is nobody's business.
            let bytes = crate::sidecar::read(&sidecar.path).map_err(|_| Refusal::no_manifest())?;
            Ok((StatusCode::OK, MANIFEST, bytes.into()))
        }
    }
}

fn text(status: StatusCode, text: &str) -> Answer {
    (status, TEXT, format!("{text}\n").into())
}

fn json(bytes: serde_json::Result<Vec<u8>>) -> Answer {
    match bytes {
        Ok(bytes) => (StatusCode::OK, JSON, bytes.into()),
        Err(error) => text(StatusCode::INTERNAL_SERVER_ERROR, &error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_there_is_not_found() {
        let store = Store::default();
        let get = |path, query| answer(&store, &Method::GET, path, query, b"").0.as_u16();
        assert_eq!(get("/matches/byBinding", "alg=org.guardsplat.sh.1"), 400);
        assert_eq!(get("/matches/byBinding", "alg=com.example&value=c0ffee42"), 200);
        assert_eq!(get("/manifests/urn:c2pa:gone", ""), 404);
        assert_eq!(get("/manifests/../../etc/passwd", ""), 404);
        let post = answer(&store, &Method::POST, "/matches/byContent", "", b"ply");
        assert_eq!(post.0.as_u16(), 501);
    }
}
