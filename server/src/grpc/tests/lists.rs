//! Lists, page by page, and tokens that are not of the list.
use guardsplat_proto::v1::job::State;
use guardsplat_proto::v1::{ListJobsRequest, ListJobsResponse, ListKeysRequest};
use tonic::Status;

use super::harness::{Server, invalid, key_spec};

async fn list(server: &Server, size: i32, token: &str, states: &[State]) -> Result<ListJobsResponse, Status> {
    let states = states.iter().map(|&state| state.into()).collect();
    let request = ListJobsRequest {
        page_size: size,
        page_token: token.into(),
        states,
        ..Default::default()
    };
    server
        .jobs
        .clone()
        .list_jobs(request)
        .await
        .map(|answer| answer.into_inner())
}

#[tokio::test]
async fn pages_hold_every_job_once_newest_first() {
    let server = Server::start().await;
    let mut names = Vec::new();
    for _ in 0..5 {
        names.push(server.create(key_spec(8)).await.name);
    }
    names.reverse();
    let (mut listed, mut token, mut sizes) = (Vec::new(), String::new(), Vec::new());
    loop {
        let page = list(&server, 2, &token, &[]).await.unwrap();
        sizes.push(page.jobs.len());
        listed.extend(page.jobs.into_iter().map(|job| job.name));
        token = page.next_page_token;
        // One that comes meanwhile is on no later page.
        server.create(key_spec(8)).await;
        if token.is_empty() {
            break;
        }
    }
    assert_eq!((listed, sizes), (names, vec![2, 2, 1]));
}

#[tokio::test]
async fn states_filter() {
    let server = Server::start().await;
    let first = server.create(key_spec(8)).await.name;
    let second = server.create(key_spec(8)).await.name;
    assert_eq!(server.take().await.0.name, first);
    let names = async |states: &[State]| {
        let page = list(&server, 0, "", states).await.unwrap();
        page.jobs.into_iter().map(|job| job.name).collect::<Vec<_>>()
    };
    assert_eq!(names(&[State::Queued]).await, std::slice::from_ref(&second));
    assert_eq!(names(&[State::Running]).await, std::slice::from_ref(&first));
    assert_eq!(names(&[State::Running, State::Queued]).await, [second, first]);
    assert!(names(&[State::Failed]).await.is_empty());
    assert_eq!(
        invalid(list(&server, 0, "", &[State::Queued, State::Unspecified]).await),
        ["states[1]"]
    );
}

#[tokio::test]
async fn tokens_belong_to_their_query() {
    let server = Server::start().await;
    for _ in 0..3 {
        server.create(key_spec(8)).await;
    }
    let token = list(&server, 1, "", &[State::Queued, State::Failed])
        .await
        .unwrap()
        .next_page_token;
    // The same filter in another order, and another size, are the same query.
    list(&server, 2, &token, &[State::Failed, State::Queued]).await.unwrap();
    let mut tampered = token.clone().into_bytes();
    tampered[20] ^= 1;
    let tampered = String::from_utf8(tampered).unwrap();
    for (token, states) in [
        (token.as_str(), &[State::Queued][..]),
        (&token, &[]),
        (&token[1..], &[]),
    ] {
        assert_eq!(invalid(list(&server, 1, token, states).await), ["page_token"]);
    }
    for token in [tampered.as_str(), "2", "é"] {
        assert_eq!(
            invalid(list(&server, 1, token, &[State::Queued, State::Failed]).await),
            ["page_token"]
        );
    }
    assert_eq!(invalid(list(&server, -1, "", &[]).await), ["page_size"]);
    let request = ListKeysRequest {
        page_size: 0,
        page_token: token,
    };
    assert_eq!(invalid(server.keys.clone().list_keys(request).await), ["page_token"]);
}

/// However many lists are asked for, the queue is not walked for each.
#[tokio::test]
async fn lists_share_one_count_of_the_queue() {
    let server = Server::start().await;
    let first = server.create(key_spec(8)).await.name;
    for _ in 0..9 {
        server.create(key_spec(8)).await;
    }
    let begun = std::time::Instant::now();
    let before = server.api.positions_counted().await;
    for _ in 0..100 {
        let page = list(&server, 0, "", &[]).await.unwrap();
        assert_eq!(page.jobs.len(), 10);
        let oldest = page.jobs.last().unwrap();
        assert_eq!((oldest.name.as_str(), oldest.queue_position), (first.as_str(), Some(0)));
    }
    let counted = server.api.positions_counted().await - before;
    // Twice a second, however long it took.
    let most = 2 + begun.elapsed().as_millis() as u64 / 500;
    assert!((1..=most).contains(&counted), "{counted} of at most {most}");
}
