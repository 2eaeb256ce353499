//! The command `hoof`.
fn main() {}
