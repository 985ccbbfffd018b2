//! Runs a function in both languages on the same rows of numbers.
//!
//! Both read their arguments in order from a row of words and write their results in order to another. Results may
//! differ by the tolerance that the function states, and by as much as they change if the arguments change by four
//! units in the last place. This second part depends on the order of operations, and is large where digits cancel.
//! Decisions are equal, or equal to a decision after such a change.

use std::fmt::Write;
use syntable_model::random::Stream;
use syntable_simd::{Vec3, vec3};
use syntable_transport::Dielectrics;
use syntable_transport::bsdf::{sheen_table, table};
use syntable_transport::wgsl;

/// From this magnitude on, numbers count as infinite on both sides.
const FAR: f32 = 3e38;

/// Rows that each function is called with.
const ROWS: u64 = 4096;

/// A relative change of four units in the last place.
const ULPS: f32 = 4.0 * f32::EPSILON;

/// How results are compared.
#[derive(Clone, Copy)]
pub enum Tolerance {
    /// To the bit.
    Exact,
    /// Relative and absolute differences, added.
    Within(f32, f32),
}

/// A function in Rust that reads a row and returns words.
type Rust = dyn Fn(&mut Call) -> Vec<Word>;

/// A function of the shaders and the Rust that it mirrors.
pub struct Function {
    /// Name in WGSL.
    pub name: &'static str,
    /// Names of further functions that this test covers.
    pub through: &'static [&'static str],
    /// Mixes of dielectrics to test.
    dielectrics: &'static [Dielectrics],
    tolerance: Tolerance,
    arguments: fn(&mut Row),
    wgsl: &'static str,
    rust: Box<Rust>,
}

impl Function {
    /// `arguments` makes a row, the WGSL statements read it and write results, and `rust` does the same.
    pub fn new<R: Results>(
        name: &'static str,
        tolerance: Tolerance,
        arguments: fn(&mut Row),
        wgsl: &'static str,
        rust: fn(&mut Call) -> R,
    ) -> Self {
        let rust = move |call: &mut Call| {
            let mut words = Vec::new();
            rust(call).write(&mut words);
            words
        };
        let dielectrics = &[Dielectrics::EnergyConserving];
        Self { name, through: &[], dielectrics, tolerance, arguments, wgsl, rust: Box::new(rust) }
    }

    /// Also covers other functions.
    pub fn covers(self, through: &'static [&'static str]) -> Self {
        Self { through, ..self }
    }

    /// Tests both mixes of dielectrics.
    pub fn with_both_dielectrics(self) -> Self {
        Self { dielectrics: &[Dielectrics::EnergyConserving, Dielectrics::Gltf], ..self }
    }
}

/// Results of a function, in the order in which the shader writes them.
pub trait Results: 'static {
    fn write(self, words: &mut Vec<Word>);
}

impl Results for f32 {
    fn write(self, words: &mut Vec<Word>) {
        words.push(Word::Real(self));
    }
}

impl Results for u32 {
    fn write(self, words: &mut Vec<Word>) {
        words.push(Word::Bits(self));
    }
}

impl Results for bool {
    fn write(self, words: &mut Vec<Word>) {
        u32::from(self).write(words);
    }
}

impl Results for Vec3 {
    fn write(self, words: &mut Vec<Word>) {
        self.array().write(words);
    }
}

impl<R: Results, const N: usize> Results for [R; N] {
    fn write(self, words: &mut Vec<Word>) {
        self.into_iter().for_each(|result| result.write(words));
    }
}

impl<A: Results, B: Results> Results for (A, B) {
    fn write(self, words: &mut Vec<Word>) {
        self.0.write(words);
        self.1.write(words);
    }
}

impl<A: Results, B: Results, C: Results> Results for (A, B, C) {
    fn write(self, words: &mut Vec<Word>) {
        (self.0, (self.1, self.2)).write(words);
    }
}

/// A word of a row.
#[derive(Clone, Copy, Debug)]
pub enum Word {
    Real(f32),
    /// A random number in [0, 1), accurate to an absolute error, so that 1 minus the number is as accurate.
    Unit(f32),
    Bits(u32),
}

