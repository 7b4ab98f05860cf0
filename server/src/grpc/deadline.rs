//! Deadlines of callers (`grpc-timeout`): a call that takes longer ends with `DEADLINE_EXCEEDED` and details. Clients have
//! a clock of their own, and tonic's calls it `CANCELLED` then, from which a caller can't tell who ended the call.
use std::time::Duration;

use tonic::Status;
use tonic::codegen::http::{HeaderMap, Request};

use super::around::{Answer, AroundCall};
use crate::error::Error;

/// So much before the deadline the answer is given, to be ahead of the client's.
const AHEAD: Duration = Duration::from_millis(2);

/// Ends calls at their deadline. An answer that is a stream is the caller's to end once it has begun.
#[derive(Clone, Copy, Debug)]
pub struct Deadlines;

impl AroundCall for Deadlines {
    fn around<B>(&self, request: &Request<B>) -> impl FnOnce(Answer) -> Answer + 'static {
        let left = timeout(request.headers()).map(|given| given.saturating_sub(AHEAD));
        move |answer| {
            let Some(left) = left else { return answer };
            Box::pin(async move {
                match tokio::time::timeout(left, answer).await {
                    Ok(answer) => answer,
                    Err(_) => Ok(Status::from(Error::DeadlineExceeded).into_http()),
                }
            })
        }
    }
}

/// The header `grpc-timeout`: up to eight digits and a unit. One that is malformed counts as none, as in tonic.
fn timeout(headers: &HeaderMap) -> Option<Duration> {
    let text = headers.get("grpc-timeout")?.to_str().ok()?;
    let (digits, unit) = text.split_at_checked(text.len().checked_sub(1)?)?;
    if digits.len() > 8 || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let number: u64 = digits.parse().ok()?;
    Some(match unit {
        "H" => Duration::from_secs(number * 3600),
        "M" => Duration::from_secs(number * 60),
        "S" => Duration::from_secs(number),
        "m" => Duration::from_millis(number),
        "u" => Duration::from_micros(number),
        "n" => Duration::from_nanos(number),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timeouts_are_read_as_grpc_writes_them() {
        let of = |text: &str| {
            let mut headers = HeaderMap::new();
            headers.insert("grpc-timeout", text.parse().unwrap());
            timeout(&headers)
        };
        assert_eq!(of("2H"), Some(Duration::from_secs(7200)));
        assert_eq!(of("3M"), Some(Duration::from_secs(180)));
        assert_eq!(of("82S"), Some(Duration::from_secs(82)));
        assert_eq!(of("15m"), Some(Duration::from_millis(15)));
        assert_eq!(of("7u"), Some(Duration::from_micros(7)));
        assert_eq!(of("99999999n"), Some(Duration::from_nanos(99_999_999)));
        for bad in ["", "5", "S", "-1S", "999999999S", "1.5S", "5x", "1é"] {
            assert_eq!(timeout(&HeaderMap::new()), None);
            if let Ok(value) = bad.parse() {
                let mut headers = HeaderMap::new();
                headers.insert("grpc-timeout", value);
                assert_eq!(timeout(&headers), None, "{bad}");
            }
        }
    }
}
