//! Answers that are streams, for readers that may be slow but not stand still.
use std::future::ready;
use std::time::Duration;

use futures::stream::{self, BoxStream, Stream, StreamExt};
use tokio::sync::mpsc;
use tokio::time::timeout;
use tonic::Status;
use tracing::Instrument as _;

use crate::error::Error;

/// A reader that has taken nothing for so long gets nothing kept ready.
const REST: Duration = Duration::from_secs(1);

/// What a reader is told, one thing after the other.
pub trait Source: Send + 'static {
    /// A thing to be told.
    type Item: Send + 'static;

    /// What is to be told next; none at the end.
    fn next(&mut self) -> impl Future<Output = Option<Self::Item>> + Send;

    /// Lets go of what it keeps ready, as nothing is taken now.
    fn rest(&mut self);
}

/// A stream that keeps nothing ready.
struct Ready<S>(BoxStream<'static, S>);

impl<T: Send + 'static> Source for Ready<T> {
    type Item = T;

    fn next(&mut self) -> impl Future<Output = Option<T>> + Send {
        self.0.next()
    }

    fn rest(&mut self) {}
}

/// How the source of a stream ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// It had no more to tell, or nobody was there to be told.
    Told,
    /// It was let go, because what it told was not taken.
    Shed,
}

/// Tells a reader what `source` does. When the reader has taken nothing for so long that was there to be taken, the
/// source is let go, with all that it holds; should the reader come back, it has what was told before, then `shed`.
///
/// A stream itself can't notice that: while there is no room in HTTP/2's window nobody asks it for anything. So a task
/// asks the source, and has room for one message.
pub fn patient<T: Send + 'static>(
    source: impl Stream<Item = Result<T, Status>> + Send + 'static,
    stall: Duration,
    shed: impl FnOnce() -> Status + Send + 'static,
) -> BoxStream<'static, Result<T, Status>> {
    patient_source(Ready(source.boxed()), stall, shed)
}

/// The same for a source that keeps something ready: a reader that has taken nothing for a second has it let go of that.
pub fn patient_source<T: Send + 'static>(
    source: impl Source<Item = Result<T, Status>>,
    stall: Duration,
    shed: impl FnOnce() -> Status + Send + 'static,
) -> BoxStream<'static, Result<T, Status>> {
    let (give, mut take) = mpsc::channel(1);
    let telling = async move {
        match tell(source, give, stall).await {
            End::Told => None,
            End::Shed => Some(shed()),
        }
    };
    let telling = tokio::spawn(telling.in_current_span());
    let told = stream::poll_fn(move |context| take.poll_recv(context));
    let end = stream::once(telling).filter_map(|ended| {
        ready(match ended {
            Ok(status) => status.map(Err),
            Err(error) => Some(Err(Error::internal("telling what changes", error).into())),
        })
    });
    told.chain(end).boxed()
}

async fn tell<S: Source>(mut source: S, give: mpsc::Sender<S::Item>, stall: Duration) -> End {
    let rest = REST.min(stall);
    loop {
        // There is room when what was told before has been taken. Only then the source is asked, so that what is told is
        // as things stand, and one who is behind costs nothing.
        let mut room = timeout(rest, give.reserve()).await;
        if room.is_err() {
            source.rest();
            room = timeout(stall - rest, give.reserve()).await;
        }
        let room = match room {
            Ok(Ok(room)) => room,
            Ok(Err(_)) => return End::Told,
            Err(_) => return End::Shed,
        };
        let next = tokio::select! {
            next = source.next() => next,
            () = give.closed() => None,
        };
        match next {
            Some(next) => room.send(next),
            None => return End::Told,
        }
    }
}

#[cfg(test)]
mod tests {
    use tokio::sync::oneshot;
    use tokio::time::sleep;

    use super::*;

    const SHORT: Duration = Duration::from_millis(50);
    const LONG: Duration = Duration::from_secs(3600);

    /// Numbers from 0 on, and what says that whoever tells them is gone.
    fn numbers() -> (impl Stream<Item = Result<u32, Status>> + Send, oneshot::Receiver<()>) {
        let (held, gone) = oneshot::channel();
        let numbers = stream::unfold((0, held), |(n, held)| async move { Some((Ok(n), (n + 1, held))) });
        (numbers, gone)
    }

    fn shed() -> Status {
        Status::unavailable("shed")
    }

    #[tokio::test]
    async fn who_takes_nothing_is_shed_and_told_so_in_the_end() {
        let (numbers, gone) = numbers();
        let mut stream = patient(numbers, SHORT, shed);
        assert_eq!(stream.next().await.unwrap().unwrap(), 0);
        // The source is let go while the stream is still there.
        gone.await.unwrap_err();
        assert_eq!(stream.next().await.unwrap().unwrap(), 1);
        assert_eq!(stream.next().await.unwrap().unwrap_err().message(), "shed");
        assert!(stream.next().await.is_none());
    }

    #[tokio::test]
    async fn who_is_slow_is_not_shed() {
        let stall = Duration::from_secs(2);
        let (numbers, _gone) = numbers();
        let mut stream = patient(numbers, stall, shed);
        for n in 0..12 {
            sleep(stall / 10).await;
            assert_eq!(stream.next().await.unwrap().unwrap(), n);
        }
    }

    #[tokio::test]
    async fn who_is_told_nothing_is_not_shed() {
        let late = stream::once(sleep(4 * SHORT)).map(|()| Ok(7));
        let mut stream = patient(late, SHORT, shed);
        assert_eq!(stream.next().await.unwrap().unwrap(), 7);
        assert!(stream.next().await.is_none());
    }

    #[tokio::test]
    async fn a_source_ends_with_its_reader() {
        let (numbers, gone) = numbers();
        let silent = numbers.take(1).chain(stream::pending());
        let mut stream = patient(silent, LONG, shed);
        assert_eq!(stream.next().await.unwrap().unwrap(), 0);
        drop(stream);
        gone.await.unwrap_err();
    }

    /// Tells how often it rested.
    struct Rested(u32);

    impl Source for Rested {
        type Item = Result<u32, Status>;

        async fn next(&mut self) -> Option<Self::Item> {
            Some(Ok(self.0))
        }

        fn rest(&mut self) {
            self.0 += 1;
        }
    }

    #[tokio::test]
    async fn a_source_rests_when_nothing_is_taken() {
        let mut stream = patient_source(Rested(0), LONG, shed);
        for _ in 0..10 {
            sleep(REST / 8).await;
            assert_eq!(stream.next().await.unwrap().unwrap(), 0);
        }
        sleep(2 * REST).await;
        // What was told before, and what is told after.
        let told = [stream.next().await, stream.next().await].map(|told| told.unwrap().unwrap());
        assert_eq!(told, [0, 1]);
    }

    #[tokio::test]
    async fn errors_are_passed_on() {
        let failing = stream::iter([Ok(1), Err(Status::not_found("gone"))]);
        let told: Vec<_> = patient(failing, LONG, shed).collect().await;
        assert_eq!(told.len(), 2);
        assert_eq!(told[1].as_ref().unwrap_err().message(), "gone");
    }
}
