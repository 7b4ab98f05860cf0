//! `meta.json` of both versions: how many Gaussians, which entry holds which picture, and what its bytes stand for.
use super::codebook::Codebook;
use super::json::{Json, Property, files, range};

/// Largest magnitude of the logarithms of positions: beyond 88.7 their exponentials are not in single precision.
pub(crate) const MAX_LOG: f64 = 88.0;

/// Longest part of the parser's message, which quotes the file.
const MAX_MESSAGE: usize = 200;

/// What a picture holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Lower,
    Upper,
    Quats,
    Scales,
    Sh0,
    Centroids,
    Labels,
}

impl Role {
    /// What messages call it: the usual name without its ending.
    pub fn name(self) -> &'static str {
        match self {
            Role::Lower => "means_l",
            Role::Upper => "means_u",
            Role::Quats => "quats",
            Role::Scales => "scales",
            Role::Sh0 => "sh0",
            Role::Centroids => "shN_centroids",
            Role::Labels => "shN_labels",
        }
    }
}

/// What is known without the pictures, the same for both versions.
#[derive(Debug)]
pub(super) struct Meta {
    /// Number of Gaussians, the first pixels of every picture but that of centroids.
    pub count: u64,
    /// Entry of the lower bytes of positions.
    pub lower: String,
    /// Entry of the upper bytes of positions.
    pub upper: String,
    /// Least and largest of each coordinate, as sign(x) ln(1 + |x|).
    pub ranges: [(f64, f64); 3],
    /// Entry of rotations.
    pub quats: String,
    /// Entry of scales.
    pub scales: String,
    /// What its bytes stand for.
    pub sizes: [Codebook; 3],
    /// Entry of colours and opacity.
    pub sh0: String,
    /// What the bytes of colours stand for.
    pub dc: [Codebook; 3],
    /// What the byte of opacity stands for.
    pub opacity: Codebook,
    /// Higher bands.
    pub rest: Option<Rest>,
}

/// What is known of higher bands.
#[derive(Debug)]
pub(super) struct Rest {
    /// Entry of the palette.
    pub centroids: String,
    /// Entry of each Gaussian's place in it.
    pub labels: String,
    /// What the bytes of the palette stand for.
    pub values: Codebook,
    /// Number of bands and of places of the palette, which version 1 leaves to the picture's size.
    pub promised: Option<(usize, usize)>,
}

/// Reads the text; `Err` says what is missing or wrong.
pub(super) fn parse(text: &[u8]) -> Result<Meta, String> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let json: Json =
        serde_json::from_slice(text).map_err(|e| e.to_string().chars().take(MAX_MESSAGE).collect::<String>())?;
    let old = match json.version {
        None | Some(1) => true,
        Some(2) => false,
        Some(other) => return Err(format!("version {other}; known are 1 and 2")),
    };
    let shape = json.means.shape.as_ref().and_then(|shape| shape.first().copied());
    let (count, place) = if old {
        (shape, "means.shape")
    } else {
        (json.count, "count")
    };
    let count = count.ok_or_else(|| format!("no {place}"))?;
    if json.quats.encoding.as_deref().is_some_and(|e| e != "quaternion_packed") {
        return Err("quats.encoding is not quaternion_packed".into());
    }
    let [lower, upper] = files(&json.means, "means")?;
    let [quats] = files(&json.quats, "quats")?;
    let [scales] = files(&json.scales, "scales")?;
    let [sh0] = files(&json.sh0, "sh0")?;
    let meta = Meta {
        count,
        ranges: ranges(&json.means)?,
        sizes: tables(&json.scales, "scales", old)?,
        dc: tables(&json.sh0, "sh0", old)?,
        opacity: if old {
            linear(&json.sh0, "sh0", 3)?
        } else {
            Codebook::logits()
        },
        // Version 2 of no bands is what a writer of scenes without them might leave.
        rest: match json.rest.filter(|rest| old || rest.bands != Some(0)) {
            Some(rest) => Some(higher(&rest, old)?),
            None => None,
        },
        lower,
        upper,
        quats,
        scales,
        sh0,
    };
    meta.check_names()?;
    Ok(meta)
}

impl Meta {
    /// Writing one picture must not change another.
    fn check_names(&self) -> Result<(), String> {
        let mut names = vec![
            "meta.json",
            &self.lower,
            &self.upper,
            &self.quats,
            &self.scales,
            &self.sh0,
        ];
        names.extend(self.rest.iter().flat_map(|rest| [&*rest.centroids, &*rest.labels]));
        names.sort_unstable();
        match names.windows(2).any(|pair| pair[0] == pair[1]) {
            true => Err("one file for two things".into()),
            false => Ok(()),
        }
    }
}

fn ranges(means: &Property) -> Result<[(f64, f64); 3], String> {
    let mut all = [(0.0, 0.0); 3];
    for (i, slot) in all.iter_mut().enumerate() {
        let (min, max) = range(means, "means", i)?;
        if min.abs().max(max.abs()) > MAX_LOG {
            return Err(format!(
                "means.mins and means.maxs {i} are {min:e} and {max:e}, limit {MAX_LOG}"
            ));
        }
        *slot = (min, max);
    }
    Ok(all)
}

fn linear(property: &Property, name: &str, i: usize) -> Result<Codebook, String> {
    let (min, max) = range(property, name, i)?;
    Codebook::linear(min, max).map_err(|reason| format!("{name}.mins and {name}.maxs: {reason}"))
}

fn listed(property: &Property, name: &str) -> Result<Codebook, String> {
    let entries = property
        .codebook
        .as_ref()
        .ok_or_else(|| format!("no {name}.codebook"))?;
    Codebook::listed(entries).map_err(|reason| format!("{name}.codebook: {reason}"))
}

/// What the bytes of three channels stand for.
fn tables(property: &Property, name: &str, old: bool) -> Result<[Codebook; 3], String> {
    if old {
        let [x, y, z] = [0, 1, 2].map(|i| linear(property, name, i));
        return Ok([x?, y?, z?]);
    }
    let all = listed(property, name)?;
    Ok([all.clone(), all.clone(), all])
}

fn higher(rest: &Property, old: bool) -> Result<Rest, String> {
    let [centroids, labels] = files(rest, "shN")?;
    let promised = if old {
        None
    } else {
        let bands = rest.bands.filter(|bands| (1..=3).contains(bands));
        let count = rest.count.filter(|count| *count <= 1 << 16);
        Some((
            bands.ok_or("shN.bands must be 1, 2 or 3")? as usize,
            count.ok_or("shN.count must be at most 65536")? as usize,
        ))
    };
    Ok(Rest {
        centroids,
        labels,
        values: if old {
            linear(rest, "shN", 0)?
        } else {
            listed(rest, "shN")?
        },
        promised,
    })
}
