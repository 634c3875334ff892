//! Single shapes.

use glam::DQuat;

use super::text::{Table, list, number, numbers, quoted, vector};
use crate::scene::{Object, Polygon, Scene, Shape};

pub(super) fn object(scene: &Scene, object: &Object) -> Table {
    geometry(&object.shape)
        .set("material", quoted(&scene.materials[object.material].name))
        .set_some("name", object.name.as_deref().map(quoted))
        .set_some("group", object.group.map(|group| quoted(&scene.groups[group])))
}

fn geometry(shape: &Shape) -> Table {
    let table = Table::one_of("shapes").set("type", quoted(shape.kind()));
    match shape {
        Shape::Sphere(sphere) => table.set("center", vector(sphere.center)).set("radius", number(sphere.radius)),
        Shape::Plane(plane) => table.set("point", vector(plane.point)).set("normal", vector(plane.normal)),
        Shape::Disk(disk) => table
            .set("center", vector(disk.center))
            .set("normal", vector(disk.normal))
            .set("radius", number(disk.radius))
            .set("inner_radius", number(disk.inner_radius)),
        Shape::Polygon(shape) => polygon(table, shape),
        Shape::Box(cuboid) => table
            .set("min", vector(cuboid.min))
            .set("max", vector(cuboid.max))
            .set_some("rotation", cuboid.rotation.map(rotation)),
        Shape::Cylinder(cylinder) => table
            .set("base", vector(cylinder.base))
            .set("apex", vector(cylinder.apex))
            .set("radius", number(cylinder.radius))
            .set("caps", cylinder.caps),
        Shape::Cone(cone) => table
            .set("base", vector(cone.base))
            .set("apex", vector(cone.apex))
            .set("radius", number(cone.radius))
            .set("apex_radius", number(cone.apex_radius))
            .set("caps", cone.caps),
    }
}

fn polygon(table: Table, polygon: &Polygon) -> Table {
    let some = |text: String| (text != "[]").then_some(text);
    table
        .set("corners", list(polygon.corners.iter().copied().map(vector)))
        .set_some("uvs", some(list(polygon.uvs.iter().map(|uv| numbers(&uv.to_array())))))
        .set_some("normals", some(list(polygon.normals.iter().copied().map(vector))))
}

fn rotation(rotation: DQuat) -> String {
    format!("{{ quaternion = {} }}", numbers(&rotation.to_array()))
}
