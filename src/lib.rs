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
//! ```text
//!  screen (the program's main thread)                     recorder
//!    │  intents            records │ ▲ ticks, snapshot       ▲ every tick
//!    ▼                             ▼ │                       │
//!  session ── commands ──────────► control, 1 kHz ───────────┘
//!          ◄─ events ─────────────
//! ```
//!
//! What crosses to and from `control` is `Copy` and goes through wait-free channels ([`realtime::channel`]); nothing in a
//! tick allocates, locks, logs or touches a file. STOP is a latch of its own that the tick reads before it acts. Simulated
//! time is the same [`control::cycle::Cycle::tick`] called without a thread ([`session::rollout`]).
//!
//! # Who may use whom
//!
//! ```text
//! ui         -> the engine's public interface          draws and asks; decides nothing
//! engine     -> everything below                       wires
//! config     -> everything below                       files to checked values
//! report     -> recording, optimize                    draws what happened
//! session    -> optimize, recording, control, sim, realtime, robot    decides which trial, and whether it counts
//! recording  -> realtime, robot                        writes and reads what was known
//! control    -> robot, realtime                        decides this millisecond's torques
//! sim        -> robot                                  answers as the machine would
//! realtime   -> robot                                  carries
//! optimize, robot -> nothing of ours                   numbers | the machine
//! ```
//!
//! `tests/architecture.rs` checks the arrows.
//!
//! # Where this differs from the first plan of the house
//!
//! * *The next proposal is drafted, not asked for.* A verdict stays open to undo until the next trial begins, yet the
//!   operator should see the next proposal at once. So a proposal is a [`optimize::study::TrialDraft`] without effect, made on
//!   a fork of the study in which the verdict is told already; verdict and proposal become final together, on approval.
//! * *A study has a folder* (`study.log`, `config/`, one `session.mcap` per run of the program), because a study can be
//!   continued by another session.
//! * *A simulated robot is carried back to its mark before each trial*, as a person does it with a real one. A trial is
//!   then a function of its parameters and seed alone: the console, `optimize` and a replay agree bit for bit.
//! * *The control thread's body is [`control::control_loop`]*, not the engine's: the engine paces it, a bench and the test with the
//!   aborting allocator call the very same code.
//! * *A cache warm-up precedes each tick on hardware* ([`control::control_loop`]): cold caches were a good part of the longest
//!   ticks.
//! * *There is a second process where there is a robot* (`engine/guard.rs`): a program that is killed cannot damp it any more.
//! * *The session may act by itself* (`--approve`, [`trial`]), through the same wishes as a person and refused
//!   for the same reasons; a person's STOP, cancel or fault outranks it.
//! * *The emulated Go1 is [`sim::emulator`]*: it speaks [`robot::go1::packet`] from the other side, so a study on it passes
//!   through every line that a study on the robot passes through.
//! * `config` stands beside `engine`: it turns files into the settings of every part, so it must know them all.

pub mod config;
pub mod control;
pub mod engine;
pub mod optimize;
pub mod realtime;
pub mod recording;
pub mod report;
pub mod robot;
pub mod session;
pub mod sim;
pub mod telemetry;
pub mod trial;
