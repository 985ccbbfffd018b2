// Numbers of paths, as in sampler.rs, to the bit.

const SOBOL_PAIRS: u32 = 12u;

struct Sampler {
    seed: u32,
    index: u32,
}

fn unit_float(bits: u32) -> f32 {
    return f32(bits >> 8u) * 5.9604644775390625e-8;
}

fn hash(value: u32) -> u32 {
    var x = value;
    x = (x ^ (x >> 16u)) * 0x7feb352du;
    x = (x ^ (x >> 15u)) * 0x846ca68bu;
    return x ^ (x >> 16u);
}

fn scramble_reversed(value: u32, seed: u32) -> u32 {
    var x = value ^ (value * 0x3d20adeau);
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
}

fn pascal(index: u32) -> u32 {
    var b = index;
    b ^= (b >> 16u) & 0x0000ffffu;
    b ^= (b >> 8u) & 0x00ff00ffu;
    b ^= (b >> 4u) & 0x0f0f0f0fu;
    b ^= (b >> 2u) & 0x33333333u;
    return b ^ ((b >> 1u) & 0x55555555u);
}

// A pair of numbers in [0, 1) with the dimension `number`.
fn sample_pair(s: Sampler, number: u32) -> vec2<f32> {
    let seed = hash(s.seed ^ (number * 0x9e3779b9u));
    if number < SOBOL_PAIRS {
        let shuffled = reverseBits(scramble_reversed(reverseBits(s.index), seed));
        let first = scramble_reversed(shuffled, seed ^ 0x7f4a7c15u);
        let second = scramble_reversed(pascal(shuffled), seed ^ 0x5bd1e995u);
        return vec2(unit_float(reverseBits(first)), unit_float(reverseBits(second)));
    }
    let a = hash(seed ^ (s.index * 0x85ebca6bu));
    return vec2(unit_float(a), unit_float(hash(a)));
}

// A plain random number in [0, 1), independent of the pairs.
fn sample_random(s: Sampler, number: u32) -> f32 {
    let seed = s.seed ^ ((number * 0xc2b2ae35u) ^ 0x27d4eb2fu);
    return unit_float(hash(hash(seed) ^ (s.index * 0x85ebca6bu)));
}
