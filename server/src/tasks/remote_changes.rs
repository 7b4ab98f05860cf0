//! Passes on what other servers changed, to those who wait here.
use tokio::sync::broadcast::error::RecvError;

use crate::ledger::RemoteChange;
use crate::service::Service;

/// Passes on until the API is stopped. Returns at once where no other server can change anything.
pub async fn relay(api: Service) {
    let Some(mut remote) = api.ledger().remote_changes() else {
        return;
    };
    let mut stopping = api.changes().listen();
    loop {
        let heard = tokio::select! {
            () = stopping.stopped() => return,
            heard = remote.recv() => heard,
        };
        let changes = api.changes();
        match heard {
            Ok(RemoteChange::Job {
                id,
                queue_grew,
                queue_moved,
            }) => {
                changes.job(id);
                if queue_grew {
                    changes.queue_grew();
                }
                if queue_moved {
                    changes.queue_moved();
                }
            }
            Ok(RemoteChange::Anything) | Err(RecvError::Lagged(_)) => changes.everything(),
            Err(RecvError::Closed) => return,
        }
    }
}
