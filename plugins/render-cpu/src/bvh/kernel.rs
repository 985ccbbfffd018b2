//! Choosing between the portable and the AVX2 lanes at run time.

#[cfg(target_arch = "x86_64")]
use super::lanes::Avx2;
use super::lanes::{Lanes, Portable};

/// Work that can be done on any lanes.
pub(super) trait Task {
    type Out;

    /// Implementations are `#[inline(always)]`, so that they are compiled for the caller's CPU.
    ///
    /// # Safety
    /// The CPU has the features of `L`.
    unsafe fn run<L: Lanes>(self) -> Self::Out;
}

/// Which lanes to use; an `Avx2` only exists where the CPU has it and FMA.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Kernel {
    /// The fastest this CPU has.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            return Self::Avx2;
        }
        Self::Portable
    }

    /// Does the task: one predictable branch and a call.
    #[inline]
    pub fn run<T: Task>(self, task: T) -> T::Out {
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma")]
        fn with_avx2<T: Task>(task: T) -> T::Out {
            // SAFETY: this function is compiled, and only called, for CPUs with AVX2 and FMA.
            unsafe { task.run::<Avx2>() }
        }
        match self {
            // SAFETY: portable lanes need no feature.
            Self::Portable => unsafe { task.run::<Portable>() },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detect` made this value.
            Self::Avx2 => unsafe { with_avx2(task) },
        }
    }
}
