//! Parts of documents that are made from records: what stands between `<!-- BEGIN name -->` and `<!-- END name -->`.
use super::atomic_write::write_whole;
use crate::error::{Error, Result};
use std::path::Path;

/// A document with another text between the markers of a name; the rest stays as it is, and so do the markers.
///
/// # Errors
/// Says which marker is not there, is there twice, or comes too early, or that a name or text cannot be marked.
pub fn replace_between(document: &str, name: &str, text: &str) -> std::result::Result<String, String> {
    if name.is_empty() || !name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-') {
        return Err(format!("{name:?} is no name for a marker: letters, digits and - are"));
    }
    let [begin, end] = ["BEGIN", "END"].map(|which| format!("<!-- {which} {name} -->"));
    if text.contains(&begin) || text.contains(&end) {
        return Err(format!("the text for {name} has its markers in it"));
    }
    let (before, rest) = once(document, &begin)?;
    if before.contains(&end) {
        return Err(format!("{end} comes before {begin}"));
    }
    let (_, after) = once(rest, &end)?;
    Ok(format!("{before}{begin}\n\n{}\n\n{end}{after}", text.trim()))
}

/// What comes before and after a marker.
fn once<'a>(text: &'a str, marker: &str) -> std::result::Result<(&'a str, &'a str), String> {
    let (before, after) = text.split_once(marker).ok_or_else(|| format!("there is no {marker}"))?;
    match after.contains(marker) {
        true => Err(format!("{marker} is there twice")),
        false => Ok((before, after)),
    }
}

/// Does [`replace_between`] in a file, whole or not at all; a file that already says so is not touched.
///
/// # Errors
/// [`Error::BadMarkers`], and [`Error::Io`].
pub fn replace_in_file(path: &Path, name: &str, text: &str) -> Result<()> {
    let document = std::fs::read_to_string(path).map_err(Error::io(path))?;
    let new = replace_between(&document, name, text).map_err(|reason| Error::BadMarkers {
        path: path.to_path_buf(),
        reason,
    })?;
    if new == document {
        return Ok(());
    }
    write_whole(path, new.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    const DOCUMENT: &str = "# A\n<!-- BEGIN a -->\nold\n<!-- END a -->\n<!-- BEGIN b --><!-- END b -->\nend";

    #[test]
    fn only_what_is_between_changes() {
        let new = replace_between(DOCUMENT, "a", "new\n").unwrap();
        assert_eq!(
            new,
            "# A\n<!-- BEGIN a -->\n\nnew\n\n<!-- END a -->\n<!-- BEGIN b --><!-- END b -->\nend"
        );
        assert_eq!(replace_between(&new, "a", "new").unwrap(), new, "twice is once");
        let both = replace_between(&new, "b", "more").unwrap();
        assert!(both.contains("\n\nnew\n\n") && both.ends_with("<!-- BEGIN b -->\n\nmore\n\n<!-- END b -->\nend"));
    }

    #[test]
    fn documents_without_clear_markers_stay() {
        let twice = DOCUMENT.repeat(2);
        let swapped = "<!-- END a --><!-- BEGIN a --><!-- END a -->";
        for (document, name, text, reason) in [
            (DOCUMENT, "c", "", "there is no <!-- BEGIN c -->"),
            ("<!-- BEGIN a -->", "a", "", "there is no <!-- END a -->"),
            (&twice, "a", "", "<!-- BEGIN a --> is there twice"),
            (swapped, "a", "", "<!-- END a --> comes before <!-- BEGIN a -->"),
            (DOCUMENT, "a", "<!-- END a -->", "the text for a has its markers in it"),
            (
                DOCUMENT,
                "a -->",
                "",
                "\"a -->\" is no name for a marker: letters, digits and - are",
            ),
        ] {
            assert_eq!(replace_between(document, name, text).unwrap_err(), reason);
        }
    }

    #[test]
    fn files_are_replaced_or_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("evaluation.md");
        std::fs::write(&path, DOCUMENT).unwrap();
        let error = replace_in_file(&path, "c", "new").unwrap_err();
        assert!(matches!(error, Error::BadMarkers { .. }), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), DOCUMENT);
        replace_in_file(&path, "a", "new").unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().contains("\n\nnew\n\n"));
        assert!(replace_in_file(&folder.path().join("none.md"), "a", "").is_err());
    }
}
