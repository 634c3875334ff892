//! Layers beside the colour: what a picture may hold of the surfaces that its camera rays meet.

/// A layer beside the colour (arbitrary output variable), under the name that users ask for it by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Aov {
    /// Distance along the view axis, scene units; of a panorama the distance from the eye. 1e10 on a miss.
    Depth,
    /// The point that is seen, world coordinates; 0 on a miss.
    Position,
    /// The shading normal on the side that is seen, world coordinates, unit before filtering; 0 on a miss.
    Normal,
    /// Reflectance of the surface that is seen, 0 to 1: of mirrors their reflectance, of glass its tint; 0 on a miss.
    Albedo,
    /// Texture coordinates of the point that is seen; 0 on a miss.
    Uv,
    /// Pixels that what is seen moves to the next frame, right and up; 0 on a miss and where there is no next frame.
    Motion,
    /// Numbers of the object and of the material that are seen, counted from 1; 0 on a miss.
    Ids,
    /// How many samples the pixel took.
    Samples,
    /// Variance of the pixel's mean, estimated from its samples; 0 where there is but one.
    Variance,
    /// How far the decision that the ray meets what is seen is from turning, in errors that f32 cannot avoid: below 8 it was
    /// made in f64. At most 1e10, and 1e10 on a miss.
    Margin,
    /// Box tests, primitive tests and the share of live lanes.
    Cost,
    /// Cryptomatte of objects.
    CryptoObject,
    /// Cryptomatte of materials.
    CryptoMaterial,
    /// Cryptomatte of groups.
    CryptoGroup,
}

impl Aov {
    /// All of them, by their number.
    pub const ALL: [Aov; 14] = [
        Aov::Depth,
        Aov::Position,
        Aov::Normal,
        Aov::Albedo,
        Aov::Uv,
        Aov::Motion,
        Aov::Ids,
        Aov::Samples,
        Aov::Variance,
        Aov::Margin,
        Aov::Cost,
        Aov::CryptoObject,
        Aov::CryptoMaterial,
        Aov::CryptoGroup,
    ];

    /// The three Cryptomattes.
    pub const CRYPTOMATTES: [Aov; 3] = [Aov::CryptoObject, Aov::CryptoMaterial, Aov::CryptoGroup];

    /// The name that users ask for it by. For a Cryptomatte it is the type name as well.
    pub fn name(self) -> &'static str {
        match self {
            Aov::Depth => "depth",
            Aov::Position => "position",
            Aov::Normal => "normal",
            Aov::Albedo => "albedo",
            Aov::Uv => "uv",
            Aov::Motion => "motion",
            Aov::Ids => "ids",
            Aov::Samples => "samples",
            Aov::Variance => "variance",
            Aov::Margin => "margin",
            Aov::Cost => "cost",
            Aov::CryptoObject => "crypto_object",
            Aov::CryptoMaterial => "crypto_material",
            Aov::CryptoGroup => "crypto_asset",
        }
    }
}

/// Names that stand for several layers.
const SETS: [&str; 2] = ["cryptomatte", "all"];

/// The layers that a picture is to have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layers {
    /// A bit for each [`Aov`].
    set: u16,
    /// Ids that a Cryptomatte keeps of a pixel: even, 2 to 16.
    pub ranks: u8,
    /// Whether each row of a cloud is an object of its own, `name:17`, and not the cloud as a whole.
    pub instances: bool,
}

impl Default for Layers {
    fn default() -> Self {
        Layers { set: 0, ranks: 6, instances: false }
    }
}

impl Layers {
    /// Most ranks: as many as readers look for.
    pub const MOST_RANKS: u8 = 16;

    /// With one more.
    pub fn with(self, aov: Aov) -> Self {
        Layers { set: self.set | 1 << aov as u8, ..self }
    }

    /// With those of a name: of one [`Aov`], "cryptomatte" for three, or "all" for all but "margin" and "cost".
    ///
    /// # Errors
    /// The name is unknown; says which are known.
    pub fn with_named(self, name: &str) -> Result<Self, UnknownAov> {
        let means = |aov: &Aov| match name {
            "cryptomatte" => Aov::CRYPTOMATTES.contains(aov),
            "all" => !matches!(aov, Aov::Margin | Aov::Cost),
            _ => aov.name() == name,
        };
        let found: Vec<Aov> = Aov::ALL.into_iter().filter(means).collect();
        if found.is_empty() {
            return Err(UnknownAov(name.to_owned()));
        }
        Ok(found.into_iter().fold(self, Layers::with))
    }

    /// Whether one is among them.
    pub fn has(self, aov: Aov) -> bool {
        self.set >> aov as u8 & 1 == 1
    }

    /// Whether any of some is among them.
    pub fn has_any(self, aovs: &[Aov]) -> bool {
        aovs.iter().any(|aov| self.has(*aov))
    }

    /// Whether there are none.
    pub fn is_empty(self) -> bool {
        self.set == 0
    }

    /// Those that there are.
    pub fn iter(self) -> impl Iterator<Item = Aov> {
        Aov::ALL.into_iter().filter(move |aov| self.has(*aov))
    }
}

/// A name that no layer has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no layer \"{0}\": the names are {names}", names = known_names())]
pub struct UnknownAov(String);

/// All names, for a reader.
pub(super) fn known_names() -> String {
    let names: Vec<&str> = Aov::ALL.into_iter().map(Aov::name).chain(SETS).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_asked_for_by_name() {
        let named = |names: &[&str]| names.iter().try_fold(Layers::default(), |layers, name| layers.with_named(name));
        let some = named(&["ids", "depth", "ids"]).unwrap();
        assert_eq!(some.iter().collect::<Vec<_>>(), [Aov::Depth, Aov::Ids]);
        let all = named(&["all"]).unwrap();
        assert!(Aov::ALL.into_iter().all(|aov| all.has(aov) != matches!(aov, Aov::Margin | Aov::Cost)));
        assert_eq!(named(&["cryptomatte"]).unwrap().iter().collect::<Vec<_>>(), Aov::CRYPTOMATTES);
        for (number, aov) in Aov::ALL.into_iter().enumerate() {
            assert_eq!((aov as usize, named(&[aov.name()])), (number, Ok(Layers::default().with(aov))));
        }
        let message = named(&["Depth"]).unwrap_err().to_string();
        assert!(message.contains("\"Depth\"") && message.contains("depth, position"), "{message}");
    }
}
