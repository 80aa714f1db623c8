//! Compiles `proto/frog.proto` to Rust types and to the descriptor that a recording carries.

use std::path::PathBuf;

use prost::Message as _;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=proto");
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let mut descriptors = protox::compile(["frog.proto"], ["proto"])?;
    prost_build::Config::new().compile_fds(descriptors.clone())?;
    // Every schema of a recording contains the descriptor: without comments it has a third of the length.
    for file in &mut descriptors.file {
        file.source_code_info = None;
    }
    std::fs::write(out.join("frog.v1.bin"), descriptors.encode_to_vec())?;
    Ok(())
}
