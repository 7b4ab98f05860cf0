//! The store on whatever service the environment names: an emulator, or an account of one's own. Not run unless asked for;
//! `server/tests/stores/azure.sh` has the one of Azure and asks.
use super::*;

const LIFETIME: Duration = Duration::from_secs(60);

fn opened() -> ArtifactStore {
    let url = std::env::var("GUARDSPLAT_TEST_ARTIFACTS").expect("GUARDSPLAT_TEST_ARTIFACTS names a place of its own");
    // Each run has a prefix of its own, so that one that was ended is in nobody's way. Its object `ledger` stays there.
    let place = Place::parse(&format!("{url}/{}", Uuid::now_v7())).unwrap();
    ArtifactStore::open_at(&place, std::env::vars(), LIFETIME, LIMIT).unwrap()
}

async fn listed(store: &ArtifactStore) -> Vec<String> {
    let all: Vec<Listed> = store.list().try_collect().await.unwrap();
    let mut paths: Vec<String> = all.iter().map(|listed| listed.path.to_string()).collect();
    paths.sort();
    paths
}

#[tokio::test]
#[ignore = "needs a service: server/tests/stores/azure.sh"]
async fn artifacts_are_written_read_listed_and_deleted() {
    let store = opened();
    store.check().await.unwrap();
    store.claim("one").await.unwrap();
    store.claim("one").await.unwrap();
    let another = store.claim("two").await.unwrap_err();
    assert!(matches!(another, StoreError::OfAnother { .. }), "{another}");

    // In one piece, and in three parts.
    let mut paths = Vec::new();
    for length in [0, 1000, 13 * CHUNK_BYTES + 17] {
        let (data, path) = (bytes(length), upload());
        let chunks: Vec<_> = data.chunks(700_001).collect();
        put(&store, &path, Announced::of(&data), &chunks).await.unwrap();
        for offset in [0, length / 2, length] {
            let read = get(&store, &path, offset as u64).await.unwrap().concat();
            assert!(read == data[offset..], "{length} bytes from {offset}");
        }
        paths.push(path);
    }
    // What breaks off or is wrong is none.
    let (data, path) = (bytes(12 * CHUNK_BYTES), upload());
    let mut writer = store.write(&path, Announced::of(&data)).await.unwrap();
    for chunk in data.chunks(CHUNK_BYTES).take(11) {
        writer.chunk(chunk.to_vec()).await.unwrap();
    }
    writer.abort().await.unwrap();
    let wrong = Announced {
        sha256: [7; 32],
        ..Announced::of(&data)
    };
    let chunks: Vec<_> = data.chunks(CHUNK_BYTES).collect();
    assert!(put(&store, &upload(), wrong, &chunks).await.is_err());

    let mut expected: Vec<String> = paths.iter().map(ToString::to_string).collect();
    expected.sort();
    assert_eq!(listed(&store).await, expected);
    for path in &paths {
        store.delete(path).await.unwrap();
        store.delete(path).await.unwrap();
        assert!(matches!(store.read(path, 0).await, Err(StoreError::Gone { .. })));
    }
    assert!(listed(&store).await.is_empty());
}

#[tokio::test]
#[ignore = "needs a service: server/tests/stores/azure.sh"]
async fn addresses_are_signed_for_reading_and_for_writing() {
    let store = opened();
    let (data, path) = (bytes(3000), upload());
    put(&store, &path, Announced::of(&data), &[&data]).await.unwrap();
    let url = store.download_url(&path, LIFETIME).await.unwrap().unwrap();
    assert!(fetch(&url).await == (200, data.clone()));

    let id = Uuid::now_v7();
    let staged = ArtifactPath::staged(id);
    let address = store.upload_url(&staged, 3000, LIFETIME).await.unwrap().unwrap();
    let mut request = reqwest::Client::new().put(&address.url).body(data.clone());
    for (name, value) in address.headers {
        request = request.header(*name, *value);
    }
    let answer = request.send().await.unwrap();
    assert!(answer.status().is_success(), "{}", answer.text().await.unwrap());
    let taken = ArtifactPath::taken(Uuid::now_v7(), id);
    let take = store.take(&staged, taken.clone(), Announced::of(&data)).await.unwrap();
    take.keep();
    store.delete(&staged).await.unwrap();
    assert!(get(&store, &taken, 0).await.unwrap().concat() == data);

    // Nothing is open to those who have no address, and an address is for one artifact.
    let [named, other] = [&path, &taken].map(ToString::to_string);
    for url in [url.split('?').next().unwrap(), &url.replace(&named, &other)] {
        let (status, _) = fetch(url).await;
        assert!((400..500).contains(&status), "{status} at {url}");
    }
    for path in [&path, &taken] {
        store.delete(path).await.unwrap();
    }
}
