//! Room for a value of each pixel.

use std::ops::{Deref, DerefMut};

use bytemuck::Pod;

/// A list that is as long as a picture is large, and used as a slice.
///
/// Memory that a program touches for the first time is cleared by the system, page by page: for a picture of one sample a
/// pixel that takes longer than many a ray. Large planes of zeros ask for pages of 2 MiB, which are a quarter of the work.
pub struct Plane<T>(Room<T>);

enum Room<T> {
    List(Vec<T>),
    /// Anonymous memory, and how many elements it has.
    #[cfg(target_os = "linux")]
    Pages(memmap2::MmapMut, usize),
}

/// Bytes from which on pages of their own are asked for.
#[cfg(target_os = "linux")]
const LARGE: usize = 2 << 20;

impl<T: Pod> Plane<T> {
    /// So many zeros.
    pub fn zeroed(length: usize) -> Self {
        Plane(pages(length).unwrap_or_else(|| Room::List(vec![T::zeroed(); length])))
    }
}

/// Zeros with pages of their own; `None` where that is no use, or not to be had.
#[cfg(target_os = "linux")]
fn pages<T: Pod>(length: usize) -> Option<Room<T>> {
    let bytes = length.checked_mul(size_of::<T>()).filter(|bytes| *bytes >= LARGE)?;
    let map = memmap2::MmapMut::map_anon(bytes).ok()?;
    // Where the system has no such pages, others do.
    let _ = map.advise(memmap2::Advice::HugePage);
    Some(Room::Pages(map, length))
}

#[cfg(not(target_os = "linux"))]
fn pages<T: Pod>(_: usize) -> Option<Room<T>> {
    None
}

impl<T: Pod> Deref for Plane<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match &self.0 {
            Room::List(list) => list,
            #[cfg(target_os = "linux")]
            Room::Pages(map, length) => bytemuck::cast_slice(&map[..length * size_of::<T>()]),
        }
    }
}

impl<T: Pod> DerefMut for Plane<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        match &mut self.0 {
            Room::List(list) => list,
            #[cfg(target_os = "linux")]
            Room::Pages(map, length) => bytemuck::cast_slice_mut(&mut map[..*length * size_of::<T>()]),
        }
    }
}

impl<T> From<Vec<T>> for Plane<T> {
    fn from(list: Vec<T>) -> Self {
        Plane(Room::List(list))
    }
}

impl<T> FromIterator<T> for Plane<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Plane(Room::List(values.into_iter().collect()))
    }
}

impl<T> Default for Plane<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T: Pod> Clone for Plane<T> {
    fn clone(&self) -> Self {
        self.to_vec().into()
    }
}

impl<T: Pod + PartialEq> PartialEq for Plane<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T: Pod + PartialEq, const N: usize> PartialEq<[T; N]> for Plane<T> {
    fn eq(&self, other: &[T; N]) -> bool {
        **self == *other
    }
}

impl<T: Pod + std::fmt::Debug> std::fmt::Debug for Plane<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl<'a, T: Pod> IntoIterator for &'a Plane<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<T: Pod> IntoIterator for Plane<T> {
    type Item = T;
    type IntoIter = std::vec::IntoIter<T>;

    fn into_iter(self) -> Self::IntoIter {
        match self.0 {
            Room::List(list) => list.into_iter(),
            #[cfg(target_os = "linux")]
            Room::Pages(..) => Vec::from(&*self).into_iter(),
        }
    }
}

impl<'a, T: Pod> IntoIterator for &'a mut Plane<T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter_mut()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Planes are slices, whatever holds them: small ones and such as have pages of their own.
    #[test]
    fn planes_are_slices_of_any_length() {
        for length in [0, 1, 1000, (1 << 19) + 3, 3 << 19] {
            let mut plane = Plane::<f32>::zeroed(length);
            assert!(plane.len() == length && plane.iter().all(|value| *value == 0.0), "{length}");
            plane.iter_mut().enumerate().for_each(|(index, value)| *value = index as f32);
            let copy: Plane<f32> = (0..length).map(|index| index as f32).collect();
            assert!(copy == plane && plane.clone() == copy);
            if let Some(last) = plane.last_mut() {
                *last += 1.0;
                assert!(copy != plane);
            }
        }
        let pixels = Plane::<[f32; 4]>::zeroed(1 << 18);
        assert!(pixels.len() == 1 << 18 && pixels[(1 << 18) - 1] == [0.0; 4]);
    }
}
