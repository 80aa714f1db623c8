//! Section `[dds]` of `robot.toml`, and the choice of the interface to the robot.

use std::net::Ipv4Addr;

use nix::ifaddrs::getifaddrs;
use nix::net::if_::InterfaceFlags;

use crate::robot::description::{DescriptionError, RobotFiles};
use crate::robot::link_settings::LinkSettings;
use crate::robot::state_counter::StateClock;

/// Largest DDS domain whose ports exist.
const LARGEST_DOMAIN: u16 = 232;

/// Section `[dds]` of `robot.toml`, which explains every key.
#[derive(Debug, Clone, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Go2Network {
    /// DDS domain.
    pub domain: u16,
    /// Network interface to the robot, or its IPv4 address; empty: the only one in `subnet`.
    pub interface: String,
    /// Addresses of the robot's network, as ADDRESS/BITS.
    pub subnet: String,
    /// Whether commands are sent reliably: only for a robot whose reader demands that.
    pub reliable_commands: bool,
    /// Time between two states on the robot's clock, ms.
    pub state_period_ms: u32,
    /// A state older than the newest by more than this means that the robot has restarted, ms.
    pub restart_ms: u32,
    /// Time that a motor may take to report servo mode after the first command, ms.
    pub servo_grace_ms: u32,
    /// Force per count of a foot sensor, N.
    pub foot_force_n: f64,
}

/// Error of choosing the interface to the robot.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant and its fields")]
pub enum InterfaceError {
    #[error("the network interfaces of this machine cannot be listed: {reason}")]
    Unlisted { reason: String },
    #[error(
        "--interface {name}: this machine has none of that name or address that is up and has an IPv4 address; it has {known}"
    )]
    Unknown { name: String, known: String },
    #[error("--interface {name}: it has several addresses ({addresses}); give one of them in its place")]
    SeveralAddresses { name: String, addresses: String },
    #[error(
        "no interface of this machine has an address in the robot's network {subnet} (it has {known}); give one with --interface"
    )]
    None { subnet: String, known: String },
    #[error("several interfaces have an address in the robot's network {subnet}: {found}; give one with --interface")]
    Several { subnet: String, found: String },
}

/// An interface of this machine that is up, with one of its addresses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NetworkInterface {
    /// Its name, for example `eth0`.
    pub name: String,
    /// Its address.
    pub address: Ipv4Addr,
}

impl Go2Network {
    /// Reads and checks the section `[dds]` of the robot's `robot.toml`; none if there is none.
    ///
    /// # Errors
    /// A key is unknown or missing, or a value is out of range.
    pub fn read(files: &RobotFiles) -> Result<Option<Go2Network>, DescriptionError> {
        #[derive(serde::Deserialize)]
        struct DdsToml {
            dds: Option<Go2Network>,
        }
        let Some(network) = files.toml::<DdsToml>()?.dds else { return Ok(None) };
        if network.domain > LARGEST_DOMAIN {
            return Err(files.invalid("dds.domain", network.domain.to_string(), "give 0 to 232"));
        }
        if parse_subnet(&network.subnet).is_none() {
            return Err(files.invalid("dds.subnet", network.subnet, "give ADDRESS/BITS, for example 192.168.123.0/24"));
        }
        network.link_settings().check(files, "dds")?;
        Ok(Some(network))
    }

    /// Returns the settings that every robot has.
    pub fn link_settings(&self) -> LinkSettings {
        LinkSettings {
            clock: StateClock { state_period_ms: self.state_period_ms, restart_ms: self.restart_ms },
            servo_grace_ms: self.servo_grace_ms,
            foot_force_n: self.foot_force_n,
        }
    }

    /// Returns the address of the interface to the robot: of `interface`, or of the only one in `subnet`.
    ///
    /// # Errors
    /// No interface or several fit, or they cannot be listed.
    pub fn address(&self) -> Result<Ipv4Addr, InterfaceError> {
        self.address_among(&interfaces()?)
    }

    /// Returns the address of the interface to the robot, as [`Go2Network::address`], among `all` interfaces of a machine.
    ///
    /// # Errors
    /// No interface or several fit.
    pub fn address_among(&self, all: &[NetworkInterface]) -> Result<Ipv4Addr, InterfaceError> {
        choose(all, &self.interface, &self.subnet)
    }
}

/// Lists the interfaces that are up, each address of them once.
fn interfaces() -> Result<Vec<NetworkInterface>, InterfaceError> {
    let listed = getifaddrs().map_err(|errno| InterfaceError::Unlisted { reason: errno.to_string() })?;
    let up = listed.filter(|found| found.flags.contains(InterfaceFlags::IFF_UP));
    let addressed = up.filter_map(|found| {
        let address = found.address?.as_sockaddr_in()?.ip();
        Some(NetworkInterface { name: found.interface_name, address })
    });
    Ok(addressed.collect())
}

/// Chooses among `all` the interface with that name or address, or, without one, the only one in `subnet`.
fn choose(all: &[NetworkInterface], wanted: &str, subnet: &str) -> Result<Ipv4Addr, InterfaceError> {
    let list = |found: &[&NetworkInterface]| {
        let named: Vec<_> = found.iter().map(|one| format!("{} {}", one.name, one.address)).collect();
        if named.is_empty() { "none".to_owned() } else { named.join(", ") }
    };
    let known = || list(&all.iter().collect::<Vec<_>>());
    if wanted.is_empty() {
        let (network, mask) = parse_subnet(subnet).unwrap_or_default();
        let found: Vec<_> = all.iter().filter(|one| u32::from(one.address) & mask == network).collect();
        return match found[..] {
            [one] => Ok(one.address),
            [] => Err(InterfaceError::None { subnet: subnet.to_owned(), known: known() }),
            _ => Err(InterfaceError::Several { subnet: subnet.to_owned(), found: list(&found) }),
        };
    }
    let is_wanted = |one: &&NetworkInterface| one.name == wanted || one.address.to_string() == wanted;
    let found: Vec<_> = all.iter().filter(is_wanted).collect();
    match found[..] {
        [one] => Ok(one.address),
        [] => Err(InterfaceError::Unknown { name: wanted.to_owned(), known: known() }),
        _ => Err(InterfaceError::SeveralAddresses { name: wanted.to_owned(), addresses: list(&found) }),
    }
}

/// Parses ADDRESS/BITS to network and mask; none if it is not that, or not a network. BITS is 1 to 32.
pub fn parse_subnet(text: &str) -> Option<(u32, u32)> {
    let (address, bits) = text.split_once('/')?;
    let (address, bits): (Ipv4Addr, u32) = (address.parse().ok()?, bits.parse().ok()?);
    let mask = u32::MAX.checked_shl(32_u32.checked_sub(bits)?).unwrap_or(0);
    let network = u32::from(address);
    (bits > 0 && network & mask == network).then_some((network, mask))
}
