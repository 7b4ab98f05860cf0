//! Assets: registered, looked at, listed.
use guardsplat_commitment::Hash;
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::{Asset, CreateAssetRequest, ListAssetsRequest, ListAssetsResponse};
use uuid::Uuid;

use crate::error::{Error, Result};
use crate::ledger::{ArtifactId, AssetFilter, AssetRow, KeyId, NewAsset, OwnerId};
use crate::notary;
use crate::service::clock::{self, timestamp};
use crate::service::names::ResourceKind;
use crate::service::violations::Violations;
use crate::service::{Service, ownership, page, submission, text, upload};

const HASH: &str = "must be 64 hexadecimal digits in lower case";

/// A request that holds, as far as that can be said without the ledger.
struct Registration {
    owner: OwnerId,
    key: KeyId,
    display_name: String,
    original: Source,
    request_id: Option<Uuid>,
}

/// Where the hash of an original comes from.
enum Source {
    Told(Hash),
    Artifact(ArtifactId),
}

impl Service {
    pub(crate) async fn register_asset(&self, project: String, request: CreateAssetRequest) -> Result<Asset> {
        let registration = checked(request)?;
        let asked = registration.request_id;
        let request = asked.map(|id| ownership::request(&project, id));
        let (sha256, artifact) = match registration.original {
            Source::Told(sha256) => (sha256, None),
            Source::Artifact(id) => (self.hash_of(&project, id, request).await?, Some(id)),
        };
        let id = Uuid::now_v7();
        let nonce = notary::new_nonce(self.master(), id)?;
        let new = NewAsset {
            id,
            project,
            commitment: Uuid::now_v7(),
            owner: registration.owner,
            display_name: registration.display_name,
            sha256,
            artifact,
            key: registration.key,
            sealed_nonce: nonce.sealed,
            nonce_hash: nonce.hash,
            request_id: request,
        };
        let signer = self.notary().signing_key();
        let row = self.ledger().create_asset(new, signer, clock::now()).await;
        Ok(message(row.map_err(|error| ownership::as_asked(error, asked))?))
    }

    /// What the server counted of an artifact when it was uploaded. One that is gone is still known to the request that
    /// registered it.
    async fn hash_of(&self, project: &str, id: ArtifactId, request: Option<Uuid>) -> Result<Hash> {
        if let Some(row) = self.find_artifact(project, id).await? {
            return upload::digest(&row.sha256)
                .ok_or_else(|| Error::internal("reading a hash kept in the ledger", "it is no SHA-256"));
        }
        let before = match request {
            Some(request) => self.ledger().find_asset_request(request).await?,
            None => None,
        };
        let same = before.filter(|row| row.artifact == Some(id) && row.project == project);
        same.map(|row| row.sha256)
            .ok_or_else(|| ResourceKind::Artifact.not_found(id))
    }

    pub(crate) async fn asset(&self, project: &str, name: &str) -> Result<Asset> {
        let id = ResourceKind::Asset.parse("name", name)?;
        Ok(message(self.owned_asset(project, id).await?))
    }

    pub(crate) async fn page_of_assets(
        &self,
        project: &str,
        request: &ListAssetsRequest,
    ) -> Result<ListAssetsResponse> {
        let size = page::size(request.page_size)?;
        let given = |kind: ResourceKind, field, name: &str| match name {
            "" => Ok(None),
            name => kind.parse(field, name).map(Some),
        };
        let filter = AssetFilter {
            owner: given(ResourceKind::Owner, "owner", &request.owner)?,
            key: given(ResourceKind::Key, "key", &request.key)?,
        };
        let query: [&[u8]; 3] = [b"assets", request.owner.as_bytes(), request.key.as_bytes()];
        let before = page::position(&query, &request.page_token)?;
        // One more than asked for tells whether there is another page.
        let rows = self.ledger().list_assets(project, filter, before, size + 1).await?;
        let (rows, next_page_token) = page::cut(&query, rows, size, |row| (row.create_time, row.id));
        Ok(ListAssetsResponse {
            assets: rows.into_iter().map(message).collect(),
            next_page_token,
        })
    }
}

fn checked(request: CreateAssetRequest) -> Result<Registration> {
    let CreateAssetRequest { asset, request_id } = request;
    let asset = asset.ok_or_else(|| Error::invalid("asset", "is missing"))?;
    let mut problems = Violations::default();
    let request_id = problems.take(submission::request_id(&request_id))?.flatten();
    let owner = problems.take(ResourceKind::Owner.parse("asset.owner", &asset.owner))?;
    problems.take(text::display_name("asset.display_name", &asset.display_name))?;
    let original = match &asset.original {
        Some(Original::Sha256(digits)) => {
            let hash = upload::digest(digits).map(Source::Told);
            problems.check(hash.is_some(), "asset.sha256", HASH);
            hash
        }
        Some(Original::Artifact(name)) => problems
            .take(ResourceKind::Artifact.parse("asset.artifact", name))?
            .map(Source::Artifact),
        None => {
            problems.add("asset.original", "is missing, one of sha256 and artifact must be set");
            None
        }
    };
    let key = problems.take(ResourceKind::Key.parse("asset.key", &asset.key))?;
    for (field, empty) in [
        ("asset.name", asset.name.is_empty()),
        ("asset.payload_number", asset.payload_number == 0),
        ("asset.commitment", asset.commitment.is_empty()),
        ("asset.create_time", asset.create_time.is_none()),
        ("asset.reveal_time", asset.reveal_time.is_none()),
    ] {
        problems.check(empty, field, "is set by the server and must be empty");
    }
    problems.finish()?;
    let (Some(owner), Some(key), Some(original)) = (owner, key, original) else {
        // What is missing was a problem above.
        return Err(Error::invalid("asset", "names something that is invalid"));
    };
    Ok(Registration {
        owner,
        key,
        display_name: asset.display_name,
        original,
        request_id,
    })
}

fn message(row: AssetRow) -> Asset {
    Asset {
        name: ResourceKind::Asset.name(row.id),
        owner: ResourceKind::Owner.name(row.owner),
        display_name: row.display_name,
        original: Some(Original::Sha256(hex::encode(row.sha256))),
        key: ResourceKind::Key.name(row.key),
        payload_number: row.payload,
        commitment: ResourceKind::Commitment.name(row.commitment),
        create_time: Some(timestamp(row.create_time)),
        reveal_time: row.reveal_time.map(timestamp),
    }
}
