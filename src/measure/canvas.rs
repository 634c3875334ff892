//! Rectangles and figures on a raster: as much drawing as a scale bar needs.

use crate::output::png::Raster;

/// Width and height of a character with the gap beside it, in dots.
pub(super) const CHARACTER: (usize, usize) = (4, 5);

/// A rectangle of pixels: left, top, width, height; what reaches beyond the raster is left out.
pub(super) fn fill(raster: &mut Raster, [x, y, width, height]: [usize; 4], color: [u8; 3]) {
    let columns = raster.width as usize;
    let (left, right) = (x.min(columns), x.saturating_add(width).min(columns));
    for row in raster.pixels.chunks_exact_mut(columns.max(1)).skip(y).take(height) {
        row[left..right].fill(color);
    }
}

/// A number whose upper left corner is at (x, y), with dots of `dot` pixels; unknown characters stay empty.
pub(super) fn write(raster: &mut Raster, text: &str, (x, y): (usize, usize), dot: usize, color: [u8; 3]) {
    for (place, character) in text.chars().enumerate() {
        for (row, dots) in glyph(character).into_iter().enumerate() {
            for column in (0..3).filter(|column| dots >> (2 - column) & 1 == 1) {
                fill(raster, [x + (CHARACTER.0 * place + column) * dot, y + row * dot, dot, dot], color);
            }
        }
    }
}

/// Five rows of three dots.
fn glyph(character: char) -> [u8; 5] {
    match character {
        '0' => [0b111, 0b101, 0b101, 0b101, 0b111],
        '1' => [0b010, 0b110, 0b010, 0b010, 0b111],
        '2' => [0b111, 0b001, 0b111, 0b100, 0b111],
        '3' => [0b111, 0b001, 0b111, 0b001, 0b111],
        '4' => [0b101, 0b101, 0b111, 0b001, 0b001],
        '5' => [0b111, 0b100, 0b111, 0b001, 0b111],
        '6' => [0b111, 0b100, 0b111, 0b101, 0b111],
        '7' => [0b111, 0b001, 0b010, 0b010, 0b010],
        '8' => [0b111, 0b101, 0b111, 0b101, 0b111],
        '9' => [0b111, 0b101, 0b111, 0b001, 0b111],
        'e' => [0b000, 0b010, 0b101, 0b110, 0b011],
        '-' => [0b000, 0b000, 0b111, 0b000, 0b000],
        _ => [0; 5],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_are_unlike_and_what_lies_outside_is_left_out() {
        let drawn = |text: &str, place| {
            let mut raster = Raster { width: 9, height: 12, pixels: vec![[0; 3]; 108] };
            write(&mut raster, text, place, 2, [9; 3]);
            raster.pixels
        };
        let all: Vec<_> = "0123456789e-".chars().map(|c| drawn(&c.to_string(), (1, 1))).collect();
        for (i, one) in all.iter().enumerate() {
            assert!(one.contains(&[9; 3]) && all[..i].iter().all(|other| other != one), "{i}");
        }
        assert!(!drawn("8", (9, 0)).contains(&[9; 3]) && !drawn("8", (0, 12)).contains(&[9; 3]));
        assert!(drawn("8", (7, 10)).contains(&[9; 3]));
    }
}
