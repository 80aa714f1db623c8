//! Who approves a jump and judges it.

/// How much a person is asked. STOP, the loss of the operator and every limit work the same in all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Approval {
    /// A person approves and judges each jump.
    #[default]
    Each,
    /// What landed and settled is accepted by itself, and on the simulator the next jump is approved by itself; a fall or
    /// anything odd waits for a person.
    FallsOnly,
    /// Nobody is asked: for the simulator alone.
    Auto,
}

impl Approval {
    /// All of them.
    pub const ALL: [Approval; 3] = [Approval::Each, Approval::FallsOnly, Approval::Auto];

    /// The word on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Approval::Each => "each",
            Approval::FallsOnly => "falls-only",
            Approval::Auto => "auto",
        }
    }
}
