//! Reports as files: JSON and CSV for programs, HTML for people, Markdown for documents. The same records give the same
//! bytes.
mod atomic_write;
mod csv;
mod html;
mod json;
mod markdown;
mod markers;
mod picture;
mod svg;

pub use csv::{to_csv, write_csv, write_robustness_csv};
pub use html::{to_html, write_html};
pub use json::{to_json, write_json};
pub use markdown::{to_markdown, write_markdown};
pub use markers::{replace_between, replace_in_file};
pub use svg::{to_svg, write_svg};

#[cfg(test)]
mod tests;
