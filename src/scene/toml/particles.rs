//! `[[clouds]]` of `type = "particles"`: atoms from files of simulations and of chemistry.

use ::toml::de::DeValue;

use super::Reader;
use super::clouds::{checked, named};
use super::keyed::is_keyed;
use super::table::{Item, Table};
use super::values::{choice, color, list, number, numbers, text, whole};
use crate::scene::error::SceneError;
use crate::scene::particles::{
    Bonds, ColorMap, Coloring, Element, Format, Frame, Look, Radius, Style, Trajectory, scene,
};
use crate::scene::rules::{Broken, MOST_PRIMITIVES, Rule};
use crate::scene::{Cloud, Warning};

const STYLES: &[(&str, Style)] =
    &[("spheres", Style::Spheres), ("ball-and-stick", Style::BallAndStick), ("licorice", Style::Licorice)];
const MAPS: &[(&str, ColorMap)] =
    &[("viridis", ColorMap::Viridis), ("coolwarm", ColorMap::CoolWarm), ("grey", ColorMap::Grey)];
const BONDS: &[(&str, Bonds)] =
    &[("auto", Bonds::Auto), ("file", Bonds::File), ("distance", Bonds::Distance), ("none", Bonds::None)];
/// Most copies of a cell along an edge.
const MOST_COPIES: u64 = 1 << 16;

impl<'a> Reader<'a, '_> {
    /// The clouds that a table of particles becomes: spheres, and cylinders for bonds. `index` tells tables apart.
    pub fn particles(&mut self, table: Table<'a>, index: usize) -> Option<Vec<Cloud>> {
        let look = look(&table);
        let number = table.or("frame", scene::number(table.context.file.frame), whole(1, u64::MAX));
        let material = table.need("material", |item| self.materials.find(item));
        let name = table.maybe("name", text);
        let group = self.group(&table);
        let file = table.need("file", |item| Some(item.clone()));
        let drawn =
            look.zip(number).and_then(|(look, number)| self.drawn(&table, file.as_ref()?, &look, number, index));
        let clouds = drawn.map(|drawn| {
            log(&table, &drawn.warnings);
            scene::clouds(drawn, [material.unwrap_or(0); 2])
        });
        let clouds = clouds.zip(group).and_then(|(clouds, (group, transform))| {
            let place = |cloud: Cloud| {
                let shapes = checked(&table, cloud.shapes, &transform)?;
                Some(Cloud { shapes, group, ..cloud })
            };
            clouds.into_iter().map(place).collect::<Option<Vec<Cloud>>>()
        });
        table.finish();
        let (clouds, name) = (clouds?, name?);
        material?;
        Some(clouds.into_iter().map(|cloud| Cloud { name: name.clone(), ..cloud }).collect())
    }

    fn drawn(
        &mut self,
        table: &Table<'a>,
        item: &Item<'a>,
        look: &Look,
        number: u64,
        index: usize,
    ) -> Option<crate::scene::particles::Drawn> {
        let file = named(item)?;
        let Some(format) = Format::of(&file.file.path) else {
            return file
                .broken(&format!("must be a file of atoms, ending in one of {}", Format::endings()), String::new());
        };
        let (columns, bonds) = (look.columns(), look.needs_bonds(format));
        let key = (index, file.file.path.clone(), columns.clone(), bonds);
        let open = || Trajectory::open(&file.file.path, format, columns, bonds);
        let read = |trajectory: &mut Trajectory| -> Result<Frame, Box<SceneError>> { trajectory.frame(number) };
        let found = self.store.trajectories.get(key, open);
        let (trajectory, frame) = match found.and_then(|trajectory| Ok((read(trajectory)?, trajectory))) {
            Ok((frame, trajectory)) => (trajectory, frame),
            Err(error) if error.place.line == 0 => return file.broken(&error.rule, error.found),
            Err(error) => {
                let help = format!("{} is named at {}", file.file.shown, item.context.place(&item.span));
                item.context.log.push(error.help(help));
                return None;
            }
        };
        match look.draw(frame, trajectory, MOST_PRIMITIVES) {
            Ok(drawn) => Some(drawn),
            Err(broken) => {
                let rule = format!("{} {}", broken.key, broken.rule).into();
                let key = if table.has(broken.key) { broken.key } else { "file" };
                table.broken(Broken { key, rule, ..broken })
            }
        }
    }
}

