//! What is inside a page for programs: the JSON, and the pictures.
use crate::evidence::Evidence;
use crate::picture::View;
use base64::{Engine, engine::general_purpose::STANDARD};
use maud::{Markup, PreEscaped, html};

/// What stands before and after the JSON.
const START: &str = "<script type=\"application/json\" id=\"evidence\">";
const END: &str = "</script>";
/// What stands before a picture.
const DATA: &str = "src=\"data:image/png;base64,";

/// The JSON as a block of data, which no browser runs.
///
/// `<`, `>` and `&` are only found within strings of JSON, where their numbers stand for them, so that nothing in it ends
/// the block or begins a comment.
pub(super) fn block(json: &str) -> Markup {
    let escaped = json
        .replace('&', "\\u0026")
        .replace('<', "\\u003c")
        .replace('>', "\\u003e")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029");
    html! { script type="application/json" id="evidence" { (PreEscaped(escaped)) } }
}

/// The JSON inside a page, `None` where there is none.
pub(crate) fn json(page: &str) -> Option<&str> {
    let (_, rest) = page.split_once(START)?;
    Some(rest.split_once(END)?.0)
}

/// The address of a picture that is inside the page.
pub(super) fn address(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

/// Gives the evidence's pictures the bytes that the page has for them; the number of those that no view names.
pub(crate) fn fill(page: &str, evidence: &mut Evidence) -> usize {
    let mut others = 0;
    for rest in page.split(DATA).skip(1) {
        let data = rest.split_once('"').and_then(|(data, _)| STANDARD.decode(data).ok());
        let mut ours = false;
        if let Some(png) = data {
            // All of them, since two views may show the same.
            for picture in evidence.views.iter_mut().flat_map(View::pictures_mut) {
                ours |= picture.fill(&png);
            }
        }
        others += usize::from(!ours);
    }
    others
}
