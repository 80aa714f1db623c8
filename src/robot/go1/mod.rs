//! The Unitree Go1 over its low-level UDP protocol: [`packet`] defines the datagrams, [`convert`] their meaning,
//! [`link`] the socket; [`Go1`] implements [`Robot`] with them.
//!
//! `robots/go1/README.md` lists the known and unknown properties of the robot with their sources.

pub mod convert;
pub mod link;
pub mod packet;

use std::net::{SocketAddr, UdpSocket};

use super::description::{DescriptionError, RobotFiles};
use super::link_settings::LinkSettings;
use super::servo_grace::ServoGrace;
use super::state_counter::StateClock;
use super::{CONTACT_S, JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use link::{Link, LinkError, LinkOptions};
use packet::{CommandError, CrcForm, LowCmd};

/// Section `[network]` of `robot.toml`, which explains every key.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Go1Network {
    /// Address of the robot's low-level controller.
    pub address: SocketAddr,
    /// Local port; 0 takes any free one.
    pub local_port: u16,
    /// Form of the commands' checksum.
    pub crc: CrcForm,
    /// Time between two states on the robot's clock, ms.
    pub state_period_ms: u32,
    /// A state older than the newest by more than this means that the robot has restarted, ms.
    pub restart_ms: u32,
    /// Period of hello commands to a robot that has not answered yet, ms.
    pub hello_ms: u32,
    /// Time that a motor may take to report servo mode after the first command, ms.
    pub servo_grace_ms: u32,
    /// Resolution of a foot sensor, N.
    pub foot_force_n: f64,
}

impl Go1Network {
    /// Reads and checks the section `[network]` of the robot's `robot.toml`; none if there is none.
    ///
    /// # Errors
    /// A key is unknown or missing, or a value is out of range.
    pub fn read(files: &RobotFiles) -> Result<Option<Go1Network>, DescriptionError> {
        #[derive(serde::Deserialize)]
        struct NetworkToml {
            network: Option<Go1Network>,
        }
        let Some(network) = files.toml::<NetworkToml>()?.network else { return Ok(None) };
        network.link_settings().check(files, "network")?;
        let hello_ms = network.hello_ms;
        if !(10..=10_000).contains(&hello_ms) {
            return Err(files.invalid("network.hello_ms", format!("{hello_ms} ms"), "give 10 to 10000 milliseconds"));
        }
        Ok(Some(network))
    }

    /// Returns the settings that every robot has.
    fn link_settings(&self) -> LinkSettings {
        LinkSettings {
            clock: StateClock { state_period_ms: self.state_period_ms, restart_ms: self.restart_ms },
            servo_grace_ms: self.servo_grace_ms,
            foot_force_n: self.foot_force_n,
        }
    }
}

/// A Go1 behind its link.
///
/// Assumed: the robot sends its states to the source address of the commands. From `begin_contact` until the first state
/// arrives, at most for [`CONTACT_S`], a hello command, in which every motor brakes without a target, is sent a few times
/// per second. The controller's first command ends them too: its damping is never mixed with braking.
#[derive(Debug)]
pub struct Go1 {
    link: Link,
    network: Go1Network,
    /// Time for which the robot has been called, ms; none if it is not called.
    called_ms: Option<u32>,
    servo: ServoGrace,
    /// The last sent command that damps every joint.
    damping: Option<LowCmd>,
}

impl Go1 {
    /// Opens the link. With `listen_only` no hello commands are sent before `begin_contact`.
    ///
    /// # Errors
    /// The local port is taken, or there is no route to the address.
    pub fn open(network: &Go1Network, listen_only: bool) -> Result<Go1, LinkError> {
        let link = Link::open(&LinkOptions {
            address: network.address,
            local_port: network.local_port,
            clock: network.link_settings().clock,
        })?;
        Ok(Go1 {
            link,
            network: *network,
            called_ms: (!listen_only).then_some(0),
            servo: ServoGrace::new(network.servo_grace_ms),
            damping: None,
        })
    }

    /// Returns the local address.
    ///
    /// # Errors
    /// Error of the operating system.
    pub fn local_address(&self) -> std::io::Result<SocketAddr> {
        self.link.local_address()
    }

    /// Returns a second descriptor of the socket to the robot, for the guard.
    ///
    /// # Errors
    /// The system has no descriptor left.
    pub fn socket(&self) -> std::io::Result<UdpSocket> {
        self.link.socket()
    }

    /// Encodes the command that damps every joint with `kd`, N m s/rad.
    ///
    /// # Errors
    /// `kd` is out of the datagram's range.
    pub fn damping(&self, kd: f64) -> Result<LowCmd, CommandError> {
        convert::low_cmd(&JointCommand::damping(kd), self.network.crc)
    }

    /// Calls a robot that has never answered: sends a hello command at once, then one per period.
    fn call(&mut self) {
        let Some(called_ms) = self.called_ms.filter(|ms| *ms < 1000 * CONTACT_S && !self.link.has_received()) else {
            return;
        };
        self.called_ms = Some(called_ms + 1);
        if called_ms.is_multiple_of(self.network.hello_ms) {
            // An error is counted in the link's statistics.
            let _ = self.link.send(&LowCmd::braking(self.network.crc));
        }
    }
}

impl Robot for Go1 {
    /// Returns the newest state if one arrived since the last call, its age otherwise.
    fn read(&mut self) -> Result<RobotState, RobotError> {
        self.servo.advance();
        let Some(state) = self.link.receive() else {
            let age_ms = self.link.status().state_age_ms;
            self.call();
            return Err(RobotError::NoNewState { age_ms });
        };
        let mut state = convert::robot_state(state, self.network.foot_force_n);
        self.servo.apply(&mut state, self.link.status().reboots);
        Ok(state)
    }

    /// Sends one command. If it does not fit a datagram, the error is `EINVAL` and the last damping command is sent in
    /// its place. Every robot is damped before it is armed; one that was never damped was never commanded, and nothing
    /// is sent to it. No hello command follows.
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.called_ms = None;
        let encoded = convert::low_cmd(command, self.network.crc);
        if *command == JointCommand::damping(command.motor[0].kd_joint) {
            self.damping = encoded.as_ref().ok().copied().or(self.damping);
        }
        if let Some(datagram) = encoded.as_ref().ok().or(self.damping.as_ref()) {
            self.link.send(datagram).map_err(|errno| RobotError::Send { errno })?;
        }
        encoded.map_err(|_| RobotError::Send { errno: nix::errno::Errno::EINVAL as i32 })?;
        self.servo.command();
        Ok(())
    }

    /// Returns false: only a person can place the robot.
    fn place(&mut self, _: &Placement) -> bool {
        false
    }

    fn link(&self) -> Option<LinkStatus> {
        Some(*self.link.status())
    }

    fn begin_contact(&mut self) {
        self.called_ms = Some(0);
    }

    fn warm_up(&mut self) {
        // Any command that fits a datagram.
        let Ok(command) = self.damping(1.0) else { return };
        if let Some(state) = self.link.warm_up(command) {
            std::hint::black_box(convert::robot_state(state, self.network.foot_force_n));
        }
    }
}
