//! Files that a job reads besides its scene or its suspects, each named in a field of its own.
use guardsplat_evidence::Role;
use guardsplat_proto::v1::{EmbedSpec, VerifySpec};

/// Such a file, where a job names one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OtherFile<'a> {
    /// Where it is named.
    pub field: &'static str,
    /// `artifacts/{artifact}`.
    pub name: &'a str,
    /// What it is for.
    pub role: Role,
}

/// Those of an embedding, in the order in which its inputs have them.
pub(crate) fn of_embed(spec: &EmbedSpec) -> Vec<OtherFile<'_>> {
    named([("job.embed.cameras", &spec.cameras, Role::Cameras)])
}

/// Those of a verification, in the order in which its inputs have them.
pub(crate) fn of_verify(spec: &VerifySpec) -> Vec<OtherFile<'_>> {
    named([
        ("job.verify.cameras", &spec.cameras, Role::Cameras),
        ("job.verify.original", &spec.original, Role::Original),
    ])
}

fn named<'a, const N: usize>(fields: [(&'static str, &'a String, Role); N]) -> Vec<OtherFile<'a>> {
    let files = fields.into_iter().filter(|(_, name, _)| !name.is_empty());
    files
        .map(|(field, name, role)| OtherFile { field, name, role })
        .collect()
}
