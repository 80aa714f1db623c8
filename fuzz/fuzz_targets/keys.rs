//! Entry of cargo-fuzz: `cargo +nightly fuzz run keys`.
#![no_main]

#[path = "../../tests/fuzz/targets.rs"]
#[allow(dead_code, reason = "each entry uses one target")]
mod targets;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| targets::keys(bytes));
