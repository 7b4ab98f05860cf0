//! Owners, assets and commitments, over the socket.
use std::collections::HashSet;

use guardsplat_commitment::{Chain, Document, PublicKey};
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::{
    Asset, Commitment, CreateAssetRequest, CreateOwnerRequest, DeleteArtifactRequest, ExportCommitmentRequest,
    GetAssetRequest, GetCommitmentRequest, GetHeadRequest, GetOwnerRequest, GetPublicKeyRequest, ListAssetsRequest,
    ListCommitmentsRequest, ListOwnersRequest, Owner,
};
use tonic::{Code, Status};
use uuid::Uuid;

use super::harness::{Server, invalid, key_spec, not_found, refused, sha256};
use crate::notary;
use crate::service::Limits;

pub(crate) async fn create_owner(server: &Server, display_name: &str, request_id: &str) -> Result<Owner, Status> {
    let owner = Owner {
        display_name: display_name.into(),
        ..Owner::default()
    };
    let request = CreateOwnerRequest {
        owner: Some(owner),
        request_id: request_id.into(),
    };
    let answer = server.registry.clone().create_owner(request).await?;
    Ok(answer.into_inner())
}

pub(crate) async fn create_asset(server: &Server, asset: Asset, request_id: &str) -> Result<Asset, Status> {
    let request = CreateAssetRequest {
        asset: Some(asset),
        request_id: request_id.into(),
    };
    let answer = server.registry.clone().create_asset(request).await?;
    Ok(answer.into_inner())
}

pub(crate) fn asset(owner: &str, key: &str, original: Original) -> Asset {
    Asset {
        owner: owner.into(),
        display_name: "robot".into(),
        original: Some(original),
        key: key.into(),
        ..Asset::default()
    }
}

fn hash(byte: u8) -> Original {
    Original::Sha256(hex::encode([byte; 32]))
}

/// The names of an owner and a key.
async fn owner_and_key(server: &Server) -> (String, String) {
    let owner = create_owner(server, "studio", "").await.unwrap().name;
    (owner, server.key(32, b"key file").await)
}

async fn commitment(server: &Server, name: &str) -> Result<Commitment, Status> {
    let request = GetCommitmentRequest { name: name.into() };
    Ok(server.registry.clone().get_commitment(request).await?.into_inner())
}

async fn export(server: &Server, name: &str) -> Result<Document, Status> {
    let request = ExportCommitmentRequest { name: name.into() };
    let answer = server.registry.clone().export_commitment(request).await?;
    Ok(Document::from_json(&answer.into_inner().document).unwrap())
}

pub(crate) async fn public_key(server: &Server) -> PublicKey {
    let answer = server.registry.clone().get_public_key(GetPublicKeyRequest {}).await;
    let told = answer.unwrap().into_inner();
    let key = PublicKey::from_hex(&told.hex).unwrap();
    assert_eq!(PublicKey::from_pem(&told.pem).unwrap(), key);
    key
}

#[tokio::test]
async fn an_original_is_registered_and_committed_to() {
    let server = Server::start().await;
    let (owner, key) = owner_and_key(&server).await;
    let bytes = b"the original scene";
    let artifact = server.upload("scene.ply", bytes).await.name;
    let made = create_asset(&server, asset(&owner, &key, Original::Artifact(artifact)), "").await;
    let made = made.unwrap();
    let wanted = Asset {
        name: made.name.clone(),
        owner: owner.clone(),
        display_name: "robot".into(),
        original: Some(Original::Sha256(sha256(bytes))),
        key: key.clone(),
        payload_number: 1,
        commitment: made.commitment.clone(),
        create_time: made.create_time,
        reveal_time: None,
    };
    assert_eq!(made, wanted);
    let request = GetAssetRequest {
        name: made.name.clone(),
    };
    let got = server.registry.clone().get_asset(request).await.unwrap().into_inner();
    assert_eq!(got, made);

    let told = commitment(&server, &made.commitment).await.unwrap();
    assert_eq!(
        (told.asset.as_str(), told.owner.as_str(), told.key.as_str()),
        (&*made.name, &*owner, &*key)
    );
    assert_eq!(
        (told.sequence, told.payload_number, told.sha256.clone()),
        (1, 1, sha256(bytes))
    );
    assert_eq!(
        (told.previous_hash.clone(), told.commit_time),
        ("0".repeat(64), made.create_time)
    );

    // The document stands for itself, and a published key is all that it is checked with.
    let document = export(&server, &made.commitment).await.unwrap();
    document.verify(&public_key(&server).await).unwrap();
    assert_eq!(hex::encode(document.signed.hash()), told.hash);
    assert_eq!(hex::encode(document.signed.signature), told.signature);

    // The server can open it, and tells nobody.
    let id = document.signed.commitment.asset;
    let ledger = server.ledger();
    let key_id = document.signed.commitment.key;
    let candidates = ledger.candidates(key_id, 0, 10).await.unwrap();
    assert_eq!((candidates.len(), candidates[0].asset), (1, id));
    let opening = notary::open_nonce(server.api.master(), id, &candidates[0].sealed_nonce).unwrap();
    document.signed.commitment.opens_with(&opening).unwrap();
    let told = format!("{told:?}{made:?}{}", document.to_json().unwrap());
    assert!(!told.contains(&hex::encode(opening.nonce())) && !told.contains(&hex::encode(opening.blinding())));
}

