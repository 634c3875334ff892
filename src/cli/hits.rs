//! `.npy` files of rays and of what they met.

use std::fmt::Write;
use std::path::Path;

use octray::scene::{Rows, cloud_file};
use octray::{Hit, Ray};

use super::exit::{Exit, Failure};

/// Columns of a file of rays.
const RAYS: [&str; 8] = ["ox", "oy", "oz", "t_min", "dx", "dy", "dz", "t_max"];
/// One hit: as numpy names its parts, packed.
const HIT: &str = "[('t', '<f4'), ('primitive', '<i4'), ('material', '<i4'), ('normal', '<f4', (3,)), \
    ('uv', '<f4', (2,)), ('front', '|b1')]";
/// Bytes of it.
const HIT_BYTES: usize = 33;
/// Yes or no.
const BOOL: &str = "'|b1'";
/// A header ends at a multiple of this, as the format asks for.
const ALIGNMENT: usize = 64;

/// Reads rays: float32, N x 8, C order; origin, t_min, direction, t_max.
pub fn read_rays(path: &Path) -> Result<Vec<Ray>, Failure> {
    let failure = |message: String| Failure::new(Exit::Input, message).of(path);
    let npy = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
    if !npy {
        return Err(failure("rays must be in a .npy file of float32, N x 8".to_owned()));
    }
    match cloud_file::rows(path, RAYS) {
        Ok(Rows::F32(rows)) => Ok(rows.into_iter().map(ray).collect()),
        Ok(Rows::F64(_)) => Err(failure("rays must be float32 (\"<f4\"), found float64".to_owned())),
        Err(broken) if broken.found.is_empty() => Err(failure(format!("a file of rays {}", broken.rule))),
        Err(broken) => Err(failure(format!("a file of rays {}, found {}", broken.rule, broken.found))),
    }
}

fn ray([x, y, z, t_min, dx, dy, dz, t_max]: [f32; 8]) -> Ray {
    Ray { origin: [x, y, z], t_min, dir: [dx, dy, dz], t_max }
}

/// A `.npy` file of hits. A miss has t = inf, primitive and material -1, zeros and false.
pub fn hits_file(hits: &[Option<Hit>]) -> Vec<u8> {
    let mut bytes = header(HIT, hits.len());
    bytes.reserve_exact(hits.len().saturating_mul(HIT_BYTES));
    hits.iter().for_each(|hit| push(&mut bytes, hit.as_ref()));
    bytes
}

/// A `.npy` file of answers.
pub fn bools_file(answers: &[bool]) -> Vec<u8> {
    let mut bytes = header(BOOL, answers.len());
    bytes.extend(answers.iter().map(|answer| u8::from(*answer)));
    bytes
}

fn push(bytes: &mut Vec<u8>, hit: Option<&Hit>) {
    let index = |index: u32| i32::try_from(index).unwrap_or(-1);
    let (t, primitive, material) =
        hit.map_or((f32::INFINITY, -1, -1), |hit| (hit.t, index(hit.primitive), index(hit.material)));
    bytes.extend_from_slice(&t.to_le_bytes());
    bytes.extend_from_slice(&primitive.to_le_bytes());
    bytes.extend_from_slice(&material.to_le_bytes());
    let (normal, uv) = hit.map_or(([0.0; 3], [0.0; 2]), |hit| (hit.normal, hit.uv));
    normal.iter().chain(&uv).for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
    bytes.push(u8::from(hit.is_some_and(|hit| hit.front)));
}

/// Magic, version 1.0, and a Python dictionary padded with spaces.
///
/// Source: NumPy enhancement proposal 1, "A simple file format for NumPy arrays", 2007.
fn header(descr: &str, rows: usize) -> Vec<u8> {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write!(text, "{{'descr': {descr}, 'fortran_order': False, 'shape': ({rows},), }}");
    let before = 10; // magic, version and length
    let length = (before + text.len() + 1).next_multiple_of(ALIGNMENT) - before;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend_from_slice(&u16::try_from(length).unwrap_or_default().to_le_bytes());
    bytes.extend_from_slice(format!("{text:<width$}\n", width = length - 1).as_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_aligned_and_end_in_a_line_break() {
        for rows in [0, 1, 10, 123_456_789] {
            for descr in [HIT, BOOL] {
                let bytes = header(descr, rows);
                assert_eq!((bytes.len() % ALIGNMENT, bytes.last()), (0, Some(&b'\n')));
                assert_eq!(usize::from(u16::from_le_bytes([bytes[8], bytes[9]])), bytes.len() - 10);
            }
        }
    }

    #[test]
    fn a_record_is_packed() {
        let (head, bytes) = (header(HIT, 2), hits_file(&[None, None]));
        assert_eq!(bytes.len(), head.len() + 2 * HIT_BYTES);
        let miss = &bytes[head.len()..head.len() + HIT_BYTES];
        assert_eq!(miss[..12], [f32::INFINITY.to_le_bytes(), [0xff; 4], [0xff; 4]].concat());
        assert_eq!(miss[12..], [0; 21]);
    }
}
