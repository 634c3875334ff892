//! Crops of one frame, joined to the whole.

use super::{Channel, Cryptomatte, Picture, Samples, Window};

/// Why crops do not make a frame. Parts are told by their number, from 0.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JoinError {
    /// There is nothing to join.
    #[error("there are no parts")]
    Empty,
    /// A part of another frame.
    #[error("its frame is {}x{} pixels, that of the first one {}x{}", found.0, found.1, first.0, first.1)]
    Frame {
        /// Which part.
        part: usize,
        /// Its display window.
        found: (u32, u32),
        /// That of the first part.
        first: (u32, u32),
    },
    /// A part with other layers.
    #[error("it {} the layer {name} of the same type, unlike the first one", if *has { "has" } else { "lacks" })]
    Layers {
        /// Which part.
        part: usize,
        /// The channel.
        name: String,
        /// Whether this part has it, or the first one.
        has: bool,
    },
    /// A pixel that two parts have, and not the same.
    #[error("its pixel {x},{y} is not the one that a part before it has there")]
    Overlap {
        /// The later part.
        part: usize,
        /// Column in the display window.
        x: i32,
        /// Row in the display window.
        y: i32,
    },
    /// A pixel that no part has.
    #[error("the pixel {x},{y} is in none of the parts, and so are {more} others")]
    Missing {
        /// Column in the display window.
        x: i32,
        /// Row in the display window.
        y: i32,
        /// How many more are missing.
        more: usize,
    },
}

impl JoinError {
    /// The part that it is about, where it is about one.
    pub fn part(&self) -> Option<usize> {
        match self {
            JoinError::Frame { part, .. } | JoinError::Layers { part, .. } | JoinError::Overlap { part, .. } => {
                Some(*part)
            }
            JoinError::Empty | JoinError::Missing { .. } => None,
        }
    }
}

impl Picture {
    /// The frame that crops of it make: every pixel of the display window, and what is beyond it in an overscan. Parts
    /// may overlap where they agree to the bit.
    ///
    /// # Errors
    /// Parts that do not fit together, or leave something open.
    pub fn join(parts: &[Picture]) -> Result<Picture, JoinError> {
        let first = parts.first().ok_or(JoinError::Empty)?;
        let mut window = Window::full(first.display);
        for (part, picture) in parts.iter().enumerate() {
            if picture.display != first.display {
                return Err(JoinError::Frame { part, found: picture.display, first: first.display });
            }
            same_layers(part, picture, first)?;
            let Window { x0, y0, x1, y1 } = picture.window;
            let Window { x0: left, y0: top, x1: right, y1: bottom } = window;
            window = Window { x0: x0.min(left), y0: y0.min(top), x1: x1.max(right), y1: y1.max(bottom) };
        }
        let mut whole = Picture::new(first.display, window);
        whole.channels = first.channels.iter().map(|channel| blank(channel, parts, window.area())).collect();
        let mut filled = vec![false; window.area()];
        for (part, picture) in parts.iter().enumerate() {
            place(part, picture, &mut whole, &mut filled)?;
        }
        if let Some(index) = filled.iter().position(|filled| !filled) {
            let (x, y) = window.pixel(index);
            return Err(JoinError::Missing { x, y, more: filled.iter().filter(|filled| !**filled).count() - 1 });
        }
        whole.cryptomattes = mattes(parts);
        Ok(whole)
    }
}

fn same_layers(part: usize, picture: &Picture, first: &Picture) -> Result<(), JoinError> {
    let alike = |a: &Samples, b: &Samples| a.kind() == b.kind();
    let lacks = |picture: &Picture, channel: &Channel| {
        !picture.channel(&channel.name).is_some_and(|found| alike(&found.samples, &channel.samples))
    };
    let more = picture.channels.iter().find(|channel| lacks(first, channel)).map(|channel| (channel, true));
    let found =
        more.or_else(|| first.channels.iter().find(|channel| lacks(picture, channel)).map(|channel| (channel, false)));
    found.map_or(Ok(()), |(channel, has)| Err(JoinError::Layers { part, name: channel.name.clone(), has }))
}

/// A channel of the whole, without anything in it.
fn blank(channel: &Channel, parts: &[Picture], area: usize) -> Channel {
    let Channel { name, samples } = channel;
    let (name, mut samples) = (name.clone(), samples.kind().zeros(area));
    let is_unrounded = |channel: &Channel| matches!(channel.samples, Samples::Unrounded(_));
    if parts.iter().any(|part| part.channel(&name).is_some_and(is_unrounded)) {
        samples.unrounded();
    }
    Channel { name, samples }
}