impl Word {
    fn bits(self) -> u32 {
        match self {
            Self::Real(x) | Self::Unit(x) => x.to_bits(),
            Self::Bits(bits) => bits,
        }
    }
}

/// Makes the arguments of a row: edge cases in the first rows and in part of the others.
pub struct Row {
    number: u64,
    stream: Stream,
    words: Vec<Word>,
}

impl Row {
    /// One of the edge cases, or none for a random argument.
    fn edge<T: Copy>(&mut self, edges: &[T]) -> Option<T> {
        let chosen =
            if (self.number as usize) < edges.len() { self.number } else { self.stream.below(edges.len() as u64) };
        let is_edge = self.number < 16 || self.stream.chance(0.3);
        is_edge.then(|| edges[chosen as usize % edges.len()])
    }

    fn push(&mut self, x: f32) -> f32 {
        self.words.push(Word::Real(x));
        x
    }

    fn push3(&mut self, v: Vec3) -> Vec3 {
        vec3(self.push(v.x), self.push(v.y), self.push(v.z))
    }

    /// A number in [low, high), or an edge case.
    pub fn within(&mut self, low: f32, high: f32, edges: &[f32]) -> f32 {
        let random = self.stream.uniform(low.into(), high.into()) as f32;
        let x = self.edge(edges).unwrap_or(random);
        self.push(x)
    }

    /// A number in (0, ∞), as often below 1 as above.
    pub fn positive(&mut self, decades: f32) -> f32 {
        let random = 10_f64.powf(self.stream.uniform((-decades).into(), decades.into())) as f32;
        self.push(random)
    }

    /// A random number in [0, 1), like the numbers of samplers.
    pub fn unit(&mut self) -> f32 {
        let random = (self.stream.next_u32() >> 8) as f32 * (0.5 * f32::EPSILON);
        let edges = [0.0, 1.0 - 0.5 * f32::EPSILON, 0.5, 0.5 * f32::EPSILON, 0.25, 0.75];
        let x = self.edge(&edges).unwrap_or(random);
        self.words.push(Word::Unit(x));
        x
    }

    /// A number in [0, 1], both ends included.
    pub fn fraction(&mut self) -> f32 {
        self.within(0.0, 1.0, &[0.0, 1.0, 0.5, 1e-3])
    }

    /// A cosine above 0.
    pub fn cosine(&mut self) -> f32 {
        self.within(1e-4, 1.0, &[1.0, 1e-6, 0.05, 0.5, 1e-3])
    }

    /// A relative index of refraction: beyond the surface over this side.
    pub fn eta(&mut self) -> f32 {
        self.within(0.4, 2.5, &[1.5, 1.0 / 1.5, 1.0, 1.33, 2.4, 1.0 / 2.4, 1.001])
    }

    /// An index below `count`.
    pub fn below(&mut self, count: u32) -> u32 {
        let chosen = self.stream.below(count.into()) as u32;
        self.words.push(Word::Bits(chosen));
        chosen
    }

    /// 32 bits.
    pub fn bits(&mut self) -> u32 {
        let random = self.stream.next_u32();
        let bits = self.edge(&[0, 1, u32::MAX, 0x8000_0000, 0x7fff_ffff, 2, 255, 256]).unwrap_or(random);
        self.words.push(Word::Bits(bits));
        bits
    }

    /// A vector with components in [-extent, extent], or a short or null one.
    pub fn vector(&mut self, extent: f32) -> Vec3 {
        let random = Vec3::from([0; 3].map(|_| self.stream.uniform((-extent).into(), extent.into()) as f32));
        let edges = [Vec3::ZERO, vec3(0.0, 0.0, -0.0), vec3(extent, 0.0, 0.0), vec3(1e-10, 0.0, 1e-10)];
        let v = self.edge(&edges).unwrap_or(random);
        self.push3(v)
    }

    /// A color in [0, 1]³.
    pub fn color(&mut self) -> Vec3 {
        let random = Vec3::from([0; 3].map(|_| self.stream.unit() as f32));
        let v = self.edge(&[Vec3::ZERO, Vec3::ONE, vec3(1.0, 0.0, 0.0), vec3(0.5, 0.5, 0.5)]).unwrap_or(random);
        self.push3(v)
    }

    /// A unit vector.
    pub fn direction(&mut self) -> Vec3 {
        let v = self.axis();
        self.push3(v)
    }

