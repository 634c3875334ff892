//! Attributes in the order of their names.
//!
//! The crate keeps some of them in a hash map, so their order differs from run to run. A header's length stays, and
//! with it every offset behind it.
//! Source: "OpenEXR File Layout", OpenEXR documentation: magic number and version, four bytes each, then a header:
//! attributes (name, 0, type, 0, size in four bytes, value), then 0. Files of several parts (bit 12 of the version)
//! have several headers, and one more 0.

const START: usize = 8;
const SEVERAL_PARTS: u32 = 1 << 12;

/// Sorts the attributes of every header. `None` where the bytes are no EXR file.
pub(super) fn sort_attributes(bytes: &mut [u8]) -> Option<()> {
    let version = u32::from_le_bytes(bytes.get(4..START)?.try_into().ok()?);
    let mut place = sort_header(bytes, START)?;
    while version & SEVERAL_PARTS != 0 && *bytes.get(place)? != 0 {
        place = sort_header(bytes, place)?;
    }
    Some(())
}

/// Sorts one header that begins at `start`, and gives the place behind its closing 0.
fn sort_header(bytes: &mut [u8], start: usize) -> Option<usize> {
    let mut attributes = Vec::new();
    let mut place = start;
    while *bytes.get(place)? != 0 {
        let name = until_zero(bytes, place)?;
        let kind = until_zero(bytes, place + name.len() + 1)?;
        let value = place + name.len() + kind.len() + 6;
        let size = i32::from_le_bytes(bytes.get(value - 4..value)?.try_into().ok()?);
        let end = value.checked_add(usize::try_from(size).ok()?)?;
        attributes.push((name.to_vec(), bytes.get(place..end)?.to_vec()));
        place = end;
    }
    attributes.sort();
    let sorted: Vec<u8> = attributes.into_iter().flat_map(|(_, attribute)| attribute).collect();
    bytes.get_mut(start..place)?.copy_from_slice(&sorted);
    Some(place + 1)
}

fn until_zero(bytes: &[u8], start: usize) -> Option<&[u8]> {
    bytes.get(start..)?.split(|&byte| byte == 0).next()
}
