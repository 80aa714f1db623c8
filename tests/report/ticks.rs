//! Round numbers on the axes of figures.

use quadfrog::report::ticks::{decimals, padded, round_ticks};

#[test]
fn ticks_are_round_numbers_within_the_range() {
    assert_eq!(round_ticks([0.0, 1.0], 5), [0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]);
    assert_eq!(round_ticks([-3.0, 17.0], 5), [0.0, 5.0, 10.0, 15.0]);
    assert_eq!(decimals(&round_ticks([0.0, 1.0], 5)), 1);
    assert_eq!(decimals(&round_ticks([0.0, 300.0], 5)), 0);
    assert!(round_ticks([1.0, 1.0], 5).is_empty());
}

/// Regression: an axis from -0.39 to -0.1 had the one label "-0".
#[test]
fn an_axis_has_two_ticks() {
    for most in 2..8 {
        let ticks = round_ticks([-0.39, -0.1], most);
        assert!(ticks.len() >= 2 && decimals(&ticks) > 0, "{most}: {ticks:?}");
    }
}

#[test]
fn an_axis_has_a_width_for_any_values() {
    for values in [&[][..], &[0.0], &[5.0, 5.0], &[f64::NAN, 2.0, 3.0], &[-1e-300, 1e-300]] {
        let [low, high] = padded(values, 0.05);
        assert!(low < high, "{values:?}");
        assert!(!round_ticks([low, high], 6).is_empty(), "{values:?}");
    }
    // Regression: the power of ten of the step was 0, and every whole number a tick.
    for high in [5e-324, 1e-310, f64::MIN_POSITIVE] {
        assert!(round_ticks([0.0, high], 6).is_empty(), "{high:e}");
    }
    assert!(round_ticks([f64::MIN, f64::MAX], 6).is_empty());
}
