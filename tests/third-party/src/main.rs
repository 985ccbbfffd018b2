//! SynTable with plugins from outside.

use outside as _;
use syntable_standard as _;

fn main() -> std::process::ExitCode {
    syntable_runtime::cli::main()
}