#[tokio::test]
async fn a_restart_keeps_everything() {
    let server = Server::start().await;
    let (owner, key) = owner_and_key(&server).await;
    let before = public_key(&server).await;
    let mut made = Vec::new();
    for byte in 0..3 {
        made.push(
            create_asset(&server, asset(&owner, &key, hash(byte)), "")
                .await
                .unwrap(),
        );
    }
    let server = server.restart(Limits::default()).await;
    assert_eq!(public_key(&server).await, before);
    made.push(create_asset(&server, asset(&owner, &key, hash(9)), "").await.unwrap());
    let numbers: Vec<i64> = made.iter().map(|asset| asset.payload_number).collect();
    assert_eq!(numbers, [1, 2, 3, 4]);
    let mut chain = Chain::new(before);
    for asset in &made {
        let document = export(&server, &asset.commitment).await.unwrap();
        chain.push(&document.signed).unwrap();
    }
    let head = server.registry.clone().get_head(GetHeadRequest {}).await.unwrap();
    assert_eq!(head.into_inner().hash, hex::encode(chain.head().hash));
    // The seed of the signing key is nowhere: what signs is sealed (`notary`), and the folder has no other file for it.
    assert!(
        server
            .files()
            .iter()
            .all(|file| !file.to_string_lossy().contains("sign"))
    );
}

#[tokio::test]
async fn registrations_at_once_are_one_chain() {
    let server = Server::start().await;
    let (owner, key) = owner_and_key(&server).await;
    let tasks: Vec<_> = (0..24)
        .map(|byte| {
            let mut registry = server.registry.clone();
            let asset = asset(&owner, &key, hash(byte));
            let request = CreateAssetRequest {
                asset: Some(asset),
                request_id: String::new(),
            };
            tokio::spawn(async move { registry.create_asset(request).await.unwrap().into_inner() })
        })
        .collect();
    let mut numbers = HashSet::new();
    for task in tasks {
        numbers.insert(task.await.unwrap().payload_number);
    }
    assert_eq!(numbers, (1..=24).collect());
    let mut chain = Chain::new(public_key(&server).await);
    let (mut seen, mut token) = (0, String::new());
    loop {
        let request = ListCommitmentsRequest {
            page_size: 7,
            page_token: token,
        };
        let page = server
            .registry
            .clone()
            .list_commitments(request)
            .await
            .unwrap()
            .into_inner();
        for told in page.commitments {
            seen += 1;
            assert_eq!(told.sequence, seen);
            let document = export(&server, &told.name).await.unwrap();
            assert_eq!(hex::encode(document.signed.commitment.previous), told.previous_hash);
            chain.push(&document.signed).unwrap();
        }
        token = page.next_page_token;
        if token.is_empty() {
            break;
        }
    }
    assert_eq!(seen, 24);
}

#[tokio::test]
async fn a_registration_sent_again_is_the_same() {
    let server = Server::start().await;
    let [id, owner_id] = [(); 2].map(|()| Uuid::new_v4().to_string());
    let owner = create_owner(&server, "studio", &owner_id).await.unwrap();
    assert_eq!(create_owner(&server, "studio", &owner_id).await.unwrap(), owner);
    let other = create_owner(&server, "another", &owner_id).await;
    refused(other, Code::AlreadyExists, "REQUEST_ID_REUSED");

    let key = server.key(32, b"key file").await;
    let artifact = server.upload("scene.ply", b"scene").await.name;
    let wanted = asset(&owner.name, &key, Original::Artifact(artifact.clone()));
    let made = create_asset(&server, wanted.clone(), &id).await.unwrap();
    assert_eq!(create_asset(&server, wanted.clone(), &id).await.unwrap(), made);
    // Equal content under another name, or told as a hash, is the same request.
    let again = server.upload("copy.ply", b"scene").await.name;
    for original in [Original::Artifact(again), Original::Sha256(sha256(b"scene"))] {
        let same = asset(&owner.name, &key, original);
        assert_eq!(create_asset(&server, same, &id).await.unwrap(), made);
    }
    let other = asset(&owner.name, &key, hash(1));
    let details = refused(
        create_asset(&server, other, &id).await,
        Code::AlreadyExists,
        "REQUEST_ID_REUSED",
    );
    assert_eq!(details.error_info().unwrap().metadata["request_id"], id);

    // Nor does it need the artifact any more.
    let request = DeleteArtifactRequest { name: artifact.clone() };
    server.artifacts.clone().delete_artifact(request).await.unwrap();
    let server = server.restart(Limits::default()).await;
    assert_eq!(create_asset(&server, wanted.clone(), &id).await.unwrap(), made);
    assert_eq!(not_found(create_asset(&server, wanted.clone(), "").await), artifact);
    let fresh = Uuid::new_v4().to_string();
    assert_eq!(not_found(create_asset(&server, wanted, &fresh).await), artifact);
}

