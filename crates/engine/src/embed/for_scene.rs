//! What settings become for a scene: the views, their number and the steps that it takes.
use super::optimizer::Optimizer;
use super::settings::Settings;
use crate::error::Result;
use crate::extract::sufficient_side;
use crate::scene::Gaussians;
use crate::splat::Geometry;
use crate::view::{Camera, ViewSampler};

/// What the views of the early stop are multiplied by where each shows another part of the scene: eight of a room read three
/// points better than sixty others, and no more steps were taken for a mark that needed them.
const VIEWS_OF_PARTS: usize = 3;
/// What the steps between two looks at these are multiplied by there.
const LOOKS_APART: usize = 2;

impl Settings {
    /// Most held-out views that an embedding of any scene looks at, those of its verification first: whoever wants others
    /// takes those that follow.
    pub fn views_looked_at(&self) -> usize {
        let early = self.early_stop.map_or(0, |stop| stop.views);
        self.verify.views + VIEWS_OF_PARTS * early
    }

    /// The settings for a scene and the cameras it is seen from, which say all by themselves: its kind, the side of its
    /// views, and how many steps views of its parts take. For these again they are the same.
    ///
    /// # Errors
    /// A scene without Gaussians, or cameras or a kind that do not suit it.
    pub fn for_scene(&self, gaussians: &Gaussians, cameras: &[Camera]) -> Result<Self> {
        if self.times_of_parts == 1 && self.times_of_fine == 1 && (self.kind.is_some() || !cameras.is_empty()) {
            return Ok(*self);
        }
        let sampler = ViewSampler::seen_from(gaussians, self.seed, self.viewpoints(cameras))?;
        // Windows show other parts each, too, but all from one side.
        let windows = self.windows > 0.0 && sampler.faces_one_side();
        let mut settings = self.for_views(sampler.shows_parts() || windows, sampler.given().is_some() || windows);
        if cameras.is_empty() {
            settings.kind = Some(sampler.kind());
        }
        if self.times_of_fine > 1 {
            let side = sufficient_side(&Geometry::new(gaussians), &sampler, self.size)?;
            settings = settings.with_views_of(side);
        }
        Ok(settings)
    }

    /// With views of `side` pixels, in training and in the verification where that has no side of its own, that stand for
    /// the same pictures as before.
    fn with_views_of(&self, side: u32) -> Self {
        let mut settings = Self {
            times_of_fine: 1,
            ..*self
        };
        if side > self.size {
            settings.enlarged = (self.enlarged * self.size as f32 / side as f32).max(1.0);
            settings.size = side;
            settings.verify.size = self.verify.size.or(Some(side));
        }
        settings
    }

    /// The settings for a scene of which views show other parts each, or each the whole; `near` says whether they lie near each
    /// other, among cameras that were given or before one side.
    fn for_views(&self, of_parts: bool, near: bool) -> Self {
        let mut settings = *self;
        let times = std::mem::replace(&mut settings.times_of_parts, 1);
        if !of_parts || times == 1 {
            return settings;
        }
        settings.steps *= times as usize;
        if let Some(extension) = &mut settings.extension {
            extension.after *= times as usize;
            // The second time doubles what is long already, and brings a third of a point.
            extension.most = extension.most.min(1);
        }
        if let Some(stop) = &mut settings.early_stop {
            stop.every *= LOOKS_APART;
            stop.views *= VIEWS_OF_PARTS;
        }
        if let Optimizer::PreconditionedSgd(sgd) = &mut settings.optimizer
            && !near
        {
            sgd.length *= times as f32;
        }
        settings
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embed::Preset;
    use crate::sample::sample;
    use crate::view::SceneKind;

    #[test]
    fn views_of_parts_take_more_and_longer_steps() {
        let standard = Preset::Standard.settings();
        let whole = standard.for_views(false, false);
        assert_eq!((whole.steps, whole.times_of_parts), (standard.steps, 1));
        let [parts, near] = [false, true].map(|near| standard.for_views(true, near));
        assert_eq!((parts.steps, near.steps), (2 * standard.steps, 2 * standard.steps));
        assert_eq!(parts.extension.unwrap().after, 2 * standard.extension.unwrap().after);
        let views = |settings: &Settings| settings.verify.views + settings.early_stop.unwrap().views;
        assert_eq!(views(&parts), standard.views_looked_at());
        assert!(views(&whole) < views(&parts));
        let length = |settings: &Settings| match settings.optimizer {
            Optimizer::PreconditionedSgd(sgd) => sgd.length,
            Optimizer::Adam(_) => f32::NAN,
        };
        assert_eq!(length(&parts), 2.0 * length(&standard));
        assert_eq!(length(&near), length(&standard));
        let paper = Preset::Paper.settings();
        assert_eq!(paper.for_views(true, false), paper);
        assert!(standard.overridden(r#"{"times_of_parts": 0}"#).is_err());
    }

    #[test]
    fn fine_views_stand_for_the_same_pictures() {
        let standard = Preset::Standard.settings();
        let fine = standard.with_views_of(2 * standard.size);
        assert_eq!(
            fine.size as f32 * fine.enlarged,
            standard.size as f32 * standard.enlarged
        );
        assert_eq!(fine.verify.size, Some(fine.size));
        assert_eq!(standard.with_views_of(standard.size).verify, standard.verify);
    }

    #[test]
    fn settings_for_a_scene_are_found_once() {
        let scene = sample(200, 0, 1).unwrap().gaussians;
        let standard = Preset::Standard.settings();
        let found = standard.for_scene(&scene, &[]).unwrap();
        assert_eq!(found.kind, Some(SceneKind::Object));
        assert_eq!(found.for_scene(&scene, &[]).unwrap(), found);
    }
}