/// Puts a part into the whole, and looks at what is there already.
fn place(part: usize, picture: &Picture, whole: &mut Picture, filled: &mut [bool]) -> Result<(), JoinError> {
    let to = whole.window;
    let channels: Vec<&Channel> = whole.channels.iter().filter_map(|channel| picture.channel(&channel.name)).collect();
    for from in 0..picture.pixels.len() {
        let (x, y) = picture.window.pixel(from);
        let Some(place) = to.index(x, y) else { continue };
        let mut same = true;
        let seen = std::mem::replace(&mut filled[place], true);
        same &= put(&mut whole.pixels[place], picture.pixels[from], |a, b| a.map(f32::to_bits) == b.map(f32::to_bits));
        for (channel, source) in whole.channels.iter_mut().zip(&channels) {
            same &= match (&mut channel.samples, &source.samples) {
                (Samples::Half(to), Samples::Half(samples)) => {
                    put(&mut to[place], samples[from], |a, b| a.to_bits() == b.to_bits())
                }
                (Samples::Unrounded(to), Samples::Half(samples)) => {
                    put(&mut to[place], samples[from].to_f32(), |a, b| a.to_bits() == b.to_bits())
                }
                (Samples::Unrounded(to), Samples::Unrounded(samples))
                | (Samples::Float(to), Samples::Float(samples)) => {
                    put(&mut to[place], samples[from], |a, b| a.to_bits() == b.to_bits())
                }
                (Samples::Uint(to), Samples::Uint(samples)) => put(&mut to[place], samples[from], |a, b| a == b),
                _ => false,
            };
        }
        if seen && !same {
            return Err(JoinError::Overlap { part, x, y });
        }
    }
    Ok(())
}

/// Writes a value, and says whether it was there before.
fn put<T: Copy>(place: &mut T, value: T, same: impl Fn(T, T) -> bool) -> bool {
    same(std::mem::replace(place, value), value)
}

fn mattes(parts: &[Picture]) -> Vec<Cryptomatte> {
    let mut mattes: Vec<Cryptomatte> = Vec::new();
    for matte in parts.iter().flat_map(|part| &part.cryptomattes) {
        match mattes.iter_mut().find(|known| known.name == matte.name) {
            Some(known) => known.manifest.extend(matte.manifest.clone()),
            None => mattes.push(matte.clone()),
        }
    }
    mattes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole() -> Picture {
        let mut picture = Picture::new((6, 5), Window { x0: -1, y0: 0, x1: 6, y1: 5 });
        picture.pixels.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = [i as f32, 0.5, -0.0, 1.0]);
        let area = picture.window.area();
        let id = |name: &str| f32::from_bits(Cryptomatte::id(name));
        let ids = (0..area).map(|i| if i < 20 { id("a") } else { id("b") }).collect();
        picture.channels = vec![
            Channel { name: "id.object".into(), samples: Samples::Uint((0..area as u32).collect()) },
            Channel { name: "crypto_object00.R".into(), samples: Samples::Float(ids) },
        ];
        let manifest = ["a", "b"].map(|name| (name.to_owned(), Cryptomatte::id(name))).into();
        picture.cryptomattes = vec![Cryptomatte { name: "crypto_object".into(), manifest }];
        picture
    }

    fn parts() -> Vec<Picture> {
        let windows = [(-1, 0, 3, 2), (2, 0, 6, 5), (-1, 2, 2, 5)];
        windows.map(|(x0, y0, x1, y1)| whole().crop(Window { x0, y0, x1, y1 }).unwrap()).into()
    }

    #[test]
    fn crops_make_the_whole_to_the_bit() {
        assert_eq!(Picture::join(&parts()), Ok(whole()));
        let mut turned = parts();
        turned.reverse();
        assert_eq!(Picture::join(&turned), Ok(whole()));
        assert_eq!(Picture::join(&[]), Err(JoinError::Empty));
    }

    #[test]
    fn what_does_not_fit_is_told() {
        let with = |change: &dyn Fn(&mut Vec<Picture>)| {
            let mut parts = parts();
            change(&mut parts);
            Picture::join(&parts).unwrap_err()
        };
        assert_eq!(with(&|parts| drop(parts.pop())), JoinError::Missing { x: -1, y: 2, more: 8 });
        assert_eq!(with(&|parts| parts[1].pixels[0][2] = 0.0), JoinError::Overlap { part: 1, x: 2, y: 0 });
        let id = |parts: &mut Vec<Picture>| parts[1].channels[0].samples = Samples::Uint(vec![9; 20].into());
        assert_eq!(with(&id), JoinError::Overlap { part: 1, x: 2, y: 0 });
        assert!(matches!(with(&|parts| parts[2].display = (6, 6)), JoinError::Frame { part: 2, .. }));
        let fewer = with(&|parts| drop(parts[1].channels.pop()));
        assert_eq!(fewer, JoinError::Layers { part: 1, name: "crypto_object00.R".into(), has: false });
        let other = with(&|parts| parts[2].channels[0].samples = Samples::Float(vec![0.0; 9].into()));
        assert_eq!(other, JoinError::Layers { part: 2, name: "id.object".into(), has: true });
    }
}
