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
//!
//! Modules, each using only those before it, and no file in an import cycle:
//!
//! ```text
//! action  column  series  theme    names, keys and help of actions; columns; series; colours and characters
//! keymap  settings  message        keys; console.toml; messages and effects
//! model                            data of the screen and questions to it
//! layout  legal  text              places on the screen; conditions of actions; trial rows as text
//! update | view | feed | export    changes the model; draws it; messages' source; files on request
//! connection  terminal  app        the SSH connection; the terminal; the loop
//! ```

pub mod action;
pub mod app;
pub mod column;
pub mod connection;
pub mod export;
pub mod feed;
pub mod keymap;
pub mod layout;
pub mod legal;
pub mod message;
pub mod model;
pub mod series;
pub mod settings;
pub mod terminal;
pub mod text;
pub mod theme;
pub mod update;
pub mod view;
