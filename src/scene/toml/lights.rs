//! `[[lights]]`.

use super::Reader;
use super::names::Names;
use super::table::Table;
use super::values::{choice, color, direction, flag, number, point, text};
use crate::scene::rules::Rule;
use crate::scene::{Falloff, Light, Part, Source};

#[derive(Clone, Copy)]
enum Kind {
    Point,
    Directional,
    Spot,
}

const KINDS: &[(&str, Kind)] = &[("point", Kind::Point), ("directional", Kind::Directional), ("spot", Kind::Spot)];
const LATER: &str = "area lights are not in this version: use \"point\", \"directional\" or \"spot\"";
const FALLOFFS: &[(&str, Falloff)] = &[("inverse-square", Falloff::InverseSquare), ("none", Falloff::None)];

impl Reader<'_, '_> {
    /// Reads all lights.
    pub fn read_lights(&mut self) {
        let mut names = Names::new("light");
        for table in self.tables("lights", "light") {
            let light = light(table, &mut names);
            let part = Part::Light(self.scene.lights.len());
            self.scene.lights.extend(light);
            self.claim(Some(part));
        }
    }
}

fn light(mut table: Table<'_>, names: &mut Names) -> Option<Light> {
    let kind = table.kind(KINDS, &[("sphere", LATER), ("disk", LATER), ("polygon", LATER)])?;
    let source = match kind {
        Kind::Point => point_light(&table),
        Kind::Directional => {
            let (direction, irradiance) = (table.need("direction", direction), table.need("irradiance", color));
            direction.zip(irradiance).map(|(direction, irradiance)| Source::Directional { direction, irradiance })
        }
        Kind::Spot => spot(&table),
    };
    let shadows = table.or("shadows", true, flag);
    let name = table.maybe("name", |item| {
        let name = text(item)?;
        names.give(&name, item.context, &item.span)?;
        Some(name)
    });
    table.finish();
    Some(Light { name: name?, shadows: shadows?, source: source? })
}

fn point_light(table: &Table<'_>) -> Option<Source> {
    let (position, intensity) = (table.need("position", point), table.need("intensity", color));
    let falloff = table.or("falloff", Falloff::default(), choice(FALLOFFS));
    Some(Source::Point { position: position?, intensity: intensity?, falloff: falloff? })
}

fn spot(table: &Table<'_>) -> Option<Source> {
    let (position, direction) = (table.need("position", point), table.need("direction", direction));
    let intensity = table.need("intensity", color);
    let cone = table.need("cone", number(Rule::CONE));
    let penumbra = table.or("penumbra", 0.0, |item| {
        let angle = number(Rule::LENGTH_OR_ZERO)(item)?;
        let fits = cone.is_none_or(|cone| angle <= cone);
        if fits { Some(angle) } else { item.wrong("must be at most its cone") }
    });
    let (position, direction, intensity) = (position?, direction?, intensity?);
    Some(Source::Spot { position, direction, intensity, cone: cone?, penumbra: penumbra? })
}
