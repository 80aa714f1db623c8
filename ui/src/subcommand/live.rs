//! The live view of a session: `--live`.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, ToSocketAddrs};

use anyhow::anyhow;
use quadfrog::recording::live::LiveServer;

use super::failure::Failure;

/// Port of Foxglove's WebSocket servers.
const PORT: u16 = 8765;
/// The address of `--live` without a value.
pub const DEFAULT: &str = "127.0.0.1:8765";

/// Starts the server of `--live ADDR`.
pub fn start(text: &str) -> Result<LiveServer, Failure> {
    let address = parse(text).map_err(|reason| {
        Failure::input(format!(
            "--live {text}: {reason}; give PORT or HOST:PORT of this machine, for example {DEFAULT}"
        ))
    })?;
    LiveServer::start(address).map_err(|error| match error.kind() {
        ErrorKind::AddrInUse => {
            let other = SocketAddr::new(address.ip(), address.port().wrapping_add(1).max(1024));
            Failure::Other(anyhow!(
                "--live {address}: another program listens there, perhaps another session; end it, or give another port, for example --live {other}"
            ))
        }
        ErrorKind::InvalidInput => {
            Failure::input(format!("--live {address}: {error}. From another machine: ssh -L {PORT}:{DEFAULT} this machine"))
        }
        _ => Failure::Other(anyhow!("--live {address}: {error}")),
    })
}

/// Returns the address that `PORT`, `HOST` or `HOST:PORT` names.
fn parse(text: &str) -> Result<SocketAddr, String> {
    if let Ok(port) = text.parse::<u16>() {
        return Ok(SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
    }
    if let Ok(host) = text.parse::<IpAddr>() {
        return Ok(SocketAddr::new(host, PORT));
    }
    let mut found = text.to_socket_addrs().map_err(|error| error.to_string())?;
    found.next().ok_or_else(|| "no such host".to_owned())
}
