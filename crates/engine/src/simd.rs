//! Loops compiled for several instruction sets, of which the widest is run that the processor has.
//!
//! Loops are plain Rust over arrays of lanes, which the compiler turns into vector instructions. `pulp` brings AVX2; its
//! AVX-512 is a feature that has burn built anew for processors that few have, so that set alone is here. Every set has AVX-512's or AVX2's fused multiplication and addition, or neither: sums of
//! products then differ in their last bit between sets. On one machine the same set is always chosen.

/// A loop, with what it works on.
pub(crate) trait Vectorised {
    /// What it returns.
    type Output;

    /// Runs it. Inlined into a function of each instruction set; `FUSED` says whether the set multiplies and adds in one
    /// instruction ([`multiply_add`]).
    fn run<const FUSED: bool>(self) -> Self::Output;
}

/// `a * b + c`, rounded once where that is one instruction, else twice: a fused one in software takes a hundred times as
/// long.
#[inline(always)]
pub(crate) fn multiply_add<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Vector instructions that this processor has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instructions(Set);

/// Private, so that nobody names a set that was not found.
#[derive(Clone, Copy, Debug)]
enum Set {
    /// 16 lanes, fused.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// 8 lanes, fused.
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    /// What every processor of the architecture has: SSE2, NEON.
    Baseline,
}

impl Instructions {
    /// All sets of this processor, the widest first.
    pub fn present() -> impl Iterator<Item = Self> {
        #[cfg(target_arch = "x86_64")]
        let found = [
            (is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("fma"))
            .then_some(Set::Avx512),
            pulp::x86::V3::try_new().map(Set::Avx2),
            Some(Set::Baseline),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let found = [Some(Set::Baseline)];
        found.into_iter().flatten().map(Self)
    }

    /// The widest set of this processor.
    pub fn widest() -> Self {
        Self::present().next().unwrap_or(Self(Set::Baseline))
    }

    /// Runs a loop with these instructions.
    #[allow(unsafe_code)]
    pub fn run<V: Vectorised>(self, work: V) -> V::Output {
        match self.0 {
            // SAFETY: `present` found these instructions, and nothing else makes this variant.
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => unsafe { avx512(work) },
            #[cfg(target_arch = "x86_64")]
            Set::Avx2(set) => set.vectorize(Fused(work)),
            Set::Baseline => work.run::<{ cfg!(target_arch = "aarch64") }>(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
fn avx512<V: Vectorised>(work: V) -> V::Output {
    work.run::<true>()
}

#[cfg(target_arch = "x86_64")]
struct Fused<V>(V);

#[cfg(target_arch = "x86_64")]
impl<V: Vectorised> pulp::NullaryFnOnce for Fused<V> {
    type Output = V::Output;

    #[inline(always)]
    fn call(self) -> V::Output {
        self.0.run::<true>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Product;

    impl Vectorised for Product {
        type Output = f32;

        #[inline(always)]
        fn run<const FUSED: bool>(self) -> f32 {
            let a = std::hint::black_box(1.0 + f32::EPSILON);
            multiply_add::<FUSED>(a, a, -1.0 - 2.0 * f32::EPSILON)
        }
    }

    #[test]
    fn wide_sets_keep_what_rounding_a_product_would_lose() {
        for set in Instructions::present() {
            let left = set.run(Product);
            let fused = !matches!(set.0, Set::Baseline) || cfg!(target_arch = "aarch64");
            assert_eq!(left, if fused { f32::EPSILON.powi(2) } else { 0.0 }, "{set:?}");
        }
        assert!(matches!(
            Instructions::present().last(),
            Some(Instructions(Set::Baseline))
        ));
    }
}
