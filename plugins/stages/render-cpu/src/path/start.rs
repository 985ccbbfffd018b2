//! Camera rays: the start of every path.

use super::PathTracer;
use super::cursor::Cursor;
use crate::batch::{BATCH, Batch, load, set, store};
use syntable_prepare::Sampler;
use syntable_simd::Vec3;
use syntable_simd::functions::sin_cos_turns;
use syntable_simd::{Int, Real, complement};
use syntable_transport::PixelFilter;
use syntable_transport::film::{Task, place};
use syntable_transport::path::LENS;

/// Position along an axis of the pixel, which is [0, 1], from a uniform number. The density falls linearly to 0 one
/// pixel from the center.
#[inline(always)]
fn tent<T: Real>(u: T) -> T {
    let half = T::splat(0.5);
    let left = u.lt(half);
    let edge = (T::select(left, u, complement(u)) * 2.0_f32).sqrt();
    T::select(left, edge - half, T::splat(1.5) - edge)
}

impl PathTracer<'_> {
    /// Fills a batch with camera rays; returns their number.
    #[inline(always)]
    pub(super) fn start<T: Real>(&self, batch: &mut Batch, task: &Task, cursor: &mut Cursor) -> usize {
        let (first, per_pixel) = (*cursor, task.samples.len());
        let paths = &mut batch.paths;
        let mut count = 0;
        while count < BATCH && !cursor.is_over(task) {
            let (x, y) = place(task.area, task.pixels[cursor.number]);
            let corner = self.camera.corner(x, y);
            // Pixels outside the image have numbers of their own, in two's complement.
            let (seed, first) = self.order.pixel(x as u32, y as u32);
            let more = ((task.samples.end - cursor.sample) as usize).min(BATCH - count);
            for i in count..count + more {
                set(&mut paths.origin, i, self.camera.origin());
                set(&mut paths.direction, i, corner);
                paths.seed[i] = seed;
                paths.index[i] = first + cursor.sample + (i - count) as u32;
                paths.slot[i] = i as u32;
                batch.radiance[i] = [0.0; 3];
                batch.met[i] = false;
                if self.has_guides() {
                    batch.guides.clear(i);
                }
            }
            count += more;
            cursor.sample += more as u32;
            if cursor.sample == task.samples.end {
                *cursor = Cursor { number: cursor.number + 1, sample: task.samples.start };
            }
        }
        let [along_u, along_v] = self.camera.slopes().map(Vec3::<T>::broadcast);
        for at in (0..count).step_by(T::WIDTH) {
            let sampler = Sampler { seed: T::Int::load(&paths.seed[at..]), index: T::Int::load(&paths.index[at..]) };
            let mut position = sampler.pair(0);
            if self.settings.filter == PixelFilter::Tent {
                position = position.map(tent);
            }
            let [u, v] = position;
            let mut direction = load::<T>(&paths.direction, at) + along_u * u + along_v * v;
            if self.camera.is_warped() {
                store(direction, &mut paths.direction, at);
                let (mut us, mut vs) = ([0.0; 8], [0.0; 8]);
                u.store(&mut us);
                v.store(&mut vs);
                for (lane, (u, v)) in us.into_iter().zip(vs).enumerate().take(T::WIDTH.min(count - at)) {
                    let before = (first.sample - task.samples.start) as usize + at + lane;
                    let (x, y) = place(task.area, task.pixels[first.number + before / per_pixel]);
                    // Outside the image of the lens, rays hit no surface.
                    let seen = self.camera.warped(x, y, [u, v]).unwrap_or(Vec3::from([f32::NAN; 3]));
                    set(&mut paths.direction, at + lane, seen);
                }
                direction = load(&paths.direction, at);
            }
            if let Some(lens) = &self.camera.lens {
                let [r, turn] = sampler.pair(LENS);
                let (sin, cos) = sin_cos_turns(turn);
                let r = r.sqrt();
                let aside = Vec3::broadcast(lens.right) * (r * cos) + Vec3::broadcast(lens.down) * (r * sin);
                store(load::<T>(&paths.origin, at) + aside, &mut paths.origin, at);
                direction = direction * T::splat(lens.focus) - aside;
            }
            store(direction.normalized(), &mut paths.direction, at);
            store(Vec3::all(T::splat(1.0)), &mut paths.throughput, at);
            store(Vec3::all(T::splat(0.0)), &mut paths.normal, at);
            T::splat(f32::INFINITY).store(&mut paths.pdf[at..]);
            T::splat(0.0).store(&mut paths.near[at..]);
            T::splat(0.0).store(&mut paths.width[at..]);
            T::splat(self.spread).store(&mut paths.spread[at..]);
            T::splat(0.0).store(&mut paths.regularize[at..]);
        }
        count
    }
}
