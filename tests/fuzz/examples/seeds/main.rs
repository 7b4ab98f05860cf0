//! Makes the seeds of the corpus: small files of every kind, right ones and such that are a little wrong.
//!
//! `cargo run --release --example seeds`. Files that are there stay as they are.
mod claims;
mod models;
mod packages;
mod pictures;
mod scenes;
mod server;
mod sog;
mod texts;

use std::path::Path;

/// Puts a seed of a target into the corpus.
fn put(target: &str, name: &str, bytes: impl AsRef<[u8]>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    let path = folder.join(name);
    if !path.exists() {
        std::fs::write(&path, bytes).expect("a file can be written");
        println!("{}", path.display());
    }
}

/// Puts a seed, and what remains of it when it is cut, or when a byte of it is another.
fn put_damaged(target: &str, name: &str, bytes: &[u8]) {
    put(target, name, bytes);
    put(target, &format!("{name}-cut"), &bytes[..bytes.len() * 2 / 3]);
    let mut changed = bytes.to_vec();
    changed[bytes.len() / 2] ^= 0x55;
    put(target, &format!("{name}-changed"), changed);
}

fn main() {
    scenes::put_all();
    sog::put_all();
    models::put_all();
    packages::put_all();
    pictures::put_all();
    texts::put_all();
    server::put_all();
    claims::put_all();
}
