//! One and eight lanes of arithmetic with the same bits on every processor.
//!
//! Numeric code is written once, generic over [`Real`] (one or eight lanes, whichever is faster) or [`Wide`] (always
//! eight lanes), and wrapped in a [`Task`]. [`Processor::run`] picks the instruction set and runs the task.
//! [`functions`] has elementary functions made of IEEE basic operations, [`Vec3`] is a small vector over any number of
//! lanes.
//!
//! **Soundness.** The lane types of an instruction set are private. Code gets them only as type arguments of a task
//! that [`Processor::run`] started after the instruction set was detected, so none of their safe methods can execute an
//! instruction that the processor lacks. Only `processor.rs` detects instruction sets.
//!
//! **Invariant.** Every operation is an IEEE operation on one lane, rounded once, and fused only in [`Wide::mul_add`].
//! So all instruction sets give the same bits.

#[cfg(target_arch = "x86_64")]
mod avx2;
pub mod functions;
mod processor;
mod real;
mod scalar;
mod vec3;
mod wide;

pub use processor::{Processor, Simd, Task, prefetch};
pub use real::{Int, Mask, Real, at_least, at_most, complement, inverse, max, min};
pub use vec3::{Basis, Rgb, Vec3, vec3};
pub use wide::{Column, WIDTH, Wide};
