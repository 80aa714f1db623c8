//! What the machine reports of its state.
