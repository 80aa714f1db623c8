//! The signals of a recording as a table: a row per tick, a column per scalar. A column has the name of its field in
//! `proto/frog.proto` and that field's unit; those of twelve joints end in leg and joint, `position_FR_hip`; those of the
//! command begin with `command_`, the simulator's true state with `truth_`, the battery with `battery_`.

use std::io::{self, Write};
use std::sync::mpsc::sync_channel;

use nalgebra::{UnitQuaternion, Vector3};

use super::columns::{Cells, TableFormat, TableWriter, TypedColumn};
use crate::recording::player::{MarkerKind, Played, Player};
use crate::robot::{Battery, JOINTS, Leg, MotorCommand, Truth, joint_name};
use crate::telemetry::Tick;

/// Rows of a batch: some 30 MB of memory for all signals.
const BATCH_ROWS: usize = 16_384;

/// Topic whose signals are exported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SignalTopic {
    /// `/robot/tick`.
    Tick,
    /// `/robot/joint_states`.
    JointStates,
    /// `/robot/joint_cmd`.
    JointCommand,
}

impl SignalTopic {
    /// All topics with signals of every tick.
    pub const ALL: [SignalTopic; 3] = [SignalTopic::Tick, SignalTopic::JointStates, SignalTopic::JointCommand];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            SignalTopic::Tick => "/robot/tick",
            SignalTopic::JointStates => "/robot/joint_states",
            SignalTopic::JointCommand => "/robot/joint_cmd",
        }
    }
}

/// Ticks of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SignalRange {
    /// Trial to which they belong; none for all ticks.
    pub trial: Option<u32>,
    /// First time since the engine started, ns.
    pub from_ns: u64,
    /// Time since the engine started before which they end, ns.
    pub until_ns: u64,
}

/// Value of a signal at a tick.
enum Scalar {
    Missing,
    Number(f64),
    Whole(i64),
    Flag(bool),
    Name(&'static str),
}

type Read = Box<dyn Fn(&Tick) -> Scalar>;

/// A signal: an empty column and its value at a tick.
struct Signal {
    column: TypedColumn,
    read: Read,
}

/// The signals of a topic, or of all.
pub struct Signals {
    signals: Vec<Signal>,
}

impl Signals {
    /// Returns the signals of a topic, or of all.
    pub fn of(topic: Option<SignalTopic>) -> Signals {
        let mut signals = Signals { signals: Vec::new() };
        for of in SignalTopic::ALL.into_iter().filter(|of| topic.is_none_or(|topic| topic == *of)) {
            match of {
                SignalTopic::Tick => signals.add_tick(),
                SignalTopic::JointStates => signals.add_joint_states(),
                SignalTopic::JointCommand => signals.add_joint_command(),
            }
        }
        signals
    }

    /// Writes the rows of a recording's files, one after the other: `log_time`, ns UTC since 1970, then the signals. Returns the destination and the
    /// number of rows.
    ///
    /// # Errors
    /// When the destination cannot be written.
    pub fn export<W: Write + Send>(
        &self,
        players: &mut [Player],
        range: SignalRange,
        format: TableFormat,
        out: W,
    ) -> io::Result<(W, u64)> {
        let mut columns = self.columns();
        let mut writer = TableWriter::new(format, out, &columns)?;
        std::thread::scope(|scope| {
            // Reading and encoding at the same time; two batches go round.
            let (full, batches) = sync_channel::<Vec<TypedColumn>>(0);
            let (emptied, empty) = sync_channel::<Vec<TypedColumn>>(2);
            let encoder = scope.spawn(move || {
                for mut columns in batches {
                    writer.write(&columns)?;
                    columns.iter_mut().for_each(TypedColumn::clear);
                    // The reader may have ended.
                    let _ = emptied.send(columns);
                }
                writer.finish()
            });
            let mut spare = Some(self.columns());
            let mut rows = 0;
            'files: for player in players {
                let start_utc_ns = player.start_utc_ns();
                let Some(first_ns) = range.first_ns(player) else { continue };
                player.seek(first_ns);
                for played in player.by_ref() {
                    if played.time_ns() >= range.until_ns {
                        break;
                    }
                    let Played::Tick(tick) = played else { continue };
                    if range.trial.is_some() && tick.trial != range.trial {
                        continue;
                    }
                    rows += 1;
                    self.push(&mut columns, start_utc_ns.saturating_add(tick.time_ns), &tick);
                    if columns[0].rows() == BATCH_ROWS {
                        let Some(next) = spare.take().or_else(|| empty.recv().ok()) else { break 'files };
                        // The encoder has ended with an error.
                        if full.send(std::mem::replace(&mut columns, next)).is_err() {
                            break 'files;
                        }
                    }
                }
            }
            let _ = full.send(columns);
            drop(full);
            let out =
                encoder.join().unwrap_or_else(|_| Err(io::Error::other("the encoder panicked; please report it")))?;
            Ok((out, rows))
        })
    }

