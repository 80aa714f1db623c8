//! The terminal operator console: it draws from the engine's public interface and asks through it; it decides nothing.
//!
//! One loop (`app`) takes keys and the feed, folds both into the [`model::Model`] with the one function that may change
//! it ([`update::update`]), and draws the model with free functions ([`view::render`]).
//!
//! ```text
//! keys, signals ──┐                      ┌── effects: wishes, STOP, bell, quit ──> app ──> engine
//!                 ├─> Msg ─> update(model)
//! engine, replay ─┘                      └── model ──> view::render ──> terminal
//! ```

pub mod action;
pub mod app;
pub mod column;
pub mod comparison;
pub mod dialog;
pub mod export;
pub mod feed;
pub mod history;
pub mod keymap;
pub mod line;
pub mod model;
pub mod series;
pub mod settings;
pub mod terminal;
pub mod theme;
pub mod update;
pub mod view;
