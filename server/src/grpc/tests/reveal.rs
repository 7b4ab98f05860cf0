//! Opening a commitment: who may, what is given away, and what is told of it afterwards.
use guardsplat_codeword::{MARK_CODE, Payload, Whitening, mark};
use guardsplat_commitment::OpenedDocument;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::{Asset, GetAssetRequest, RevealCommitmentRequest, RevealCommitmentResponse};
use tonic::{Code, Status};

use super::calls::asking;
use super::claims::{Bench, bench, framed, logits, of_asset};
use super::harness::{Server, refused};
use super::registry::public_key;
use crate::access::DEFAULT_PROJECT;
use crate::access::Scope::{Admin, Embed, Verify};
use crate::service::Limits;

async fn reveal(door: &Server, token: &str, name: &str) -> Result<RevealCommitmentResponse, Status> {
    let request = RevealCommitmentRequest { name: name.into() };
    let mut registry = RegistryServiceClient::new(door.channel.clone());
    let answer = registry.reveal_commitment(asking(token, request)).await;
    answer.map(|answer| answer.into_inner())
}

async fn get(bench: &Bench, name: &str) -> Asset {
    let request = GetAssetRequest { name: name.into() };
    let answer = bench.server.registry.clone().get_asset(request).await;
    answer.unwrap().into_inner()
}

#[tokio::test]
async fn a_commitment_is_opened_by_admins_and_gives_away_one_word() {
    let bench = bench().await;
    let word = bench.word(0).await;
    let asset = &bench.assets[0].0;
    let known = get(&bench, asset).await;
    assert_eq!(known.reveal_time, None);
    let door = bench.server.with_a_door(Limits::default()).await;
    let shop = door.token(DEFAULT_PROJECT, &[Embed, Verify]).await;
    let admin = door.token(DEFAULT_PROJECT, &[Admin]).await;
    refused(
        reveal(&door, &shop, &known.commitment).await,
        Code::PermissionDenied,
        "SCOPE_MISSING",
    );
    let answer = reveal(&door, &admin, &known.commitment).await.unwrap();

    // With the document alone, and the key of the service, somebody else comes to the word that was embedded.
    let opened = OpenedDocument::from_json(&answer.document).unwrap();
    opened.verify(&public_key(&bench.server).await).unwrap();
    let commitment = &opened.document.signed.commitment;
    let secret = opened.opening.whitening_secret();
    let whitening = Whitening {
        secret: &secret,
        asset: commitment.asset.as_bytes(),
        nonce: opened.opening.nonce(),
    };
    let payload = Payload::of_key(MARK_CODE, commitment.key.as_bytes(), commitment.payload as u32);
    assert_eq!(mark(MARK_CODE, payload, &whitening).unwrap().word.to_string(), word);

    // Said again, the first time counts; and the asset and evidence of later claims tell of it.
    let again = reveal(&door, &admin, &known.commitment).await.unwrap();
    assert!(again == answer && again.reveal_time.is_some());
    let known = get(&bench, asset).await;
    assert_eq!(known.reveal_time, answer.reveal_time);
    let (_, checked) = bench.claimed(of_asset(asset), vec![framed(0, logits(&word, 4))]).await;
    let history = checked.evidence.unwrap().verification.unwrap().history.unwrap();
    assert!(history.asset.unwrap().revealed.is_some());
    // The next asset's is as secret as ever.
    let other = bench.assets[1].0.clone();
    let (_, checked) = bench.claimed(of_asset(&other), vec![framed(0, logits(&word, 4))]).await;
    let history = checked.evidence.unwrap().verification.unwrap().history.unwrap();
    assert_eq!(history.asset.unwrap().revealed, None);
}
