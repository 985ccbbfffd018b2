// Rays of the camera, as in core/lib/transport's camera.rs and the start of paths in plugins/stages/render-cpu's start.rs.

// Direction of a pixel's corner, as if there were no distortion; advances one meter along the optical axis.
fn camera_corner(x: i32, y: i32) -> vec3<f32> {
    return view.corner.xyz + view.along_u.xyz * f32(x) + view.along_v.xyz * f32(y);
}

// A direction with distortion, in the camera's frame with z = 1: the tables have (x, y) at the corners of the pixels of the
// window, row by row, then at the centers. FAR where the lens sees nothing.
fn warp_entry(index: u32) -> vec2<f32> {
    let entry = table_f(view.warp + index / 2u);
    return select(entry.xy, entry.zw, (index & 1u) == 1u);
}

fn from_camera(x: f32, y: f32) -> vec3<f32> {
    return view.row_x.xyz * x + view.row_y.xyz * y + view.row_z.xyz;
}

fn to_camera(v: vec3<f32>) -> vec3<f32> {
    return vec3(dot(view.row_x.xyz, v), dot(view.row_y.xyz, v), dot(view.row_z.xyz, v));
}

// The ray through the center of a pixel of the window, in place `column`, `row`; a null direction sees nothing.
fn center_direction(column: u32, row: u32) -> vec3<f32> {
    let place = image_place(column, row);
    if (view.flags & WARPED) != 0u {
        let corners = (view.around_width + 1u) * (view.around_height + 1u);
        let around = vec2<u32>(place - view.window.xy);
        let d = warp_entry(corners + around.y * view.around_width + around.x);
        return select(from_camera(d.x, d.y), vec3(0.0), max(abs(d.x), abs(d.y)) >= FAR);
    }
    let x = f32(place.x) + 0.5;
    let y = f32(place.y) + 0.5;
    return view.corner.xyz + view.along_u.xyz * x + view.along_v.xyz * y;
}

fn warped_direction(column: u32, row: u32, place: vec2<f32>) -> vec3<f32> {
    let columns = view.around_width + 1u;
    let around = vec2<u32>(image_place(column, row) - view.window.xy);
    let at = around.y * columns + around.x;
    let a = warp_entry(at);
    let b = warp_entry(at + 1u);
    let c = warp_entry(at + columns);
    let d = warp_entry(at + columns + 1u);
    let largest = max(max(abs(a), abs(b)), max(abs(c), abs(d)));
    if max(largest.x, largest.y) >= FAR {
        return vec3(0.0);
    }
    let m = mix(mix(a, b, place.x), mix(c, d, place.x), place.y);
    return from_camera(m.x, m.y);
}

// Position along an axis of the pixel by a density that falls linearly to 0 one pixel from its center.
fn tent(u: f32) -> f32 {
    let left = u < 0.5;
    let edge = sqrt(select(1.0 - u, u, left) * 2.0);
    return select(1.5 - edge, edge - 0.5, left);
}

fn spread_bits(value: u32) -> u32 {
    var x = (value | (value << 4u)) & 0x0f0fu;
    x = (x | (x << 2u)) & 0x3333u;
    return (x | (x << 1u)) & 0x5555u;
}

// Numbers of a sample of a pixel, as SampleOrder has it. The tables have the seeds of the blocks that the window meets.
fn sampler_of(column: u32, row: u32, sample: u32) -> Sampler {
    let place = image_place(column, row);
    let x = u32(place.x);
    let y = u32(place.y);
    let mask = (1u << view.block_bits) - 1u;
    let first_column = u32(view.window.x) >> view.block_bits;
    let first_row = u32(view.window.y) >> view.block_bits;
    // Columns left of the image count on from the highest number.
    let wrap = 0xffffffffu >> view.block_bits;
    let block_column = ((x >> view.block_bits) - first_column) & wrap;
    let block_row = ((y >> view.block_bits) - first_row) & wrap;
    let block = block_row * view.block_columns + block_column;
    let seed = table_word(view.blocks, block);
    let first = (spread_bits(x & mask) | (spread_bits(y & mask) << 1u)) << view.sample_bits;
    return Sampler(seed, first + sample);
}
