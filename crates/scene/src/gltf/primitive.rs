//! Meshes and those of their primitives that are splats: which accessors have what, and what the extension says of them.
use crate::fields::quote;
use serde::de::{IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;

/// The extension by which splats are known.
pub(crate) const EXTENSION: &str = "KHR_gaussian_splatting";
/// Highest degree of spherical harmonics that the extension has attributes for.
pub(crate) const MAX_DEGREE: usize = 3;
/// Coefficients of that degree, a channel.
const COEFFICIENTS: usize = (MAX_DEGREE + 1) * (MAX_DEGREE + 1);
/// `mode` of points.
const POINTS: u64 = 0;
/// `mode` where nothing is said.
const TRIANGLES: u64 = 4;

/// The primitives of a mesh that are splats, with their places among all of them.
#[derive(Default)]
pub(super) struct Mesh {
    pub splats: Vec<(usize, Primitive)>,
}

/// A primitive that is splats.
#[derive(Deserialize)]
pub(super) struct Primitive {
    #[serde(default)]
    pub attributes: Attributes,
    mode: Option<u64>,
    targets: Option<IgnoredAny>,
    #[serde(default)]
    extensions: Extensions,
}

#[derive(Default, Deserialize)]
struct Extensions {
    #[serde(rename = "KHR_gaussian_splatting")]
    splatting: Option<Box<Splatting>>,
}

/// What the extension says.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Splatting {
    kernel: Option<String>,
    color_space: Option<String>,
    projection: Option<String>,
    sorting_method: Option<String>,
    #[serde(default)]
    extensions: Compressions,
}

/// How splats may be compressed, and what else is said by extensions of the extension.
#[derive(Default)]
struct Compressions {
    /// The buffer view of an SPZ.
    spz: Option<usize>,
    /// The first one that is not known.
    unknown: Option<String>,
}

/// The accessors of the attributes that splats have.
#[derive(Clone, Default)]
pub(super) struct Attributes {
    pub position: Option<usize>,
    pub rotation: Option<usize>,
    pub scale: Option<usize>,
    pub opacity: Option<usize>,
    /// Band after band.
    harmonics: [Option<usize>; COEFFICIENTS],
    /// A coefficient of a band that the extension has not.
    beyond: Option<String>,
}

impl Primitive {
    /// Whether these can be read; `Err` names the property that says something else than what is known.
    pub fn check(&self) -> Result<(), String> {
        let mode = self.mode.unwrap_or(TRIANGLES);
        if mode != POINTS {
            return Err(format!("mode is {mode}, must be 0 (points) for splats"));
        }
        if self.targets.is_some() {
            return Err("targets: splats that morph are not read".into());
        }
        let Some(splatting) = &self.extensions.splatting else {
            return Ok(());
        };
        // Where a property that must be there is missing, as in files of drafts, it is taken for the only usual value.
        let said = [
            ("kernel", &splatting.kernel, &["ellipse"][..]),
            ("colorSpace", &splatting.color_space, &["srgb_rec709_display"]),
            ("projection", &splatting.projection, &["perspective"]),
            ("sortingMethod", &splatting.sorting_method, &["cameraDistance"]),
        ];
        for (property, value, known) in said {
            if let Some(value) = value.as_deref().filter(|value| !known.contains(value)) {
                let value = quote(value);
                return Err(format!("{EXTENSION}.{property} is {value:?}; {:?} is read", known[0]));
            }
        }
        match &splatting.extensions.unknown {
            Some(name) => Err(format!(
                "{EXTENSION}.extensions has {:?}, which is not read",
                quote(name)
            )),
            None => Ok(()),
        }
    }

    /// The buffer view of the SPZ that the splats are in, if they are in one.
    pub fn spz(&self) -> Option<usize> {
        self.extensions.splatting.as_ref()?.extensions.spz
    }
}

impl Attributes {
    /// The accessors of all coefficients, `(degree + 1)^2` of them; `Err` names one that is missing or too many.
    pub fn harmonics(&self) -> Result<Vec<usize>, String> {
        if let Some(name) = &self.beyond {
            let name = quote(name);
            return Err(format!(
                "attribute {name}: spherical harmonics have the degrees 0 to {MAX_DEGREE}"
            ));
        }
        let last = self.harmonics.iter().rposition(Option::is_some).unwrap_or(0);
        let degree = last.isqrt();
        let all = 0..(degree + 1) * (degree + 1);
        all.map(|i| self.harmonics[i].ok_or_else(|| format!("no attribute {}", harmonic(i))))
            .collect()
    }
}

