//! Groups and what their transforms do to shapes and clouds.

use glam::{DQuat, DVec3};

use super::Reader;
use super::values::{number, point, rotation, text};
use crate::scene::rules::Rule;
use crate::scene::{CloudShapes, Cone, Cuboid, Cylinder, Disk, Plane, Polygon, Rows, Shape, Sphere};

/// Scale first, then rotation, then translation.
#[derive(Debug, Clone, Copy)]
pub struct Transform {
    scale: f64,
    rotation: Option<DQuat>,
    translation: DVec3,
}

impl Default for Transform {
    fn default() -> Self {
        Transform { scale: 1.0, rotation: None, translation: DVec3::ZERO }
    }
}

impl Reader<'_, '_> {
    /// Reads `[[groups]]`.
    pub fn read_groups(&mut self) {
        for table in self.tables("groups", "group") {
            let named = table.need("name", |item| Some((text(item)?, item.span.clone())));
            let translation = table.or("translate", DVec3::ZERO, point);
            let rotation = table.or("rotation", None, rotation);
            let scale = table.or("scale", 1.0, number(Rule::LENGTH));
            if let Some((name, span)) = named {
                // The name counts even if the rest is broken: shapes may refer to it.
                self.groups.give(&name, table.context, &span);
                self.transforms.push(Transform {
                    scale: scale.unwrap_or(1.0),
                    rotation: rotation.unwrap_or_default(),
                    translation: translation.unwrap_or_default(),
                });
            }
            table.finish();
        }
        self.claim(None);
    }
}

impl Transform {
    /// Whether it changes nothing.
    pub fn is_identity(&self) -> bool {
        self.scale == 1.0 && self.rotation.is_none() && self.translation == DVec3::ZERO
    }

    fn point(&self, p: DVec3) -> DVec3 {
        self.direction(p * self.scale) + self.translation
    }

    fn direction(&self, v: DVec3) -> DVec3 {
        self.rotation.map_or(v, |rotation| rotation * v)
    }

    /// The shape in world coordinates.
    pub fn shape(&self, shape: Shape) -> Shape {
        if self.is_identity() {
            return shape;
        }
        let scale = self.scale;
        match shape {
            Shape::Sphere(Sphere { center, radius }) => {
                Shape::Sphere(Sphere { center: self.point(center), radius: radius * scale })
            }
            Shape::Plane(Plane { point, normal }) => {
                Shape::Plane(Plane { point: self.point(point), normal: self.direction(normal) })
            }
            Shape::Disk(disk) => Shape::Disk(Disk {
                center: self.point(disk.center),
                normal: self.direction(disk.normal),
                radius: disk.radius * scale,
                inner_radius: disk.inner_radius * scale,
            }),
            Shape::Polygon(polygon) => Shape::Polygon(Polygon {
                corners: polygon.corners.into_iter().map(|corner| self.point(corner)).collect(),
                uvs: polygon.uvs,
                normals: polygon.normals.into_iter().map(|normal| self.direction(normal)).collect(),
            }),
            Shape::Box(cuboid) => Shape::Box(self.cuboid(cuboid)),
            Shape::Cylinder(cylinder) => Shape::Cylinder(Cylinder {
                base: self.point(cylinder.base),
                apex: self.point(cylinder.apex),
                radius: cylinder.radius * scale,
                ..cylinder
            }),
            Shape::Cone(cone) => Shape::Cone(Cone {
                base: self.point(cone.base),
                apex: self.point(cone.apex),
                radius: cone.radius * scale,
                apex_radius: cone.apex_radius * scale,
                ..cone
            }),
        }
    }

    fn cuboid(&self, Cuboid { min, max, rotation }: Cuboid) -> Cuboid {
        let Some(turn) = self.rotation else {
            return Cuboid { min: self.point(min), max: self.point(max), rotation };
        };
        // A box turns about its own centre: only the centre moves, the rest goes into its rotation.
        let (center, half) = (self.point((min + max) / 2.0), (max - min) / 2.0 * self.scale);
        Cuboid { min: center - half, max: center + half, rotation: Some(rotation.map_or(turn, |own| turn * own)) }
    }

    /// A cloud in world coordinates; without a transform its rows stay as precise as they are.
    pub fn cloud(&self, shapes: CloudShapes) -> CloudShapes {
        if self.is_identity() {
            return shapes;
        }
        let triple = |row: &[f64], at: usize| DVec3::new(row[at], row[at + 1], row[at + 2]);
        match shapes {
            CloudShapes::Spheres(rows) => CloudShapes::Spheres(changed(&rows, |row| {
                let p = self.point(triple(&row, 0));
                [p.x, p.y, p.z, row[3] * self.scale]
            })),
            CloudShapes::Disks(rows) => CloudShapes::Disks(changed(&rows, |row| {
                let (p, n) = (self.point(triple(&row, 0)), self.direction(triple(&row, 4)));
                [p.x, p.y, p.z, row[3] * self.scale, n.x, n.y, n.z]
            })),
            CloudShapes::Boxes(rows, rotation) => {
                let rows = changed(&rows, |row| {
                    let cuboid = self.cuboid(Cuboid { min: triple(&row, 0), max: triple(&row, 3), rotation });
                    let (min, max) = (cuboid.min, cuboid.max);
                    [min.x, min.y, min.z, max.x, max.y, max.z]
                });
                CloudShapes::Boxes(rows, self.rotation.map(|turn| rotation.map_or(turn, |own| turn * own)).or(rotation))
            }
            CloudShapes::Cylinders(rows, caps) => {
                let rows = changed(&rows, |row| {
                    let (a, b) = (self.point(triple(&row, 0)), self.point(triple(&row, 3)));
                    [a.x, a.y, a.z, b.x, b.y, b.z, row[6] * self.scale]
                });
                CloudShapes::Cylinders(rows, caps)
            }
            CloudShapes::Polygons { corners, starts } => {
                CloudShapes::Polygons { corners: changed(&corners, |row| self.point(row.into()).to_array()), starts }
            }
        }
    }
}

fn changed<const N: usize>(rows: &Rows<N>, change: impl Fn([f64; N]) -> [f64; N]) -> Rows<N> {
    Rows::F64((0..rows.len()).map(|i| change(rows.row(i))).collect())
}
