//! Code for each of the three axes.

/// `[f(0), f(1), f(2)]`, written out: a closure would be compiled without the CPU features of the
/// function around it, and then not be inlined.
macro_rules! each_axis {
    ($a:ident => $body:expr) => {
        [
            {
                let $a = 0_usize;
                $body
            },
            {
                let $a = 1_usize;
                $body
            },
            {
                let $a = 2_usize;
                $body
            },
        ]
    };
}
pub(super) use each_axis;
