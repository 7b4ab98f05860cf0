//! Paths and announcements, on no store at all.
use proptest::prelude::*;

use super::*;

#[test]
fn paths_are_made_of_ids() {
    let (job, id) = (Uuid::from_u128(1), Uuid::from_u128(2));
    let path = ArtifactPath::output(job, "../../token", id);
    assert_eq!(path.to_string().matches('/').count(), 3);
    assert!(!path.to_string().contains("token"));
    assert_ne!(path, ArtifactPath::output(job, "another", id));
    for (path, ahead) in [
        (path, false),
        (ArtifactPath::upload(id), false),
        (ArtifactPath::taken(job, id), true),
        (ArtifactPath::staged(id), true),
    ] {
        assert_eq!(ArtifactPath::parse(&path.to_string()).unwrap(), path);
        assert_eq!((path.id(), path.is_ahead_of_its_row()), (Some(id), ahead), "{path}");
    }
    for bad in [
        "",
        "uploads",
        "uploads/",
        "uploads/../../etc/passwd",
        "/uploads/00000000-0000-0000-0000-000000000002",
        "uploads/00000000-0000-0000-0000-000000000002#1",
        "uploads/00000000000000000000000000000002",
        "uploads/00000000-0000-0000-0000-000000000002/",
        "staged/00000000-0000-0000-0000-000000000002/00000000-0000-0000-0000-000000000002",
        "outputs/00000000-0000-0000-0000-000000000002/../00000000-0000-0000-0000-000000000002",
        "outputs/00000000-0000-0000-0000-000000000002/0123456789ABCDEF/00000000-0000-0000-0000-000000000002",
    ] {
        assert!(matches!(ArtifactPath::parse(bad), Err(StoreError::BadPath(_))), "{bad}");
    }
}

proptest! {
    #[test]
    fn no_text_leads_out_of_the_store(
        text in "(staged|uploads|outputs|\\.\\.|[a-z/#.%]*)(/[a-f0-9./#%-]{0,40}){0,4}",
    ) {
        if let Ok(path) = ArtifactPath::parse(&text) {
            prop_assert_eq!(path.to_string(), text);
        }
    }

    /// However bytes are cut into chunks, exactly the announced ones pass.
    #[test]
    fn only_what_was_announced_passes(
        data in prop::collection::vec(any::<u8>(), 1..200),
        cut in 1..50usize,
        longer in -2..=2i64,
        flip in any::<bool>(),
    ) {
        let size = data.len().saturating_add_signed(longer as isize) as u64;
        let mut announced = Announced::of(&data);
        announced.size = size;
        announced.sha256[31] ^= u8::from(flip);
        let mut check = Check::new(announced, LIMIT).unwrap();
        let taken = data.chunks(cut).try_for_each(|chunk| check.chunk(chunk));
        let passed = taken.and_then(|()| check.finish()).is_ok();
        prop_assert_eq!(passed, size == data.len() as u64 && !flip);
    }
}
