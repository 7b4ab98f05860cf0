//! `credentials value`: what a resolution service is asked for about a copy.
use guardsplat_operations::thumbnails::Thumbnails;
use guardsplat_operations::verification::read;
use guardsplat_soft_binding::{ALGORITHM, Value};
use serde::Serialize;

use super::{Exit, copy};
use crate::cli::display::Display;
use crate::cli::{print_json, print_line};
use crate::credentials_program::binding_key;
use crate::error::Result;

/// What is told: the query of the C2PA's Soft Binding Resolution API.
#[derive(Serialize)]
struct Query {
    alg: &'static str,
    value: String,
}

pub fn run(arguments: &copy::Arguments) -> Result<Exit> {
    let suspect = arguments.suspect()?;
    let key = arguments.key()?;
    let engine = arguments.engine(&key)?;
    let mut display = Display::new("reading");
    // Nobody looks at what was read.
    let mut shown = Thumbnails::default();
    let (reading, _) = read(&engine, &suspect, &arguments.views()?, &mut shown, |done, total| {
        display.set(done, total, String::new);
    })?;
    drop(display);
    let query = Query {
        alg: ALGORITHM,
        value: Value::seal(
            binding_key(&key, &key.id()),
            &engine.message_code.read(&reading.summed)?,
        )?
        .text(),
    };
    if arguments.json {
        print_json(&query)?;
    } else {
        print_line(&query.value);
    }
    Ok(Exit::Done)
}