    fn columns(&self) -> Vec<TypedColumn> {
        let time = TypedColumn::new("log_time", Cells::Whole(Vec::new()));
        std::iter::once(time).chain(self.signals.iter().map(|signal| signal.column.clone())).collect()
    }

    fn push(&self, columns: &mut [TypedColumn], log_time: u64, tick: &Tick) {
        let Some((time, columns)) = columns.split_first_mut() else { return };
        add(time, Scalar::Whole(log_time as i64));
        for (column, signal) in columns.iter_mut().zip(&self.signals) {
            add(column, (signal.read)(tick));
        }
    }

    fn add(&mut self, name: impl Into<String>, cells: Cells, read: impl Fn(&Tick) -> Scalar + 'static) {
        self.signals.push(Signal { column: TypedColumn::new(name, cells), read: Box::new(read) });
    }

    fn number(&mut self, name: impl Into<String>, read: impl Fn(&Tick) -> f64 + 'static) {
        self.add(name, Cells::Number(Vec::new()), move |tick| Scalar::Number(read(tick)));
    }

    fn whole(&mut self, name: impl Into<String>, read: impl Fn(&Tick) -> i64 + 'static) {
        self.add(name, Cells::Whole(Vec::new()), move |tick| Scalar::Whole(read(tick)));
    }

    fn flag(&mut self, name: impl Into<String>, read: impl Fn(&Tick) -> bool + 'static) {
        self.add(name, Cells::Flag(Vec::new()), move |tick| Scalar::Flag(read(tick)));
    }

    /// Adds a signal that may be missing.
    fn optional(&mut self, name: impl Into<String>, cells: Cells, read: impl Fn(&Tick) -> Option<Scalar> + 'static) {
        self.add(name, cells, move |tick| read(tick).unwrap_or(Scalar::Missing));
        if let Some(signal) = self.signals.last_mut() {
            signal.column.there = Some(Vec::new());
        }
    }

    fn vector(&mut self, names: [&str; 3], read: fn(&Tick) -> Vector3<f64>) {
        for (axis, name) in names.into_iter().enumerate() {
            self.number(name, move |tick| read(tick)[axis]);
        }
    }

    fn rotation(&mut self, name: &str, read: fn(&Tick) -> UnitQuaternion<f64>) {
        for (part, letter) in ["x", "y", "z", "w"].into_iter().enumerate() {
            self.number(format!("{name}_{letter}"), move |tick| read(tick).coords[part]);
        }
    }

    fn joints(&mut self, name: &str, read: fn(&Tick, usize) -> f64) {
        for joint in 0..JOINTS {
            self.number(format!("{name}_{}", joint_name(joint)), move |tick| read(tick, joint));
        }
    }

    fn battery(&mut self, name: &str, read: fn(&Battery) -> f64) {
        let value = move |tick: &Tick| Some(Scalar::Number(read(tick.state.battery.as_ref()?)));
        self.optional(format!("battery_{name}"), Cells::Number(Vec::new()), value);
    }

    fn truth(&mut self, name: &str, read: impl Fn(&Truth) -> f64 + 'static) {
        let value = move |tick: &Tick| Some(Scalar::Number(read(tick.state.truth.as_ref()?)));
        self.optional(format!("truth_{name}"), Cells::Number(Vec::new()), value);
    }

    fn true_flag(&mut self, name: &str, read: impl Fn(&Truth) -> bool + 'static) {
        let value = move |tick: &Tick| Some(Scalar::Flag(read(tick.state.truth.as_ref()?)));
        self.optional(format!("truth_{name}"), Cells::Flag(Vec::new()), value);
    }

    fn true_vector(&mut self, name: &str, read: fn(&Truth) -> Vector3<f64>) {
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            self.truth(&format!("{name}_{letter}"), move |truth| read(truth)[axis]);
        }
    }

