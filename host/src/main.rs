//! The `prehend` command: parse, run, exit status.
fn main() {}
