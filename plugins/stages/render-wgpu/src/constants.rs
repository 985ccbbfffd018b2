//! Numbers that the program and the shaders share. Only Rust defines them; they are written into the source of the
//! shaders.

use std::fmt::Write;

/// A number of a shader.
#[derive(Clone, Copy, Debug)]
pub enum Constant {
    /// `f32`
    Float(f32),
    /// `u32`
    Count(u32),
    /// `i32`
    Signed(i32),
}

impl From<f32> for Constant {
    fn from(number: f32) -> Self {
        Self::Float(number)
    }
}

impl From<u32> for Constant {
    fn from(number: u32) -> Self {
        Self::Count(number)
    }
}

impl From<i32> for Constant {
    fn from(number: i32) -> Self {
        Self::Signed(number)
    }
}

impl Constant {
    /// The type and a literal of it. Exponents keep large numbers short; a literal has just enough digits to be exact.
    fn literal(self) -> (&'static str, String) {
        match self {
            Self::Float(number) => ("f32", format!("{number:e}f")),
            Self::Count(number) => ("u32", format!("{number}u")),
            Self::Signed(number) => ("i32", format!("{number}i")),
        }
    }
}

/// Declarations in WGSL.
pub fn declared(constants: &[(&str, Constant)]) -> String {
    let mut text = String::new();
    for (name, constant) in constants {
        let (kind, literal) = constant.literal();
        let _ = writeln!(text, "const {name}: {kind} = {literal};");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_type_and_their_last_bit() {
        let text = declared(&[("A", 3.0e38.into()), ("B", u32::MAX.into()), ("C", (-2).into()), ("D", 0.1_f32.into())]);
        assert_eq!(
            text,
            "const A: f32 = 3e38f;\nconst B: u32 = 4294967295u;\nconst C: i32 = -2i;\nconst D: f32 = 1e-1f;\n"
        );
    }
}
