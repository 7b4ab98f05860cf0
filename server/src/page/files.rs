//! The files of the page, from `server/page`, as they are compiled in.
use std::sync::LazyLock;

use http_body_util::Full;
use hyper::body::Bytes;
use sha2::{Digest, Sha256};
use tonic::body::Body;
use tonic::codegen::http::header::{CACHE_CONTROL, CONTENT_TYPE, ETAG, HeaderValue, IF_NONE_MATCH};
use tonic::codegen::http::{HeaderMap, Response, StatusCode};

use super::empty;

/// A file of the page.
pub struct File {
    /// Its path, `/` first.
    pub path: &'static str,
    /// Its media type.
    pub kind: &'static str,
    /// What is in it.
    pub bytes: &'static [u8],
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";
const TEXT: &str = "text/plain; charset=utf-8";

macro_rules! file {
    ($path:expr, $kind:expr, $name:literal) => {
        File {
            path: $path,
            kind: $kind,
            bytes: include_bytes!(concat!("../../page/", $name)),
        }
    };
    ($name:literal, $kind:expr) => {
        file!(concat!("/", $name), $kind, $name)
    };
}

/// All there are. Nothing else is ever given out.
pub const FILES: &[File] = &[
    file!("/", HTML, "index.html"),
    file!("style.css", CSS),
    file!("icon.svg", SVG),
    file!("main.js", SCRIPT),
    file!("calls.js", SCRIPT),
    file!("elements.js", SCRIPT),
    file!("errors.js", SCRIPT),
    file!("formats.js", SCRIPT),
    file!("gltf.js", SCRIPT),
    file!("jobs.js", SCRIPT),
    file!("mark.js", SCRIPT),
    file!("operate.js", SCRIPT),
    file!("ply.js", SCRIPT),
    file!("session.js", SCRIPT),
    file!("spz.js", SCRIPT),
    file!("transfer.js", SCRIPT),
    file!("verdict.js", SCRIPT),
    file!("verify.js", SCRIPT),
    file!("viewer.js", SCRIPT),
    file!("vendor/api.js", SCRIPT),
    file!("vendor/splats.js", SCRIPT),
    file!("vendor/LICENSES.txt", TEXT),
];

/// What tells versions of the files apart, in their order.
static TAGS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let tag = |file: &File| format!("\"{}\"", hex::encode(&Sha256::digest(file.bytes)[..16]));
    FILES.iter().map(tag).collect()
});

/// A file and its tag.
pub struct Found(usize);

/// The file at a path, if there is one.
pub fn find(path: &str) -> Option<Found> {
    FILES.iter().position(|file| file.path == path).map(Found)
}

impl Found {
    /// The file, or that it is what the browser has. Asked for again every time, so that no old one is used with a new
    /// server.
    pub fn answer(&self, headers: &HeaderMap) -> Response<Body> {
        let (file, tag) = (&FILES[self.0], &TAGS[self.0]);
        let known = headers.get_all(IF_NONE_MATCH).iter();
        let known = known
            .filter_map(|known| known.to_str().ok())
            .flat_map(|known| known.split(','));
        let mut answer = match known
            .into_iter()
            .any(|known| known.trim().trim_start_matches("W/") == tag)
        {
            true => empty(StatusCode::NOT_MODIFIED),
            false => Response::new(Body::new(Full::new(Bytes::from_static(file.bytes)))),
        };
        let headers = answer.headers_mut();
        headers.insert(CONTENT_TYPE, HeaderValue::from_static(file.kind));
        headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
        // It is made of hexadecimal digits.
        if let Ok(tag) = HeaderValue::from_str(tag) {
            headers.insert(ETAG, tag);
        }
        answer
    }
}
