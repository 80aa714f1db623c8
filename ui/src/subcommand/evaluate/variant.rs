//! Differences between the compared runs.

/// Settings of the runs that are compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variant {
    /// Whether Virtual Model Control is on.
    pub vmc: bool,
    /// Coulomb coefficient of ground and blocks; none for that of the configuration.
    pub friction: Option<f64>,
}

/// Returns the name of a variant of Virtual Model Control.
pub fn on_off(vmc: bool) -> &'static str {
    if vmc { "on" } else { "off" }
}
