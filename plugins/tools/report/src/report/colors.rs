//! The colors of the style sheet, tested for contrast (WCAG 2.2, success criteria 1.4.3 and 1.4.11).

use std::collections::BTreeMap;

const STYLE: &str = include_str!("page/style.css");

/// Light and dark colors, by name.
fn colors() -> BTreeMap<String, [[f64; 3]; 2]> {
    let lines = STYLE.lines().filter_map(|line| line.trim().strip_prefix("--")?.split_once(": light-dark("));
    lines
        .map(|(name, pair)| {
            let pair: Vec<[f64; 3]> = pair.trim_end_matches(");").split(", ").map(color).collect();
            (name.to_owned(), [pair[0], pair[1]])
        })
        .collect()
}

/// The channels of `#rrggbb`, in [0, 1].
fn color(text: &str) -> [f64; 3] {
    let digits = text.strip_prefix('#').expect("a color");
    assert_eq!(digits.len(), 6, "{text}");
    std::array::from_fn(|channel| {
        f64::from(u8::from_str_radix(&digits[2 * channel..2 * channel + 2], 16).expect("digits")) / 255.0
    })
}

/// Relative luminance (WCAG 2.2, definition).
fn luminance(color: [f64; 3]) -> f64 {
    let linear = |value: f64| if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) };
    let [red, green, blue] = color.map(linear);
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

fn contrast(a: [f64; 3], b: [f64; 3]) -> f64 {
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

#[test]
fn the_formula_gives_known_ratios() {
    let of = |a, b| contrast(color(a), color(b));
    assert!((of("#ffffff", "#000000") - 21.0).abs() < 1e-9);
    // The lightest gray that passes on white.
    assert!((of("#767676", "#ffffff") - 4.54).abs() < 0.005 && of("#777777", "#ffffff") < 4.5);
}

#[test]
fn text_and_controls_stand_out_in_light_and_in_dark() {
    let colors = colors();
    let text = ["ink", "muted", "accent", "bad", "top", "intermediate", "bottom"];
    let pairs = text.iter().flat_map(|text| [(*text, "paper", 4.5), (*text, "raised", 4.5)]);
    let more = [("on-accent", "accent", 4.5), ("edge", "paper", 3.0), ("edge", "raised", 3.0), ("bar", "paper", 3.0)];
    for (front, back, least) in pairs.chain(more) {
        for (theme, name) in ["light", "dark"].into_iter().enumerate() {
            let ratio = contrast(colors[front][theme], colors[back][theme]);
            assert!(ratio >= least, "{front} on {back} in {name}: {ratio:.2}, not {least}");
        }
    }
}
