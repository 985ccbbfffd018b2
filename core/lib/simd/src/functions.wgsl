// Elementary functions, as in functions.rs; and vectors.

const PI: f32 = 3.14159265358979;
const FRAC_1_PI: f32 = 0.318309886183791;
// What counts as infinite: shaders may assume that there is no infinity.
const FAR: f32 = 3.0e38;

fn copysign(x: f32, sign_of: f32) -> f32 {
    return bitcast<f32>((bitcast<u32>(x) & 0x7fffffffu) | (bitcast<u32>(sign_of) & 0x80000000u));
}

fn is_negative(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x80000000u) != 0u;
}

fn sin_cos_turns(turns: f32) -> vec2<f32> {
    let quarters = turns * 4.0;
    let quadrant = i32(quarters + copysign(0.5, quarters));
    let x = (quarters - f32(quadrant)) * 1.57079632679490;
    let x2 = x * x;
    let s = x + x * x2 * (x2 * (x2 * -0.00019515296 + 0.008332161) + -0.16666655);
    let c = (x2 * x2 * (x2 * (x2 * 2.4433157e-5 + -0.0013887316) + 0.041666646) - x2 * 0.5) + 1.0;
    let odd = (quadrant & 1) == 1;
    let sine = select(s, c, odd);
    let cosine = select(c, s, odd);
    return vec2(
        select(sine, -sine, (quadrant & 2) != 0),
        select(cosine, -cosine, ((quadrant + 1) & 2) != 0),
    );
}

fn arc_cosine(x: f32) -> f32 {
    let a = min(abs(x), 1.0);
    var p = a * -0.0012624911 + 0.00667009;
    p = a * p + -0.017088126;
    p = a * p + 0.03089188;
    p = a * p + -0.050174305;
    p = a * p + 0.08897899;
    p = a * p + -0.2145988;
    p = a * p + 1.57079632679490;
    let angle = sqrt(1.0 - a) * p;
    return select(angle, PI - angle, x < 0.0);
}

// Angle of the point (x, y) in turns, in [-1/2, 1/2]; 0 for the origin.
fn atan2_turns(y: f32, x: f32) -> f32 {
    let ax = abs(x);
    let ay = abs(y);
    let steep = ay > ax;
    var t = select(ay, ax, steep) / max(select(ax, ay, steep), 1.17549435e-38);
    let beyond = t > 0.41421357;
    t = select(t, (t - 1.0) / (t + 1.0), beyond);
    let t2 = t * t;
    var p = t2 * 8.053744e-2 - 1.3877686e-1;
    p = p * t2 + 1.9977711e-1;
    p = p * t2 - 3.333295e-1;
    var angle = t + t * t2 * p;
    angle = select(angle, angle + 0.785398163397448, beyond);
    angle = select(angle, 1.57079632679490 - angle, steep);
    angle = select(angle, PI - angle, x < 0.0);
    return copysign(angle * (0.5 / PI), y);
}

// Base-2 logarithm to about 0.01, for choosing texture levels.
fn log2_rough(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let exponent = i32(bits >> 23u) - 127;
    let mantissa = bitcast<f32>((bits & 0x007fffffu) | 0x3f800000u);
    return f32(exponent) + (mantissa - 1.0) * (1.0 + 0.34314575 * (2.0 - mantissa));
}

fn luminance(c: vec3<f32>) -> f32 {
    return dot(c, vec3(0.2126, 0.7152, 0.0722));
}

fn max_component(v: vec3<f32>) -> f32 {
    return max(max(v.x, v.y), v.z);
}

fn is_black(c: vec3<f32>) -> bool {
    return all(c == vec3(0.0));
}

fn normalized_or(v: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let square = dot(v, v);
    if square > 1e-30 && square < FAR {
        return v * (1.0 / sqrt(square));
    }
    return other;
}

// A right-handed orthonormal frame around a unit vector: x, y, z as columns.
fn basis_around(z: vec3<f32>) -> mat3x3<f32> {
    let s = copysign(1.0, z.z);
    let a = -1.0 / (s + z.z);
    let b = z.x * z.y * a;
    return mat3x3(vec3(s * z.x * z.x * a + 1.0, s * b, -s * z.x), vec3(b, s + z.y * z.y * a, -z.y), z);
}

fn to_local(basis: mat3x3<f32>, v: vec3<f32>) -> vec3<f32> {
    return vec3(dot(v, basis[0]), dot(v, basis[1]), dot(v, basis[2]));
}
