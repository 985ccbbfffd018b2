//! The letters of three alphabets, digits and signs as strokes.

/// One letter or sign: its strokes, with x from 0 and y from 0 at the capitals' top to 1 at the baseline, in heights of
/// a capital, and the distance to the next letter.
#[derive(Debug, Clone, PartialEq)]
pub struct Glyph {
    /// Polylines; a dot is a stroke of two equal points.
    pub strokes: Vec<Vec<[f32; 2]>>,
    /// Width without the gap to the next letter.
    pub width: f32,
}

/// Width of a quarter of a normal letter, in heights of a capital.
const QUARTER: f32 = 0.145;

/// Letters with their widths in quarters and their strokes, separated by spaces. A stroke is a list of points of a
/// grid: a digit for x in quarters of the letter's width, and a letter for y in sixths of a capital's height. A capital
/// letter for y marks a point beside the line, which bends it (a quadratic spline).
const LETTERS: &[(char, f32, &str)] = &[
    ('A', 4.4, "0g2a4g 1e3e"),
    ('B', 3.8, "0a0g 0a2a4A4D2d0d 2d4D4G2g0g"),
    ('C', 4.2, "4b4A2a0A0d0G2g4G4f"),
    ('D', 4.2, "0a0g2g4G4d4A2a0a"),
    ('E', 3.4, "4a0a0g4g 0d3d"),
    ('F', 3.2, "4a0a0g 0d3d"),
    ('G', 4.4, "4b4A2a0A0d0G2g4G4e4d2d"),
    ('H', 4.1, "0a0g 4a4g 0d4d"),
    ('I', 0.0, "0a0g"),
    ('J', 2.6, "4a4e4G0G0e"),
    ('K', 4.0, "0a0g 4a0e 1d4g"),
    ('L', 3.2, "0a0g4g"),
    ('M', 5.2, "0g0a2f4a4g"),
    ('N', 4.2, "0g0a4g4a"),
    ('O', 4.6, "2a4A4d4G2g0G0d0A2a"),
    ('P', 3.8, "0g0a2a4A4D2d0d"),
    ('Q', 4.6, "2a4A4d4G2g0G0d0A2a 2e4g"),
    ('R', 4.0, "0g0a2a4A4D2d0d 2d4g"),
    ('S', 3.8, "4b4A2a0A0D2d4D4G2g0G0f"),
    ('T', 4.0, "0a4a 2a2g"),
    ('U', 4.2, "0a0e0G4G4e4a"),
    ('V', 4.3, "0a2g4a"),
    ('W', 6.2, "0a1g2b3g4a"),
    ('X', 4.1, "0a4g 4a0g"),
    ('Y', 4.1, "0a2d4a 2d2g"),
    ('Z', 3.8, "0a4a0g4g"),
    ('a', 3.0, "4e4C2c0C0e0G2g4G4e 4c4g"),
    ('b', 3.1, "0a0g 0e0C2c4C4e4G2g0G0e"),
    ('c', 2.9, "4d4C2c0C0e0G2g4G4f"),
    ('d', 3.1, "4a4g 4e4C2c0C0e0G2g4G4e"),
    ('e', 3.1, "0e4e4C2c0C0e0G2g4G4f"),
    ('f', 1.8, "4a2A2c2g 0c4c"),
    ('g', 3.1, "4e4C2c0C0e0G2g4G4e 4c4h4I2i0I0h"),
    ('h', 3.0, "0a0g 0e0C2c4C4e4g"),
    ('i', 0.0, "0c0g 0a0a"),
    ('j', 1.2, "4c4h4I0I0i 4a4a"),
    ('k', 3.0, "0a0g 4c0e 1e4g"),
    ('l', 0.0, "0a0g"),
    ('m', 5.0, "0c0g 0e0C1c2C2e2g 2e2C3c4C4e4g"),
    ('n', 3.0, "0c0g 0e0C2c4C4e4g"),
    ('o', 3.2, "2c4C4e4G2g0G0e0C2c"),
    ('p', 3.1, "0c0i 0e0C2c4C4e4G2g0G0e"),
    ('q', 3.1, "4c4i 4e4C2c0C0e0G2g4G4e"),
    ('r', 1.9, "0c0g 0e0C3C4c"),
    ('s', 2.7, "4d4C2c0C0E2e4E4G2g0G0f"),
    ('t', 1.8, "2a2e2G4g 0c4c"),
    ('u', 3.0, "0c0e0G2g4G4e 4c4g"),
    ('v', 3.0, "0c2g4c"),
    ('w', 4.8, "0c1g2d3g4c"),
    ('x', 2.9, "0c4g 4c0g"),
    ('y', 3.0, "0c2g 4c2g1i0i"),
    ('z', 2.7, "0c4c0g4g"),
    ('0', 3.5, "2a4A4d4G2g0G0d0A2a"),
    ('1', 1.5, "0b4a4g"),
    ('2', 3.4, "0b0A2a4A4b4D0g4g"),
    ('3', 3.4, "0b0A2a4A4D2d 2d4D4G2g0G0f"),
    ('4', 3.6, "3g3a0e4e"),
    ('5', 3.4, "4a0a0d2c4C4e4G2g0G0f"),
    ('6', 3.5, "4b4A2a0A0d0e0G2g4G4e4C2c0C0e"),
    ('7', 3.3, "0a4a1g"),
    ('8', 3.5, "2a4A4D2d0D0A2a 2d4D4G2g0G0D2d"),
    ('9', 3.5, "0f0G2g4G4d4c4A2a0A0c0E2e4E4c"),
    ('.', 0.0, "0g0g"),
    (',', 0.4, "4g0h"),
    (':', 0.0, "0d0d 0g0g"),
    ('!', 0.0, "0a0e 0g0g"),
    ('-', 1.8, "0d4d"),
    ('+', 2.8, "0d4d 2b2f"),
    ('/', 2.4, "4a0g"),
    ('%', 4.4, "4a0g 1a2A2b2C1c0C0b0A1a 3e4E4f4G3g2G2f2E3e"),
    ('&', 4.2, "4g1b1A2a3A3b0E0f0G2g4e"),
    ('(', 1.0, "4a0C0d0E4h"),
    (')', 1.0, "0a4C4d4E0h"),
    ('*', 2.4, "2a2c 0a4c 4a0c"),
    ('Γ', 3.2, "0g0a4a"),
    ('Δ', 4.4, "2a4g0g2a"),
    ('Θ', 4.6, "2a4A4d4G2g0G0d0A2a 1d3d"),
    ('Λ', 4.3, "0g2a4g"),
    ('Ξ', 3.6, "0a4a 1d3d 0g4g"),
    ('Π', 4.1, "0g0a4a4g"),
    ('Σ', 3.6, "4a0a2d0g4g"),
    ('Φ', 4.6, "2a2g 2b4B4d4F2f0F0d0B2b"),
    ('Ψ', 4.4, "0a0c0E4E4c4a 2a2g"),
    ('Ω', 4.6, "0g1g1f0E0c0A2a4A4c4E3f3g4g"),
    ('α', 3.3, "4c3G2g0G0e0C2c3C4g"),
    ('β', 3.1, "0i0b0A2a4A4D2d 2d4D4G2g0f"),
    ('γ', 3.0, "0c2g4c 2g2i"),
    ('δ', 3.1, "4b2A0A4D4e4G2g0G0e0C3c"),
    ('ε', 2.7, "4d4C2c0C0E2e 2e0E0G2g4G4f"),
    ('η', 3.0, "0c0g 0e0C2c4C4e4i"),
    ('θ', 3.0, "2a4A4d4G2g0G0d0A2a 0d4d"),
    ('λ', 3.1, "0a1a4g 2d0g"),
    ('μ', 3.0, "0i0c 0e0G2g4G4e 4c4g"),
    ('π', 3.5, "0c4c 1c1g 3c3g"),
    ('ρ', 3.1, "0i0e0C2c4C4e4G2g0G0e"),
    ('σ', 3.4, "4c2c0C0e0G2g4G4e4C2c"),
    ('τ', 2.6, "0c4c 2c2f2G4g"),
    ('φ', 3.8, "2b2i 2c4C4e4G2g0G0e0C2c"),
    ('ψ', 3.6, "0c0e0G4G4e4c 2b2i"),
    ('ω', 4.4, "1c0D0e0G1g2G2e2G3g4G4e4D3c"),
    ('Б', 3.8, "4a0a0g2g4G4D2d0d"),
    ('Д', 4.6, "0h0g4g4h 1g2a3a3g"),
    ('Ж', 5.6, "2a2g 0a4g 4a0g"),
    ('З', 3.4, "0b0A2a4A4D2d1d 2d4D4G2g0G0f"),
    ('И', 4.2, "0a0g4a4g"),
    ('Л', 4.2, "0g1g1a4a4g"),
    ('У', 4.0, "0a2d 4a1g0g"),
    ('Ц', 4.4, "0a0g4g4h 3a3g"),
    ('Ч', 3.8, "0a0D2d4d 4a4g"),
    ('Ш', 5.4, "0a0g4g4a 2a2g"),
    ('Щ', 5.6, "0a0g4g4h 3a3g 1a1g"),
    ('Ы', 5.2, "0a0g1g2G2D1d0d 4a4g"),
    ('Ь', 3.6, "0a0g2g4G4D2d0d"),
    ('Э', 4.2, "0b0A2a4A4d4G2g0G0f 2d4d"),
    ('Ю', 6.0, "0a0g 0d1d 3a4A4d4G3g1G1d1A3a"),
    ('Я', 4.0, "4g4a2a0A0D2d4d 2d0g"),
];

