//! The one table of calls and what a token must be good for. A call that is not in it is refused, whoever makes it.
use guardsplat_soft_binding::resolution::{ALGORITHMS_PATH, BY_BINDING_PATH, BY_CONTENT_PATH, MANIFESTS_PATH};

use super::Scope::{self, Admin, Embed, Verify, Worker};

/// What a call needs, where tokens are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Nothing: whoever looks after the server asks this, and it tells nothing of anybody.
    Nothing,
    /// A token, whatever it is good for.
    Token,
    /// A token with one of these scopes.
    AnyOf(&'static [Scope]),
}

use Need::{AnyOf, Nothing, Token};

const EMBED: Need = AnyOf(&[Embed]);
const ADMIN: Need = AnyOf(&[Admin]);
const WORKER: Need = AnyOf(&[Worker]);
/// Both kinds of work; `CreateJob` and `CancelJob` look at the job too.
const WORK: Need = AnyOf(&[Embed, Verify]);
/// Deleting artifacts; `DeleteArtifact` looks at what is deleted too.
const DELETE: Need = LOOK;
/// Looking at what the project has.
const LOOK: Need = AnyOf(&[Embed, Verify, Admin]);
/// Workers read the inputs of running jobs in this way, and nothing else; admins evidence, and nothing else.
const READ: Need = AnyOf(&[Embed, Verify, Admin, Worker]);

/// Paths of all calls, as HTTP/2 has them.
pub const METHODS: &[(&str, Need)] = &[
    ("/guardsplat.v1.JobService/CreateJob", WORK),
    ("/guardsplat.v1.JobService/GetJob", LOOK),
    ("/guardsplat.v1.JobService/ListJobs", LOOK),
    ("/guardsplat.v1.JobService/CancelJob", WORK),
    ("/guardsplat.v1.JobService/WatchJob", LOOK),
    ("/guardsplat.v1.JobService/RequeueJob", ADMIN),
    ("/guardsplat.v1.JobService/ListJobAttempts", LOOK),
    ("/guardsplat.v1.JobService/ListWorkers", ADMIN),
    ("/guardsplat.v1.ArtifactService/UploadArtifact", WORK),
    ("/guardsplat.v1.ArtifactService/StartUpload", WORK),
    ("/guardsplat.v1.ArtifactService/AppendUpload", WORK),
    ("/guardsplat.v1.ArtifactService/FinishUpload", WORK),
    ("/guardsplat.v1.ArtifactService/DownloadArtifact", READ),
    ("/guardsplat.v1.ArtifactService/GetDownloadUrl", READ),
    ("/guardsplat.v1.ArtifactService/GetArtifact", WORK),
    ("/guardsplat.v1.ArtifactService/DeleteArtifact", DELETE),
    ("/guardsplat.v1.KeyService/GetKey", LOOK),
    ("/guardsplat.v1.KeyService/ListKeys", LOOK),
    ("/guardsplat.v1.KeyService/UpdateKeyState", ADMIN),
    ("/guardsplat.v1.RegistryService/CreateOwner", EMBED),
    ("/guardsplat.v1.RegistryService/GetOwner", LOOK),
    ("/guardsplat.v1.RegistryService/ListOwners", LOOK),
    ("/guardsplat.v1.RegistryService/CreateAsset", EMBED),
    ("/guardsplat.v1.RegistryService/GetAsset", LOOK),
    ("/guardsplat.v1.RegistryService/ListAssets", LOOK),
    ("/guardsplat.v1.RegistryService/GetCommitment", LOOK),
    ("/guardsplat.v1.RegistryService/ListCommitments", LOOK),
    ("/guardsplat.v1.RegistryService/GetHead", LOOK),
    ("/guardsplat.v1.RegistryService/ExportCommitment", LOOK),
    ("/guardsplat.v1.RegistryService/RevealCommitment", ADMIN),
    ("/guardsplat.v1.RegistryService/GetPublicKey", Token),
    ("/guardsplat.v1.TokenService/CreateToken", ADMIN),
    ("/guardsplat.v1.TokenService/ListTokens", ADMIN),
    ("/guardsplat.v1.TokenService/RevokeToken", ADMIN),
    ("/guardsplat.v1.HookService/CreateHook", ADMIN),
    ("/guardsplat.v1.HookService/GetHook", ADMIN),
    ("/guardsplat.v1.HookService/ListHooks", ADMIN),
    ("/guardsplat.v1.HookService/DeleteHook", ADMIN),
    ("/guardsplat.v1.HookService/ListDeliveries", ADMIN),
    ("/guardsplat.v1.HookService/RedeliverDelivery", ADMIN),
    ("/guardsplat.v1.WorkerService/LeaseJob", WORKER),
    ("/guardsplat.v1.WorkerService/ReportJob", WORKER),
    ("/guardsplat.v1.WorkerService/UploadOutput", WORKER),
    ("/guardsplat.v1.WorkerService/DownloadKey", WORKER),
    ("/guardsplat.v1.WorkerService/CompleteJob", WORKER),
    ("/guardsplat.v1.WorkerService/FailJob", WORKER),
    ("/guardsplat.v1.WorkerService/ReleaseJob", WORKER),
    ("/grpc.health.v1.Health/Check", Nothing),
    ("/grpc.health.v1.Health/Watch", Nothing),
    ("/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", Token),
    ("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", Token),
];

/// Paths of the C2PA's resolution API, which only the listener for browsers has. One that ends with a slash stands for all
/// below it. Sidecars are for whoever may download artifacts.
pub const RESOLUTION: &[(&str, Need)] = &[
    (ALGORITHMS_PATH, Nothing),
    (BY_BINDING_PATH, WORK),
    (BY_CONTENT_PATH, WORK),
    (MANIFESTS_PATH, WORK),
];

/// What a call needs; `None` for one that is not in the table.
pub fn need(path: &str) -> Option<Need> {
    METHODS.iter().find(|(known, _)| *known == path).map(|(_, need)| *need)
}

/// What a question of the resolution API needs; `None` for none of it.
pub fn need_to_resolve(path: &str) -> Option<Need> {
    let is = |known: &str| known == path || known.ends_with('/') && path.starts_with(known);
    RESOLUTION.iter().find(|(known, _)| is(known)).map(|(_, need)| *need)
}
