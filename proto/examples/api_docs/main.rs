//! Writes `docs/api.md` from the comments in the protos: `cargo run -p guardsplat-proto --example api_docs`.
//! A test checks that the page is in step.
mod render;

fn main() -> std::io::Result<()> {
    let page = render::page().map_err(std::io::Error::other)?;
    std::fs::write(render::PATH, page)?;
    println!("{} was written", render::PATH);
    Ok(())
}
