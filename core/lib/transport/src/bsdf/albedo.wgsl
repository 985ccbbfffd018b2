// Directional albedo of the GGX lobe, as in albedo.rs: (facing, grazing). `lobe_table` gives entries of the table: a cell of
// roughness and cosine is two vectors.

const ALBEDO_CELLS: u32 = 20u;

struct Cell {
    number: u32,
    weight: f32,
}

fn table_cell(x: f32) -> Cell {
    let scaled = clamp(x, 0.0, 1.0) * f32(ALBEDO_CELLS);
    let number = u32(min(scaled, f32(ALBEDO_CELLS - 1u)));
    return Cell(number, scaled - f32(number));
}

fn albedo_at(row: Cell, mu: f32) -> vec2<f32> {
    let column = table_cell(mu);
    let at = 2u * (row.number * ALBEDO_CELLS + column.number);
    let lower = lobe_table(at);
    let upper = lobe_table(at + 1u);
    return mix(mix(lower.xy, lower.zw, column.weight), mix(upper.xy, upper.zw, column.weight), row.weight);
}

fn row_mean(row: Cell) -> vec2<f32> {
    let entry = lobe_table(2u * ALBEDO_CELLS * ALBEDO_CELLS + row.number);
    return mix(entry.xy, entry.zw, row.weight);
}

fn albedo_white(a: vec2<f32>) -> f32 {
    return a.x + a.y;
}
