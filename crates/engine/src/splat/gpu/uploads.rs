//! Views on the device: the words of those drawn last are kept, because a step draws a view several times.
use std::collections::VecDeque;

use crate::launch::Buffer;
use crate::splat::prepare::ViewId;

/// Device memory for kept views: those that an embedding draws from at the size of its pool.
const KEPT_BYTES: usize = 768 << 20;

/// Recent views, the latest last; together they stay below [`KEPT_BYTES`].
#[derive(Default)]
pub(super) struct Uploads(VecDeque<(ViewId, Buffer)>);

impl Uploads {
    /// The words of `view`, from before or made now.
    pub fn get_or_insert(&mut self, view: ViewId, make: impl FnOnce() -> Buffer) -> Buffer {
        let before = self.0.iter().position(|(id, _)| id.0 == view.0);
        let found = match before.and_then(|at| self.0.remove(at)) {
            Some((_, found)) => found,
            None => make(),
        };
        self.0.push_back((view, found.clone()));
        let mut total: usize = self.0.iter().map(|(_, words)| 4 * words.len).sum();
        while total > KEPT_BYTES {
            let Some((_, oldest)) = self.0.pop_front() else {
                break;
            };
            total -= 4 * oldest.len;
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splat::GpuRasterizer;
    use crate::testing::wgpu;

    #[test]
    fn the_latest_views_are_kept_within_the_budget() {
        let Some(compute) = wgpu() else { return };
        let rasterizer = GpuRasterizer::new(&compute.device).unwrap();
        let one = Buffer::of(rasterizer.client(), &[1u32]);
        let made = |bytes: usize| Buffer {
            handle: one.handle.clone(),
            len: bytes / 4,
        };
        let mut uploads = Uploads::default();
        for (id, bytes) in [(0, 300 << 20), (1, 300 << 20), (0, 7), (2, 300 << 20)] {
            let got = uploads.get_or_insert(ViewId(id), || made(bytes));
            assert_eq!(got.len, 75 << 20, "a view is uploaded once");
        }
        let ids = |u: &Uploads| u.0.iter().map(|(id, _)| id.0).collect::<Vec<_>>();
        assert_eq!(ids(&uploads), [0, 2], "the one not used for longest goes");
        // One above the budget is used and not kept.
        assert_eq!(uploads.get_or_insert(ViewId(3), || made(900 << 20)).len, 225 << 20);
        assert!(ids(&uploads).is_empty());
    }
}
