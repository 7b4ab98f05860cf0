//! Commitments as they are told: one, all in their order, and as documents that stand for themselves.
use guardsplat_commitment::{Document, OpenedDocument, Signed};
use guardsplat_proto::v1::{
    Commitment, ListCommitmentsRequest, ListCommitmentsResponse, PublicKey, RevealCommitmentResponse,
};
use uuid::Uuid;

use crate::error::{Error, Result};
use crate::notary;
use crate::service::clock::{self, timestamp};
use crate::service::names::ResourceKind;
use crate::service::{Service, page};

/// What page tokens of this list are bound to.
const QUERY: &[&[u8]] = &[b"commitments"];

impl Service {
    pub(crate) async fn commitment(&self, project: &str, name: &str) -> Result<Signed> {
        let id = ResourceKind::Commitment.parse("name", name)?;
        self.owned_commitment(project, id).await
    }

    pub(crate) async fn page_of_commitments(
        &self,
        project: &str,
        request: &ListCommitmentsRequest,
    ) -> Result<ListCommitmentsResponse> {
        let size = page::size(request.page_size)?;
        let after = page::position(QUERY, &request.page_token)?.map_or(0, |(sequence, _)| sequence);
        // One more than asked for tells whether there is another page.
        let rows = self.ledger().list_commitments(project, after, size + 1).await?;
        let (rows, next_page_token) = page::cut(QUERY, rows, size, |row| (sequence(row), row.commitment.id));
        Ok(ListCommitmentsResponse {
            commitments: rows.iter().map(to_proto).collect(),
            next_page_token,
        })
    }

    pub(crate) async fn head(&self, project: &str) -> Result<Commitment> {
        let head = self.ledger().head(project).await?;
        // The chain itself has no name; none has this id.
        let head = head.ok_or_else(|| ResourceKind::Commitment.not_found(Uuid::nil()))?;
        Ok(to_proto(&head))
    }

    pub(crate) async fn document(&self, project: &str, name: &str) -> Result<String> {
        let document = Document {
            signed: self.commitment(project, name).await?,
            public_key: self.notary().public_key(),
        };
        document
            .to_json()
            .map_err(|error| Error::internal("writing a commitment", error))
    }

    /// Opens a commitment for whoever is to check it, and notes that it was opened.
    pub(crate) async fn reveal(&self, project: &str, name: &str) -> Result<RevealCommitmentResponse> {
        let signed = self.commitment(project, name).await?;
        let asset = signed.commitment.asset;
        let secret = self.ledger().candidate(asset).await?;
        let secret = secret.ok_or_else(|| ResourceKind::Asset.not_found(asset))?;
        let document = OpenedDocument {
            opening: notary::open_nonce(self.master(), asset, &secret.sealed_nonce)?,
            document: Document {
                signed,
                public_key: self.notary().public_key(),
            },
        };
        let failed = |error| Error::internal("opening a commitment", error);
        // What does not open is not given out as if it did.
        document.verify(&self.notary().public_key()).map_err(failed)?;
        let text = document.to_json().map_err(failed)?;
        let row = self.ledger().reveal_asset(asset, clock::now()).await?;
        Ok(RevealCommitmentResponse {
            document: text,
            reveal_time: row.reveal_time.map(timestamp),
        })
    }

    pub(crate) fn public_key(&self) -> Result<PublicKey> {
        let key = self.notary().public_key();
        let pem = key
            .to_pem()
            .map_err(|error| Error::internal("writing the public key", error))?;
        Ok(PublicKey { hex: key.to_hex(), pem })
    }
}

/// A commitment for the API.
pub(crate) fn to_proto(signed: &Signed) -> Commitment {
    let commitment = &signed.commitment;
    Commitment {
        name: ResourceKind::Commitment.name(commitment.id),
        sequence: sequence(signed),
        previous_hash: hex::encode(commitment.previous),
        asset: ResourceKind::Asset.name(commitment.asset),
        owner: ResourceKind::Owner.name(commitment.owner),
        sha256: hex::encode(commitment.sha256),
        key: ResourceKind::Key.name(commitment.key),
        payload_number: i64::try_from(commitment.payload).unwrap_or(i64::MAX),
        nonce_hash: hex::encode(commitment.nonce_hash),
        commit_time: Some(timestamp(commitment.time)),
        hash: hex::encode(signed.hash()),
        signature: hex::encode(signed.signature),
    }
}

/// The place in the chain, which the ledger keeps as a number that fits.
fn sequence(signed: &Signed) -> i64 {
    i64::try_from(signed.commitment.sequence).unwrap_or(i64::MAX)
}
