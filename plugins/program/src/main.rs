//! The stock `syntable` binary.

fn main() -> std::process::ExitCode {
    syntable_program::main()
}
