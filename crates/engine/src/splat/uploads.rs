//! Views on the device: buffers of those drawn last are kept, because a step draws a view several times.
use super::prepare::ViewId;
use crate::error::Result;
use cubecl::server::Handle;
use std::collections::VecDeque;

/// Device memory for kept views.
const KEPT_BYTES: usize = 256 << 20;

/// What a view needs on the device, whatever the colours.
#[derive(Clone)]
pub(super) struct Uploaded {
    /// Sum of the buffers.
    pub bytes: usize,
    pub splats: Handle,
    pub start: Handle,
    pub list: Handle,
    pub slot_start: Handle,
    pub slots: Handle,
}

/// Recent views, the latest last; together they stay below [`KEPT_BYTES`].
#[derive(Default)]
pub(super) struct Uploads(VecDeque<(ViewId, Uploaded)>);

impl Uploads {
    /// The buffers of `view`, from before or made now.
    pub fn get_or_insert(&mut self, view: ViewId, make: impl FnOnce() -> Result<Uploaded>) -> Result<Uploaded> {
        let before = self.0.iter().position(|(id, _)| id.0 == view.0);
        let found = match before.and_then(|at| self.0.remove(at)) {
            Some((_, found)) => found,
            None => make()?,
        };
        self.0.push_back((view, found.clone()));
        let mut total: usize = self.0.iter().map(|(_, u)| u.bytes).sum();
        while total > KEPT_BYTES {
            let Some((_, oldest)) = self.0.pop_front() else {
                break;
            };
            total -= oldest.bytes;
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{DeviceChoice, open};
    use burn::backend::{BackendTensor, DispatchTensorKind};

    #[test]
    fn the_latest_views_are_kept_within_the_budget() {
        // Handles come from any device; where there is none, the GPU's own tests say so.
        let Ok(compute) = open(DeviceChoice::Wgpu) else {
            return;
        };
        let probe = burn::tensor::Tensor::<1>::zeros([1], &compute.device)
            .into_dispatch()
            .kind;
        let DispatchTensorKind::Cube(BackendTensor::Float(probe)) = probe else {
            panic!()
        };
        let handle = probe.handle;
        let made = |bytes| {
            let handle = || handle.clone();
            let (splats, start, list) = (handle(), handle(), handle());
            Ok(Uploaded {
                bytes,
                splats,
                start,
                list,
                slot_start: handle(),
                slots: handle(),
            })
        };
        let mut uploads = Uploads::default();
        for (id, bytes) in [(0, 100 << 20), (1, 100 << 20), (0, 7), (2, 100 << 20)] {
            let got = uploads.get_or_insert(ViewId(id), || made(bytes)).unwrap();
            assert_eq!(got.bytes, 100 << 20, "a view is uploaded once");
        }
        let ids = |u: &Uploads| u.0.iter().map(|(id, _)| id.0).collect::<Vec<_>>();
        assert_eq!(ids(&uploads), [0, 2], "the one not used for longest goes");
        // One above the budget is used and not kept.
        assert_eq!(
            uploads.get_or_insert(ViewId(3), || made(300 << 20)).unwrap().bytes,
            300 << 20
        );
        assert!(ids(&uploads).is_empty());
    }
}