/// Capital letters that other alphabets share with the Latin one, and the Latin letters of the same form.
const SHARED: &[(char, char)] = &[
    ('Α', 'A'),
    ('Β', 'B'),
    ('Ε', 'E'),
    ('Η', 'H'),
    ('Ι', 'I'),
    ('Κ', 'K'),
    ('Μ', 'M'),
    ('Ν', 'N'),
    ('Ο', 'O'),
    ('Ρ', 'P'),
    ('Τ', 'T'),
    ('Υ', 'Y'),
    ('Χ', 'X'),
    ('Ζ', 'Z'),
    ('υ', 'u'),
    ('χ', 'x'),
    ('ζ', 'ε'),
    ('ξ', 'ε'),
    ('ι', 'l'),
    ('κ', 'k'),
    ('ν', 'v'),
    ('ο', 'o'),
    ('А', 'A'),
    ('В', 'B'),
    ('Г', 'Γ'),
    ('Е', 'E'),
    ('К', 'K'),
    ('М', 'M'),
    ('Н', 'H'),
    ('О', 'O'),
    ('П', 'Π'),
    ('Р', 'P'),
    ('С', 'C'),
    ('Т', 'T'),
    ('Ф', 'Φ'),
    ('Х', 'X'),
];

/// Small Cyrillic letters that look like Latin ones. The others look like small capitals.
const SMALL: &[(char, char)] = &[('а', 'a'), ('е', 'e'), ('о', 'o'), ('р', 'p'), ('с', 'c'), ('у', 'y'), ('х', 'x')];