#[tokio::test]
async fn wrong_registrations_leave_nothing() {
    let server = Server::start().await;
    let (owner, key) = owner_and_key(&server).await;
    let with = |change: fn(&mut Asset)| {
        let mut asset = asset(&owner, &key, hash(1));
        change(&mut asset);
        asset
    };
    let sha256 = |text: &str| Some(Original::Sha256(text.to_owned()));
    let cases = [
        (with(|a| a.owner.clear()), "asset.owner"),
        (with(|a| a.owner = a.key.clone()), "asset.owner"),
        (with(|a| a.key.clear()), "asset.key"),
        (with(|a| a.key = a.owner.clone()), "asset.key"),
        (with(|a| a.display_name = "x".repeat(64)), "asset.display_name"),
        (with(|a| a.display_name = "a\nb".into()), "asset.display_name"),
        (with(|a| a.original = None), "asset.original"),
        (
            with(|a| a.original = Some(Original::Artifact(a.key.clone()))),
            "asset.artifact",
        ),
        (
            with(|a| a.original = Some(Original::Artifact("artifacts/../x".into()))),
            "asset.artifact",
        ),
        (with(|a| a.name = format!("assets/{}", Uuid::nil())), "asset.name"),
        (with(|a| a.payload_number = 1), "asset.payload_number"),
        (with(|a| a.commitment = "commitments/x".into()), "asset.commitment"),
        (with(|a| a.create_time = Some(Default::default())), "asset.create_time"),
    ];
    for (asset, field) in cases {
        assert_eq!(invalid(create_asset(&server, asset, "").await), [field]);
    }
    for digits in ["", "7", &"0F".repeat(32), &"0f".repeat(33), &"0g".repeat(32)] {
        let asset = Asset {
            original: sha256(digits),
            ..with(|_| {})
        };
        assert_eq!(
            invalid(create_asset(&server, asset, "").await),
            ["asset.sha256"],
            "{digits}"
        );
    }
    assert_eq!(invalid(create_asset(&server, with(|_| {}), "7").await), ["request_id"]);
    // All at once.
    let fields = invalid(create_asset(&server, Asset::default(), "x").await);
    assert_eq!(fields, ["request_id", "asset.owner", "asset.original", "asset.key"]);
    let nothing = CreateAssetRequest::default();
    assert_eq!(invalid(server.registry.clone().create_asset(nothing).await), ["asset"]);
    assert_eq!(invalid(create_owner(&server, "", "").await), ["owner.display_name"]);
    assert_eq!(
        invalid(create_owner(&server, "\u{1b}", "0").await),
        ["request_id", "owner.display_name"]
    );
    let nothing = CreateOwnerRequest::default();
    assert_eq!(invalid(server.registry.clone().create_owner(nothing).await), ["owner"]);
    // None of them made a commitment.
    let head = server.registry.clone().get_head(GetHeadRequest {}).await;
    refused(head, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn what_an_asset_needs_must_be_there() {
    let server = Server::start().await;
    let (owner, key) = owner_and_key(&server).await;
    let nowhere = |collection: &str| format!("{collection}/{}", Uuid::now_v7());
    let (no_owner, no_key, no_artifact) = (nowhere("owners"), nowhere("keys"), nowhere("artifacts"));
    assert_eq!(
        not_found(create_asset(&server, asset(&no_owner, &key, hash(1)), "").await),
        no_owner
    );
    assert_eq!(
        not_found(create_asset(&server, asset(&owner, &no_key, hash(1)), "").await),
        no_key
    );
    let missing = asset(&owner, &key, Original::Artifact(no_artifact.clone()));
    assert_eq!(not_found(create_asset(&server, missing, "").await), no_artifact);
    // Nor does anybody learn the hash of a key file, or of what an attempt has not finished.
    let job = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    for secret in [true, false] {
        let hidden = server.stored(&job, &token, b"hidden", secret).await;
        let foreign = asset(&owner, &key, Original::Artifact(hidden.clone()));
        assert_eq!(not_found(create_asset(&server, foreign, "").await), hidden);
    }
}

#[tokio::test]
async fn payload_numbers_run_out() {
    let server = Server::start().await;
    let owner = create_owner(&server, "studio", "").await.unwrap().name;
    let key = server.key(1, b"key file").await;
    create_asset(&server, asset(&owner, &key, hash(1)), "").await.unwrap();
    let second = create_asset(&server, asset(&owner, &key, hash(2)), "").await;
    let details = refused(second, Code::ResourceExhausted, "PAYLOADS_USED_UP");
    assert_eq!(details.bad_request().unwrap().field_violations[0].field, "asset.key");
    let metadata = &details.error_info().unwrap().metadata;
    assert_eq!(
        (metadata["name"].as_str(), metadata["limit"].as_str()),
        (key.as_str(), "1")
    );
}

#[tokio::test]
async fn lists_are_filtered_and_come_in_pages() {
    let server = Server::start().await;
    let (one, first) = owner_and_key(&server).await;
    let two = create_owner(&server, "another", "").await.unwrap().name;
    let second = server.key(32, b"another key").await;
    let mut made = Vec::new();
    for byte in 0..6 {
        let (owner, key) = ([&one, &two][byte % 2], [&first, &second, &second][byte % 3]);
        let asset = create_asset(&server, asset(owner, key, hash(byte as u8)), "").await;
        made.insert(0, asset.unwrap());
    }
    let list = async |owner: &str, key: &str, page_size: i32, page_token: &str| {
        let request = ListAssetsRequest {
            page_size,
            page_token: page_token.into(),
            owner: owner.into(),
            key: key.into(),
        };
        let answer = server.registry.clone().list_assets(request).await;
        answer.map(|answer| answer.into_inner())
    };
    for owner in ["", &one, &two] {
        for key in ["", &first, &second] {
            let (mut seen, mut token) = (Vec::new(), String::new());
            loop {
                let page = list(owner, key, 2, &token).await.unwrap();
                seen.extend(page.assets);
                token = page.next_page_token;
                if token.is_empty() {
                    break;
                }
            }
            let fits =
                |asset: &&Asset| (owner.is_empty() || asset.owner == owner) && (key.is_empty() || asset.key == key);
            let wanted: Vec<Asset> = made.iter().filter(fits).cloned().collect();
            assert_eq!(seen, wanted);
        }
    }
    let token = list(&one, "", 1, "").await.unwrap().next_page_token;
    assert_eq!(invalid(list(&two, "", 1, &token).await), ["page_token"]);
    assert_eq!(invalid(list("", "", 1, &token).await), ["page_token"]);
    assert_eq!(invalid(list(&first, "", 1, "").await), ["owner"]);
    assert_eq!(invalid(list("", &one, 1, "").await), ["key"]);
    assert_eq!(invalid(list("", "", -1, "").await), ["page_size"]);

    let owners = async |page_size, page_token: &str| {
        let page_token = page_token.into();
        let request = ListOwnersRequest { page_size, page_token };
        let answer = server.registry.clone().list_owners(request).await;
        answer.map(|answer| answer.into_inner())
    };
    let page = owners(1, "").await.unwrap();
    assert_eq!(page.owners[0].name, two);
    let page = owners(1, &page.next_page_token).await.unwrap();
    assert_eq!(
        (page.owners[0].name.as_str(), page.next_page_token.as_str()),
        (&*one, "")
    );
    assert_eq!(invalid(owners(1, &token).await), ["page_token"]);
}

#[tokio::test]
async fn names_are_checked_everywhere() {
    let server = Server::start().await;
    let mut registry = server.registry.clone();
    let id = Uuid::now_v7();
    let (owner, asset, signed) = (
        format!("owners/{id}"),
        format!("assets/{id}"),
        format!("commitments/{id}"),
    );
    for name in ["", "keys/../x", &format!("jobs/{id}")] {
        let name = || name.to_owned();
        assert_eq!(
            invalid(registry.get_owner(GetOwnerRequest { name: name() }).await),
            ["name"]
        );
        assert_eq!(
            invalid(registry.get_asset(GetAssetRequest { name: name() }).await),
            ["name"]
        );
        assert_eq!(invalid(commitment(&server, &name()).await), ["name"]);
        assert_eq!(invalid(export(&server, &name()).await), ["name"]);
    }
    let request = GetOwnerRequest { name: owner.clone() };
    assert_eq!(not_found(registry.get_owner(request).await), owner);
    let request = GetAssetRequest { name: asset.clone() };
    assert_eq!(not_found(registry.get_asset(request).await), asset);
    assert_eq!(not_found(commitment(&server, &signed).await), signed);
    assert_eq!(not_found(export(&server, &signed).await), signed);
}
