//! SynTable with plugins from outside.

use std::process::ExitCode;

use syntable_program as _;

fn main() -> ExitCode {
    match outside::program() {
        Ok(program) => program.run(),
        Err(clash) => {
            eprintln!("{clash}");
            ExitCode::from(2)
        }
    }
}
