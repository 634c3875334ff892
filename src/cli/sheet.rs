//! `--contact-sheet`: the pictures of a batch at a glance.

use std::path::Path;

use octray::batch::Job;
use octray::film::{Picture, Window};
use octray::output::{self, Description, Format, Options};

use super::exit::{Exit, Failure};
use super::{Run, pictures};

/// Width of the sheet in pixels, as far as cells allow.
const WIDTH: usize = 1280;
/// Least and most pixels along a side of a cell.
const SIDES: [usize; 2] = [160, 320];
/// Most pictures; of more, every so many are shown.
const MOST: usize = 400;
/// Digits, three columns by five rows, from the upper left on.
const DIGITS: [&str; 10] = [
    "###|#.#|#.#|#.#|###",
    ".#.|##.|.#.|.#.|###",
    "###|..#|###|#..|###",
    "###|..#|###|..#|###",
    "#.#|#.#|###|..#|..#",
    "###|#..|###|..#|###",
    "###|#..|###|#.#|###",
    "###|..#|..#|..#|..#",
    "###|#.#|###|#.#|###",
    "###|#.#|###|..#|###",
];
/// Room for a number, with a margin.
const LABEL: usize = 12;

/// Draws the pictures of jobs in rows, each with its number in the list; those that are not there are crossed out.
pub fn write(jobs: &[Job], path: &Path, run: &Run) -> Result<(), Failure> {
    let step = jobs.len().div_ceil(MOST).max(1);
    let shown: Vec<(usize, &Job)> = jobs.iter().enumerate().step_by(step).collect();
    let columns = (shown.len() as f64).sqrt().ceil().max(1.0) as usize;
    let cell = cell(&shown, columns);
    let (width, height) = (columns * cell.0, shown.len().div_ceil(columns) * (cell.1 + LABEL));
    let size = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    let display = (size(width), size(height));
    let mut sheet = Picture::new(display, Window::full(display));
    sheet.pixels.fill([0.02, 0.02, 0.02, 1.0]);
    for (place, (index, job)) in shown.into_iter().enumerate() {
        let corner = (place % columns * cell.0, place / columns * (cell.1 + LABEL));
        match output::read(&job.output) {
            Ok(picture) => draw(&picture, &mut sheet, corner, cell),
            Err(_) => cross(&mut sheet, corner, cell),
        }
        label(index + 1, &mut sheet, (corner.0 + 4, corner.1 + cell.1 + 2));
    }
    let described = Description { scene: Some("contact sheet".into()), ..Description::default() };
    let encoded = output::encode(Format::Png, &sheet, Options::default(), &described);
    let encoded = encoded.map_err(|error| Failure::new(Exit::Output, error).of(path))?;
    pictures::write_bytes(path, &encoded.bytes, run)
}

/// Width and height of a cell: as the first picture that is there.
fn cell(shown: &[(usize, &Job)], columns: usize) -> (usize, usize) {
    let width = (WIDTH / columns).clamp(SIDES[0], SIDES[1]);
    let first = shown.iter().find_map(|(_, job)| output::read(&job.output).ok());
    let (x, y) = first.map_or((1, 1), |picture| picture.display);
    let height = (width as f64 * f64::from(y) / f64::from(x)) as usize;
    (width, height.clamp(width / 4, 2 * width))
}

fn set(sheet: &mut Picture, x: usize, y: usize, color: [f32; 3]) {
    if let Some(index) = sheet.window.index(x as i32, y as i32) {
        sheet.pixels[index] = [color[0], color[1], color[2], 1.0];
    }
}

/// A picture fitted into a cell: means of the pixels that fall together, over the sheet.
fn draw(picture: &Picture, sheet: &mut Picture, corner: (usize, usize), cell: (usize, usize)) {
    let (width, height) = (picture.display.0 as usize, picture.display.1 as usize);
    let fits = |room: usize, side: usize| (room - 4) as f64 / side as f64;
    let scale = fits(cell.0, width).min(fits(cell.1, height)).min(1.0);
    let fitted = |side: usize| ((side as f64 * scale) as usize).max(1);
    let (w, h) = (fitted(width), fitted(height));
    for y in 0..h {
        for x in 0..w {
            let (xs, ys) = (x * width / w..(x + 1) * width / w, y * height / h..(y + 1) * height / h);
            let mut sum = [0.0; 4];
            let mut count = 0.0f32;
            for y in ys {
                for pixel in xs.clone().filter_map(|x| picture.get(x as i32, y as i32)) {
                    sum = std::array::from_fn(|k| sum[k] + pixel[k]);
                    count += 1.0;
                }
            }
            if count > 0.0 {
                let over = |k: usize| (sum[k] + (count - sum[3]).max(0.0) * 0.02) / count;
                let place = (corner.0 + (cell.0 - w) / 2 + x, corner.1 + (cell.1 - h) / 2 + y);
                set(sheet, place.0, place.1, [over(0), over(1), over(2)]);
            }
        }
    }
}

fn cross(sheet: &mut Picture, corner: (usize, usize), cell: (usize, usize)) {
    for k in cell.0 / 8..cell.0 - cell.0 / 8 {
        let y = corner.1 + k * cell.1 / cell.0;
        for thick in 0..3 {
            set(sheet, corner.0 + k + thick, y, [0.6, 0.05, 0.05]);
            set(sheet, corner.0 + cell.0 - k + thick, y, [0.6, 0.05, 0.05]);
        }
    }
}

fn label(number: usize, sheet: &mut Picture, corner: (usize, usize)) {
    for (place, digit) in number.to_string().bytes().enumerate() {
        let rows = DIGITS[usize::from(digit - b'0')].split('|');
        for (y, row) in rows.enumerate() {
            for (x, _) in row.bytes().enumerate().filter(|(_, dot)| *dot == b'#') {
                set(sheet, corner.0 + 4 * place + x, corner.1 + y, [0.7; 3]);
            }
        }
    }
}
