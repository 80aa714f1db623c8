//! The signals of a recording as a table: a row per tick, a column per scalar. A column has the name of its field in
//! `proto/frog.proto` and that field's unit; those of twelve joints end in leg and joint, `position_FR_hip`; those of the
//! command begin with `command_`, the simulator's true state with `truth_`, the battery with `battery_`.

use std::io::{self, Write};
use std::sync::mpsc::sync_channel;
use std::thread::Builder;

use nalgebra::{UnitQuaternion, Vector3};

use super::columns::{Cells, TableFormat, TableWriter, TypedColumn};
use crate::recording::player::{MarkerKind, Played, Player};
use crate::robot::{Battery, JOINTS, Leg, Truth, joint_name};
use crate::telemetry::Tick;

/// Rows of a batch: some 30 MB of memory for all signals.
const BATCH_ROWS: usize = 16_384;

/// Ticks of a block: few enough for the processor's cache.
const BLOCK_TICKS: usize = 128;

/// Log time, ns UTC since 1970, and tick.
type Stamped = (u64, Tick);

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

    /// Returns a few words about its signals.
    pub fn about(self) -> &'static str {
        match self {
            SignalTopic::Tick => "State of the trunk, feet, estimate and phase of every tick",
            SignalTopic::JointStates => "Measured angle, speed and torque of each joint",
            SignalTopic::JointCommand => "Commanded angle, speed, torque and gains of each joint",
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

/// A value of a signal: the type of its column.
trait Cell: Sized {
    /// Cells of this type, none yet.
    const NONE: Cells;

    /// Returns the cells of this type; none of a column with another.
    fn of(cells: &mut Cells) -> Option<&mut Vec<Self>>;
}

macro_rules! cell {
    ($type:ty, $kind:ident) => {
        impl Cell for $type {
            const NONE: Cells = Cells::$kind(Vec::new());

            fn of(cells: &mut Cells) -> Option<&mut Vec<Self>> {
                if let Cells::$kind(cells) = cells { Some(cells) } else { None }
            }
        }
    };
}

cell!(f64, Number);
cell!(i64, Whole);
cell!(bool, Flag);
cell!(&'static str, Name);

/// Adds the values of a signal at the ticks of a block.
type Push = Box<dyn Fn(&mut TypedColumn, &[Stamped])>;

/// A signal: an empty column, and what adds its values at the ticks of a block.
struct Signal {
    column: TypedColumn,
    push: Push,
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

    /// Writes the rows of a recording's files, one after the other: `log_time`, ns UTC since 1970, then the signals. Returns the
    /// number of rows.
    ///
    /// # Errors
    /// When the destination cannot be written.
    pub fn export(
        &self,
        players: &mut [Player],
        range: SignalRange,
        format: TableFormat,
        out: &mut (dyn Write + Send),
    ) -> io::Result<u64> {
        match self.export_in_parallel(players, range, format, out)? {
            Some(rows) => Ok(rows),
            None => self.export_alone(players, range, format, out),
        }
    }

    /// Exports with two more threads: reading, filling columns and encoding at the same time. Returns none, with nothing read and
    /// written, where the system does not give the threads.
    fn export_in_parallel(
        &self,
        players: &mut [Player],
        range: SignalRange,
        format: TableFormat,
        out: &mut (dyn Write + Send),
    ) -> io::Result<Option<u64>> {
        std::thread::scope(|scope| {
            // Two batches go round.
            let (full, batches) = sync_channel::<Vec<TypedColumn>>(0);
            let (emptied, empty) = sync_channel::<Vec<TypedColumn>>(2);
            let encode = move || {
                // Without a first batch there is no reader.
                let Ok(first) = batches.recv() else { return Ok(()) };
                let mut writer = TableWriter::new(format, out, &first)?;
                for mut columns in std::iter::once(first).chain(batches) {
                    writer.write(&columns)?;
                    columns.iter_mut().for_each(TypedColumn::clear);
                    // The reader may have ended.
                    let _ = emptied.send(columns);
                }
                writer.finish()
            };
            let Ok(encoder) = Builder::new().spawn_scoped(scope, encode) else { return Ok(None) };
            let (read, blocks) = sync_channel(2);
            let reader = move || range.read(players, |block| read.send(block).is_ok());
            if Builder::new().spawn_scoped(scope, reader).is_err() {
                return Ok(None);
            }
            let (mut columns, mut spare) = (self.columns(), Some(self.columns()));
            let mut rows = 0;
            for block in &blocks {
                rows += block.len() as u64;
                self.push(&mut columns, &block);
                if columns[0].rows() >= BATCH_ROWS {
                    let Some(next) = spare.take().or_else(|| empty.recv().ok()) else { break };
                    // The encoder has ended with an error.
                    if full.send(std::mem::replace(&mut columns, next)).is_err() {
                        break;
                    }
                }
            }
            // The reader ends.
            drop(blocks);
            let _ = full.send(columns);
            drop(full);
            encoder.join().unwrap_or_else(|_| Err(io::Error::other("the encoder panicked; please report it")))?;
            Ok(Some(rows))
        })
    }

    /// Exports on the calling thread.
    fn export_alone(
        &self,
        players: &mut [Player],
        range: SignalRange,
        format: TableFormat,
        out: &mut (dyn Write + Send),
    ) -> io::Result<u64> {
        let mut columns = self.columns();
        let mut writer = TableWriter::new(format, out, &columns)?;
        let (mut rows, mut written) = (0, Ok(()));
        range.read(players, |block| {
            rows += block.len() as u64;
            self.push(&mut columns, &block);
            if columns[0].rows() >= BATCH_ROWS {
                written = writer.write(&columns);
                columns.iter_mut().for_each(TypedColumn::clear);
            }
            written.is_ok()
        });
        written?;
        writer.write(&columns)?;
        writer.finish()?;
        Ok(rows)
    }

    fn columns(&self) -> Vec<TypedColumn> {
        let time = TypedColumn::new("log_time", Cells::Whole(Vec::new()));
        std::iter::once(time).chain(self.signals.iter().map(|signal| signal.column.clone())).collect()
    }

    /// Adds the rows of a block, column by column.
    fn push(&self, columns: &mut [TypedColumn], block: &[Stamped]) {
        let Some((time, columns)) = columns.split_first_mut() else { return };
        extend(time, block.iter().map(|(log_time, _)| *log_time as i64));
        for (column, signal) in columns.iter_mut().zip(&self.signals) {
            (signal.push)(column, block);
        }
    }

    fn add<T: Cell>(&mut self, name: impl Into<String>, read: impl Fn(&Tick) -> T + 'static) {
        let push = move |column: &mut TypedColumn, block: &[Stamped]| {
            extend(column, block.iter().map(|(_, tick)| read(tick)));
        };
        self.signals.push(Signal { column: TypedColumn::new(name, T::NONE), push: Box::new(push) });
    }

    /// Adds a signal that may be missing.
    fn optional<T: Cell>(&mut self, name: impl Into<String>, read: impl Fn(&Tick) -> Option<T> + 'static) {
        let push = move |column: &mut TypedColumn, block: &[Stamped]| {
            extend(column, block.iter().filter_map(|(_, tick)| read(tick)));
            let there = block.iter().map(|(_, tick)| i16::from(read(tick).is_some()));
            column.there.get_or_insert_default().extend(there);
        };
        let column = TypedColumn { there: Some(Vec::new()), ..TypedColumn::new(name, T::NONE) };
        self.signals.push(Signal { column, push: Box::new(push) });
    }

    fn vector(&mut self, names: [&str; 3], read: impl Fn(&Tick) -> &Vector3<f64> + Copy + 'static) {
        for (axis, name) in names.into_iter().enumerate() {
            self.add(name, move |tick| read(tick)[axis]);
        }
    }

    fn rotation(&mut self, name: &str, read: impl Fn(&Tick) -> &UnitQuaternion<f64> + Copy + 'static) {
        for (part, letter) in ["x", "y", "z", "w"].into_iter().enumerate() {
            self.add(format!("{name}_{letter}"), move |tick| read(tick).coords[part]);
        }
    }

    fn joints<T: Cell>(&mut self, name: &str, read: impl Fn(&Tick, usize) -> T + Copy + 'static) {
        for joint in 0..JOINTS {
            self.add(format!("{name}_{}", joint_name(joint)), move |tick| read(tick, joint));
        }
    }

    fn battery(&mut self, name: &str, read: impl Fn(&Battery) -> f64 + 'static) {
        self.optional(format!("battery_{name}"), move |tick| tick.state.battery.as_ref().map(&read));
    }

    fn truth<T: Cell>(&mut self, name: &str, read: impl Fn(&Truth) -> T + 'static) {
        self.optional(format!("truth_{name}"), move |tick| tick.state.truth.as_ref().map(&read));
    }

    fn true_vector(&mut self, name: &str, read: impl Fn(&Truth) -> &Vector3<f64> + Copy + 'static) {
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            self.truth(&format!("{name}_{letter}"), move |truth| read(truth)[axis]);
        }
    }

    fn add_tick(&mut self) {
        self.add("number", |tick| tick.number as i64);
        self.add("time_ns", |tick| tick.time_ns as i64);
        self.add("mode", |tick| tick.mode.name());
        self.add("phase", |tick| tick.phase.name());
        self.optional("trial", |tick| tick.trial.map(i64::from));
        self.add("trial_time", |tick| tick.trial_time_s);
        self.add("theta", |tick| tick.theta_rad);
        self.vector(["roll", "pitch", "yaw"], |tick| &tick.estimate.roll_pitch_yaw);
        self.vector(["position_x", "position_y", "position_z"], |tick| &tick.estimate.position_world);
        self.vector(["velocity_x", "velocity_y", "velocity_z"], |tick| &tick.estimate.velocity_world);
        self.rotation("orientation", |tick| &tick.estimate.world_from_body);
        let turning = ["angular_velocity_x", "angular_velocity_y", "angular_velocity_z"];
        self.vector(turning, |tick| &tick.estimate.angular_velocity_body);
        for (leg, name) in legs() {
            self.add(format!("contact_{name}"), move |tick| tick.estimate.contact[leg]);
        }
        for (leg, name) in legs() {
            for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                self.add(format!("foot_{letter}_{name}"), move |tick| tick.estimate.foot_position_leg[leg][axis]);
            }
        }
        self.add("robot_time_ms", |tick| i64::from(tick.state.robot_time_ms));
        self.rotation("imu", |tick| &tick.state.imu.world_from_body);
        self.vector(["gyro_x", "gyro_y", "gyro_z"], |tick| &tick.state.imu.gyro_body);
        self.vector(["acc_x", "acc_y", "acc_z"], |tick| &tick.state.imu.accel_body);
        for (leg, name) in legs() {
            self.add(format!("force_{name}"), move |tick| tick.state.foot_force_n[leg]);
        }
        self.joints("motor_temperature", |tick, joint| tick.state.motor_temperature_c[joint]);
        self.joints("motor_enabled", |tick, joint| tick.state.motor_enabled[joint]);
        self.battery("charge", |battery| battery.charge_percent);
        self.battery("voltage", |battery| battery.voltage_v);
        self.battery("current", |battery| battery.current_a);
        for cell in 0..Battery::default().cell_v.len() {
            self.battery(&format!("cell_{}", cell + 1), move |battery| battery.cell_v[cell]);
        }
        self.add_truth();
        self.add("lateness_ns", |tick| i64::from(tick.stages.lateness_ns));
        self.add("read_ns", |tick| i64::from(tick.stages.read_ns));
        self.add("decide_ns", |tick| i64::from(tick.stages.decide_ns));
        self.add("write_ns", |tick| i64::from(tick.stages.write_ns));
    }

    fn add_truth(&mut self) {
        self.true_vector("position", |truth| &truth.position_world);
        self.true_vector("velocity", |truth| &truth.velocity_world);
        for (part, letter) in ["x", "y", "z", "w"].into_iter().enumerate() {
            self.truth(&format!("orientation_{letter}"), move |truth| truth.world_from_body.coords[part]);
        }
        self.true_vector("angular_velocity", |truth| &truth.angular_velocity_body);
        for (leg, name) in legs() {
            self.truth(&format!("contact_{name}"), move |truth| truth.foot_contact[leg]);
        }
        for (leg, name) in legs() {
            for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                self.truth(&format!("force_{letter}_{name}"), move |truth| truth.foot_force_world[leg][axis]);
            }
        }
        self.truth("body_contact", |truth| truth.body_contact);
    }

    fn add_joint_states(&mut self) {
        self.joints("position", |tick, joint| tick.state.joint_position_rad[joint]);
        self.joints("velocity", |tick, joint| tick.state.joint_velocity_rad_s[joint]);
        self.joints("effort", |tick, joint| tick.state.joint_torque_n_m[joint]);
    }

    fn add_joint_command(&mut self) {
        self.joints("command_position", |tick, joint| tick.command.motor[joint].position_rad);
        self.joints("command_velocity", |tick, joint| tick.command.motor[joint].velocity_rad_s);
        self.joints("command_kp", |tick, joint| tick.command.motor[joint].kp_joint);
        self.joints("command_kd", |tick, joint| tick.command.motor[joint].kd_joint);
        self.joints("command_torque", |tick, joint| tick.command.motor[joint].torque_n_m);
        self.joints("torque_demanded", |tick, joint| tick.torque_demanded[joint]);
        self.joints("limited", |tick, joint| tick.limited & (1 << joint) != 0);
    }
}

