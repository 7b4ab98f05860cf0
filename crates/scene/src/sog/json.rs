//! The text of `meta.json` as it is written.
use serde::Deserialize;

/// What either version may have; which of it is needed depends on the version. What else there is nobody needs.
#[derive(Deserialize)]
pub(super) struct Json {
    pub version: Option<u64>,
    pub count: Option<u64>,
    pub means: Property,
    pub scales: Property,
    pub quats: Property,
    pub sh0: Property,
    #[serde(rename = "shN")]
    pub rest: Option<Property>,
}

/// A property of Gaussians.
#[derive(Deserialize)]
pub(super) struct Property {
    pub files: Vec<String>,
    pub mins: Option<Numbers>,
    pub maxs: Option<Numbers>,
    pub codebook: Option<Vec<Option<f64>>>,
    pub shape: Option<Vec<u64>>,
    pub encoding: Option<String>,
    pub count: Option<u64>,
    pub bands: Option<u64>,
}

/// A number for all channels, or one a channel.
#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum Numbers {
    One(f64),
    Many(Vec<f64>),
}

/// The names of a property's pictures.
pub(super) fn files<const N: usize>(property: &Property, name: &str) -> Result<[String; N], String> {
    <[String; N]>::try_from(property.files.clone())
        .map_err(|files| format!("{name}.files has {} names, must have {N}", files.len()))
}

/// Number `i` of `mins` or `maxs`; a single number is one for all.
fn number(numbers: Option<&Numbers>, i: usize, name: &str) -> Result<f64, String> {
    match numbers {
        Some(Numbers::One(number)) => Some(*number),
        Some(Numbers::Many(many)) => many.get(i).copied(),
        None => None,
    }
    .ok_or_else(|| format!("{name} has no number {i}"))
}

/// Where the steps of channel `i` start and end.
pub(super) fn range(property: &Property, name: &str, i: usize) -> Result<(f64, f64), String> {
    Ok((
        number(property.mins.as_ref(), i, &format!("{name}.mins"))?,
        number(property.maxs.as_ref(), i, &format!("{name}.maxs"))?,
    ))
}
