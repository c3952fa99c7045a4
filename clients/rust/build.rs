//! Generates the code of the contract with protoc, which `PROTOC` may name.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    tonic_prost_build::configure()
        .build_server(false)
        .compile_protos(&["sketchmatch/v1/match_service.proto"], &["../../proto"])?;
    Ok(())
}
