//! Boundary maps as the reference makes them: half a pixel to the top left, blind along the edges of the image.

use syntable_model::product::Mask;

/// Tolerance as a share of the image's diagonal.
const TOLERANCE: f64 = 0.003;

/// Radius within which boundary pixels count as the same, px.
pub fn radius(width: u32, height: u32) -> i64 {
    let [width, height] = [width, height].map(f64::from);
    (TOLERANCE * (width * width + height * height).sqrt()).ceil() as i64
}

/// The boundary of a mask.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Boundary {
    /// Its pixels (x, y), row by row.
    pub pixels: Vec<[i64; 2]>,
    radius: i64,
}

impl Boundary {
    /// Pixels that differ from that to the right, below, or both; in the last row and column from the one that is there.
    pub fn of(mask: &Mask) -> Self {
        let [width, height] = [mask.width(), mask.height()].map(i64::from);
        let area = mask.bbox();
        let [x0, y0, w, h] = [area.x, area.y, area.width, area.height].map(i64::from);
        let mut bits = vec![false; (w * h) as usize];
        for position in mask.runs().flatten().map(i64::from) {
            bits[((position % height - y0) * w + position / height - x0) as usize] = true;
        }
        let at = |x: i64, y: i64| {
            (x0..x0 + w).contains(&x) && (y0..y0 + h).contains(&y) && bits[((y - y0) * w + x - x0) as usize]
        };
        let is_boundary = |x: i64, y: i64| {
            let (right, below) = (x + 1 < width, y + 1 < height);
            let differs = |x, y, own| at(x, y) != own;
            let own = at(x, y);
            right && differs(x + 1, y, own)
                || below && differs(x, y + 1, own)
                || right && below && differs(x + 1, y + 1, own)
        };
        let columns = || (x0 - 1).max(0)..x0 + w;
        let rows = (y0 - 1).max(0)..y0 + h;
        let pixels = rows.flat_map(|y| columns().map(move |x| [x, y]));
        let pixels = pixels.filter(|[x, y]| is_boundary(*x, *y)).collect();
        Self { pixels, radius: radius(mask.width(), mask.height()) }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Whether there is no pixel.
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Number of pixels that lie within the radius of one of the other's.
    pub fn near(&self, other: &Self) -> usize {
        let Some(low) = corner(&other.pixels, i64::min).map(|low| low.map(|v| v - self.radius)) else { return 0 };
        let Some(high) = corner(&other.pixels, i64::max).map(|high| high.map(|v| v + self.radius)) else { return 0 };
        let width = high[0] - low[0] + 1;
        let index = |[x, y]: [i64; 2]| ((y - low[1]) * width + x - low[0]) as usize;
        let mut bits = vec![false; (width * (high[1] - low[1] + 1)) as usize];
        for &[x, y] in &other.pixels {
            for dy in -self.radius..=self.radius {
                for dx in (-self.radius..=self.radius).filter(|dx| dx * dx + dy * dy <= self.radius * self.radius) {
                    bits[index([x + dx, y + dy])] = true;
                }
            }
        }
        let is_inside = |p: &[i64; 2]| (0..2).all(|axis| (low[axis]..=high[axis]).contains(&p[axis]));
        self.pixels.iter().filter(|pixel| is_inside(pixel) && bits[index(**pixel)]).count()
    }
}

fn corner(pixels: &[[i64; 2]], choose: fn(i64, i64) -> i64) -> Option<[i64; 2]> {
    pixels.iter().copied().reduce(|a, b| [choose(a[0], b[0]), choose(a[1], b[1])])
}
