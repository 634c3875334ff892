//! Arrays from files: `.npy` (C order, little-endian) and `.csv` with a header.
//!
//! A file's own length is compared with what its header promises before anything is allocated. What
//! the numbers mean, and whether they are right, is for the callers to say.

use std::fs::{self, File};
use std::io::{BufReader, Read};
use std::path::Path;

use npyz::{DType, NpyHeader, Order};

use super::Rows;
use super::error::shorten;
use super::rules::Broken;

/// Columns of a cloud of spheres.
pub const SPHERES: [&str; 4] = ["x", "y", "z", "r"];
/// Columns of a cloud of disks.
pub const DISKS: [&str; 7] = ["x", "y", "z", "r", "nx", "ny", "nz"];
/// Columns of a cloud of boxes.
pub const BOXES: [&str; 6] = ["min_x", "min_y", "min_z", "max_x", "max_y", "max_z"];
/// Columns of a cloud of cylinders.
pub const CYLINDERS: [&str; 7] = ["base_x", "base_y", "base_z", "apex_x", "apex_y", "apex_z", "r"];
/// Columns of the corners of polygons.
pub const CORNERS: [&str; 3] = ["x", "y", "z"];
/// Columns of colours.
pub const COLORS: [&str; 3] = ["r", "g", "b"];

/// Longest header of a `.npy` file in bytes; numpy writes some hundred.
const LONGEST_HEADER: usize = 1 << 16;
/// Deepest nesting of brackets in such a header; a plain array has 2.
const DEEPEST: usize = 8;
/// Numbers that are decoded at a time.
const CHUNK: usize = 8192;

/// Reads an array of `N` columns. In `.csv` files further columns are passed over.
///
/// # Errors
/// What is wrong with the file; the rule goes on from the file's name ("must be ...", "row 3: ...").
pub fn rows<const N: usize>(path: &Path, columns: [&str; N]) -> Result<Rows<N>, Broken> {
    if is_csv(path)? {
        return csv_rows(path, columns, |field| field.parse().ok(), "a number").map(Rows::F64);
    }
    let mut npy = Npy::open(path)?;
    let words = format!("an array of N x {N} numbers");
    match npy.dtype.as_str() {
        "<f4" => npy.values(N, &words, f32::from_le_bytes).map(|values| Rows::F32(in_rows(values))),
        "<f8" => npy.values(N, &words, f64::from_le_bytes).map(|values| Rows::F64(in_rows(values))),
        found => Err(broken("must hold little-endian float32 or float64 (\"<f4\" or \"<f8\")", format!("{found:?}"))),
    }
}

/// Reads a column of whole numbers from 0 on: uint8, uint16 or uint32.
///
/// # Errors
/// As [`rows`].
pub fn indices(path: &Path, column: &str) -> Result<Vec<u32>, Broken> {
    if is_csv(path)? {
        let rows = csv_rows(path, [column], |field| field.parse().ok(), "a whole number from 0 on")?;
        return Ok(rows.into_iter().map(|[value]| value).collect());
    }
    let mut npy = Npy::open(path)?;
    let words = "an array of N numbers";
    match npy.dtype.as_str() {
        "|u1" => Ok(npy.values(1, words, u8::from_le_bytes)?.into_iter().map(u32::from).collect()),
        "<u2" => Ok(npy.values(1, words, u16::from_le_bytes)?.into_iter().map(u32::from).collect()),
        "<u4" => npy.values(1, words, u32::from_le_bytes),
        found => Err(broken(
            "must hold uint8, or little-endian uint16 or uint32 (\"|u1\", \"<u2\" or \"<u4\")",
            format!("{found:?}"),
        )),
    }
}

fn broken(rule: &str, found: String) -> Broken {
    Broken { key: "", rule: rule.to_owned().into(), found }
}

fn cannot_read(error: std::io::Error) -> Broken {
    broken(&format!("cannot be read: {error}"), String::new())
}

fn is_csv(path: &Path) -> Result<bool, Broken> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let csv = match extension.as_deref() {
        Some("csv") => true,
        Some("npy") => false,
        _ => return Err(broken("must be a .npy or a .csv file", String::new())),
    };
    if fs::metadata(path).map_err(cannot_read)?.is_file() {
        return Ok(csv);
    }
    Err(broken("must be a file, not a directory or device", String::new()))
}

fn in_rows<T: Copy, const N: usize>(values: Vec<T>) -> Vec<[T; N]> {
    values.as_chunks().0.to_vec()
}

/// An open `.npy` file behind its header.
struct Npy {
    dtype: String,
    shape: Vec<u64>,
    order: Order,
    /// Bytes behind the header.
    left: u64,
    file: BufReader<File>,
}

impl Npy {
    fn open(path: &Path) -> Result<Self, Broken> {
        let file = File::open(path).map_err(cannot_read)?;
        let length = file.metadata().map_err(cannot_read)?.len();
        let mut file = BufReader::new(file);
        let bytes = header_bytes(&mut file)?;
        let header = NpyHeader::from_reader(&bytes[..])
            .map_err(|error| broken("must be a .npy file with a sound header", shorten(&error.to_string())))?;
        let DType::Plain(dtype) = header.dtype() else {
            return Err(broken("must be a plain array", "a structured one".to_owned()));
        };
        let left = length.saturating_sub(bytes.len() as u64);
        let (shape, order) = (header.shape().to_vec(), header.order());
        Ok(Npy { dtype: dtype.to_string(), shape, order, left, file })
    }

