//! The kinds of scenes, as options have them.
use clap::ValueEnum;
use guardsplat_proto::v1::embed_spec;

/// How a scene was captured, which says where its viewers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SceneKind {
    /// Seen from outside
    Object,
    /// Surroundings, seen from inside
    Room,
    /// Ground, seen from above
    Terrain,
    /// Seen from one side
    Forward,
    /// Something amid its surroundings, seen from around it
    Unbounded,
}

/// The number that the API has for a kind; found from the scene where none is given.
pub fn number(kind: Option<SceneKind>) -> i32 {
    let kind = match kind {
        None => embed_spec::SceneKind::Unspecified,
        Some(SceneKind::Object) => embed_spec::SceneKind::Object,
        Some(SceneKind::Room) => embed_spec::SceneKind::Room,
        Some(SceneKind::Terrain) => embed_spec::SceneKind::Terrain,
        Some(SceneKind::Forward) => embed_spec::SceneKind::Forward,
        Some(SceneKind::Unbounded) => embed_spec::SceneKind::Unbounded,
    };
    kind.into()
}
