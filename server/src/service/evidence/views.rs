//! Pictures for the evidence, as workers send them: checked before anything is kept.
use guardsplat_evidence::{Picture, View};
use guardsplat_proto::v1::SeenView;

use crate::error::Result;
use crate::service::violations::Problems;

/// Most views; all of them travel in one message.
const MOST: usize = 8;
/// Largest side of a picture in pixels: it is to be looked at, what was read is named by its hash.
const SIDE: u32 = 512;
/// Most bytes of a name.
const NAME_BYTES: usize = 200;

/// The views, with ten times the difference where the original is known.
pub fn checked(views: &[SeenView]) -> Result<Vec<View>> {
    let mut problems = Problems::default();
    if views.len() > MOST {
        problems.add(
            "views",
            format!("has {} entries, at most {MOST} are taken", views.len()),
        );
    }
    let mut checked = Vec::new();
    for (i, view) in views.iter().take(MOST).enumerate() {
        let field = |name: &str| format!("views[{i}].{name}");
        let named = !view.name.is_empty() && view.name.len() <= NAME_BYTES;
        problems.check(named, &field("name"), "must have 1 to 200 bytes");
        let read = picture(field("read"), &view.read, &mut problems);
        let original = match view.original.is_empty() {
            true => None,
            false => picture(field("original"), &view.original, &mut problems),
        };
        let Some(read) = read else { continue };
        let difference = original.as_ref().and_then(|original| {
            let difference = Picture::difference(original, &read);
            difference
                .map_err(|error| problems.add(field("original"), error.to_string()))
                .ok()
        });
        checked.push(View {
            name: view.name.clone(),
            original,
            read,
            difference,
        });
    }
    problems.finish()?;
    Ok(checked)
}

fn picture(field: String, png: &[u8], problems: &mut Problems) -> Option<Picture> {
    match Picture::from_png(png.to_vec()) {
        Ok(picture) if picture.width.max(picture.height) <= SIDE => Some(picture),
        Ok(picture) => {
            let (width, height) = (picture.width, picture.height);
            problems.add(
                field,
                format!("is {width} x {height} pixels, at most {SIDE} a side are taken"),
            );
            None
        }
        Err(error) => {
            problems.add(field, error.to_string());
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(width: u32, height: u32, value: u8) -> Vec<u8> {
        let values = vec![value; 3 * (width * height) as usize];
        let picture = Picture::from_rgb(width, height, &values).unwrap();
        picture.png().unwrap().to_vec()
    }

    fn view(read: Vec<u8>, original: Vec<u8>) -> SeenView {
        SeenView {
            name: "view 1".into(),
            read,
            original,
        }
    }

    #[test]
    fn differences_are_made_here() {
        let views = [view(png(4, 2, 103), png(4, 2, 100)), view(png(4, 2, 7), Vec::new())];
        let found = checked(&views).unwrap();
        assert_eq!(found[0].difference, Some(Picture::from_rgb(4, 2, &[30; 24]).unwrap()));
        assert_eq!((&found[1].original, &found[1].difference), (&None, &None));
        assert!(checked(&[]).unwrap().is_empty());
    }

    #[test]
    fn what_is_no_picture_or_too_much_is_refused() {
        let refused = |views: &[SeenView], field: &str| {
            let error = checked(views).unwrap_err().to_string();
            assert!(error.contains(field), "{error}");
        };
        refused(&[view(b"GIF89a".to_vec(), Vec::new())], "views[0].read");
        refused(&[view(png(513, 1, 0), Vec::new())], "513 x 1");
        refused(&[view(png(4, 2, 0), png(2, 4, 0))], "views[0].original");
        refused(&vec![view(png(1, 1, 0), Vec::new()); 9], "at most 8");
        let unnamed = SeenView {
            name: String::new(),
            ..view(png(1, 1, 0), Vec::new())
        };
        refused(&[unnamed], "views[0].name");
    }
}
