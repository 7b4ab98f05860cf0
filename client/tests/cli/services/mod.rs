//! The four services that clients use, over the state of the tests.
mod artifacts;
mod jobs;
mod keys;
mod registry;

use std::pin::Pin;

use tokio_stream::Stream;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};

type Replies<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

fn replies<T: Send + 'static>(items: Vec<Result<T, Status>>) -> Replies<T> {
    Box::pin(tokio_stream::iter(items))
}

/// That a resource is not there, told as the server tells it.
pub fn not_found(name: &str) -> Status {
    let mut details = ErrorDetails::new();
    details
        .set_error_info("NOT_FOUND", "guardsplat", [("name".to_owned(), name.to_owned())])
        .set_resource_info("guardsplat.v1/thing", name, "", "");
    Status::with_error_details(Code::NotFound, format!("{name} does not exist"), details)
}

/// That a request id stands for another request, told as the server tells it.
fn reused(request_id: &str) -> Status {
    let message = format!("request_id {request_id} was used for another job");
    let mut details = ErrorDetails::new();
    details
        .set_error_info("REQUEST_ID_REUSED", "guardsplat", [])
        .add_bad_request_violation("request_id", message.clone());
    Status::with_error_details(Code::AlreadyExists, message, details)
}
