//! The program `quadfrog`: arguments, configuration, engine or player, console, exit status.

fn main() {}
