//! The stock `syntable` binary.

use syntable_standard as _;

fn main() -> std::process::ExitCode {
    syntable_runtime::cli::main()
}