/// The legs with the ends of their fields' names.
fn legs() -> impl Iterator<Item = (usize, String)> {
    Leg::ALL.iter().enumerate().map(|(index, leg)| (index, leg.name().to_lowercase()))
}

/// Adds cells to a column of their type.
fn extend<T: Cell>(column: &mut TypedColumn, values: impl Iterator<Item = T>) {
    match T::of(&mut column.cells) {
        Some(cells) => cells.extend(values),
        None => debug_assert!(false, "{}: values of another type", column.name),
    }
}

impl SignalRange {
    /// Passes the ticks in blocks to `take`, until their end or until it returns false.
    fn read(&self, players: &mut [Player], mut take: impl FnMut(Vec<Stamped>) -> bool) {
        for player in players {
            let start_utc_ns = player.start_utc_ns();
            let Some(first_ns) = self.first_ns(player) else { continue };
            player.seek(first_ns);
            let within = player.by_ref().take_while(|played| played.time_ns() < self.until_ns);
            let mut ticks = within.filter_map(|played| match played {
                Played::Tick(tick) if self.trial.is_none() || tick.trial == self.trial => {
                    Some((start_utc_ns.saturating_add(tick.time_ns), *tick))
                }
                _ => None,
            });
            loop {
                let mut block = Vec::with_capacity(BLOCK_TICKS);
                block.extend(ticks.by_ref().take(BLOCK_TICKS));
                if block.is_empty() {
                    break;
                }
                if !take(block) {
                    return;
                }
            }
        }
    }

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