    /// All numbers, once the shape fits: `columns` of them a row, or a plain list where that is 1.
    fn values<T, const B: usize>(
        &mut self,
        columns: usize,
        words: &str,
        decode: impl Fn([u8; B]) -> T,
    ) -> Result<Vec<T>, Broken> {
        let rows = match self.shape[..] {
            [rows] if columns == 1 => rows,
            [rows, found] if found == columns as u64 => rows,
            _ => {
                let sizes: Vec<_> = self.shape.iter().map(u64::to_string).collect();
                return Err(broken(&format!("must be {words}"), format!("the shape ({})", sizes.join(", "))));
            }
        };
        if self.order == Order::Fortran && rows > 1 && columns > 1 {
            return Err(broken("must be in C order", "Fortran order".to_owned()));
        }
        let bytes = rows.checked_mul((columns * B) as u64).filter(|bytes| *bytes == self.left);
        let Some(count) = bytes.and_then(|bytes| usize::try_from(bytes).ok()).map(|bytes| bytes / B) else {
            let rule = format!("must be as long as its {rows} rows of {} bytes", columns * B);
            return Err(broken(&rule, format!("{} bytes behind the header", self.left)));
        };
        let mut values = Vec::with_capacity(count);
        let mut chunk = vec![0; CHUNK * B];
        while values.len() < count {
            let part = &mut chunk[..(count - values.len()).min(CHUNK) * B];
            self.file.read_exact(part).map_err(cannot_read)?;
            values.extend(part.as_chunks::<B>().0.iter().map(|bytes| decode(*bytes)));
        }
        Ok(values)
    }
}

/// The magic, version and header of a `.npy` file, checked for what its parser would choke on: length,
/// nesting, and sizes whose product overflows.
///
/// Source: numpy.lib.format, "Format version 1.0" to "3.0", in the NumPy manual.
fn header_bytes(file: &mut impl Read) -> Result<Vec<u8>, Broken> {
    let not_npy = || broken("must be a .npy file", "other bytes at its start".to_owned());
    let short = |_| broken("must be a whole .npy file", "the end of the file in its header".to_owned());
    let mut bytes = vec![0; 10];
    file.read_exact(&mut bytes).map_err(|_| not_npy())?;
    if !bytes.starts_with(b"\x93NUMPY") {
        return Err(not_npy());
    }
    let mut length = u32::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    if bytes[6] != 1 {
        bytes.resize(12, 0);
        file.read_exact(&mut bytes[10..]).map_err(short)?;
        length = u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]);
    }
    let start = bytes.len();
    if length as usize > LONGEST_HEADER {
        return Err(broken("must have a header of at most 65536 bytes", length.to_string()));
    }
    bytes.resize(start + length as usize, 0);
    file.read_exact(&mut bytes[start..]).map_err(short)?;
    let sound = shallow(&bytes[start..]) && product(&bytes[start..]).is_some();
    if sound { Ok(bytes) } else { Err(broken("must be a .npy file with a sound header", "one of no array".to_owned())) }
}

fn shallow(text: &[u8]) -> bool {
    let opened = text.iter().filter(|byte| b"([{".contains(byte)).count();
    opened <= DEEPEST
}

/// The product of all numbers in a text but zeros, if it fits.
fn product(text: &[u8]) -> Option<u64> {
    let numbers = text.split(|byte| !byte.is_ascii_digit()).filter(|digits| !digits.is_empty());
    let value = |digits: &[u8]| std::str::from_utf8(digits).ok()?.parse::<u64>().ok();
    numbers.map(value).try_fold(1u64, |product, number| product.checked_mul(number?.max(1)))
}

fn csv_rows<T: Copy + Default, const N: usize>(
    path: &Path,
    columns: [&str; N],
    parse: impl Fn(&str) -> Option<T>,
    words: &str,
) -> Result<Vec<[T; N]>, Broken> {
    let file = File::open(path).map_err(cannot_read)?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(file);
    let header = reader.headers().map_err(csv_error)?.clone();
    let mut places = [0; N];
    for (place, column) in places.iter_mut().zip(columns) {
        let found: Vec<_> = (0..header.len()).filter(|i| &header[*i] == column).collect();
        let [only] = found[..] else {
            let rule = format!("must have a header with the columns {}, each once", columns.join(", "));
            return Err(broken(&rule, shorten(&header.iter().collect::<Vec<_>>().join(", "))));
        };
        *place = only;
    }
    let (mut rows, mut record) = (Vec::new(), csv::StringRecord::new());
    while reader.read_record(&mut record).map_err(csv_error)? {
        let mut row = [T::default(); N];
        for ((value, place), column) in row.iter_mut().zip(places).zip(columns) {
            let field = record.get(place).unwrap_or_default();
            let rule = || format!("row {}: {column} must be {words}", rows.len());
            *value = parse(field).ok_or_else(|| match field {
                "" => broken(&rule(), "nothing".to_owned()),
                _ => broken(&rule(), format!("{:?}", shorten(field))),
            })?;
        }
        rows.push(row);
    }
    Ok(rows)
}

fn csv_error(error: csv::Error) -> Broken {
    match error.kind() {
        csv::ErrorKind::Utf8 { pos, .. } => {
            let line = pos.as_ref().map_or(0, csv::Position::line);
            broken("must be UTF-8 text", format!("other bytes in line {line}"))
        }
        _ => broken(&format!("cannot be read: {error}"), String::new()),
    }
}
