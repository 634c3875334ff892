//! Primaries and white points: linear light of one set as that of another.

use std::borrow::Cow;

use glam::{DMat3, DVec2, DVec3};

use crate::film::{Channel, Picture};

/// Where the primaries and the white of linear colours lie on the CIE 1931 xy diagram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Primaries {
    /// Red, green, blue, white.
    pub xy: [DVec2; 4],
}

impl Primaries {
    /// Rec. ITU-R BT.709 with D65: what pictures are in.
    pub const REC709: Primaries = Primaries {
        xy: [DVec2::new(0.64, 0.33), DVec2::new(0.30, 0.60), DVec2::new(0.15, 0.06), DVec2::new(0.3127, 0.3290)],
    };

    /// Rec. ITU-R BT.2020 with D65, which Rec. 2100 shares.
    pub const REC2020: Primaries = Primaries {
        xy: [DVec2::new(0.708, 0.292), DVec2::new(0.170, 0.797), DVec2::new(0.131, 0.046), DVec2::new(0.3127, 0.3290)],
    };

    /// ACEScg: AP1 with the white of ACES, near D60.
    ///
    /// Source: Academy of Motion Picture Arts and Sciences, "ACEScg: a working space for CGI render and
    /// compositing", S-2014-004 (2015), section 4.3.
    pub const ACESCG: Primaries = Primaries {
        xy: [
            DVec2::new(0.713, 0.293),
            DVec2::new(0.165, 0.830),
            DVec2::new(0.128, 0.044),
            DVec2::new(0.32168, 0.33767),
        ],
    };

    /// Whether both are the same but for the rounding to the f32 of a file.
    pub fn is_near(&self, other: &Primaries) -> bool {
        self.xy.iter().zip(other.xy).all(|(a, b)| a.abs_diff_eq(b, 1e-5))
    }

    /// Linear colours of these primaries to CIE XYZ, white at Y = 1. `None` where they span no space.
    ///
    /// Source: SMPTE RP 177-1993, "Derivation of basic television color equations".
    fn to_xyz(self) -> Option<DMat3> {
        let [red, green, blue, white] = self.xy.map(xyz);
        let axes = DMat3::from_cols(red, green, blue);
        let scale = axes.inverse() * white;
        let matrix = axes * DMat3::from_diagonal(scale);
        matrix.is_finite().then_some(matrix)
    }

    /// The matrix that takes linear colours of these primaries to others, white to white. `None` where either span
    /// no space.
    ///
    /// Source: Lam, "Metamerism and colour constancy" (1985), the Bradford transform: cone responses in proportion.
    pub fn matrix_to(self, other: Primaries) -> Option<DMat3> {
        const BRADFORD: DMat3 = DMat3::from_cols(
            DVec3::new(0.8951, -0.7502, 0.0389),
            DVec3::new(0.2664, 1.7135, -0.0685),
            DVec3::new(-0.1614, 0.0367, 1.0296),
        );
        let [from, to] = [self, other].map(|primaries| BRADFORD * xyz(primaries.xy[3]));
        let adapt = BRADFORD.inverse() * DMat3::from_diagonal(to / from) * BRADFORD;
        let matrix = other.to_xyz()?.inverse() * adapt * self.to_xyz()?;
        matrix.is_finite().then_some(matrix)
    }
}

/// The tristimulus values of a chromaticity with Y = 1.
fn xyz(xy: DVec2) -> DVec3 {
    DVec3::new(xy.x / xy.y, 1.0, (1.0 - xy.x - xy.y) / xy.y)
}

/// Layers whose R, G, B are colours, and whether they are variances of colours.
const LAYERS: [(&str, bool); 2] = [("albedo", false), ("variance", true)];

