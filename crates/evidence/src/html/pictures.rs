//! Views: the original where it is known, what was read, and ten times the difference.
use super::embedded::address;
use super::text::{hash, sent, visible};
use crate::picture::{Picture, View};
use maud::{Markup, html};

/// The views; nothing where there are none.
pub(super) fn section(views: &[View]) -> Markup {
    if views.is_empty() {
        return html! {};
    }
    html! {
        section {
            h2 { "Pictures" }
            @if views.iter().any(|view| view.difference.is_some()) {
                p { "A difference is ten times as strong as it is, so that it can be seen at all; black is no difference." }
            }
            @for view in views {
                h3 { (sent(&view.name)) }
                div.views { @for (what, picture) in view.pictures() { (figure(view, what, picture)) } }
            }
        }
    }
}

fn figure(view: &View, what: &str, picture: &Picture) -> Markup {
    let alt = format!(
        "{}: {what}, {} \u{d7} {} pixels",
        visible(&view.name),
        picture.width,
        picture.height
    );
    let mut title = what.to_owned();
    if let Some(first) = title.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    html! {
        figure {
            @if let Some(png) = picture.png() {
                img src=(address(png)) alt=(alt) width=(picture.width) height=(picture.height);
            }
            figcaption {
                (title)
                @if picture.png().is_none() { " (the picture is not part of this page)" }
                (hash(&picture.sha256))
            }
        }
    }
}
