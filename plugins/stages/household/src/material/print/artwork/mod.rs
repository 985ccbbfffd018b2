//! Illustrations and photographs on prints.

mod morsel;
mod scenery;

use crate::material::photograph::Photograph;
use crate::material::{MaterialCanvas, ScalarField, SrgbColor, hsv, mix, shade};
use morsel::Morsel;
use syntable_model::random::Stream;

/// Texels along the edge of the noise that artwork takes its grain from.
const GRAIN: usize = 128;

/// The artwork of one product: equal on all its panels.
pub struct Artwork<'a> {
    stream: Stream,
    grain: ScalarField,
    photographs: &'a [Photograph],
    kind: u64,
}

/// Where artwork goes in a panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArtworkPlace {
    /// It fills its box.
    Full,
    /// It lies on the ground that is already drawn.
    OnGround,
}

impl<'a> Artwork<'a> {
    /// Artwork from a stream of its own. With photographs, crops of them replace illustrations.
    pub fn new(stream: &Stream, photographs: &'a [Photograph]) -> Self {
        let mut noise = stream.child("grain");
        let grain = ScalarField::fractal(GRAIN, [8, 8], 4, 0.62, &mut noise);
        let kind = stream.child("kind").below(12);
        Self { stream: stream.clone(), grain, photographs, kind }
    }

    /// Draws the artwork in a box `[x0, y0, x1, y1]`, and nothing outside of `clip`.
    pub fn draw(
        &self,
        canvas: &mut MaterialCanvas,
        place: ArtworkPlace,
        r: [f32; 4],
        clip: [f32; 4],
        colors: [SrgbColor; 2],
    ) {
        let before = canvas.set_clip(clip);
        match (self.photographs.is_empty(), place) {
            (false, _) => self.photograph(canvas, place, r),
            (true, ArtworkPlace::Full) => self.scene(canvas, r, colors),
            (true, ArtworkPlace::OnGround) => self.goods(canvas, r, colors),
        }
        canvas.set_clip(before);
    }

    /// A crop of a photograph, square or in an ellipse with a white rim.
    fn photograph(&self, canvas: &mut MaterialCanvas, place: ArtworkPlace, r: [f32; 4]) {
        let mut stream = self.stream.child("photograph");
        let Some(photograph) = stream.pick(self.photographs) else { return };
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        let zoom = stream.uniform(0.55, 1.0) as f32;
        let aspect = w / h / photograph.aspect();
        let [du, dv] = if aspect > 1.0 { [zoom, zoom / aspect] } else { [zoom * aspect, zoom] };
        let (u0, v0) = (stream.unit() as f32 * (1.0 - du), stream.unit() as f32 * (1.0 - dv));
        let sample = |x: f32, y: f32| photograph.sample(u0 + du * (x - r[0]) / w, v0 + dv * (y - r[1]) / h);
        let (cx, cy) = ((r[0] + r[2]) / 2.0, (r[1] + r[3]) / 2.0);
        if place == ArtworkPlace::OnGround && stream.chance(0.4) {
            canvas.ellipse([cx, cy], [0.5 * w, 0.5 * h], [0.96; 3]);
            let (rx, ry) = (0.47 * w, 0.47 * h);
            canvas.paint(r, |x, y| (libm::hypotf((x - cx) / rx, (y - cy) / ry) - 1.0) * rx.min(ry), sample);
        } else {
            canvas.paint(r, |_, _| -1.0, sample);
        }
    }

    /// A scene that fills the box.
    fn scene(&self, canvas: &mut MaterialCanvas, r: [f32; 4], colors: [SrgbColor; 2]) {
        let stream = &mut self.stream.child("scene");
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        match self.kind {
            0 | 1 => scenery::landscape(canvas, stream, &self.grain, r),
            2 => {
                scenery::blur(canvas, stream, r, colors[0]);
                scenery::splash(canvas, stream, &self.grain, r, mix(colors[1], [0.97; 3], 0.7));
            }
            3 => {
                canvas.gradient(r, [mix(colors[0], [1.0; 3], 0.3), shade(colors[0], 0.6)]);
                scenery::waves(canvas, stream, r, colors);
                scenery::bubbles(canvas, stream, r, colors[1]);
            }
            4..=7 => {
                scenery::table_top(canvas, stream, &self.grain, r);
                self.goods(canvas, [r[0], r[1] + 0.1 * h, r[2], r[3]], colors);
            }
            _ => {
                scenery::blur(canvas, stream, r, colors[0]);
                self.goods(canvas, [r[0] + 0.05 * w, r[1] + 0.25 * h, r[2] - 0.05 * w, r[3]], colors);
            }
        }
    }

