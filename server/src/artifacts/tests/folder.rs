//! What is a folder's own: staged files, empty folders, a full disk.
use super::*;

/// A server that was killed in the middle of an upload: the next one clears up, and touches nothing else.
#[tokio::test]
async fn what_a_killed_server_left_is_removed() {
    let bench = Bench::folder().await;
    let store = &bench.store;
    let (data, kept, cut) = (bytes(5000), upload(), upload());
    put(store, &kept, Announced::of(&data), &[&data]).await.unwrap();
    let output = ArtifactPath::output(Uuid::now_v7(), "token", Uuid::now_v7());
    for path in [&cut, &output] {
        let mut writer = store.write(path, Announced::of(&data)).await.unwrap();
        writer.chunk(data[..100].to_vec()).await.unwrap();
        std::mem::forget(writer);
    }
    assert_eq!(bench.files().len(), 3);
    // Where other servers write, only what is old is nobody's.
    let folder = bench.file(&kept).parent().unwrap().parent().unwrap().to_owned();
    let place = Place::Folder(folder.clone());
    ArtifactStore::open_at(&place, [], Duration::from_secs(60), LIMIT).unwrap();
    assert_eq!(bench.files().len(), 3);
    let again = ArtifactStore::open(&folder, LIMIT).unwrap();
    assert_eq!(bench.files().len(), 1);
    assert_eq!(get(&again, &kept, 0).await.unwrap().concat(), data);
}

#[tokio::test]
async fn empty_folders_do_not_stay() {
    let bench = Bench::folder().await;
    let path = ArtifactPath::output(Uuid::now_v7(), "token", Uuid::now_v7());
    put(&bench.store, &path, Announced::of(b"x"), &[b"x"]).await.unwrap();
    let folder = bench.file(&path).ancestors().nth(4).unwrap().to_owned();
    assert!(folder.ends_with("artifacts"));
    bench.store.delete(&path).await.unwrap();
    assert_eq!(fs::read_dir(folder).unwrap().count(), 0);
}

#[test]
fn a_folder_that_cannot_be_is_named() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let error = ArtifactStore::open(&file, LIMIT).unwrap_err();
    assert!(
        error.to_string().starts_with(&format!("{}: ", file.display())),
        "{error}"
    );
}

#[test]
fn only_a_full_disk_is_told_as_one() {
    let failed = |kind| object_store::Error::Generic {
        store: "LocalFileSystem",
        source: Box::new(std::io::Error::from(kind)),
    };
    assert!(matches!(
        failed(std::io::ErrorKind::StorageFull).into(),
        StoreError::NoSpace(_)
    ));
    assert!(matches!(
        failed(std::io::ErrorKind::PermissionDenied).into(),
        StoreError::Failed(_)
    ));
}
