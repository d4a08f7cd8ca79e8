//! The `demeter` program.
fn main() {}