    fn add_tick(&mut self) {
        self.whole("number", |tick| tick.number as i64);
        self.whole("time_ns", |tick| tick.time_ns as i64);
        self.add("mode", Cells::Name(Vec::new()), |tick| Scalar::Name(tick.mode.name()));
        self.add("phase", Cells::Name(Vec::new()), |tick| Scalar::Name(tick.phase.name()));
        self.optional("trial", Cells::Whole(Vec::new()), |tick| Some(Scalar::Whole(tick.trial?.into())));
        self.number("trial_time", |tick| tick.trial_time_s);
        self.number("theta", |tick| tick.theta_rad);
        self.vector(["roll", "pitch", "yaw"], |tick| tick.estimate.roll_pitch_yaw);
        self.vector(["position_x", "position_y", "position_z"], |tick| tick.estimate.position_world);
        self.vector(["velocity_x", "velocity_y", "velocity_z"], |tick| tick.estimate.velocity_world);
        self.rotation("orientation", |tick| tick.estimate.world_from_body);
        let turning = ["angular_velocity_x", "angular_velocity_y", "angular_velocity_z"];
        self.vector(turning, |tick| tick.estimate.angular_velocity_body);
        for (leg, name) in legs() {
            self.flag(format!("contact_{name}"), move |tick| tick.estimate.contact[leg]);
        }
        for (leg, name) in legs() {
            for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                self.number(format!("foot_{letter}_{name}"), move |tick| tick.estimate.foot_position_leg[leg][axis]);
            }
        }
        self.whole("robot_time_ms", |tick| tick.state.robot_time_ms.into());
        self.rotation("imu", |tick| tick.state.imu.world_from_body);
        self.vector(["gyro_x", "gyro_y", "gyro_z"], |tick| tick.state.imu.gyro_body);
        self.vector(["acc_x", "acc_y", "acc_z"], |tick| tick.state.imu.accel_body);
        for (leg, name) in legs() {
            self.number(format!("force_{name}"), move |tick| tick.state.foot_force_n[leg]);
        }
        self.joints("motor_temperature", |tick, joint| tick.state.motor_temperature_c[joint]);
        for joint in 0..JOINTS {
            let name = format!("motor_enabled_{}", joint_name(joint));
            self.flag(name, move |tick| tick.state.motor_enabled[joint]);
        }
        self.battery("charge", |battery| battery.charge_percent);
        self.battery("voltage", |battery| battery.voltage_v);
        self.battery("current", |battery| battery.current_a);
        self.add_truth();
        self.whole("lateness_ns", |tick| tick.stages.lateness_ns.into());
        self.whole("read_ns", |tick| tick.stages.read_ns.into());
        self.whole("decide_ns", |tick| tick.stages.decide_ns.into());
        self.whole("write_ns", |tick| tick.stages.write_ns.into());
    }

    fn add_truth(&mut self) {
        self.true_vector("position", |truth| truth.position_world);
        self.true_vector("velocity", |truth| truth.velocity_world);
        for (part, letter) in ["x", "y", "z", "w"].into_iter().enumerate() {
            self.truth(&format!("orientation_{letter}"), move |truth| truth.world_from_body.coords[part]);
        }
        self.true_vector("angular_velocity", |truth| truth.angular_velocity_body);
        for (leg, name) in legs() {
            self.true_flag(&format!("contact_{name}"), move |truth| truth.foot_contact[leg]);
        }
        for (leg, name) in legs() {
            for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                self.truth(&format!("force_{letter}_{name}"), move |truth| truth.foot_force_world[leg][axis]);
            }
        }
        self.true_flag("body_contact", |truth| truth.body_contact);
    }

    fn add_joint_states(&mut self) {
        self.joints("position", |tick, joint| tick.state.joint_position_rad[joint]);
        self.joints("velocity", |tick, joint| tick.state.joint_velocity_rad_s[joint]);
        self.joints("effort", |tick, joint| tick.state.joint_torque_n_m[joint]);
    }

    fn add_joint_command(&mut self) {
        type Part = fn(&MotorCommand) -> f64;
        let parts: [(&str, Part); 5] = [
            ("position", |motor| motor.position_rad),
            ("velocity", |motor| motor.velocity_rad_s),
            ("kp", |motor| motor.kp_joint),
            ("kd", |motor| motor.kd_joint),
            ("torque", |motor| motor.torque_n_m),
        ];
        for (part, read) in parts {
            for joint in 0..JOINTS {
                let name = format!("command_{part}_{}", joint_name(joint));
                self.number(name, move |tick| read(&tick.command.motor[joint]));
            }
        }
        self.joints("torque_demanded", |tick, joint| tick.torque_demanded[joint]);
        for joint in 0..JOINTS {
            self.flag(format!("limited_{}", joint_name(joint)), move |tick| tick.limited & (1 << joint) != 0);
        }
    }
}

/// The legs with the ends of their fields' names.
fn legs() -> impl Iterator<Item = (usize, String)> {
    Leg::ALL.iter().enumerate().map(|(index, leg)| (index, leg.name().to_lowercase()))
}

fn add(column: &mut TypedColumn, value: Scalar) {
    if let Some(there) = &mut column.there {
        there.push(i16::from(!matches!(value, Scalar::Missing)));
    }
    match (&mut column.cells, value) {
        (Cells::Number(cells), Scalar::Number(value)) => cells.push(value),
        (Cells::Whole(cells), Scalar::Whole(value)) => cells.push(value),
        (Cells::Flag(cells), Scalar::Flag(value)) => cells.push(value),
        (Cells::Name(cells), Scalar::Name(value)) => cells.push(value),
        (_, value) => debug_assert!(matches!(value, Scalar::Missing), "{}: a value of another type", column.name),
    }
}

impl SignalRange {
    /// Returns the time at which playing begins: that of the range, or of the trial's first tick; none of a file without it.
    fn first_ns(&self, player: &Player) -> Option<u64> {
        let begins = |trial| player.markers().iter().find(|marker| marker.kind == MarkerKind::Trial(trial));
        let of_trial = match self.trial {
            Some(trial) => begins(trial)?.time_ns,
            None => 0,
        };
        Some(self.from_ns.max(of_trial))
    }
}