/// The picture with all its colours taken through a matrix.
///
/// A variance becomes the square of its taken-through square root: exact where the channels of a pixel vary together,
/// an upper bound otherwise where the matrix has no negative element.
pub(super) fn converted<'a>(picture: &'a Picture, matrix: DMat3) -> Cow<'a, Picture> {
    if matrix == DMat3::IDENTITY {
        return Cow::Borrowed(picture);
    }
    let mut picture = picture.clone();
    for [r, g, b, _] in &mut picture.pixels {
        (*r, *g, *b) = (matrix * DVec3::new((*r).into(), (*g).into(), (*b).into())).as_vec3().into();
    }
    for (layer, squared) in LAYERS {
        convert_layer(&mut picture.channels, layer, |color| match squared {
            false => matrix * color,
            true => (matrix * color.max(DVec3::ZERO).map(f64::sqrt)).map(|value| value * value),
        });
    }
    Cow::Owned(picture)
}

fn convert_layer(channels: &mut [Channel], layer: &str, convert: impl Fn(DVec3) -> DVec3) {
    let place = |suffix: &str| {
        let name = format!("{layer}.{suffix}");
        channels.iter().position(|channel| channel.name == name)
    };
    let (Some(r), Some(g), Some(b)) = (place("R"), place("G"), place("B")) else { return };
    let Ok([r, g, b]) = channels.get_disjoint_mut([r, g, b]) else { return };
    let [r, g, b] = [r, g, b].map(|channel| channel.samples.unrounded());
    let (Some(r), Some(g), Some(b)) = (r, g, b) else { return };
    for ((r, g), b) in r.iter_mut().zip(g).zip(b) {
        (*r, *g, *b) = convert(DVec3::new((*r).into(), (*g).into(), (*b).into())).as_vec3().into();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Samples, Window};

    /// Rows of the matrix from linear sRGB to ACEScg with Bradford adaptation, as colour-science prints them.
    #[test]
    fn the_matrix_is_the_published_one() {
        let matrix = Primaries::REC709.matrix_to(Primaries::ACESCG).unwrap().transpose();
        let want = [[0.6131, 0.3395, 0.0474], [0.0702, 0.9164, 0.0135], [0.0206, 0.1096, 0.8698]];
        for (got, want) in matrix.to_cols_array_2d().iter().flatten().zip(want.iter().flatten()) {
            assert!((got - want).abs() < 1e-4, "{got} {want}");
        }
        let back = Primaries::ACESCG.matrix_to(Primaries::REC709).unwrap();
        assert!((back.transpose() * matrix).is_finite());
        assert!((back * matrix.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12));
        assert!(Primaries { xy: [DVec2::splat(0.3); 4] }.matrix_to(Primaries::REC709).is_none());
    }

    #[test]
    fn colours_and_their_layers_are_converted_and_nothing_else() {
        let mut picture = Picture::new((1, 1), Window::full((1, 1)));
        picture.pixels[0] = [0.25, 0.5, 1.0, 0.5];
        for (name, value) in [
            ("albedo.R", 1.0),
            ("albedo.G", 1.0),
            ("albedo.B", 1.0),
            ("N.X", 0.5),
            ("variance.R", 4.0),
            ("variance.G", 4.0),
            ("variance.B", 4.0),
        ] {
            picture.channels.push(Channel { name: name.into(), samples: Samples::Float(vec![value].into()) });
        }
        let there = converted(&picture, Primaries::REC709.matrix_to(Primaries::ACESCG).unwrap());
        let value = |picture: &Picture, name: &str| picture.channel(name).unwrap().samples.floats().unwrap()[0];
        assert!((there.pixels[0][0] - (0.6131 * 0.25 + 0.3395 * 0.5 + 0.0474)).abs() < 1e-4);
        assert_eq!((there.pixels[0][3], value(&there, "N.X")), (0.5, 0.5));
        // White stays white, and so does its deviation.
        assert!((value(&there, "albedo.G") - 1.0).abs() < 1e-6 && (value(&there, "variance.B") - 4.0).abs() < 1e-5);
        let back = converted(&there, Primaries::ACESCG.matrix_to(Primaries::REC709).unwrap());
        assert!(back.pixels[0].iter().zip(picture.pixels[0]).all(|(a, b)| (a - b).abs() < 1e-6));
    }
}
