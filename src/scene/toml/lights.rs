//! `[[lights]]`.

use super::Reader;
use super::names::Names;
use super::table::Table;
use super::values::{choice, color, direction, flag, list, number, point, text};
use crate::scene::rules::Rule;
use crate::scene::rules::polygon::{clean, dropped_text};
use crate::scene::{Emitter, Falloff, Light, Part, Polygon, Source};

#[derive(Clone, Copy)]
enum Kind {
    Point,
    Directional,
    Spot,
    Sphere,
    Disk,
    Polygon,
}

const KINDS: &[(&str, Kind)] = &[
    ("point", Kind::Point),
    ("directional", Kind::Directional),
    ("spot", Kind::Spot),
    ("sphere", Kind::Sphere),
    ("disk", Kind::Disk),
    ("polygon", Kind::Polygon),
];
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
    let kind = table.kind(KINDS, &[])?;
    let source = match kind {
        Kind::Point => point_light(&table),
        Kind::Directional => {
            let (direction, irradiance) = (table.need("direction", direction), table.need("irradiance", color));
            direction.zip(irradiance).map(|(direction, irradiance)| Source::Directional { direction, irradiance })
        }
        Kind::Spot => spot(&table),
        Kind::Sphere | Kind::Disk | Kind::Polygon => area(&table, kind),
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

fn area(table: &Table<'_>, kind: Kind) -> Option<Source> {
    let emitter = match kind {
        Kind::Disk => {
            let (center, normal) = (table.need("center", point), table.need("normal", direction));
            let radius = table.need("radius", number(Rule::LENGTH));
            (|| Some(Emitter::Disk { center: center?, normal: normal?, radius: radius? }))()
        }
        Kind::Polygon => polygon(table).map(Emitter::Polygon),
        _ => {
            let (center, radius) = (table.need("center", point), table.need("radius", number(Rule::LENGTH)));
            center.zip(radius).map(|(center, radius)| Emitter::Sphere { center, radius })
        }
    };
    let (radiance, visible) = (table.need("radiance", color), table.or("visible", true, flag));
    Some(Source::Area { emitter: emitter?, radiance: radiance?, visible: visible? })
}

/// The corners, without those that are not needed.
fn polygon(table: &Table<'_>) -> Option<Polygon> {
    let corners = table.need("corners", |item| list(item, "points", point))?;
    match clean(Polygon { corners, ..Polygon::default() }) {
        Ok((polygon, dropped)) => {
            if !dropped.is_empty()
                && let Some(item) = table.item("corners")
            {
                item.context.warn(&item.span, dropped_text(&dropped));
            }
            Some(polygon)
        }
        Err(broken) => table.broken(broken),
    }
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
