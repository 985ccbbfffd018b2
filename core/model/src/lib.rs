//! Types, keys, stage traits and the registry: what a SynTable plugin needs, and all it needs.
