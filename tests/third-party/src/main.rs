//! SynTable with plugins from outside.

use outside as _;

fn main() -> std::process::ExitCode {
    syntable_program::main()
}
