//! Vectors of four values (AVX2) and of eight values (AVX-512), one trial per lane.
//!
//! They are written with intrinsics because only intrinsics gave both the choice of instructions at run time and the speed:
//! the compiler vectorised plain arrays in pieces, and the code was six times slower. Every operation is the IEEE operation
//! that `f64` does, so each lane has the same bits as the scalar code.
//!
//! # Safety
//! The intrinsics need a processor that supports them. The types are private to the crate. Only `wrist::simulate` uses them,
//! and it checks the processor first; no other code may construct them.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::lanes::Lanes;
use super::traits::{Number, Plain};

macro_rules! vector {
    ($(#[$doc:meta])* $name:ident, $register:ty, $lanes:literal, $add:ident, $sub:ident, $mul:ident, $div:ident,
     $max:ident, $min:ident, $fused:ident, $splat:ident, $load:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy)]
        #[repr(transparent)]
        pub struct $name($register);

        vector!(@operator $name, Add, add, $add);
        vector!(@operator $name, Sub, sub, $sub);
        vector!(@operator $name, Mul, mul, $mul);
        vector!(@operator $name, Div, div, $div);

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self::splat(-0.0) - self
            }
        }

        impl Number for $name {
            type Plain = Self;
            #[inline(always)]
            fn lift(value: Self) -> Self {
                value
            }
            #[inline(always)]
            fn plain(self) -> Self {
                self
            }
            #[inline(always)]
            fn times(self, factor: Self) -> Self {
                self * factor
            }
            #[inline(always)]
            fn chain(self, value: Self, _slope: Self) -> Self {
                value
            }
        }

        impl Lanes for $name {
            const LANES: usize = $lanes;
            #[inline(always)]
            fn splat(value: f64) -> Self {
                // SAFETY: the processor has the instruction (module docs, Safety).
                Self(unsafe { $splat(value) })
            }
            #[inline(always)]
            fn load(values: &[f64]) -> Self {
                assert!(values.len() >= $lanes);
                // SAFETY: the slice holds a full vector, alignment is not required, and the processor has the instruction.
                Self(unsafe { $load(values.as_ptr()) })
            }
            #[inline(always)]
            fn lane(self, lane: usize) -> f64 {
                // SAFETY: the register and the array have the same size, and every bit pattern is an f64.
                let values: [f64; $lanes] = unsafe { std::mem::transmute(self.0) };
                values[lane]
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // SAFETY: the processor has the instruction (module docs, Safety).
                Self(unsafe { $max(self.0, other.0) })
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                // SAFETY: the processor has the instruction (module docs, Safety).
                Self(unsafe { $min(self.0, other.0) })
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                // SAFETY: the processor has the instruction (module docs, Safety).
                Self(unsafe { $fused(self.0, factor.0, addend.0) })
            }
            #[inline(always)]
            fn any_positive(self) -> bool {
                self.has_positive()
            }
            #[inline(always)]
            fn where_positive(self, yes: Self, no: Self) -> Self {
                self.select(yes, no)
            }
            #[inline(always)]
            fn times_power_of_two(self, shifted: Self) -> Self {
                self.add_exponent(shifted)
            }
        }

        impl Plain for $name {}
    };
    (@operator $name:ident, $trait:ident, $method:ident, $instruction:ident) => {
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: the processor has the instruction (module docs, Safety).
                Self(unsafe { $instruction(self.0, other.0) })
            }
        }
    };
}

vector!(
    /// Four values (AVX2 and FMA).
    Four, __m256d, 4, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_div_pd,
    _mm256_max_pd, _mm256_min_pd, _mm256_fmadd_pd, _mm256_set1_pd, _mm256_loadu_pd
);
vector!(
    /// Eight values (AVX-512).
    Eight, __m512d, 8, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_div_pd,
    _mm512_max_pd, _mm512_min_pd, _mm512_fmadd_pd, _mm512_set1_pd, _mm512_loadu_pd
);

impl Four {
    #[inline(always)]
    fn has_positive(self) -> bool {
        // SAFETY: the processor has AVX2 (module docs, Safety).
        unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(self.0, _mm256_setzero_pd())) != 0 }
    }

    #[inline(always)]
    fn select(self, yes: Self, no: Self) -> Self {
        // SAFETY: the processor has AVX2 (module docs, Safety).
        unsafe {
            let positive = _mm256_cmp_pd::<_CMP_GT_OQ>(self.0, _mm256_setzero_pd());
            Self(_mm256_blendv_pd(no.0, yes.0, positive))
        }
    }

    #[inline(always)]
    fn add_exponent(self, shifted: Self) -> Self {
        // SAFETY: the processor has AVX2 (module docs, Safety).
        unsafe {
            let exponent = _mm256_slli_epi64::<52>(_mm256_castpd_si256(shifted.0));
            Self(_mm256_castsi256_pd(_mm256_add_epi64(_mm256_castpd_si256(self.0), exponent)))
        }
    }
}

impl Eight {
    #[inline(always)]
    fn has_positive(self) -> bool {
        // SAFETY: the processor has AVX-512 (module docs, Safety).
        unsafe { _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, _mm512_setzero_pd()) != 0 }
    }

    #[inline(always)]
    fn select(self, yes: Self, no: Self) -> Self {
        // SAFETY: the processor has AVX-512 (module docs, Safety).
        unsafe {
            let positive = _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, _mm512_setzero_pd());
            Self(_mm512_mask_blend_pd(positive, no.0, yes.0))
        }
    }

    #[inline(always)]
    fn add_exponent(self, shifted: Self) -> Self {
        // SAFETY: the processor has AVX-512 (module docs, Safety).
        unsafe {
            let exponent = _mm512_slli_epi64::<52>(_mm512_castpd_si512(shifted.0));
            Self(_mm512_castsi512_pd(_mm512_add_epi64(_mm512_castpd_si512(self.0), exponent)))
        }
    }
}