/// Warnings of the file of atoms are those of the scene.
fn log(table: &Table<'_>, warnings: &[Warning]) {
    warnings.iter().for_each(|warning| table.context.log.warn(warning.clone()));
}

fn look(table: &Table<'_>) -> Option<Look> {
    let style = table.maybe("style", choice(STYLES));
    let radius = table.or("radius", Radius::Auto, radius);
    let scale = table.maybe("radius_scale", number(Rule::LENGTH));
    let color = table.or("color", Coloring::Auto, coloring);
    let bonds = table.or("bonds", Bonds::Auto, bonds);
    let bond_radius = table.maybe("bond_radius", number(Rule::LENGTH));
    let elements = table.or("elements", Vec::new(), |item| list(item, "symbols of elements", element));
    let replicate = table.or("replicate", [1; 3], copies);
    Some(Look {
        style: style?,
        radius: radius?,
        scale: scale?,
        color: color?,
        bonds: bonds?,
        bond_radius: bond_radius?,
        elements: elements?,
        replicate: replicate?,
    })
}

/// A table with a `column`, which makes it no value over time.
fn column(item: &Item<'_>) -> bool {
    matches!(item.value, DeValue::Table(_)) && !is_keyed(item)
}

fn radius(item: &Item<'_>) -> Option<Radius> {
    if column(item) {
        let table = item.table()?;
        let name = table.need("column", text);
        table.finish();
        return name.map(Radius::Column);
    }
    match item.value.as_str() {
        Some("auto") => Some(Radius::Auto),
        Some("van-der-waals") => Some(Radius::VanDerWaals),
        Some("covalent") => Some(Radius::Covalent),
        Some(_) => item.wrong("must be a number, \"auto\", \"van-der-waals\", \"covalent\" or { column = \"NAME\" }"),
        None => number(Rule::LENGTH)(item).map(Radius::Same),
    }
}

fn coloring(item: &Item<'_>) -> Option<Coloring> {
    if column(item) {
        let table = item.table()?;
        let name = table.need("column", text);
        let map = table.or("map", ColorMap::default(), choice(MAPS));
        let range = table.maybe("range", |item| {
            let [low, high] = numbers(item, Rule::COORDINATE, "two numbers")?;
            if low < high { Some([low, high]) } else { item.wrong("must be two numbers, the lower one first") }
        });
        table.finish();
        return Some(Coloring::Column { name: name?, map: map?, range: range? });
    }
    match item.value.as_str() {
        Some("auto") => Some(Coloring::Auto),
        Some("element") => Some(Coloring::Kind),
        Some(_) => item.wrong("must be three numbers, \"auto\", \"element\" or { column = \"NAME\" }"),
        None => color(item).map(|color| Coloring::Same(color.to_array().map(|x| x as f32))),
    }
}

fn bonds(item: &Item<'_>) -> Option<Bonds> {
    match item.value.as_str() {
        Some(_) => choice(BONDS)(item),
        None => number(Rule::LENGTH)(item).map(Bonds::Within),
    }
}

fn element(item: &Item<'_>) -> Option<Element> {
    let element = item.value.as_str().and_then(Element::of_symbol);
    element.or_else(|| item.wrong("must hold symbols of elements such as \"C\""))
}

fn copies(item: &Item<'_>) -> Option<[u32; 3]> {
    let form = "must be three whole numbers";
    if item.elements().is_none_or(|elements| elements.len() != 3) {
        return item.wrong(form);
    }
    let counts = list(item, "three whole numbers", whole(1, MOST_COPIES))?;
    counts.into_iter().map(|count| count as u32).collect::<Vec<_>>().try_into().ok()
}
