//! The JSON of a glTF, as far as splats need it: everything else is not even read, and stays as it is.
use super::primitive::Mesh;
use serde::de::{IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// Most nodes, meshes, accessors, buffer views and so on: what is written in three bytes takes many in memory.
const MOST: usize = 1 << 17;

/// What there is in a file; indices are those of the arrays here.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document<'a> {
    asset: Asset,
    pub scene: Option<usize>,
    #[serde(default, deserialize_with = "limited")]
    pub scenes: Vec<SceneNodes>,
    #[serde(default, deserialize_with = "limited")]
    pub nodes: Vec<Node>,
    #[serde(default, deserialize_with = "limited")]
    pub meshes: Vec<Mesh>,
    #[serde(default, deserialize_with = "limited")]
    pub cameras: Vec<Camera>,
    #[serde(default, deserialize_with = "limited")]
    pub accessors: Vec<Accessor>,
    #[serde(default, deserialize_with = "limited")]
    pub buffer_views: Vec<BufferView>,
    #[serde(default, borrow, deserialize_with = "limited")]
    pub buffers: Vec<Buffer<'a>>,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
}

/// What is shown together.
#[derive(Deserialize)]
pub(super) struct SceneNodes {
    #[serde(default)]
    pub nodes: Vec<u32>,
}

/// A place in the hierarchy, with what stands there.
#[derive(Deserialize)]
pub(super) struct Node {
    pub name: Option<Box<str>>,
    #[serde(default)]
    pub children: Vec<u32>,
    pub mesh: Option<usize>,
    pub camera: Option<usize>,
    pub skin: Option<IgnoredAny>,
    /// Column by column.
    pub matrix: Option<Box<[f64; 16]>>,
    /// x, y, z, w.
    pub rotation: Option<Box<[f64; 4]>>,
    pub scale: Option<Box<[f64; 3]>>,
    pub translation: Option<Box<[f64; 3]>>,
    #[serde(default)]
    pub extensions: NodeExtensions,
}

#[derive(Default, Deserialize)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub instancing: Option<IgnoredAny>,
}

/// How a picture is taken.
#[derive(Deserialize)]
pub(super) struct Camera {
    /// `None` for an orthographic one.
    pub perspective: Option<Perspective>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Perspective {
    /// Radians from the lower to the upper edge.
    pub yfov: f64,
    /// Width over height.
    pub aspect_ratio: Option<f64>,
}

/// Numbers in a buffer view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub buffer_view: Option<usize>,
    #[serde(default)]
    pub byte_offset: u64,
    pub component_type: u32,
    #[serde(default)]
    pub normalized: bool,
    pub count: u64,
    #[serde(rename = "type")]
    pub kind: Kind,
    pub sparse: Option<IgnoredAny>,
}

/// How many numbers an element has.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
pub(super) enum Kind {
    #[serde(rename = "SCALAR")]
    Scalar,
    #[serde(rename = "VEC3")]
    Vec3,
    #[serde(rename = "VEC4")]
    Vec4,
    /// Nothing that splats are made of.
    #[serde(other)]
    Other,
}

/// Bytes of a buffer.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub byte_length: u64,
    pub byte_stride: Option<u64>,
    #[serde(default)]
    pub extensions: ViewExtensions,
}

#[derive(Default, Deserialize)]
pub(super) struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    meshopt: Option<IgnoredAny>,
    #[serde(rename = "KHR_meshopt_compression")]
    khr_meshopt: Option<IgnoredAny>,
}

impl ViewExtensions {
    /// What the bytes are compressed with, if they are.
    pub fn compression(&self) -> Option<&'static str> {
        match self {
            Self { meshopt: Some(_), .. } => Some("EXT_meshopt_compression"),
            Self {
                khr_meshopt: Some(_), ..
            } => Some("KHR_meshopt_compression"),
            _ => None,
        }
    }
}

/// Where bytes are.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer<'a> {
    #[serde(borrow)]
    pub uri: Option<Cow<'a, str>>,
    pub byte_length: u64,
}

impl Document<'_> {
    /// Understands the text; `Err` is the reason why not.
    pub fn parse(text: &str) -> Result<Document<'_>, String> {
        let document: Document<'_> =
            serde_json::from_str(text).map_err(|error| format!("not a glTF scene: its JSON: {error}"))?;
        let version = document.asset.version.as_str();
        if version != "2.0" {
            let version = crate::fields::quote(version);
            return Err(format!("glTF of asset.version {version:?}; version 2.0 is read"));
        }
        Ok(document)
    }
}

/// An array of at most [`MOST`] elements.
pub(super) fn limited<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<Vec<T>, D::Error> {
    struct Limited<T>(PhantomData<T>);
    impl<'de, T: Deserialize<'de>> Visitor<'de> for Limited<T> {
        type Value = Vec<T>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "an array of at most {MOST} elements")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut array: A) -> Result<Vec<T>, A::Error> {
            let mut all = Vec::new();
            while let Some(element) = array.next_element()? {
                if all.len() == MOST {
                    return Err(serde::de::Error::custom(format!(
                        "an array of more than {MOST} elements, the limit"
                    )));
                }
                all.push(element);
            }
            Ok(all)
        }
    }
    deserializer.deserialize_seq(Limited(PhantomData))
}