/// What the attribute of coefficient `i` is called, bands being one after the other.
pub(crate) fn harmonic(i: usize) -> String {
    let degree = i.isqrt();
    format!("{EXTENSION}:SH_DEGREE_{degree}_COEF_{}", i - degree * degree)
}

/// The number of a coefficient by its degree and number, as `3_COEF_6`; `None` for what is in no band of the extension.
fn number(name: &str) -> Option<usize> {
    let (degree, i) = name.split_once("_COEF_")?;
    let (degree, i): (usize, usize) = (degree.parse().ok()?, i.parse().ok()?);
    (degree <= MAX_DEGREE && i <= 2 * degree).then_some(degree * degree + i)
}

impl<'de> Deserialize<'de> for Attributes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Semantics;
        impl<'de> Visitor<'de> for Semantics {
            type Value = Attributes;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("accessors by semantic")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Attributes, A::Error> {
                let mut all = Attributes::default();
                while let Some((semantic, accessor)) = map.next_entry::<String, usize>()? {
                    let own = semantic.strip_prefix(EXTENSION).and_then(|rest| rest.strip_prefix(':'));
                    let place = match own {
                        None if semantic == "POSITION" => &mut all.position,
                        Some("ROTATION") => &mut all.rotation,
                        Some("SCALE") => &mut all.scale,
                        Some("OPACITY") => &mut all.opacity,
                        Some(name) => match name.strip_prefix("SH_DEGREE_") {
                            Some(name) => match number(name) {
                                Some(i) => &mut all.harmonics[i],
                                None => {
                                    all.beyond = Some(semantic);
                                    continue;
                                }
                            },
                            None => continue,
                        },
                        None => continue,
                    };
                    *place = Some(accessor);
                }
                Ok(all)
            }
        }
        deserializer.deserialize_map(Semantics)
    }
}

impl<'de> Deserialize<'de> for Compressions {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        /// The compressed splats.
        #[derive(Deserialize)]
        #[serde(rename_all = "camelCase")]
        struct Stream {
            buffer_view: usize,
        }

        struct Names;
        impl<'de> Visitor<'de> for Names {
            type Value = Compressions;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("extensions by name")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Compressions, A::Error> {
                let mut found = Compressions::default();
                while let Some(name) = map.next_key::<String>()? {
                    match name.as_str() {
                        // The name with the version of the format is that of the draft, which files in use have.
                        "KHR_gaussian_splatting_compression_spz" | "KHR_gaussian_splatting_compression_spz_2" => {
                            found.spz = Some(map.next_value::<Stream>()?.buffer_view);
                        }
                        _ => {
                            map.next_value::<IgnoredAny>()?;
                            found.unknown.get_or_insert(name);
                        }
                    }
                }
                Ok(found)
            }
        }
        deserializer.deserialize_map(Names)
    }
}

impl<'de> Deserialize<'de> for Mesh {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        /// Primitives of which only splats are kept.
        #[derive(Default)]
        struct Splats(Vec<(usize, Primitive)>);

        impl<'de> Deserialize<'de> for Splats {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct Primitives;
                impl<'de> Visitor<'de> for Primitives {
                    type Value = Splats;

                    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                        f.write_str("an array of primitives")
                    }

                    fn visit_seq<A: SeqAccess<'de>>(self, mut array: A) -> Result<Splats, A::Error> {
                        let (mut splats, mut place) = (Vec::new(), 0);
                        while let Some(primitive) = array.next_element::<Primitive>()? {
                            if primitive.extensions.splatting.is_some() {
                                splats.push((place, primitive));
                            }
                            place += 1;
                        }
                        Ok(Splats(splats))
                    }
                }
                deserializer.deserialize_seq(Primitives)
            }
        }

        #[derive(Deserialize)]
        struct Json {
            #[serde(default)]
            primitives: Splats,
        }
        Json::deserialize(deserializer).map(|mesh| Mesh {
            splats: mesh.primitives.0,
        })
    }
}
