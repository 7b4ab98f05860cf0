//! The same said many times over, at once and late: one result is published.
use futures::future::join_all;
use guardsplat_proto::v1::EmbedResult;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::State;
use tokio::time::Duration;
use tonic::Code;

use crate::place::{Place, short_or_full};

const AT_ONCE: usize = 20;
const MARKED: &[u8] = b"a scene, as the attempt made it";

pub async fn publish_once(place: Place) {
    let deliveries = short_or_full(100, 1000);
    let server = place.start(&[]).await;
    let callers: Vec<_> = (0..4).map(|_| place.caller()).collect();
    let caller = &callers[0];
    let inputs = caller.inputs().await;
    let name = caller.submit(inputs.embed(), "").await.unwrap().name;
    let (job, token) = caller.take().await;
    assert_eq!(job.name, name);
    let of = (name.as_str(), token.as_str());
    let mut outputs = Vec::new();
    while outputs.len() < deliveries {
        let sent = (0..AT_ONCE).map(|i| {
            let caller = &callers[i % callers.len()];
            async move { caller.output(of, MARKED, false, Duration::ZERO).await.unwrap() }
        });
        outputs.extend(join_all(sent).await);
    }
    let result = |scene: &str| {
        Output::EmbedResult(EmbedResult {
            scene: scene.into(),
            comparison: outputs[1].clone(),
            ..EmbedResult::default()
        })
    };
    let mut said = 0;
    let mut first = None;
    while said < deliveries {
        let sent = (0..AT_ONCE).map(|i| callers[i % callers.len()].complete(of, result(&outputs[0])));
        for answer in join_all(sent).await {
            answer.unwrap();
            said += 1;
        }
        let job = caller.job(&name).await.unwrap();
        assert_eq!(first.get_or_insert(job.clone()), &job);
    }
    assert_eq!(first.as_ref().unwrap().state(), State::Succeeded);
    // Said otherwise, it comes too late.
    let others = outputs[2..]
        .iter()
        .take(100)
        .map(|scene| caller.complete(of, result(scene)));
    for answer in join_all(others).await {
        assert_eq!(answer.unwrap_err().code(), Code::Aborted);
    }
    assert_eq!(first.unwrap(), caller.job(&name).await.unwrap());
    let (published, hidden) = outputs.split_at(2);
    for name in published {
        assert!(caller.download(name).await.unwrap() == MARKED);
    }
    for name in hidden {
        assert_eq!(
            caller.download(name).await.unwrap_err().code(),
            Code::NotFound,
            "{name}"
        );
    }
    place.figure(&format!(
        "{said} deliveries of CompleteJob and {} of UploadOutput: one result, 2 of {} outputs published",
        outputs.len(),
        outputs.len()
    ));
    server.stop().await;
}
