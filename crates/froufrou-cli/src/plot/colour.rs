//! The colours of the pictures.

/// Red, green and blue in sRGB.
pub type Colour = [u8; 3];

/// Titles and what matters.
pub const INK: Colour = [0x1c, 0x22, 0x2e];
/// Labels and what explains.
pub const GREY: Colour = [0x5b, 0x64, 0x73];
/// Frames and ticks.
pub const RULE: Colour = [0x9a, 0xa2, 0xae];
/// Grid lines.
pub const GRID: Colour = [0xe4, 0xe7, 0xec];
/// The span of a waveform.
pub const WAVE: Colour = [0x8a, 0xb2, 0xda];
/// Its effective value.
pub const WAVE_CORE: Colour = [0x24, 0x5a, 0x94];
/// Marks of events.
pub const MARK: Colour = [0xc8, 0x40, 0x1e];

/// Colours that are told apart by most eyes (Okabe and Ito 2008, without black and with the yellow
/// darkened for a white ground).
pub const DISTINCT: [Colour; 7] = [
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0x56, 0xb4, 0xe9],
    [0xc9, 0xa2, 0x00],
    [0x8a, 0x5a, 0x3c],
];

/// "Inferno" of S. van der Walt and N. Smith (2015, public domain), at ten equal steps: the steps
/// look even, and it also reads in grey.
const INFERNO: [Colour; 10] = [
    [0x00, 0x00, 0x04],
    [0x1b, 0x0c, 0x42],
    [0x4b, 0x0c, 0x6b],
    [0x78, 0x1c, 0x6d],
    [0xa5, 0x2c, 0x60],
    [0xcf, 0x44, 0x46],
    [0xed, 0x69, 0x25],
    [0xfb, 0x9a, 0x06],
    [0xf7, 0xd0, 0x3c],
    [0xfc, 0xff, 0xa4],
];

/// The colour of a level from 0, the lowest, to 1, the highest.
pub fn of_level(level: f64) -> Colour {
    let last = INFERNO.len() - 1;
    let place = if level.is_nan() { 0.0 } else { level.clamp(0.0, 1.0) * last as f64 };
    let index = (place as usize).min(last - 1);
    let u = place - index as f64;
    std::array::from_fn(|i| {
        let (a, b) = (f64::from(INFERNO[index][i]), f64::from(INFERNO[index + 1][i]));
        (a + u * (b - a)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_go_from_dark_to_bright_in_even_steps() {
        assert_eq!(of_level(f64::NAN), INFERNO[0]);
        assert_eq!((of_level(-1.0), of_level(2.0)), (INFERNO[0], INFERNO[9]));
        // CIE lightness from sRGB.
        let lightness = |[r, g, b]: Colour| {
            let linear = |c: u8| {
                let c = f64::from(c) / 255.0;
                if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
            };
            let y = 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
            if y > 0.008856 { 116.0 * y.cbrt() - 16.0 } else { 903.3 * y }
        };
        let steps: Vec<f64> = (0..=90).map(|i| lightness(of_level(f64::from(i) / 90.0))).collect();
        for pair in steps.windows(2) {
            assert!((0.4..2.0).contains(&(pair[1] - pair[0])), "{pair:?}");
        }
    }
}
