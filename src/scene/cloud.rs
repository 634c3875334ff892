//! Clouds: many primitives of one kind from arrays.

use std::borrow::Cow;

use glam::{DQuat, DVec3};

use super::{Cuboid, Cylinder, Disk, Polygon, Primitive, Shape, Sphere};

/// Many primitives of one kind; row `i` is one primitive.
#[derive(Debug, Clone)]
pub struct Cloud {
    /// Geometry, world coordinates.
    pub shapes: CloudShapes,
    /// Material of each row.
    pub material: CloudMaterial,
    /// Factor on the material's colour, linear Rec. 709, one a row; none: white.
    pub colors: Option<Vec<[f32; 3]>>,
    /// The user's name for all rows together.
    pub name: Option<String>,
    /// Index into [`Scene::groups`](super::Scene::groups).
    pub group: Option<usize>,
}

/// Geometry of a cloud, row-major as in its file.
#[derive(Debug, Clone)]
pub enum CloudShapes {
    /// x y z r.
    Spheres(Rows<4>),
    /// x y z r nx ny nz.
    Disks(Rows<7>),
    /// min, max; all turned alike, each about its centre, where a group turns them.
    Boxes(Rows<6>, Option<DQuat>),
    /// Base, apex, radius; whether the ends of all are closed.
    Cylinders(Rows<7>, bool),
    /// Corners in order, and where each polygon starts in them: N + 1 entries, the last one their count.
    Polygons {
        /// x y z of each corner.
        corners: Rows<3>,
        /// First corner of each polygon, then the count of all.
        starts: Vec<u32>,
    },
}

/// Rows of `N` numbers in the precision of their file.
#[derive(Debug, Clone, PartialEq)]
pub enum Rows<const N: usize> {
    /// Single precision.
    F32(Vec<[f32; N]>),
    /// Double precision.
    F64(Vec<[f64; N]>),
}

/// Indices into [`Scene::materials`](super::Scene::materials).
#[derive(Debug, Clone)]
pub enum CloudMaterial {
    /// The same for all rows.
    One(usize),
    /// One a row.
    Each(Vec<u32>),
}

impl<const N: usize> Rows<N> {
    /// How many rows.
    pub fn len(&self) -> usize {
        match self {
            Rows::F32(rows) => rows.len(),
            Rows::F64(rows) => rows.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Row `i` in f64, exactly.
    pub fn row(&self, i: usize) -> [f64; N] {
        match self {
            Rows::F32(rows) => rows[i].map(f64::from),
            Rows::F64(rows) => rows[i],
        }
    }
}

impl Cloud {
    /// How many primitives.
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Row `i` as a primitive.
    pub fn primitive(&self, i: usize) -> Primitive<'_> {
        Primitive { shape: Cow::Owned(self.shapes.shape(i)), material: self.material_of(i), color: self.color(i) }
    }

    /// Material of row `i`.
    pub fn material_of(&self, i: usize) -> usize {
        match &self.material {
            CloudMaterial::One(material) => *material,
            CloudMaterial::Each(materials) => materials[i] as usize,
        }
    }

    /// Factor on the colour of row `i`'s material.
    pub fn color(&self, i: usize) -> DVec3 {
        self.colors.as_ref().map_or(DVec3::ONE, |colors| DVec3::from_array(colors[i].map(f64::from)))
    }
}

impl CloudShapes {
    /// How many rows.
    pub fn len(&self) -> usize {
        match self {
            CloudShapes::Spheres(rows) => rows.len(),
            CloudShapes::Disks(rows) => rows.len(),
            CloudShapes::Boxes(rows, _) => rows.len(),
            CloudShapes::Cylinders(rows, _) => rows.len(),
            CloudShapes::Polygons { starts, .. } => starts.len().saturating_sub(1),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Row `i` as a shape.
    pub fn shape(&self, i: usize) -> Shape {
        match self {
            CloudShapes::Spheres(rows) => {
                let [x, y, z, radius] = rows.row(i);
                Shape::Sphere(Sphere { center: DVec3::new(x, y, z), radius })
            }
            CloudShapes::Disks(rows) => {
                let [x, y, z, radius, a, b, c] = rows.row(i);
                let (center, normal) = (DVec3::new(x, y, z), DVec3::new(a, b, c));
                Shape::Disk(Disk { center, normal, radius, inner_radius: 0.0 })
            }
            CloudShapes::Boxes(rows, rotation) => {
                let [a, b, c, x, y, z] = rows.row(i);
                Shape::Box(Cuboid { min: DVec3::new(a, b, c), max: DVec3::new(x, y, z), rotation: *rotation })
            }
            CloudShapes::Cylinders(rows, caps) => {
                let [a, b, c, x, y, z, radius] = rows.row(i);
                let (base, apex) = (DVec3::new(a, b, c), DVec3::new(x, y, z));
                Shape::Cylinder(Cylinder { base, apex, radius, caps: *caps })
            }
            CloudShapes::Polygons { corners, starts } => {
                let range = starts[i] as usize..starts[i + 1] as usize;
                let corners = range.map(|k| DVec3::from_array(corners.row(k))).collect();
                Shape::Polygon(Polygon { corners, ..Polygon::default() })
            }
        }
    }
}
