//! The Unitree Go1 over its low-level UDP protocol: [`packet`] is bytes without sockets, [`convert`] what they mean, [`link`] one
//! socket that judges and counts; here they become a [`Robot`].
//!
//! What is known of the robot and how, and what is not established, is in `robots/go1/README.md`.

pub mod convert;
pub mod link;
pub mod packet;

use std::net::{SocketAddr, UdpSocket};

use super::description::RobotDescription;
use super::{JOINTS, JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use link::{Link, LinkError, LinkOptions};
use packet::{CommandError, CrcForm, LowCmd};

/// The section `[network]` of `robot.toml`; every key is explained there.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// Where the robot's low-level controller listens.
    pub address: SocketAddr,
    /// The port of this machine; 0 takes any.
    pub local_port: u16,
    /// Form of the commands' checksum.
    pub crc: CrcForm,
    /// Time between two states on the robot's clock, ms.
    pub state_period_ms: u32,
    /// A state older than the newest by more than this is one of a robot that restarted, ms.
    pub restart_ms: u32,
    /// How often a robot that has not answered yet is called, ms.
    pub hello_ms: u32,
    /// How long a motor may take to report servo mode once it is commanded, ms.
    pub servo_grace_ms: u32,
    /// Force of one step of a foot's sensor, N.
    pub foot_force_n: f64,
}

impl Network {
    /// The first value that cannot be: key, value, what to give instead.
    pub fn problem(&self) -> Option<(&'static str, String, &'static str)> {
        let zero = |value: u32| value == 0;
        if zero(self.state_period_ms) {
            Some(("network.state_period_ms", "0".to_owned(), "give 1 or more milliseconds"))
        } else if zero(self.restart_ms) {
            Some(("network.restart_ms", "0".to_owned(), "give 1 or more milliseconds"))
        } else if zero(self.hello_ms) {
            Some(("network.hello_ms", "0".to_owned(), "give 1 or more milliseconds"))
        } else if !(self.foot_force_n.is_finite() && self.foot_force_n > 0.0) {
            Some(("network.foot_force_n", self.foot_force_n.to_string(), "give a number of more than zero"))
        } else {
            None
        }
    }
}

/// The robot.
///
/// It is thought to send its states to where commands come from, so a robot that has not been heard is called: a few times a
/// second a command goes out in which every motor brakes without a target. Once it is heard, the controller alone decides
/// what is sent.
#[derive(Debug)]
pub struct Go1 {
    link: Link,
    network: Network,
    /// Whether a silent robot is called.
    calls: bool,
    /// Milliseconds since the last call.
    since_call_ms: u32,
    /// Milliseconds since servo mode was first commanded in this life of the robot.
    servo_ms: Option<u32>,
    /// Restarts of the robot that `servo_ms` knows of.
    reboots: u64,
    /// The last command to damp every joint, as it was sent.
    damping: Option<LowCmd>,
}

impl Go1 {
    /// Opens the link to the robot of `description`. With `listen_only` nothing is ever sent but what is written.
    ///
    /// # Errors
    /// When the description has no network, the local port is taken, or there is no way to the address.
    pub fn open(description: &RobotDescription, listen_only: bool) -> Result<Go1, LinkError> {
        let Some(network) = description.network else {
            return Err(LinkError::NoNetwork { robot: description.name.clone() });
        };
        let link = Link::open(&LinkOptions {
            address: network.address,
            local_port: network.local_port,
            state_period_ms: network.state_period_ms,
            restart_ms: network.restart_ms,
        })?;
        Ok(Go1 {
            link,
            network,
            calls: !listen_only,
            since_call_ms: network.hello_ms,
            servo_ms: None,
            reboots: 0,
            damping: None,
        })
    }

    /// The address of this end.
    ///
    /// # Errors
    /// When the system does not say.
    pub fn local_address(&self) -> std::io::Result<SocketAddr> {
        self.link.local_address()
    }

    /// The socket to the robot once more, for who takes the last word over.
    ///
    /// # Errors
    /// When the system has no descriptor left.
    pub fn socket(&self) -> std::io::Result<UdpSocket> {
        self.link.socket()
    }

    /// The datagram in which every joint is damped with `kd`, N m s/rad.
    ///
    /// # Errors
    /// When no datagram can say so.
    pub fn damping(&self, kd: f64) -> Result<LowCmd, CommandError> {
        convert::low_cmd(&JointCommand::damping(kd), self.network.crc)
    }

    /// Calls a robot that has never answered.
    fn call(&mut self) {
        self.since_call_ms += 1;
        if self.calls && !self.link.heard() && self.since_call_ms >= self.network.hello_ms {
            self.since_call_ms = 0;
            // What cannot be sent is counted; there is nobody yet to whom it would matter.
            let _ = self.link.send(&LowCmd::damping(self.network.crc));
        }
    }
}

impl Robot for Go1 {
    /// The newest state, if one came since the last call; otherwise how long there was none.
    fn read(&mut self) -> Result<RobotState, RobotError> {
        if let Some(servo_ms) = &mut self.servo_ms {
            *servo_ms = servo_ms.saturating_add(1);
        }
        let Some(state) = self.link.receive() else {
            let age_ms = self.link.status().state_age_ms;
            self.call();
            return Err(RobotError::Silent { age_ms });
        };
        let mut state = convert::robot_state(state, self.network.foot_force_n);
        let reboots = self.link.status().reboots;
        if reboots != self.reboots {
            // Its motors have not been told anything yet.
            self.reboots = reboots;
            self.servo_ms = None;
        }
        // A motor has left servo mode only if it was told to be in it, and had the time to.
        if self.servo_ms.is_none_or(|ms| ms <= self.network.servo_grace_ms) {
            state.motor_enabled = [true; JOINTS];
        }
        Ok(state)
    }

    /// A command that no datagram can say is not sent, and the error is `EINVAL`: for this millisecond the joints are damped as
    /// they last were by command, which is how every robot is treated before it is armed. One that was never damped so was
    /// never commanded anything: it is sent nothing.
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        let said = convert::low_cmd(command, self.network.crc);
        if *command == JointCommand::damping(command.motor[0].kd) {
            self.damping = said.as_ref().ok().copied().or(self.damping);
        }
        if let Some(datagram) = said.as_ref().ok().or(self.damping.as_ref()) {
            self.link.send(datagram).map_err(|errno| RobotError::Send { errno })?;
        }
        said.map_err(|_| RobotError::Send { errno: nix::errno::Errno::EINVAL as i32 })?;
        self.servo_ms.get_or_insert(0);
        Ok(())
    }

    /// Only a person can.
    fn place(&mut self, _: &Placement) -> bool {
        false
    }

    fn link(&self) -> Option<LinkStatus> {
        Some(*self.link.status())
    }

    fn rehearse(&mut self) {
        // Any damping that a datagram can say.
        let Ok(command) = self.damping(1.0) else { return };
        if let Some(state) = self.link.rehearse(command) {
            std::hint::black_box(convert::robot_state(state, self.network.foot_force_n));
        }
    }
}
