//! `[[shapes]]`.

use glam::DVec3;

use super::Reader;
use super::table::Table;
use super::values::{direction, flag, list, number, point, rotation, size, text, uv};
use crate::scene::rules::{self, Broken, Rule, polygon};
use crate::scene::{Cone, Cuboid, Cylinder, Disk, Object, Part, Plane, Polygon, Shape, Sphere};

#[derive(Clone, Copy)]
enum Kind {
    Sphere,
    Plane,
    Disk,
    Polygon,
    Box,
    Cylinder,
    Cone,
}

const KINDS: &[(&str, Kind)] = &[
    ("sphere", Kind::Sphere),
    ("plane", Kind::Plane),
    ("disk", Kind::Disk),
    ("polygon", Kind::Polygon),
    ("box", Kind::Box),
    ("cylinder", Kind::Cylinder),
    ("cone", Kind::Cone),
];

impl<'a> Reader<'a, '_> {
    /// Reads all shapes.
    pub fn read_shapes(&mut self) {
        for table in self.tables("shapes", "shape") {
            let object = self.object(table);
            let group = object.as_ref().and_then(|object| object.group);
            let moved = group.is_some_and(|group| !self.transforms[group].is_identity());
            let part = Part::Shape(self.scene.objects.len());
            self.scene.objects.extend(object);
            self.claim(Some(part).filter(|_| !moved));
        }
    }

    fn object(&self, mut table: Table<'a>) -> Option<Object> {
        let shape = match table.kind(KINDS, &[])? {
            Kind::Sphere => sphere(&table),
            Kind::Plane => plane(&table),
            Kind::Disk => disk(&table),
            Kind::Polygon => corners(&table),
            Kind::Box => cuboid(&table),
            Kind::Cylinder => cylinder(&table),
            Kind::Cone => cone(&table),
        };
        let material = table.need("material", |item| self.materials.find(item));
        let name = table.maybe("name", text);
        let group = self.group(&table);
        let placed = shape.zip(group).and_then(|(shape, (group, transform))| {
            // Checked as it is written first, so that a message shows the numbers of the file.
            let shape = check(&table, shape)?;
            let moved = transform.shape(shape);
            if !transform.is_identity() {
                rules::shape(&moved).map_or_else(|broken| table.broken(after_group(broken)), Some)?;
            }
            Some((moved, group))
        });
        table.finish();
        let (shape, group) = placed?;
        Some(Object { shape, material: material?, name: name?, group })
    }
}

/// Words for a rule that is broken only where the group puts the shape.
pub fn after_group(broken: Broken) -> Broken {
    Broken { key: "group", rule: format!("moved by its group, {}", broken.rule).into(), ..broken }
}

/// The shape without needless corners, if it keeps all rules.
fn check(table: &Table<'_>, shape: Shape) -> Option<Shape> {
    let Shape::Polygon(polygon) = shape else {
        return rules::shape(&shape).map_or_else(|broken| table.broken(broken), |()| Some(shape));
    };
    match polygon::clean(polygon) {
        Ok((polygon, dropped)) => {
            if !dropped.is_empty() {
                let item = table.item("corners")?;
                item.context.warn(&item.span, polygon::dropped_text(&dropped));
            }
            Some(Shape::Polygon(polygon))
        }
        Err(broken) => table.broken(broken),
    }
}

fn sphere(table: &Table<'_>) -> Option<Shape> {
    let (center, radius) = (table.need("center", point), table.need("radius", number(Rule::LENGTH)));
    Some(Shape::Sphere(Sphere { center: center?, radius: radius? }))
}

fn plane(table: &Table<'_>) -> Option<Shape> {
    let normal = table.need("normal", direction);
    let (at, offset) = (table.maybe("point", point), table.maybe("offset", number(Rule::COORDINATE)));
    let point = match (at?, offset?) {
        (Some(point), None) => Some(point),
        // The point nearest the origin; the normal counts as it is written, of any length.
        (None, Some(offset)) => normal.map(|normal| {
            let length = normal.length();
            normal / length * (offset / length)
        }),
        (Some(_), Some(_)) => {
            table.exclusive("plane is given by point or by offset, not both".to_owned(), &["point", "offset"])
        }
        (None, None) => table.missing("\"point\" or \"offset\""),
    };
    Some(Shape::Plane(Plane { point: point?, normal: normal? }))
}

fn disk(table: &Table<'_>) -> Option<Shape> {
    let (center, normal) = (table.need("center", point), table.need("normal", direction));
    let radius = table.need("radius", number(Rule::LENGTH));
    let inner_radius = table.or("inner_radius", 0.0, number(Rule::LENGTH_OR_ZERO));
    Some(Shape::Disk(Disk { center: center?, normal: normal?, radius: radius?, inner_radius: inner_radius? }))
}

fn corners(table: &Table<'_>) -> Option<Shape> {
    let corners = table.need("corners", |item| {
        let count = item.elements().map(|elements| elements.len());
        match count.map_or(Ok(()), polygon::count) {
            Ok(()) => list(item, "points", point),
            Err(broken) => table.broken(broken),
        }
    });
    let uvs = table.or("uvs", Vec::new(), |item| list(item, "pairs of numbers", uv));
    let normals = table.or("normals", Vec::new(), |item| list(item, "directions", direction));
    Some(Shape::Polygon(Polygon { corners: corners?, uvs: uvs?, normals: normals? }))
}

fn cuboid(table: &Table<'_>) -> Option<Shape> {
    let (min, max) = (table.maybe("min", point), table.maybe("max", point));
    let (center, size) = (table.maybe("center", point), table.maybe("size", size));
    let rotation = table.or("rotation", None, rotation);
    let (min, max) = match (min?, max?, center?, size?) {
        (Some(min), Some(max), None, None) => (min, max),
        (None, None, Some(center), Some(size)) => {
            let half: DVec3 = size / 2.0;
            (center - half, center + half)
        }
        (None, None, ..) | (_, _, None, None) => {
            return table.missing("\"min\" and \"max\", or \"center\" and \"size\"");
        }
        _ => {
            let rule = "box is given by min and max or by center and size, not both".to_owned();
            return table.exclusive(rule, &["min", "max", "center", "size"]);
        }
    };
    Some(Shape::Box(Cuboid { min, max, rotation: rotation? }))
}

fn cylinder(table: &Table<'_>) -> Option<Shape> {
    let (base, apex) = (table.need("base", point), table.need("apex", point));
    let radius = table.need("radius", number(Rule::LENGTH));
    let caps = table.or("caps", true, flag);
    Some(Shape::Cylinder(Cylinder { base: base?, apex: apex?, radius: radius?, caps: caps? }))
}

fn cone(table: &Table<'_>) -> Option<Shape> {
    let (base, apex) = (table.need("base", point), table.need("apex", point));
    let radius = table.need("radius", number(Rule::LENGTH_OR_ZERO));
    let apex_radius = table.or("apex_radius", 0.0, number(Rule::LENGTH_OR_ZERO));
    let caps = table.or("caps", true, flag);
    let (base, apex, caps) = (base?, apex?, caps?);
    Some(Shape::Cone(Cone { base, apex, radius: radius?, apex_radius: apex_radius?, caps }))
}