/// Straight pieces of one bend.
const BEND_STEPS: usize = 5;

/// The letter of a character; none for characters without strokes. A space is a letter without strokes.
pub fn letter(character: char) -> Option<Glyph> {
    if character == ' ' {
        return Some(Glyph { strokes: Vec::new(), width: 0.12 });
    }
    let same = |table: &[(char, char)]| table.iter().find(|(own, _)| *own == character).map(|(_, latin)| *latin);
    if let Some(latin) = same(SHARED).or_else(|| same(SMALL)) {
        return letter(latin);
    }
    if let Some((_, width, strokes)) = LETTERS.iter().find(|(own, ..)| *own == character) {
        let width = width * QUARTER;
        return Some(Glyph { strokes: strokes.split(' ').map(|stroke| spline(stroke, width)).collect(), width });
    }
    // A small Cyrillic letter: the capital at the height of small letters.
    let capital = ('а'..='я').contains(&character).then(|| character.to_uppercase().next()).flatten()?;
    let mut glyph = letter(capital)?;
    for point in glyph.strokes.iter_mut().flatten() {
        *point = [0.78 * point[0], 1.0 - (1.0 - point[1]) * 2.0 / 3.0];
    }
    glyph.width *= 0.78;
    Some(glyph)
}

/// The letters of a text, without the characters that have no strokes.
pub fn letters(text: &str) -> Vec<Glyph> {
    text.chars().filter_map(letter).collect()
}

