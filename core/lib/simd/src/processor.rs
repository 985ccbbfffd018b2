//! Detection of instruction sets, and running code on the best one.

use crate::real::Real;
use crate::wide::{Portable, Wide};

/// An instruction set, a type argument of [`Task::run`].
pub trait Simd: sealed::Sealed {
    /// Lanes of the fastest arithmetic: one or eight.
    type Real: Real;
    /// Eight lanes.
    type Wide: Wide;
}

/// Code that is compiled for every instruction set.
pub trait Task {
    /// Result.
    type Output;

    /// Runs the task. Mark implementations and their callees `#[inline(always)]`: a function that is not inlined, such
    /// as some closures, is compiled without the instruction set.
    fn run<S: Simd>(self) -> Self::Output;
}

/// The instruction set that tasks run on: a capability that only detection creates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Processor(InstructionSet);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum InstructionSet {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(avx2::Token),
}

impl Processor {
    /// The fastest instruction set of this processor.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = avx2::Token::detect() {
            return Self(InstructionSet::Avx2(token));
        }
        Self::portable()
    }

    /// Plain Rust, for any processor.
    pub const fn portable() -> Self {
        Self(InstructionSet::Portable)
    }

    /// Name of the instruction set, such as `AVX2 + FMA` or `portable`.
    pub fn name(self) -> &'static str {
        match self.0 {
            InstructionSet::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2(_) => "AVX2 + FMA",
        }
    }

    /// Runs a task: one predictable branch and a call.
    #[inline]
    pub fn run<T: Task>(self, task: T) -> T::Output {
        match self.0 {
            InstructionSet::Portable => task.run::<ScalarCode>(),
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2(token) => token.run(task),
        }
    }
}

/// Prefetches the cache line at any address. A hint without effect on results.
#[inline(always)]
pub fn prefetch<T>(address: *const T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: SSE is part of x86-64, and a prefetch reads nothing.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

/// Plain Rust.
enum ScalarCode {}

impl Simd for ScalarCode {
    type Real = f32;
    type Wide = Portable;
}

mod sealed {
    /// Keeps other crates from making instruction sets.
    pub trait Sealed {}
    impl Sealed for super::ScalarCode {}
    #[cfg(target_arch = "x86_64")]
    impl Sealed for super::avx2::Avx2 {}
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{Simd, Task};
    use crate::avx2::{F32x8, WideF32x8};

    /// AVX2 and FMA.
    pub(super) enum Avx2 {}

    impl Simd for Avx2 {
        type Real = F32x8;
        type Wide = WideF32x8;
    }

    /// Proof that this processor has AVX2 and FMA.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(super) struct Token(());

    impl Token {
        pub fn detect() -> Option<Self> {
            (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")).then_some(Self(()))
        }

        #[inline]
        pub fn run<T: Task>(self, task: T) -> T::Output {
            #[target_feature(enable = "avx2,fma")]
            fn with_avx2<T: Task>(task: T) -> T::Output {
                task.run::<Avx2>()
            }
            // SAFETY: the token proves that the processor has both.
            unsafe { with_avx2(task) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Σ aᵢ bᵢ with one rounding per step, in every lane.
    struct Dot([f32; 8], [f32; 8]);

    impl Task for Dot {
        type Output = [f32; 8];

        #[inline(always)]
        fn run<S: Simd>(self) -> [f32; 8] {
            let (a, b) = (S::Wide::load(&crate::Column(self.0)), S::Wide::load(&crate::Column(self.1)));
            S::Wide::store(S::Wide::mul_add(a, b, S::Wide::splat(1.0))).0
        }
    }

    #[test]
    fn tasks_give_the_same_bits_on_every_instruction_set() {
        let a: [f32; 8] = std::array::from_fn(|i| 0.1 + i as f32);
        let b: [f32; 8] = std::array::from_fn(|i| 1.0 / (3.0 + i as f32));
        let want: [f32; 8] = std::array::from_fn(|i| a[i].mul_add(b[i], 1.0));
        for processor in [Processor::portable(), Processor::detect()] {
            assert_eq!(processor.run(Dot(a, b)), want, "{}", processor.name());
        }
    }
}
