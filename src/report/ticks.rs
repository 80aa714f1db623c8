//! Round numbers for the axes of figures.

/// Returns the range of the values, widened by `share` of it on both sides; -1 to 1 around a single value, 0 to 1 without
/// values.
pub fn padded(values: &[f64], share: f64) -> [f64; 2] {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let (low, high) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    if low > high {
        return [0.0, 1.0];
    }
    let width = high - low;
    if width <= 1e-9 * low.abs().max(1.0) {
        let half = if low == 0.0 { 1.0 } else { low.abs() * 0.5 };
        return [low - half, high + half];
    }
    [low - share * width, high + share * width]
}

/// Returns the multiples of 1, 2 or 5 times a power of ten within the range, about `most` of them: those of the smallest step
/// that gives no more, or of the next smaller one where it would give one tick, which shows no scale.
pub fn round_ticks([low, high]: [f64; 2], most: usize) -> Vec<f64> {
    let width = high - low;
    if width.is_nan() || width <= 0.0 || !width.is_finite() {
        return Vec::new();
    }
    let rough = width / most.max(1) as f64;
    let power = 10f64.powf(rough.log10().floor());
    let multiples = |factor: f64| -> Vec<f64> {
        let step = factor * power;
        let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
        (first..=last).map(|count| count as f64 * step).collect()
    };
    let steps = [0.2, 0.5, 1.0, 2.0, 5.0, 10.0];
    let fits = steps.iter().position(|factor| factor * power >= rough * (1.0 - 1e-9)).unwrap_or(steps.len() - 1);
    let ticks = multiples(steps[fits]);
    if ticks.len() < 2 && fits > 0 { multiples(steps[fits - 1]) } else { ticks }
}

/// Returns the decimal places that tell the ticks apart.
pub fn decimals(ticks: &[f64]) -> usize {
    let step = ticks.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    if step.is_finite() && step > 0.0 { (-(step * 1.000_001).log10().floor()).clamp(0.0, 9.0) as usize } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    }
}
