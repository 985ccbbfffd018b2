//! Tileable scalar fields on a square grid: noise, cells and slopes.

use syntable_model::random::Stream;

/// A scalar field on a square grid that wraps around at all edges.
#[derive(Debug, Clone)]
pub struct ScalarField {
    size: usize,
    values: Vec<f32>,
}

impl ScalarField {
    /// A constant field.
    pub fn constant(size: usize, value: f32) -> Self {
        Self { size, values: vec![value; size * size] }
    }

    /// A function of the position in tiles, (x, y) in [0, 1), x to the right and y down.
    pub fn from_fn(size: usize, mut f: impl FnMut(f32, f32) -> f32) -> Self {
        let step = 1.0 / size as f32;
        let mut values = Vec::with_capacity(size * size);
        for y in 0..size {
            for x in 0..size {
                values.push(f((x as f32 + 0.5) * step, (y as f32 + 0.5) * step));
            }
        }
        Self { size, values }
    }

    /// A field of values row by row; `size` squared of them.
    pub fn of(size: usize, values: Vec<f32>) -> Self {
        assert_eq!(values.len(), size * size, "a field is square");
        Self { size, values }
    }

    /// Edge length in texels.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Row by row.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Smooth noise in [-1, 1] over a lattice of `cells` across and down.
    pub fn noise(size: usize, cells: [usize; 2], stream: &mut Stream) -> Self {
        let [nx, ny] = cells.map(|n| n.clamp(1, size));
        let lattice: Vec<f32> =
            (0..nx * ny).map(|_| (f64::from(stream.next_u32()) / 2_147_483_647.5 - 1.0) as f32).collect();
        let columns = knots(size, nx);
        let mut values = Vec::with_capacity(size * size);
        let mut row = vec![0.0; nx];
        for (above, below, t) in knots(size, ny) {
            for (x, value) in row.iter_mut().enumerate() {
                let (a, b) = (lattice[above * nx + x], lattice[below * nx + x]);
                *value = a + (b - a) * t;
            }
            values.extend(columns.iter().map(|&(left, right, t)| row[left] + (row[right] - row[left]) * t));
        }
        Self { size, values }
    }

    /// Octaves of noise, each twice as fine and `gain` as strong; about in [-1, 1].
    pub fn fractal(size: usize, cells: [usize; 2], octaves: usize, gain: f32, stream: &mut Stream) -> Self {
        let mut sum = Self::constant(size, 0.0);
        let (mut cells, mut amplitude, mut total) = (cells, 1.0_f32, 0.0);
        for _ in 0..octaves {
            if cells[0].min(cells[1]) > size / 2 {
                break;
            }
            let octave = Self::noise(size, cells, stream);
            sum.values.iter_mut().zip(&octave.values).for_each(|(s, o)| *s += o * amplitude);
            total += amplitude * amplitude;
            amplitude *= gain;
            cells = cells.map(|n| n * 2);
        }
        let scale = 1.0 / total.sqrt().max(1e-6);
        sum.map(|x| x * scale)
    }

    /// Distances to jittered points of a lattice, in cells: to the nearest, to the second, and the nearest's own
    /// random number in [0, 1).
    pub fn cells(size: usize, cells: usize, jitter: f32, stream: &mut Stream) -> [Self; 3] {
        let n = cells.clamp(1, size);
        let mut draw = || (f64::from(stream.next_u32()) / 4_294_967_296.0) as f32;
        let points: Vec<[f32; 3]> =
            (0..n * n).map(|_| [0.5 + jitter * (draw() - 0.5), 0.5 + jitter * (draw() - 0.5), draw()]).collect();
        let scale = n as f32 / size as f32;
        let [mut first, mut second, mut id] = std::array::from_fn(|_| vec![0.0; size * size]);
        // The texels of one cell share the nine cells around it.
        let range = |cell: usize| {
            let from = |cell: usize| ((cell as f32 / scale - 0.5).ceil().max(0.0) as usize).min(size);
            from(cell)..if cell + 1 == n { size } else { from(cell + 1) }
        };
        for (cy, cx) in (0..n).flat_map(|cy| (0..n).map(move |cx| (cy, cx))) {
            let near: [[f32; 3]; 9] = std::array::from_fn(|k| {
                let [dx, dy] = [k % 3, k / 3];
                let [jx, jy, number] = points[(cy + n + dy - 1) % n * n + (cx + n + dx - 1) % n];
                [(cx + dx) as f32 - 1.0 + jx, (cy + dy) as f32 - 1.0 + jy, number]
            });
            for y in range(cy) {
                let py = (y as f32 + 0.5) * scale;
                for x in range(cx) {
                    let px = (x as f32 + 0.5) * scale;
                    let (mut nearest, mut next, mut number) = (f32::MAX, f32::MAX, 0.0);
                    for [qx, qy, q] in near {
                        let d = (qx - px) * (qx - px) + (qy - py) * (qy - py);
                        next = next.min(d.max(nearest));
                        number = if d < nearest { q } else { number };
                        nearest = nearest.min(d);
                    }
                    let i = y * size + x;
                    (first[i], second[i], id[i]) = (nearest.sqrt(), next.sqrt(), number);
                }
            }
        }
        [first, second, id].map(|values| Self { size, values })
    }

    /// Applies a function to every value.
    pub fn map(mut self, f: impl Fn(f32) -> f32) -> Self {
        self.values.iter_mut().for_each(|x| *x = f(*x));
        self
    }

