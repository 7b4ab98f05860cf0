//! What is a service's own: parts, who may use it, addresses that it signs.
use super::*;

fn s3(bench: &Bench) -> &Endpoint {
    match &bench.place {
        Laid::S3(endpoint) => endpoint,
        Laid::Folder(_) => panic!("not on S3"),
    }
}

#[test]
fn parts_are_large_enough_and_few_enough() {
    let place = Place::parse("s3://bucket").unwrap();
    let environment = [("AWS_SKIP_SIGNATURE".into(), "true".into())];
    let store = ArtifactStore::open_at(&place, environment, Duration::ZERO, 1 << 40).unwrap();
    for size in [0, 1, PART_BYTES] {
        assert_eq!(store.part_bytes(size), None, "{size}");
    }
    for size in [
        PART_BYTES + 1,
        4 << 30,
        PART_BYTES * PARTS,
        PART_BYTES * PARTS + 1,
        1 << 40,
    ] {
        let part = store.part_bytes(size).unwrap() as u64;
        assert!(part >= PART_BYTES && size.div_ceil(part) <= PARTS, "{size}: {part}");
    }
}

#[tokio::test]
async fn what_keeps_a_server_from_beginning_is_told() {
    let bench = Bench::s3().await;
    let endpoint = s3(&bench);
    let told = async |url: &str, id: &str| {
        let place = Place::parse(url).unwrap();
        let store = ArtifactStore::open_at(&place, endpoint.environment_of(id), Duration::ZERO, LIMIT).unwrap();
        let error = store.check().await.unwrap_err();
        crate::run::startup(error).to_string()
    };
    let missing = told("s3://missing/x", "tester").await;
    assert_eq!(
        missing,
        "artifacts: s3://missing/x can't be written to: the bucket or container does not exist"
    );
    let stranger = told("s3://guardsplat", "stranger").await;
    assert!(
        stranger.starts_with("artifacts: s3://guardsplat can't be written to: "),
        "{stranger}"
    );
    assert!(!stranger.contains("5ec2e7"), "{stranger}");
    assert!(endpoint.objects().is_empty());
}

/// Nothing of what opens it is shown.
#[tokio::test]
async fn credentials_are_not_shown() {
    let bench = Bench::s3().await;
    let shown = format!("{:?} {}", bench.store, bench.store.place());
    let place = "s3://guardsplat/some/where";
    assert_eq!(shown, format!("ArtifactStore({place}) {place}"));
}

#[tokio::test]
async fn a_signed_address_gives_one_artifact_for_a_time() {
    let bench = Bench::s3().await;
    let store = &bench.store;
    let (data, path, other) = (bytes(3000), upload(), upload());
    put(store, &path, Announced::of(&data), &[&data]).await.unwrap();
    put(store, &other, Announced::of(b"other"), &[b"other"]).await.unwrap();
    let url = store
        .download_url(&path, Duration::from_secs(60))
        .await
        .unwrap()
        .unwrap();
    assert!(!url.contains("5ec2e7"), "{url}");
    assert_eq!(fetch(&url).await, (200, data));
    let [path, other] = [path, other].map(|path| path.to_string());
    assert!(url.contains(&path));
    assert_eq!(fetch(&url.replace(&path, &other)).await.0, 403);
    let gone = store
        .download_url(&upload(), Duration::from_secs(60))
        .await
        .unwrap()
        .unwrap();
    assert_eq!(fetch(&gone).await.0, 404);
    let short = store
        .download_url(&ArtifactPath::parse(&path).unwrap(), Duration::from_secs(1))
        .await;
    tokio::time::sleep(Duration::from_millis(2500)).await;
    assert_eq!(fetch(&short.unwrap().unwrap()).await.0, 403);
    let folder = Bench::folder().await;
    let none = folder
        .store
        .download_url(&upload(), Duration::from_secs(60))
        .await
        .unwrap();
    assert_eq!(none, None);
}

#[tokio::test]
async fn what_is_taken_stays_only_if_it_is_kept() {
    let bench = Bench::s3().await;
    let store = &bench.store;
    let (data, id) = (bytes(3000), Uuid::now_v7());
    let staged = ArtifactPath::staged(id);
    let address = store.upload_url(&staged, 3000, Duration::from_secs(60)).await.unwrap();
    let address = address.unwrap();
    assert!(
        !address.url.contains("5ec2e7") && address.headers.is_empty(),
        "{address:?}"
    );
    let sent = reqwest::Client::new().put(&address.url).body(data.clone()).send().await;
    assert_eq!(sent.unwrap().status(), 200);
    assert_eq!(fetch(&address.url).await.0, 403, "it is for writing");
    let path = ArtifactPath::taken(Uuid::now_v7(), id);
    let take = async || store.take(&staged, path.clone(), Announced::of(&data)).await.unwrap();
    drop(take().await);
    for _ in 0..200 {
        if bench.files().len() == 1 {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(bench.files(), [bench.file(&staged)]);
    take().await.remove().await.unwrap();
    assert_eq!(bench.files(), [bench.file(&staged)]);
    take().await.keep();
    store.delete(&staged).await.unwrap();
    assert_eq!(fs::read(bench.file(&path)).unwrap(), data);
}

/// Of Azure only what it is asked for is known here.
#[tokio::test]
async fn each_service_is_sent_to_as_it_wants() {
    let lifetime = Duration::from_secs(60);
    let path = ArtifactPath::staged(Uuid::now_v7());
    let environment = [
        ("AZURE_STORAGE_ACCOUNT_NAME", "account"),
        ("AZURE_STORAGE_ACCOUNT_KEY", "NWVjMmU3"),
    ];
    let environment = environment.map(|(name, value)| (name.into(), value.into()));
    let place = Place::parse("az://container/a").unwrap();
    let azure = ArtifactStore::open_at(&place, environment, Duration::ZERO, 1 << 40).unwrap();
    let address = azure.upload_url(&path, 5000 << 20, lifetime).await.unwrap().unwrap();
    let begin = format!("https://account.blob.core.windows.net/container/a/{path}?");
    assert!(address.url.starts_with(&begin), "{}", address.url);
    assert_eq!(address.headers, [("x-ms-blob-type", "BlockBlob")]);
    // More than one request brings, and a folder.
    let many = azure.upload_url(&path, (5000 << 20) + 1, lifetime).await.unwrap();
    assert!(many.is_none());
    let folder = Bench::folder().await;
    assert!(folder.store.upload_url(&path, 1, lifetime).await.unwrap().is_none());
}
