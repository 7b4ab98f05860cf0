//! What marks can be trained to stand, by the names that people give.
use clap::ValueEnum;
use guardsplat_proto::v1::EmbedSpec;
use guardsplat_proto::v1::embed_spec::Distortion as Api;

/// What is done to scenes or their pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Distortion {
    /// Everything that is known
    All,
    /// A window of the picture is left
    Crop,
    /// Pictures are stored smaller or larger
    Scaling,
    /// Pictures are turned about their centre
    Rotation,
    /// Colours times a factor
    Brightness,
    /// Colours moved from or towards the mean grey
    Contrast,
    /// Pictures are compressed
    Jpeg,
    /// Noise on every pixel
    Noise,
    /// A blur of three pixels
    Blur,
    /// Parts of pictures are covered
    Mask,
    /// Pictures are stored in 8 bits
    #[value(name = "8bit")]
    EightBit,
    /// Crop, brightness and JPEG
    Combined,
    /// Noise on the spherical harmonics
    ShNoise,
    /// Higher spherical harmonics are dropped
    ShTruncation,
    /// The scene is stored as SPZ
    Spz,
    /// The scene is stored as SOG
    Sog,
    /// The scene loses Gaussians
    Pruning,
}

impl Distortion {
    fn api(self) -> Option<Api> {
        Some(match self {
            Self::All => return None,
            Self::Crop => Api::Crop,
            Self::Scaling => Api::Scaling,
            Self::Rotation => Api::Rotation,
            Self::Brightness => Api::Brightness,
            Self::Contrast => Api::Contrast,
            Self::Jpeg => Api::Jpeg,
            Self::Noise => Api::Noise,
            Self::Blur => Api::Blur,
            Self::Mask => Api::Mask,
            Self::EightBit => Api::EightBit,
            Self::Combined => Api::Combined,
            Self::ShNoise => Api::ShNoise,
            Self::ShTruncation => Api::ShTruncation,
            Self::Spz => Api::Spz,
            Self::Sog => Api::Sog,
            Self::Pruning => Api::Pruning,
        })
    }

    fn name(self) -> String {
        self.to_possible_value()
            .map_or_else(String::new, |value| value.get_name().into())
    }
}

/// As the API has them, each once; `all` among them stands for all.
pub fn named(list: &[Distortion]) -> Vec<i32> {
    let all = list.contains(&Distortion::All);
    let chosen = Distortion::value_variants()
        .iter()
        .filter(|one| all || list.contains(one));
    chosen.filter_map(|one| one.api()).map(i32::from).collect()
}

/// Names of those that a job was given.
pub fn names(spec: &EmbedSpec) -> Vec<String> {
    let all = Distortion::value_variants();
    let name = |given: Api| {
        let known = all.iter().find(|one| one.api() == Some(given));
        known.map_or_else(|| given.as_str_name().to_lowercase(), |one| one.name())
    };
    spec.robust_to().map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_that_the_api_has_can_be_named() {
        let all = named(&[Distortion::Jpeg, Distortion::All]);
        // Numbered without gaps, so the next one is unknown.
        assert_eq!(all, (1..=16).collect::<Vec<_>>());
        assert!(Api::try_from(17).is_err());
        let spec = EmbedSpec {
            robust_to: named(&[Distortion::EightBit, Distortion::ShTruncation, Distortion::EightBit]),
            ..EmbedSpec::default()
        };
        assert_eq!(names(&spec), ["8bit", "sh-truncation"]);
    }
}
