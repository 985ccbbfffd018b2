//! Public test kit for SynTable plugins: analytic scenes, conformance checks, statistics.
