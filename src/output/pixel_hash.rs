//! A hash of all samples of a file, whatever their compression and parts.
//!
//! It is the SHA-256, in hexadecimal, of: the line `octray pixels 1`; a line with the display window's width and height
//! and the data window's x0, y0, x1, y1 (corners excluded on the right and below); for each channel, in the byte order
//! of the names, a line with its name, a blank and `half`, `float` or `uint`, followed by the SHA-256 (32 bytes) of the
//! SHA-256s of its rows from the top. A row is its samples from left to right, little-endian. Windows are those of
//! a display window that begins at (0, 0).

use std::borrow::Cow;

use exr::meta::attribute::SampleType;
use sha2::{Digest, Sha256};

use crate::film::Window;

/// Digests of rows of a channel, each with its number from above.
#[derive(Debug, Clone, Default)]
pub(super) struct Digests(Vec<(usize, [u8; 32])>);

impl Digests {
    /// Takes a row, its samples in the byte order of this machine.
    pub fn push(&mut self, y: usize, row: &[u8], kind: SampleType) {
        self.0.push((y, Sha256::digest(little_endian(row, kind)).into()));
    }
}

/// The hash under construction.
pub(super) struct PixelHash {
    head: String,
    /// Name, line, digest of the rows.
    channels: Vec<(Vec<u8>, Vec<u8>, [u8; 32])>,
}

impl PixelHash {
    pub fn new(display: (u32, u32), window: Window) -> Self {
        let Window { x0, y0, x1, y1 } = window;
        let head = format!("octray pixels 1\n{} {} {x0} {y0} {x1} {y1}\n", display.0, display.1);
        PixelHash { head, channels: Vec::new() }
    }

    /// A channel with the digests of all its rows, in any order.
    pub fn add<'d>(&mut self, name: &[u8], kind: SampleType, rows: impl Iterator<Item = &'d Digests>) {
        let mut rows: Vec<_> = rows.flat_map(|rows| &rows.0).collect();
        rows.sort_by_key(|(y, _)| *y);
        let mut digest = Sha256::new();
        rows.into_iter().for_each(|(_, row)| digest.update(row));
        let kind = match kind {
            SampleType::F16 => "half",
            SampleType::F32 => "float",
            SampleType::U32 => "uint",
        };
        let line = [name, b" ", kind.as_bytes(), b"\n"].concat();
        self.channels.push((name.to_vec(), line, digest.finalize().into()));
    }

    pub fn finish(mut self) -> String {
        self.channels.sort();
        let mut digest = Sha256::new();
        digest.update(self.head);
        for (_, line, rows) in self.channels {
            digest.update(line);
            digest.update(rows);
        }
        hex(&digest.finalize())
    }
}

/// Lower-case hexadecimal digits.
pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn little_endian(row: &[u8], kind: SampleType) -> Cow<'_, [u8]> {
    if cfg!(target_endian = "little") {
        return Cow::Borrowed(row);
    }
    Cow::Owned(row.chunks(kind.bytes_per_sample()).flat_map(|sample| sample.iter().rev()).copied().collect())
}
