//! What is guessed to have been done to the tones of pictures: one tone, by factors of which one is near enough.
use guardsplat_codeword::Tone;

/// Weights of red, green and blue in a pixel's grey (ITU-R BT.601).
pub(super) const GREY: [f32; 3] = [0.299, 0.587, 0.114];

/// A kind of tone that is looked for.
struct Sought {
    /// Makes one of a factor.
    tone: fn(f32) -> Tone,
    /// How far factors reach, either way.
    reach: f32,
    /// The ratio of one to the next: most marks are read when the factor is right to a twentieth, those of smooth scenes when
    /// it is to a fiftieth.
    ratio: f32,
}

/// How far from 1 people go most often; there factors lie twice as near to each other.
const OFTEN: f32 = 1.3;

const SOUGHT: [Sought; 4] = [
    sought(Tone::Brightness, 2.2, 1.07),
    sought(Tone::Gamma, 2.2, 1.1),
    sought(Tone::Contrast, 2.2, 1.1),
    sought(Tone::Saturation, 2.0, 1.15),
];

const fn sought(tone: fn(f32) -> Tone, reach: f32, ratio: f32) -> Sought {
    Sought { tone, reach, ratio }
}

/// All factors of all kinds.
pub(super) fn all() -> Vec<Tone> {
    let mut all = Vec::new();
    for Sought { tone, reach, ratio } in SOUGHT {
        let steps = 2 * (reach.ln() / ratio.ln()).ceil() as i32;
        let factor = |half: i32| ratio.powf(0.5 * half as f32);
        let is_tried = |half: &i32| *half != 0 && (half % 2 == 0 || factor(half.abs()) <= OFTEN);
        all.extend((-steps..=steps).filter(is_tried).map(|half| tone(factor(half))));
    }
    all
}

/// The grey of a pixel.
#[inline(always)]
pub(super) fn grey([red, green, blue]: &[f32; 3]) -> f32 {
    red * GREY[0] + green * GREY[1] + blue * GREY[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_reach_twice_and_half() {
        for Sought { tone, .. } in SOUGHT {
            let of_kind = |t: &&Tone| std::mem::discriminant(*t) == std::mem::discriminant(&tone(1.0));
            let all = all();
            let found = |f: f32| all.iter().filter(of_kind).any(|t| *t == tone(f));
            assert!(!found(1.0));
            let (least, most) = all
                .iter()
                .filter(of_kind)
                .fold((f32::MAX, 0.0_f32), |(least, most), t| {
                    let (Tone::Brightness(f) | Tone::Gamma(f) | Tone::Contrast(f) | Tone::Saturation(f)) = t;
                    (least.min(*f), most.max(*f))
                });
            assert!(least <= 0.5 && most >= 2.0, "{least} {most}");
        }
    }
}
