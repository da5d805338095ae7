//! How many multiply-adds a core can do at most: independent chains in registers, nothing else.

/// Multiply-adds of double precision a second on one core, with the widest vectors; `None` on a processor without any that
/// this program knows.
pub fn multiply_adds_per_s() -> Option<f64> {
    #[cfg(target_arch = "x86_64")]
    {
        let mut found: Option<f64> = None;
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the processor has both, as just asked.
            found = Some(rate(4, || unsafe { x86::chains_of_four() }));
        }
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the processor has it, as just asked.
            let eight = rate(8, || unsafe { x86::chains_of_eight() });
            found = Some(found.map_or(eight, |four| four.max(eight)));
        }
        found
    }
    #[cfg(not(target_arch = "x86_64"))]
    None
}

#[cfg(target_arch = "x86_64")]
fn rate(lanes: usize, mut work: impl FnMut()) -> f64 {
    (x86::ROUNDS * x86::CHAINS * lanes) as f64 / crate::watch::best(&mut work).on_core_s
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;
    use std::hint::black_box;

    /// More than two units times four cycles of latency need.
    pub const CHAINS: usize = 12;
    pub const ROUNDS: usize = 1_000_000;

    macro_rules! chains {
        ($name:ident, $features:literal, $splat:ident, $multiply_add:ident) => {
            #[target_feature(enable = $features)]
            pub fn $name() {
                let (factor, addend) = ($splat(black_box(0.999_999)), $splat(black_box(1e-6)));
                let mut chains = [$splat(black_box(1.0)); CHAINS];
                for _ in 0..ROUNDS {
                    let mut chain = 0;
                    while chain < CHAINS {
                        chains[chain] = $multiply_add(chains[chain], factor, addend);
                        chain += 1;
                    }
                }
                black_box(chains);
            }
        };
    }

    chains!(chains_of_four, "avx2,fma", _mm256_set1_pd, _mm256_fmadd_pd);
    chains!(chains_of_eight, "avx512f", _mm512_set1_pd, _mm512_fmadd_pd);
}
