//! What happened, as tables.

pub mod table;