/// The polyline of a stroke.
fn spline(stroke: &str, width: f32) -> Vec<[f32; 2]> {
    let points: Vec<([f32; 2], bool)> = stroke
        .as_bytes()
        .chunks_exact(2)
        .map(|pair| {
            let row = pair[1].to_ascii_lowercase() - b'a';
            ([f32::from(pair[0] - b'0') / 4.0 * width, f32::from(row) / 6.0], pair[1].is_ascii_lowercase())
        })
        .collect();
    let mut line = vec![points[0].0];
    let mut bend: Option<[f32; 2]> = None;
    for &(point, is_on) in &points[1..] {
        let start = line[line.len() - 1];
        match (bend, is_on) {
            (None, true) => line.push(point),
            (None, false) => bend = Some(point),
            (Some(control), true) => {
                curve(&mut line, [start, control, point]);
                bend = None;
            }
            (Some(control), false) => {
                let middle = [(control[0] + point[0]) / 2.0, (control[1] + point[1]) / 2.0];
                curve(&mut line, [start, control, middle]);
                bend = Some(point);
            }
        }
    }
    line
}

/// Adds a quadratic curve, without its start.
fn curve(line: &mut Vec<[f32; 2]>, [a, b, c]: [[f32; 2]; 3]) {
    for i in 1..=BEND_STEPS {
        let t = i as f32 / BEND_STEPS as f32;
        let s = 1.0 - t;
        line.push(std::array::from_fn(|k| s * s * a[k] + 2.0 * s * t * b[k] + t * t * c[k]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_has_strokes_of_its_own() {
        let mut seen: Vec<(char, Glyph)> = Vec::new();
        for (character, ..) in LETTERS {
            let glyph = letter(*character).expect("in the table");
            assert!(!glyph.strokes.is_empty() && glyph.strokes.iter().all(|stroke| stroke.len() >= 2), "{character}");
            for [x, y] in glyph.strokes.iter().flatten() {
                assert!((-1e-6..=glyph.width + 1e-6).contains(x) && (0.0..=1.4).contains(y), "{character}: {x} {y}");
            }
            for (other, known) in &seen {
                let pair = (*other, *character);
                // In print, a capital i and a small L are one stroke.
                assert!(known != &glyph || pair == ('I', 'l'), "{pair:?}");
            }
            seen.push((*character, glyph));
        }
    }

    #[test]
    fn alphabets_are_complete() {
        let complete = |text: &str| assert_eq!(letters(text).len(), text.chars().count(), "{text}");
        complete("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789 .,:!-+/%&()*");
        complete("ΑΒΓΔΕΖΗΘΙΚΛΜΝΞΟΠΡΣΤΥΦΧΨΩαβγδεζηθικλμνξοπρστυφχψω");
        complete("АБВГДЕЖЗИКЛМНОПРСТУФХЦЧШЩЫЬЭЮЯабвгдежзиклмнопрстуфхцчшщыьэюя");
        assert!(letter('好').is_none());
    }

    #[test]
    fn bends_pass_through_their_ends_and_stay_in_their_triangle() {
        // A quarter of a circle, nearly: its middle is half way between the chord's middle and the control point.
        let line = spline("0a4A4g", 1.0);
        assert_eq!((line[0], line[line.len() - 1]), ([0.0, 0.0], [1.0, 1.0]));
        assert!(line.iter().all(|[x, y]| x >= y), "{line:?}");
        assert!(line.windows(2).all(|pair| pair[1][0] >= pair[0][0] && pair[1][1] >= pair[0][1]), "{line:?}");
    }
}
