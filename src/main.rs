//! The command `octray`.
#![forbid(unsafe_code)]
fn main() {}
