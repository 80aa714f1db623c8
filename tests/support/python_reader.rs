//! Recordings as the independent Python reader reads them.

use std::path::Path;
use std::process::Command;

use crate::skip::skip;
use serde_json::Value;

/// Returns what a script of this folder prints of a recording, one JSON object; none where Python or its packages are absent.
pub fn read_by_python(script: &str, recording: &Path) -> Option<Value> {
    let script =
        Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().map(|folder| folder.join("tests/support").join(script));
    let script = { script }.find(|script| script.exists()).expect("in this repository");
    let output = match Command::new("python3").arg(script).arg(recording).output() {
        Ok(output) => output,
        Err(error) => {
            skip(&format!("python3 cannot be started: {error}"));
            return None;
        }
    };
    let stderr = String::from_utf8_lossy(&output.stderr);
    if output.status.code() == Some(77) {
        skip(&format!("python3 has no mcap and mcap-protobuf-support: {}", stderr.trim()));
        return None;
    }
    assert!(output.status.success(), "{stderr}");
    Some(serde_json::from_slice(&output.stdout).expect("one JSON object"))
}
