//! `docs/api.md` is what the protos' comments make of it.
#[path = "../examples/api_docs/render.rs"]
mod render;

#[test]
fn the_page_is_in_step_with_the_protos() {
    let kept = std::fs::read_to_string(render::PATH).unwrap();
    let made = render::page().unwrap();
    let different = kept.lines().zip(made.lines()).position(|(kept, made)| kept != made);
    assert!(
        kept == made,
        "docs/api.md differs from the protos (first at line {:?}): \
         cargo run --release -p guardsplat-proto --example api_docs",
        different.map(|line| line + 1)
    );
}

#[test]
fn everything_has_a_comment() {
    let page = render::page().unwrap();
    let empty: Vec<_> = page
        .lines()
        .filter(|line| line.starts_with("| `") && line.ends_with("|  |"))
        .collect();
    assert!(empty.is_empty(), "without a comment: {empty:#?}");
    // Headings are followed by what they are for.
    assert!(!page.contains("\n\n\n"), "some message, enum or service has no comment");
}
