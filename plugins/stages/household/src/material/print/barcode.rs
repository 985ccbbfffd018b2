//! EAN-13 bar codes, with digits that have their check digit, and squares of modules.

use super::glyph::letters;
use super::text::flush_left;
use super::typeface::Typeface;
use crate::material::{MaterialCanvas, PrintFinish, SrgbColor};
use syntable_model::random::Stream;

/// Modules of the seven-module digits of the left half, odd parity, most significant first.
const ODD: [u8; 10] = [0x0d, 0x19, 0x13, 0x3d, 0x23, 0x31, 0x2f, 0x3b, 0x37, 0x0b];
/// Digits of the left half that have even parity, by first digit; bit 5 belongs to the second digit.
const PARITY: [u8; 10] = [0x00, 0x0b, 0x0d, 0x0e, 0x13, 0x19, 0x1c, 0x15, 0x16, 0x1a];
/// Width of a code with its quiet zones, modules.
const MODULES: f32 = 113.0;

/// Thirteen random digits, the last of them the check digit.
pub fn article_number(stream: &mut Stream) -> [u8; 13] {
    let mut digits: [u8; 13] = std::array::from_fn(|_| stream.below(10) as u8);
    let sum: u32 = (0..12).map(|i| u32::from(digits[i]) * if i % 2 == 1 { 3 } else { 1 }).sum();
    digits[12] = ((10 - sum % 10) % 10) as u8;
    digits
}

/// The 95 modules of a number, dark ones set.
pub fn modules(digits: &[u8; 13]) -> Vec<bool> {
    let mut dark = vec![true, false, true];
    let mut push = |pattern: u8| dark.extend((0..7).rev().map(|bit| pattern >> bit & 1 == 1));
    let parity = PARITY[usize::from(digits[0])];
    for (i, digit) in digits[1..7].iter().enumerate() {
        let odd = ODD[usize::from(*digit)];
        let is_even = parity >> (5 - i) & 1 == 1;
        // Even parity is the right half's pattern from back to front.
        push(if is_even { (!odd & 0x7f).reverse_bits() >> 1 } else { odd });
    }
    dark.extend([false, true, false, true, false]);
    let mut push = |pattern: u8| dark.extend((0..7).rev().map(|bit| pattern >> bit & 1 == 1));
    digits[7..].iter().for_each(|digit| push(!ODD[usize::from(*digit)] & 0x7f));
    dark.extend([true, false, true]);
    dark
}

/// A bar code with its digits on white in a box.
pub fn bar_code(canvas: &mut MaterialCanvas, stream: &mut Stream, face: &Typeface, r: [f32; 4]) {
    let before = canvas.set_finish(PrintFinish::matt(0.5));
    let digits = article_number(stream);
    canvas.rect(r, 0.0, [0.96; 3]);
    let module = (r[2] - r[0]) / MODULES;
    let height = r[3] - r[1];
    let ink = [0.06; 3];
    for (i, _) in modules(&digits).iter().enumerate().filter(|(_, dark)| **dark) {
        let guard = !(3..=91).contains(&i) || (45..50).contains(&i);
        let x = r[0] + (11.0 + i as f32) * module;
        canvas.rect([x, r[1] + 0.06 * height, x + module, r[1] + if guard { 0.92 } else { 0.8 } * height], 0.0, ink);
    }
    let size = (0.13 * height).min(6.4 * module);
    if size >= 3.0 {
        for (i, digit) in digits.iter().enumerate() {
            let x = match i {
                0 => 4.0,
                1..7 => 15.0 + 7.0 * (i - 1) as f32,
                _ => 61.0 + 7.0 * (i - 7) as f32,
            };
            let text = char::from(b'0' + digit).to_string();
            flush_left(canvas, face, &letters(&text), [r[0] + x * module, r[1] + 0.84 * height], size, ink);
        }
    }
    canvas.set_finish(before);
}

/// A square of dark and light modules with three finder squares, as in QR codes. It encodes nothing.
pub fn square_code(canvas: &mut MaterialCanvas, stream: &mut Stream, [x, y]: [f32; 2], edge: f32, ink: SrgbColor) {
    let count = *stream.pick(&[21_usize, 25, 29]).unwrap_or(&21);
    canvas.rect([x, y, x + edge, y + edge], 0.0, [0.96; 3]);
    let module = edge / (count + 2) as f32;
    let cell = |canvas: &mut MaterialCanvas, column: usize, row: usize, size: usize, color: SrgbColor| {
        let (left, top) = (x + (column + 1) as f32 * module, y + (row + 1) as f32 * module);
        canvas.rect([left, top, left + size as f32 * module, top + size as f32 * module], 0.0, color);
    };
    for row in 0..count {
        for column in 0..count {
            let in_finder = (row < 8 && (column < 8 || column >= count - 8)) || (row >= count - 8 && column < 8);
            if stream.chance(0.5) && !in_finder {
                cell(canvas, column, row, 1, ink);
            }
        }
    }
    for [column, row] in [[0, 0], [count - 7, 0], [0, count - 7]] {
        cell(canvas, column, row, 7, ink);
        cell(canvas, column + 1, row + 1, 5, [0.96; 3]);
        cell(canvas, column + 2, row + 2, 3, ink);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn article_numbers_have_their_check_digit() {
        for seed in 0..50 {
            let digits = article_number(&mut Stream::root(seed));
            let weighted = |i: usize| u32::from(digits[i]) * if i.is_multiple_of(2) { 1 } else { 3 };
            assert_eq!((0..13).map(weighted).sum::<u32>() % 10, 0, "{digits:?}");
        }
    }

    #[test]
    fn a_known_number_has_its_known_modules() {
        let dark: String =
            modules(&[5, 9, 0, 1, 2, 3, 4, 1, 2, 3, 4, 5, 7]).iter().map(|d| if *d { '1' } else { '0' }).collect();
        // Digits 9 L, 0 G, 1 G, 2 L, 3 L, 4 G, then 1, 2, 3, 4, 5, 7 R.
        let left = ["0001011", "0100111", "0110011", "0010011", "0111101", "0011101"].concat();
        let right = ["1100110", "1101100", "1000010", "1011100", "1001110", "1000100"].concat();
        assert_eq!(dark, format!("101{left}01010{right}101"));
    }
}
