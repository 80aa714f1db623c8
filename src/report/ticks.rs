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
/// that gives no more, or of the next smaller one where it would give one tick, which shows no scale. None for a range that is empty, not finite or too
/// narrow for numbers between its ends.
pub fn round_ticks([low, high]: [f64; 2], most: usize) -> Vec<f64> {
    let rough = (high - low) / most.max(1) as f64;
    // The power of ten of a smaller step would be 0.
    if !rough.is_finite() || rough < f64::MIN_POSITIVE {
        return Vec::new();
    }
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