    /// A unit vector that is not an argument.
    pub fn axis(&mut self) -> Vec3 {
        let d = self.stream.direction();
        let random = vec3(d.x as f32, d.y as f32, d.z as f32);
        let edges = [
            vec3(0.0, 0.0, 1.0),
            vec3(0.0, 0.0, -1.0),
            vec3(1.0, 0.0, 0.0),
            vec3(0.0, -1.0, -0.0),
            vec3(0.6, 0.0, -0.8),
        ];
        self.edge(&edges).unwrap_or(random)
    }

    /// A unit vector with z > 0, sometimes grazing.
    pub fn upper(&mut self) -> Vec3 {
        let d = self.stream.direction();
        let random = vec3(d.x as f32, d.y as f32, (d.z as f32).abs().max(1e-5));
        let grazing = |z: f32| vec3(0.6 * (1.0 - z * z).sqrt(), -0.8 * (1.0 - z * z).sqrt(), z);
        let edges = [vec3(0.0, 0.0, 1.0), grazing(1e-5), grazing(0.01), grazing(0.1), vec3(0.6, 0.0, 0.8)];
        let v = self.edge(&edges).unwrap_or(random);
        self.push3(v)
    }

    /// An offset from a light of a size: within it, near, far, almost none and none.
    pub fn offset(&mut self, size: f32) -> Vec3 {
        let d = self.stream.direction();
        let distance = self.stream.pick(&[0.0, 1e-4, 0.5, 0.99, 1.01, 2.0, 10.0, 100.0]).copied().unwrap_or_default();
        vec3(d.x as f32, d.y as f32, d.z as f32) * (distance * size)
    }

    /// A random number that is not an argument.
    pub fn random(&mut self, low: f32, high: f32) -> f32 {
        self.stream.uniform(low.into(), high.into()) as f32
    }

    /// An argument that depends on others.
    pub fn given(&mut self, v: Vec3) -> Vec3 {
        self.push3(v)
    }
}

/// A call of a Rust function on a row.
pub struct Call {
    pub dielectrics: Dielectrics,
    words: Vec<Word>,
    read: usize,
}

impl Call {
    pub fn u(&mut self) -> u32 {
        self.read += 1;
        self.words[self.read - 1].bits()
    }

    pub fn f(&mut self) -> f32 {
        f32::from_bits(self.u())
    }

    pub fn v2(&mut self) -> [f32; 2] {
        [self.f(), self.f()]
    }

    pub fn v3(&mut self) -> Vec3 {
        Vec3::from([self.f(), self.f(), self.f()])
    }
}

/// Readers and writers of rows, and the declarations that the modules expect from the renderer: the tables, and the mix
/// of dielectrics.
const PRELUDE: &str = "
override PLAIN_DIELECTRICS: bool = false;
@group(0) @binding(0) var<storage, read> arguments: array<u32>;
@group(0) @binding(1) var<storage, read_write> results: array<u32>;
@group(0) @binding(2) var<storage, read> lobes: array<vec4<f32>>;
var<private> argument: u32;
var<private> result: u32;
fn lobe_table(at: u32) -> vec4<f32> { return lobes[at]; }
fn u() -> u32 { argument++; return arguments[argument - 1u]; }
fn f() -> f32 { return bitcast<f32>(u()); }
fn v2() -> vec2<f32> { let x = f(); return vec2(x, f()); }
fn v3() -> vec3<f32> { let xy = v2(); return vec3(xy, f()); }
fn put_u(x: u32) { results[result] = x; result++; }
fn put_b(x: bool) { put_u(u32(x)); }
fn put(x: f32) { put_u(bitcast<u32>(x)); }
fn put2(v: vec2<f32>) { put(v.x); put(v.y); }
fn put3(v: vec3<f32>) { put2(v.xy); put(v.z); }
// Results that are not written are 0. At low densities, the weight is written as the value of the lobes.
fn put_sample(s: BsdfSample) {
    if !s.valid { return; }
    put_b(true); put_b(s.specular); put_b(s.transmitted); put_b(s.reflected);
    put3(s.wi); put3(s.weight * min(s.pdf, 1.0)); put(s.pdf);
}
fn shape() -> Shape {
    let sort = u(); let center = v3(); let x = v3(); let y = v3(); let normal = v3(); let half = v2(); let radius = f();
    return Shape(sort, center, x, y, normal, half, radius, vec3(1.0), f(), 0xffffffffu);
}
";

