//! The engine of quadfrog: everything but the terminal.
//!
//! quadfrog optimizes the jumps of a quadruped on the robot itself. A control thread drives the machine, or the built-in
//! simulator, at 1 kHz; an optimizer proposes a few parameters of a force profile; the robot jumps; an operator judges;
//! everything is recorded. The method is that of *Quadruped-Frog: Rapid Online Optimization of Continuous Quadruped
//! Jumping* (ICRA 2024); equations and sections in comments are the paper's.
//!
//! # Frames and units
//!
//! SI and radians everywhere; a name says its frame.
//!
//! | suffix | frame |
//! |---|---|
//! | `_world` | z up |
//! | `_body` | the trunk's: x forward, y left, z up |
//! | `_leg` | origin at the leg's hip joint, axes of the body |
//!
//! Legs are FR, FL, RR, RL; joints hip, thigh, calf; index `3 * leg + joint`. Forces in the controller are those that
//! the *foot* exerts, as in the paper.
//!
//! # Threads
//!
//! | from | to | data |
//! |---|---|---|
//! | console (the program's main thread) | session | requests |
//! | console | control | STOP, heartbeat |
//! | session | control, 1 kHz | commands |
//! | control | session | events, readiness |
//! | control | recorder | every tick |
//! | control | console | every fifth tick, snapshot |
//! | session | console, recorder | records |
//! | recorder | session | ticks of a trial |
//!
//! Everything that crosses to and from `control` is `Copy` ([`telemetry`]) and goes through wait-free channels
//! ([`realtime::channel`]). Nothing in a tick allocates, locks, logs or touches a file. STOP is a latch of its own that the tick
//! reads before it acts. Simulated time is the same [`control::cycle::Cycle::tick`] called without a thread
//! ([`session::rollout`]).
//!
//! # Modules
//!
//! ```text
//! ui         -> the engine's public interface          draws and sends requests; decides nothing
//! engine     -> everything below                       starts the threads and connects them
//! config     -> everything below but report, session   files to checked values
//! report     -> recording, optimize, control, telemetry, robot, trial, printable    figures, pages and tables of studies
//! session    -> optimize, recording, control, sim, realtime, telemetry, trial, robot    proposes, runs and judges trials
//! recording  -> telemetry, trial, optimize, robot, unfinished    writes and reads sessions
//! control    -> telemetry, realtime, trial, robot      computes the torques of a tick
//! sim        -> robot                                  simulates the robot
//! realtime   -> telemetry, robot                       threads, scheduling, clock, channels
//! telemetry  -> robot, trial                           data across the real-time boundary
//! optimize, robot, trial -> nothing of ours            samplers and studies | the machine | vocabulary of a trial
//! printable  -> nothing of ours                        characters that act on a terminal, for report and engine
//! unfinished -> nothing of ours                        files that a process which a signal ends removes
//! ```
//!
//! `tests/architecture.rs` checks these rules. `docs/architecture.md` explains the structure and how to add a task, a robot, a
//! sampler, a view or a failsafe.
//!
//! # Examples
//!
//! The engine runs without the console. `cargo run --release --example NAME` in the repository:
//!
//! | name | shows |
//! |---|---|
//! | `study` | a study in 30 lines: configuration, robot, simulator, sampler, trials |
//! | `drive_robot` | joint commands to a simulated robot, without the controller |
//! | `own_task` | an objective and a force profile of one's own |
//! | `own_sampler` | proposals of one's own in a study |
//! | `own_robot` | an implementation of [`robot::Robot`] under the controller |
//! | `read_recording` | trials and ticks of a recording |

pub mod config;
pub mod control;
pub mod engine;
pub mod optimize;
pub mod printable;
pub mod realtime;
pub mod recording;
pub mod report;
pub mod robot;
pub mod session;
pub mod sim;
pub mod telemetry;
pub mod trial;
pub mod unfinished;
