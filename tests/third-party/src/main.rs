//! SynTable with a foreign annotator.

use centroid as _;
use syntable_standard as _;

fn main() -> std::process::ExitCode {
    syntable_runtime::cli::main()
}