/// On a card, one row in so many may be wrong, for a function with a tolerance: cards divide and take roots less
/// exactly than software renderers. So a branch may occasionally go the other way, or a number that cancels may be
/// inaccurate.
const ROWS_OF_A_SLIP: usize = 200;

/// An adapter, its device and the buffer of the tables.
struct Gpu {
    is_card: bool,
    device: wgpu::Device,
    queue: wgpu::Queue,
    lobes: wgpu::Buffer,
}

impl Gpu {
    /// Opens a card, or else a software renderer; `None` if the machine has neither.
    fn open() -> Option<Self> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let power_preference = wgpu::PowerPreference::HighPerformance;
        let options = wgpu::RequestAdapterOptions { power_preference, ..wgpu::RequestAdapterOptions::default() };
        let Ok(adapter) = pollster::block_on(instance.request_adapter(&options)) else {
            syntable_testing::tools::skip("a graphics adapter (mesa-vulkan-drivers)");
            return None;
        };
        let info = adapter.get_info();
        println!("{}", info.name);
        let (device, queue) =
            pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).expect("opens");
        let halves = |cell: &[f32; 8]| {
            let [a, b, c, d, e, f, g, h] = *cell;
            [[a, b, c, d], [e, f, g, h]]
        };
        let numbers: Vec<[f32; 4]> = (table().directional().iter().flat_map(halves))
            .chain(table().mean().iter().map(|cell| halves(cell)[0]))
            .chain(sheen_table().iter().map(|cell| halves(cell)[0]))
            .collect();
        let lobes = storage(&device, size_of_val(&*numbers));
        queue.write_buffer(&lobes, 0, bytemuck::cast_slice(&numbers));
        Some(Self { is_card: info.device_type != wgpu::DeviceType::Cpu, device, queue, lobes })
    }

    /// Results of a function, `results` words for each row of arguments.
    fn run(&self, function: &Function, dielectrics: Dielectrics, arguments: &[u32], results: usize) -> Vec<u32> {
        let width = arguments.len() / ROWS as usize;
        let mut source = String::from(PRELUDE);
        wgsl::MODULES.iter().for_each(|module| source += module);
        let Function { name, wgsl, .. } = function;
        let _ = write!(
            source,
            "@compute @workgroup_size(64) fn test(@builtin(global_invocation_id) id: vec3<u32>) {{
                argument = id.x * {width}u; result = id.x * {results}u; {wgsl}
            }}"
        );
        let device = &self.device;
        let source = wgpu::ShaderSource::Wgsl(source.into());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name), source });
        let entry = |binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: binding != 1 },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(name),
            entries: &[0, 1, 2].map(entry),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(name),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let plain = if dielectrics == Dielectrics::Gltf { 1.0 } else { 0.0 };
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some("test"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &[("PLAIN_DIELECTRICS", plain)],
                ..wgpu::PipelineCompilationOptions::default()
            },
            cache: None,
        });
        let bytes = results * ROWS as usize * 4;
        let (from, to) = (storage(device, size_of_val(arguments)), storage(device, bytes));
        self.queue.write_buffer(&from, 0, bytemuck::cast_slice(arguments));
        let resources = [&from, &to, &self.lobes].map(wgpu::Buffer::as_entire_binding);
        let entries: Vec<_> =
            (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        let bound = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(name),
            layout: &layout,
            entries: &entries,
        });
        let read = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(name),
            size: bytes as u64,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &bound, &[]);
            pass.dispatch_workgroups(ROWS as u32 / 64, 1, 1);
        }
        encoder.copy_buffer_to_buffer(&to, 0, &read, 0, bytes as u64);
        self.queue.submit([encoder.finish()]);
        read.map_async(wgpu::MapMode::Read, .., |result| result.expect("maps"));
        device.poll(wgpu::PollType::wait_indefinitely()).expect("finishes");
        let view = read.get_mapped_range(..).expect("is mapped");
        bytemuck::cast_slice(&view).to_vec()
    }
}

