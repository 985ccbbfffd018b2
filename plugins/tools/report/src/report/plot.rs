//! Histograms as SVG, in the colors of the page's style sheet.

use crate::stats::distribution::Distribution;
use std::fmt::Write;

/// Width and height of the view box.
const SIZE: [f64; 2] = [360.0, 210.0];
/// Left, top, right and bottom of the plotted area.
const AREA: [f64; 4] = [46.0, 14.0, 350.0, 164.0];
/// Maximum number of labels below the bars.
const LABELS: usize = 8;
/// Estimated width of a digit of a label, in units of the view box.
const DIGIT: f64 = 6.0;

/// The histogram of a distribution in percent of its values, with a description in words. `number` makes ids unique.
pub fn histogram(of: &Distribution, number: usize) -> String {
    let (about, edges, counts) = (of.quantity().about(), of.edges(), of.histogram());
    if counts.is_empty() || of.n() == 0 {
        return String::new();
    }
    let percent: Vec<f64> = counts.iter().map(|&count| 100.0 * count as f64 / of.n() as f64).collect();
    let step = round_step(percent.iter().copied().fold(0.0, f64::max) / 4.0);
    let top = step * (percent.iter().copied().fold(0.0, f64::max) / step).ceil().max(1.0);
    let [left, above, right, below] = AREA;
    let y = |value: f64| below - (below - above) * value / top;
    let width = (right - left) / counts.len() as f64;
    let title = capital(about.title);
    let unit = if about.unit.is_empty() { String::new() } else { format!(" ({})", about.unit) };
    let value = |value: Option<f64>| value.map_or_else(|| "none".to_owned(), number_text);
    let [mean, median] = [of.mean(), of.median()].map(value);
    let mut out = format!(
        r#"<svg class="plot" viewBox="0 0 {} {}" role="img" aria-labelledby="plot-{number} plot-{number}-says"><title id="plot-{number}">{title}{unit}</title><desc id="plot-{number}-says">Histogram of {} values, one per {}: mean {mean}, median {median}.</desc>"#,
        SIZE[0],
        SIZE[1],
        of.n(),
        about.per,
    );
    let mut tick = 0.0;
    while tick <= top + step * 0.01 {
        let at = y(tick);
        let label = number_text(tick);
        let _ = write!(
            out,
            r#"<line class="grid" x1="{left}" x2="{right}" y1="{at:.1}" y2="{at:.1}"/><text class="tick end" x="{:.1}" y="{:.1}">{label}</text>"#,
            left - 6.0,
            at + 3.5
        );
        tick += step;
    }
    for (bin, (&part, &count)) in percent.iter().zip(&counts).enumerate() {
        let (x, top) = (left + width * bin as f64, y(part));
        let [from, to] = [edges[bin], edges[bin + 1]].map(number_text);
        let bin = if of.quantity().about().step >= 1.0 && edges[bin + 1] - edges[bin] <= 1.0 {
            from
        } else {
            format!("{from} to {to}")
        };
        let gap = if width > 6.0 { 1.0 } else { 0.25 };
        let _ = write!(
            out,
            r#"<rect class="bar" x="{:.2}" y="{top:.2}" width="{:.2}" height="{:.2}"><title>{bin}: {count} ({part:.1} %)</title></rect>"#,
            x + gap,
            width - 2.0 * gap,
            below - top
        );
    }
    let is_number = about.step >= 1.0 && edges.windows(2).all(|pair| pair[1] - pair[0] <= 1.0);
    let every = edges.len().div_ceil(LABELS).max(1);
    let labeled = if is_number { &edges[..edges.len() - 1] } else { edges };
    for (index, &edge) in labeled.iter().enumerate().step_by(every) {
        let label = number_text(edge);
        let half = DIGIT / 2.0 * label.chars().count() as f64;
        // The label of the last edge is wider than the margin.
        let x = (left + width * (index as f64 + if is_number { 0.5 } else { 0.0 })).min(SIZE[0] - half);
        let _ = write!(out, r#"<text class="tick middle" x="{x:.1}" y="{:.1}">{label}</text>"#, below + 15.0);
    }
    let _ = write!(
        out,
        r#"<line class="axis" x1="{left}" x2="{right}" y1="{below}" y2="{below}"/><text class="label middle" x="{:.1}" y="{:.1}">{title}{unit}</text><text class="tick end" x="{right}" y="9">N = {}</text><text class="label middle" transform="translate(11 {:.1}) rotate(-90)">% of {}</text></svg>"#,
        (left + right) / 2.0,
        SIZE[1] - 10.0,
        grouped(&of.n().to_string()),
        (above + below) / 2.0,
        plural(about.per),
    );
    out
}

/// The smallest step of 1, 2 or 5 times a power of ten that is at least a positive length.
fn round_step(least: f64) -> f64 {
    let power = 10_f64.powi(libm::log10(least.max(1e-9)).floor() as i32);
    [1.0, 2.0, 5.0, 10.0].map(|it| it * power).into_iter().find(|it| *it >= least * 0.999).unwrap_or(10.0 * power)
}

/// A number with the necessary decimals, at most three, and separated thousands.
pub fn number_text(value: f64) -> String {
    let text = if value.abs() >= 100.0 { format!("{value:.0}") } else { format!("{value:.3}") };
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    grouped(text)
}

/// Digits before the decimal point in groups of three, separated by narrow spaces.
pub fn grouped(text: &str) -> String {
    let (whole, rest) = text.find('.').map_or((text, ""), |at| text.split_at(at));
    let (sign, digits) = whole.strip_prefix('-').map_or(("", whole), |digits| ("-", digits));
    let mut out = sign.to_owned();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) && digits.len() > 4 {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out + rest
}

/// A text with its first letter capitalized.
pub fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn plural(one: &str) -> String {
    match one.split_once(' ') {
        Some((first, rest)) => format!("{first}s {rest}"),
        None => format!("{one}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::distribution::{Binning, bin};
    use crate::stats::quantity::Quantity;

    /// A quarter of the values is in the second of ten bins. Its bar is a third as high as the bar of the other three
    /// quarters.
    #[test]
    fn bars_are_as_high_as_their_parts() {
        let mut rates = Distribution::new(Quantity::OcclusionRate);
        [0.05, 0.05, 0.05, 0.15].into_iter().for_each(|rate| rates.add(rate));
        bin(&mut [&mut rates], Binning::Fixed);
        let svg = histogram(&rates, 3);
        let heights: Vec<f64> = svg
            .split(r#"class="bar""#)
            .skip(1)
            .filter_map(|bar| bar.split_once(r#"height=""#)?.1.split_once('"')?.0.parse().ok())
            .collect();
        assert_eq!(heights.len(), 10, "{svg}");
        assert!(
            (heights[0] / heights[1] - 3.0).abs() < 0.01 && heights[2..].iter().all(|it| *it == 0.0),
            "{heights:?}"
        );
        for part in [
            "4 values",
            ">N = 4<",
            "mean 0.075",
            "% of objects in a view",
            "0 to 0.1: 3 (75.0 %)",
            "<title id=\"plot-3\">",
        ] {
            assert!(svg.contains(part), "{part} is not in {svg}");
        }
    }

    #[test]
    fn no_label_is_cut() {
        let mut areas = Distribution::new(Quantity::ObjectArea);
        [1.0, 40_000.0, 70_000.0, 130_000.0].into_iter().for_each(|area| areas.add(area));
        bin(&mut [&mut areas], Binning::Fixed);
        let svg = histogram(&areas, 0);
        let labels: Vec<(f64, &str)> = svg
            .split(r#"class="tick middle" x=""#)
            .skip(1)
            .filter_map(|label| {
                let (x, rest) = label.split_once('"')?;
                Some((x.parse().ok()?, rest.split_once('>')?.1.split_once('<')?.0))
            })
            .collect();
        assert!(labels.len() > 3 && labels.iter().any(|(_, text)| text.chars().count() > 4), "{labels:?}");
        for (x, text) in labels {
            assert!(x + DIGIT / 2.0 * text.chars().count() as f64 <= SIZE[0], "{text} at {x}");
        }
    }

    #[test]
    fn numbers_read_well() {
        let of = [0.0, 0.125, 12.0, 1234.0, 12345.0, 1_234_567.4, -0.5].map(number_text);
        assert_eq!(of, ["0", "0.125", "12", "1234", "12\u{202f}345", "1\u{202f}234\u{202f}567", "-0.5"]);
        assert_eq!([0.9, 1.1, 2.2, 7.0].map(round_step), [1.0, 2.0, 5.0, 10.0]);
    }
}
