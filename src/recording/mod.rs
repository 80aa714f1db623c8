//! Sessions on disk: what is kept (`record`), how it is written and read back.

pub mod record;