    /// Combines two fields of the same size.
    pub fn zip(mut self, other: &Self, f: impl Fn(f32, f32) -> f32) -> Self {
        self.values.iter_mut().zip(&other.values).for_each(|(a, b)| *a = f(*a, *b));
        self
    }

    /// The number at a texel, wrapped around.
    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.values[(y % self.size) * self.size + x % self.size]
    }

    /// Bilinear between texels at a position in texels, wrapped around.
    pub fn sample(&self, x: f32, y: f32) -> f32 {
        let n = self.size as isize;
        let (fx, fy) = (x.floor(), y.floor());
        let (tx, ty) = (x - fx, y - fy);
        let [x0, y0] = [fx, fy].map(|f| (f as isize).rem_euclid(n) as usize);
        let next = |i: usize| if i + 1 == self.size { 0 } else { i + 1 };
        let (above, below, x1) = (y0 * self.size, next(y0) * self.size, next(x0));
        let between = |row: usize| {
            let (a, b) = (self.values[row + x0], self.values[row + x1]);
            a + (b - a) * tx
        };
        let (top, bottom) = (between(above), between(below));
        top + (bottom - top) * ty
    }

    /// Looks up each texel at an offset of `amount` times (`dx`, `dy`), texels.
    pub fn warped(&self, dx: &Self, dy: &Self, amount: f32) -> Self {
        let n = self.size;
        let values = (0..n * n)
            .map(|i| self.sample((i % n) as f32 + amount * dx.values[i], (i / n) as f32 + amount * dy.values[i]))
            .collect();
        Self { size: n, values }
    }

    /// The slopes of a height field in texels, as RGBA texels of a normal map whose green points up.
    pub fn normal_map(&self) -> Vec<u8> {
        let n = self.size;
        let mut texels = Vec::with_capacity(4 * n * n);
        for y in 0..n {
            let (above, below) = ((y + n - 1) % n * n, (y + 1) % n * n);
            for x in 0..n {
                let dx = (self.values[y * n + (x + 1) % n] - self.values[y * n + (x + n - 1) % n]) / 2.0;
                let dv = (self.values[above + x] - self.values[below + x]) / 2.0;
                let scale = 1.0 / (dx * dx + dv * dv + 1.0).sqrt();
                texels.extend([-dx * scale, -dv * scale, scale].map(|c| super::byte(0.5 + 0.5 * c)));
                texels.push(255);
            }
        }
        texels
    }
}

/// For every texel the lattice points before and after it, and the smoothed (quintic) fraction between them.
fn knots(size: usize, cells: usize) -> Vec<(usize, usize, f32)> {
    (0..size)
        .map(|i| {
            let at = (i as f32 + 0.5) * cells as f32 / size as f32;
            let t = at.fract();
            let cell = at as usize % cells;
            (cell, (cell + 1) % cells, t * t * t * (t * (t * 6.0 - 15.0) + 10.0))
        })
        .collect()
}

/// 0 below `a`, 1 above `b`, smooth between.
pub fn smoothstep(a: f32, b: f32, x: f32) -> f32 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_tilts_the_normal_away_from_the_rise() {
        let bump = ScalarField::from_fn(64, |x, _| 8.0 * (-((x - 0.5) * 8.0).powi(2)).exp());
        let map = bump.normal_map();
        let at = |x: usize| &map[4 * (32 * 64 + x)..][..3];
        assert!(at(24)[0] < 110, "left of the bump the normal points left: {:?}", at(24));
        assert!(at(40)[0] > 145, "right of it to the right: {:?}", at(40));
        let rise = ScalarField::from_fn(64, |_, y| 8.0 * (-((y - 0.5) * 8.0).powi(2)).exp()).normal_map();
        assert!(rise[4 * (24 * 64 + 5) + 1] > 145, "above the bump the normal points up");
    }

    #[test]
    fn cells_agree_with_brute_force() {
        let n = 5;
        let [first, second, _] = ScalarField::cells(40, n, 1.0, &mut Stream::root(3));
        let mut stream = Stream::root(3);
        let mut draw = || (f64::from(stream.next_u32()) / 4_294_967_296.0) as f32;
        let points: Vec<[f32; 2]> = (0..n * n)
            .map(|i| {
                let [x, y, _] = [draw(), draw(), draw()];
                [(i % n) as f32 + x, (i / n) as f32 + y]
            })
            .collect();
        for (i, (&got, &next)) in first.values().iter().zip(second.values()).enumerate() {
            let p = [(i % 40) as f32 + 0.5, (i / 40) as f32 + 0.5].map(|x| x / 8.0);
            let mut all: Vec<f32> = points
                .iter()
                .flat_map(|q| {
                    [-5.0, 0.0, 5.0]
                        .into_iter()
                        .flat_map(move |sx| [-5.0, 0.0, 5.0].map(|sy| (q[0] + sx - p[0]).hypot(q[1] + sy - p[1])))
                })
                .collect();
            all.sort_by(f32::total_cmp);
            assert!((got - all[0]).abs() < 1e-4, "{i}: {got} {}", all[0]);
            // The second nearest may lie beyond the neighboring cells only when it is far.
            assert!((next - all[1]).abs() < 1e-4 || all[1] > 1.0, "{i}: {next} {}", all[1]);
        }
    }
}