fn storage(device: &wgpu::Device, bytes: usize) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: bytes as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Results in Rust on a row, then on rows in which one number differs slightly.
fn reference(function: &Function, dielectrics: Dielectrics, row: &[Word]) -> Vec<Vec<Word>> {
    let call = |words: Vec<Word>| {
        let mut call = Call { dielectrics, words, read: 0 };
        let results = (function.rust)(&mut call);
        assert_eq!(call.read, row.len(), "`{}` reads what it is given", function.name);
        results
    };
    let mut all = vec![call(row.to_vec())];
    if let Tolerance::Within(..) = function.tolerance {
        for (i, &word) in row.iter().enumerate() {
            let (x, step) = match word {
                Word::Real(x) => (x, x * ULPS),
                Word::Unit(x) => (x, ULPS),
                Word::Bits(_) => continue,
            };
            for x in [x - step, x + step] {
                let mut words = row.to_vec();
                words[i] = Word::Real(x);
                all.push(call(words));
            }
        }
    }
    all
}

/// The difference of a result from the results in Rust, or `None` if it is accepted.
fn complaint(tolerance: Tolerance, got: u32, wanted: &[Word]) -> Option<String> {
    let (real, Tolerance::Within(relative, absolute)) = (f32::from_bits(got), tolerance) else {
        // The sign of a zero may differ between cards.
        let is_zero = |bits: u32| matches!(wanted[0], Word::Real(_)) && f32::from_bits(bits) == 0.0;
        let is_same = got == wanted[0].bits() || is_zero(got) && is_zero(wanted[0].bits());
        return (!is_same).then(|| format!("{got:#010x}, not {:#010x}", wanted[0].bits()));
    };
    let Word::Real(first) = wanted[0] else {
        let found = wanted.iter().any(|word| word.bits() == got);
        return (!found).then(|| format!("{got}, not {}", wanted[0].bits()));
    };
    assert!(!first.is_nan(), "Rust gives no number");
    let reals = wanted.iter().map(|word| f32::from_bits(word.bits()).clamp(-FAR, FAR)).filter(|x| !x.is_nan());
    let (low, high) = reals.fold((FAR, -FAR), |(low, high), x| (low.min(x), high.max(x)));
    let slack = absolute + relative * low.abs().max(high.abs()) + (high - low);
    let is_near = (low - slack..=high + slack).contains(&real.clamp(-FAR, FAR));
    (!is_near).then(|| format!("{real:e}, not {first:e} in {:e} … {:e}", low - slack, high + slack))
}

/// Calls functions in both languages, and compares the results.
pub fn compare(functions: &[Function]) {
    let Some(gpu) = Gpu::open() else { return };
    let mut complaints = Vec::new();
    for function in functions {
        let stream = Stream::root(1).child("functions").child(function.name);
        let row = |number| {
            let mut row = Row { number, stream: stream.at(number), words: Vec::new() };
            (function.arguments)(&mut row);
            row.words
        };
        let rows: Vec<Vec<Word>> = (0..ROWS).map(row).collect();
        let arguments: Vec<u32> = rows.iter().flatten().map(|word| word.bits()).collect();
        for &dielectrics in function.dielectrics {
            let wanted: Vec<_> = rows.iter().map(|row| reference(function, dielectrics, row)).collect();
            let width = wanted[0][0].len();
            let got = gpu.run(function, dielectrics, &arguments, width);
            let wrong = |row: usize| {
                (0..width).find_map(|place| {
                    let wanted: Vec<Word> = wanted[row].iter().map(|results| results[place]).collect();
                    let what = complaint(function.tolerance, got[row * width + place], &wanted)?;
                    Some(format!("result {place} is {what} for {:?}", rows[row]))
                })
            };
            let wrong: Vec<String> = (0..ROWS as usize).filter_map(wrong).collect();
            let may_slip = gpu.is_card && matches!(function.tolerance, Tolerance::Within(..));
            let slips = if may_slip { ROWS as usize / ROWS_OF_A_SLIP } else { 0 };
            if let Some(first) = wrong.get(slips) {
                let count = wrong.len();
                complaints.push(format!("`{}` ({dielectrics:?}), {count} rows wrong; {first}", function.name));
            }
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}
