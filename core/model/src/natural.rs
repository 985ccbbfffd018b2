//! The order of names with numbers in them: `2.jpg` before `10.jpg`.

use std::cmp::Ordering;

/// Orders paths folder by folder. Of two names, the first difference counts; digits there count as a number.
pub fn natural(one: &str, other: &str) -> Ordering {
    let (mut left, mut right) = (one.as_bytes(), other.as_bytes());
    while let (Some(&a), Some(&b)) = (left.first(), right.first()) {
        if a.is_ascii_digit() && b.is_ascii_digit() {
            let number = |text: &[u8]| text.iter().take_while(|byte| byte.is_ascii_digit()).count();
            let (ends, zeros) =
                ([number(left), number(right)], |text: &[u8]| text.iter().take_while(|byte| **byte == b'0').count());
            let (a, b) = (&left[zeros(left).min(ends[0])..ends[0]], &right[zeros(right).min(ends[1])..ends[1]]);
            match a.len().cmp(&b.len()).then_with(|| a.cmp(b)) {
                Ordering::Equal => (left, right) = (&left[ends[0]..], &right[ends[1]..]),
                order => return order,
            }
        } else if a == b {
            (left, right) = (&left[1..], &right[1..]);
        } else {
            // The files of a folder stay together.
            let rank = |byte: u8| if byte == b'/' { 0 } else { byte };
            return rank(a).cmp(&rank(b));
        }
    }
    left.len().cmp(&right.len()).then_with(|| one.cmp(other))
}
