//! The terminal console of the operator: draws the state of the engine and sends requests to it; decides nothing.
//!
//! One loop (`app`) folds keys and feed into the [`model::Model`] with [`update::update`], the only function that changes
//! it, and draws it with free functions ([`view::render`]).
//!
//! ```text
//! keys, signals ──┐                      ┌── effects: requests, STOP, bell, quit ──> app ──> engine
//!                 ├─> Msg ─> update(model)
//! engine, replay ─┘                      └── model ──> view::render ──> terminal
//! ```

pub mod action;
pub mod app;
pub mod column;
pub mod comparison;
pub mod connection;
pub mod dialog;
pub mod export;
pub mod feed;
pub mod history;
pub mod keymap;
pub mod model;
pub mod series;
pub mod settings;
pub mod terminal;
pub mod theme;
pub mod update;
pub mod view;
