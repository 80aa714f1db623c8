//! A Redis server of a test's own.
#![allow(dead_code, reason = "each test uses its own part")]

use std::net::TcpListener;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::skip::skip;
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::study::Storage;

/// A process that ends with the test.
pub struct Ended(pub Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A server of the test's own, and its address; none where there is none to start.
pub fn server() -> Option<(Ended, String)> {
    let port = free_port();
    let server = start(port, &["--save", "", "--appendonly", "no"])?;
    Some((server, address(port)))
}

/// A port that no program uses.
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// The address of the journal of a server on this computer.
pub fn address(port: u16) -> String {
    format!("redis://127.0.0.1:{port}/0")
}

/// Starts a server with `arguments` and waits for its answer; none where there is none to start.
pub fn start(port: u16, arguments: &[&str]) -> Option<Ended> {
    let port_text = port.to_string();
    let common = ["--port", &port_text, "--bind", "127.0.0.1"];
    let Ok(child) = Command::new("redis-server").args(common).args(arguments).stdout(Stdio::null()).spawn() else {
        skip("redis-server is not installed");
        return None;
    };
    let server = Ended(child);
    let end = Instant::now() + Duration::from_secs(30);
    while Storage::Redis(address(port)).journal(Durability::Buffered).is_err() {
        assert!(Instant::now() < end, "redis-server did not answer within half a minute");
        std::thread::sleep(Duration::from_millis(50));
    }
    Some(server)
}