    /// The goods: a heap, a bowl, a few large pieces, a row.
    fn goods(&self, canvas: &mut MaterialCanvas, r: [f32; 4], colors: [SrgbColor; 2]) {
        let stream = &mut self.stream.child("goods");
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        let edge = w.min(h);
        let main = Morsel::draw(stream);
        let side = Morsel::draw(stream);
        match self.kind {
            3 => {
                scenery::waves(canvas, stream, r, [colors[1], mix(colors[1], [1.0; 3], 0.5)]);
                scenery::bubbles(canvas, stream, r, [0.95; 3]);
            }
            0 | 4 | 8 => self.bowl(canvas, stream, r, main),
            1 | 5 | 9 => {
                let count = stream.integer(3, 6);
                let size = edge * stream.uniform(0.2, 0.3) as f32;
                for i in 0..count {
                    let t = (i as f32 + 0.5) / count as f32;
                    let y = r[1] + h * (0.5 + 0.2 * stream.uniform(-1.0, 1.0) as f32);
                    let turn = stream.uniform(0.0, std::f64::consts::TAU) as f32;
                    main.paint(canvas, &self.grain, [r[0] + t * w, y], size, turn);
                }
                self.scatter(canvas, stream, [r[0], r[1] + 0.6 * h, r[2], r[3]], side, 0.1 * edge);
            }
            2 => scenery::splash(canvas, stream, &self.grain, r, mix(colors[1], [0.97; 3], 0.8)),
            _ => {
                let rows = 5;
                for row in 0..rows {
                    let t = row as f32 / (rows - 1) as f32;
                    let half = (0.25 + 0.3 * t) * w;
                    let size = 0.13 * edge * (0.8 + 0.35 * t);
                    let count = (half / size * 1.1).max(1.0) as i32;
                    for i in 0..=count {
                        let x = 0.5 * (r[0] + r[2]) + half * (2.0 * i as f32 / count as f32 - 1.0);
                        let jitter = [0, 1].map(|_| 0.4 * size * stream.uniform(-1.0, 1.0) as f32);
                        let y = r[1] + h * (0.35 + 0.55 * t);
                        let kind = if stream.chance(0.15) { side } else { main };
                        let turn = stream.uniform(0.0, std::f64::consts::TAU) as f32;
                        kind.paint(canvas, &self.grain, [x + jitter[0], y + jitter[1]], size, turn);
                    }
                }
            }
        }
    }

    fn scatter(&self, canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4], kind: Morsel, size: f32) {
        for _ in 0..stream.integer(3, 9) {
            let at = [stream.uniform(r[0].into(), r[2].into()) as f32, stream.uniform(r[1].into(), r[3].into()) as f32];
            kind.paint(canvas, &self.grain, at, size, stream.uniform(0.0, std::f64::consts::TAU) as f32);
        }
    }

    /// A bowl with a heap of goods.
    fn bowl(&self, canvas: &mut MaterialCanvas, stream: &mut Stream, r: [f32; 4], kind: Morsel) {
        let [w, h] = [r[2] - r[0], r[3] - r[1]];
        let (rx, ry) = ((0.42 * w).min(0.8 * h), (0.12 * w).min(0.2 * h));
        let (cx, cy) = ((r[0] + r[2]) / 2.0, r[1] + 0.5 * h);
        let color = if stream.chance(0.5) { [0.93, 0.93, 0.92] } else { hsv(stream.unit(), 0.6, 0.7) };
        let depth = (0.95 * rx).min(r[3] - cy - 0.05 * h);
        canvas.shadow([cx + 0.1 * rx, cy + 0.95 * depth], [1.1 * rx, 0.3 * depth], 0.7);
        canvas.ellipse([cx, cy], [rx, ry], shade(color, 0.7));
        let size = 0.17 * rx;
        for row in 0..4 {
            let t = row as f32 / 3.0;
            let half = rx * (0.5 + 0.38 * t);
            for i in 0..7 {
                let jitter = 0.3 * size * stream.uniform(-1.0, 1.0) as f32;
                let x = cx + half * (i as f32 / 3.0 - 1.0) + jitter;
                let lift = 1.0 - (x - cx) * (x - cx) / (rx * rx);
                let y = cy - (0.9 - 0.85 * t) * 1.5 * ry * lift.max(0.0) + jitter;
                kind.paint(canvas, &self.grain, [x, y], size, stream.uniform(0.0, std::f64::consts::TAU) as f32);
            }
        }
        // The front wall covers what hangs below the rim.
        canvas.paint(
            [cx - rx, cy, cx + rx, cy + depth],
            |x, y| {
                let (u, v) = ((x - cx) / rx, (y - cy) / depth);
                let below = (v * v + u * u * (1.0 - 0.3 * v)).sqrt() - 1.0;
                let rim = ry * (1.0 - u * u).max(0.0).sqrt() - (y - cy);
                (below * depth).max(rim)
            },
            |x, y| {
                let (u, v) = ((x - cx) / rx, (y - cy) / depth);
                let shine = libm::expf(-40.0 * (u + 0.45) * (u + 0.45)) * 0.35;
                mix(shade(color, 1.0 - 0.5 * (u + 0.2).max(0.0) - 0.35 * v), [1.0; 3], shine)
            },
        );
    }
}
