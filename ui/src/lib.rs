//! The terminal console of the operator: draws the state of the engine and sends requests to it; decides nothing.
//!
//! One loop (`app`) folds keys and feed into the [`model::Model`] ([`update::update`]) and draws it with free functions
//! ([`view::render`]). The command line is [`subcommand`].
//!
//! ```text
//! keys, signals ──┐                      ┌── effects: requests, STOP, bell, quit ──> app ──> engine
//!                 ├─> Msg ─> update(model)
//! engine, replay ─┘                      └── model ──> view::render ──> terminal
//! ```
//!
//! The modules and their layers: `docs/architecture.md`.

pub mod action;
pub mod app;
mod arming;
pub mod cell_encoder;
mod column;
pub mod connection;
mod details;
mod draw;
pub mod export;
pub mod feed;
mod foreground;
pub mod graphics;
mod help;
pub mod input;
pub mod keymap;
mod layout;
mod leaving;
mod legal;
pub mod message;
pub mod model;
pub mod output;
mod picture;
pub mod screenshot;
pub mod series;
pub mod settings;
pub mod subcommand;
pub mod terminal;
pub mod text;
pub mod theme;
pub mod update;
pub mod view;
mod whole_file;
mod wrap;
