//! The parts that kernels know: each primitive of the scene as one part or several, in f64, relative to
//! the plan's origin.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::split::convex_pieces;
use crate::scene::{CloudShapes, Cone, Cuboid, Cylinder, Disk, Plane, Polygon, Primitive, Scene, Shape, Sphere};

/// The kinds of parts, each with a store and a kernel of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Kind {
    /// Spheres.
    Sphere,
    /// Infinite planes.
    Plane,
    /// Disks, rings and caps.
    Disk,
    /// Polygons of 3 corners.
    Triangle,
    /// Polygons of 4 corners.
    Quad,
    /// Polygons of 5 to 8 corners.
    Octagon,
    /// Axis-aligned boxes.
    Box,
    /// Turned boxes.
    TurnedBox,
    /// Mantles of cylinders.
    Cylinder,
    /// Mantles of cones.
    Cone,
}

impl Kind {
    /// All kinds, by their number.
    pub const ALL: [Kind; 10] = [
        Kind::Sphere,
        Kind::Plane,
        Kind::Disk,
        Kind::Triangle,
        Kind::Quad,
        Kind::Octagon,
        Kind::Box,
        Kind::TurnedBox,
        Kind::Cylinder,
        Kind::Cone,
    ];

    /// The kind whose rows hold parts of both kinds, if there is one: of two kinds of polygons the one of more corners.
    pub fn holding(self, other: Kind) -> Option<Kind> {
        let polygons = [Kind::Triangle, Kind::Quad, Kind::Octagon];
        match self == other || (polygons.contains(&self) && polygons.contains(&other)) {
            true => Some(self.max(other)),
            false => None,
        }
    }

    /// The word for it in statistics.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Sphere => "sphere",
            Kind::Plane => "plane",
            Kind::Disk => "disk",
            Kind::Triangle => "triangle",
            Kind::Quad => "quad",
            Kind::Octagon => "octagon",
            Kind::Box => "box",
            Kind::TurnedBox => "turned_box",
            Kind::Cylinder => "cylinder",
            Kind::Cone => "cone",
        }
    }
}

/// Which primitive a part belongs to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Owner {
    /// Index of the primitive in the scene.
    pub primitive: u32,
    /// Index of its material in the scene.
    pub material: u32,
}

/// A sphere.
#[derive(Debug, Clone, Copy)]
pub struct SpherePart {
    /// Scene units.
    pub center: DVec3,
    /// Scene units.
    pub radius: f64,
    /// Whose it is.
    pub owner: Owner,
}

/// A plane.
#[derive(Debug, Clone, Copy)]
pub struct PlanePart {
    /// A point of it.
    pub point: DVec3,
    /// Unit.
    pub normal: DVec3,
    /// Whose it is.
    pub owner: Owner,
}

/// A disk, a ring or a cap.
#[derive(Debug, Clone, Copy)]
pub struct DiskPart {
    /// Scene units.
    pub center: DVec3,
    /// Unit.
    pub normal: DVec3,
    /// Scene units.
    pub radius: f64,
    /// Scene units, 0 for a full disk.
    pub inner: f64,
    /// Whose it is.
    pub owner: Owner,
}

/// A convex polygon of at most `N` corners; shorter ones repeat their last corner.
#[derive(Debug, Clone, Copy)]
pub struct PolygonPart<const N: usize> {
    /// Counter-clockwise seen from the front.
    pub corners: [DVec3; N],
    /// Unit, of the whole polygon.
    pub normal: DVec3,
    /// First corner of the whole polygon, through which its plane goes.
    pub uv_origin: DVec3,
    /// Unit, along its first edge.
    pub uv_edge: DVec3,
    /// Whose it is.
    pub owner: Owner,
}

/// An axis-aligned box.
#[derive(Debug, Clone, Copy)]
pub struct BoxPart {
    /// Lower corner.
    pub min: DVec3,
    /// Upper corner.
    pub max: DVec3,
    /// Whose it is.
    pub owner: Owner,
}

/// A turned box.
#[derive(Debug, Clone, Copy)]
pub struct TurnedBoxPart {
    /// Scene units.
    pub center: DVec3,
    /// Half its size along its axes.
    pub half: DVec3,
    /// Unit, at right angles.
    pub axes: [DVec3; 3],
    /// Whose it is.
    pub owner: Owner,
}

/// The mantle of a cylinder.
#[derive(Debug, Clone, Copy)]
pub struct CylinderPart {
    /// Centre of the lower rim.
    pub base: DVec3,
    /// Unit, toward the upper rim.
    pub axis: DVec3,
    /// Scene units.
    pub height: f64,
    /// Scene units.
    pub radius: f64,
    /// Whose it is.
    pub owner: Owner,
}

/// The mantle of a cone.
#[derive(Debug, Clone, Copy)]
pub struct ConePart {
    /// Centre of the lower rim.
    pub base: DVec3,
    /// Centre of the upper rim.
    pub apex: DVec3,
    /// Unit, toward the upper rim.
    pub axis: DVec3,
    /// Scene units.
    pub height: f64,
    /// At the base.
    pub radius: f64,
    /// At the apex.
    pub apex_radius: f64,
    /// Whose it is.
    pub owner: Owner,
}

impl<const N: usize> PolygonPart<N> {
    /// The same polygon among those of up to `M` corners, which are no fewer.
    pub fn with_corners<const M: usize>(&self) -> PolygonPart<M> {
        let PolygonPart { corners, normal, uv_origin, uv_edge, owner } = *self;
        PolygonPart { corners: std::array::from_fn(|k| corners[k.min(N - 1)]), normal, uv_origin, uv_edge, owner }
    }
}

impl TurnedBoxPart {
    /// A vector in the frame of the box.
    pub fn local(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.axes[0].dot(v), self.axes[1].dot(v), self.axes[2].dot(v))
    }
}

impl ConePart {
    /// Centre of the narrower end and the unit axis from there to the wider one: where the radius comes near
    /// zero, heights must too, or nothing of it is left.
    pub fn narrow_end(&self) -> (DVec3, DVec3) {
        match self.apex_radius < self.radius {
            true => (self.apex, -self.axis),
            false => (self.base, self.axis),
        }
    }

    /// The radius there.
    pub fn narrow_radius(&self) -> f64 {
        self.radius.min(self.apex_radius)
    }

    /// Growth of the radius per unit of height from there.
    pub fn growth(&self) -> f64 {
        (self.apex_radius - self.radius).abs() / self.height
    }
}

/// All parts of a scene, by kind, in the order of the primitives.
#[derive(Debug, Default)]
pub struct Parts {
    /// Spheres.
    pub spheres: Vec<SpherePart>,
    /// Planes.
    pub planes: Vec<PlanePart>,
    /// Disks.
    pub disks: Vec<DiskPart>,
    /// Polygons of 3 corners.
    pub triangles: Vec<PolygonPart<3>>,
    /// Polygons of 4 corners.
    pub quads: Vec<PolygonPart<4>>,
    /// Polygons of 5 to 8 corners.
    pub octagons: Vec<PolygonPart<8>>,
    /// Axis-aligned boxes.
    pub boxes: Vec<BoxPart>,
    /// Turned boxes.
    pub turned_boxes: Vec<TurnedBoxPart>,
    /// Cylinders.
    pub cylinders: Vec<CylinderPart>,
    /// Cones.
    pub cones: Vec<ConePart>,
    /// The most that the coordinates of origins of rays are which were rounded to f32.
    pub rounded_origins: DVec3,
}

impl Parts {
    /// Takes a scene apart, relative to `origin`; of `needed`, by primitive, only what is true.
    pub fn new(scene: &Scene, origin: DVec3, needed: Option<&[bool]>) -> Self {
        let mut parts = Parts::default();
        let is_needed = |index: usize| needed.is_none_or(|needed| needed[index]);
        for (index, object) in scene.objects.iter().enumerate().filter(|(index, _)| is_needed(*index)) {
            parts.add(&object.primitive(), index as u32, origin);
        }
        for (first, cloud) in scene.clouds_from() {
            if let (CloudShapes::Spheres(rows), None) = (&cloud.shapes, needed) {
                let part = |row: usize| {
                    let [x, y, z, radius] = rows.row(row);
                    let owner = Owner { primitive: (first + row) as u32, material: cloud.material_of(row) as u32 };
                    SpherePart { center: DVec3::new(x, y, z) - origin, radius, owner }
                };
                parts.spheres.par_extend((0..cloud.len()).into_par_iter().map(part));
                continue;
            }
            for row in (0..cloud.len()).filter(|row| is_needed(first + row)) {
                parts.add(&cloud.primitive(row), (first + row) as u32, origin);
            }
        }
        parts
    }

    fn add(&mut self, primitive: &Primitive, index: u32, origin: DVec3) {
        let owner = Owner { primitive: index, material: primitive.material as u32 };
        match &*primitive.shape {
            Shape::Sphere(Sphere { center, radius }) => {
                self.spheres.push(SpherePart { center: *center - origin, radius: *radius, owner });
            }
            Shape::Plane(Plane { point, normal }) => {
                self.planes.push(PlanePart { point: *point - origin, normal: normal.normalize(), owner });
            }
            Shape::Disk(Disk { center, normal, radius, inner_radius }) => {
                let (center, normal) = (*center - origin, normal.normalize());
                self.disks.push(DiskPart { center, normal, radius: *radius, inner: *inner_radius, owner });
            }
            Shape::Polygon(polygon) => self.add_polygon(polygon, origin, owner),
            Shape::Box(cuboid) => self.add_box(cuboid, origin, owner),
            Shape::Cylinder(Cylinder { base, apex, radius, caps }) => {
                let mantle = Mantle::new(*base - origin, *apex - *base, [*radius; 2]);
                let Mantle { base, axis, height, .. } = mantle;
                self.cylinders.push(CylinderPart { base, axis, height, radius: *radius, owner });
                self.add_caps(&mantle, *caps, owner);
            }
            Shape::Cone(Cone { base, apex, radius, apex_radius, caps }) => {
                let mantle = Mantle::new(*base - origin, *apex - *base, [*radius, *apex_radius]);
                let Mantle { base, axis, height, .. } = mantle;
                let (apex, radius, apex_radius) = (*apex - origin, *radius, *apex_radius);
                self.cones.push(ConePart { base, apex, axis, height, radius, apex_radius, owner });
                self.add_caps(&mantle, *caps, owner);
            }
        }
    }

    fn add_polygon(&mut self, polygon: &Polygon, origin: DVec3, owner: Owner) {
        let corners: Vec<DVec3> = polygon.corners.iter().map(|corner| *corner - origin).collect();
        let normal = polygon.normal();
        let frame = (corners[0], (corners[1] - corners[0]).normalize());
        for piece in convex_pieces(&corners, normal) {
            match piece.len() {
                3 => self.triangles.push(polygon_part(&piece, normal, frame, owner)),
                4 => self.quads.push(polygon_part(&piece, normal, frame, owner)),
                _ => self.octagons.push(polygon_part(&piece, normal, frame, owner)),
            }
        }
    }

    fn add_box(&mut self, cuboid: &Cuboid, origin: DVec3, owner: Owner) {
        match cuboid.rotation {
            None => self.boxes.push(BoxPart { min: cuboid.min - origin, max: cuboid.max - origin, owner }),
            Some(rotation) => {
                let turn = DMat3::from_quat(rotation.normalize());
                let axes = [turn.x_axis, turn.y_axis, turn.z_axis];
                let half = (cuboid.max - cuboid.min) / 2.0;
                let center = (cuboid.min + half) - origin;
                self.turned_boxes.push(TurnedBoxPart { center, half, axes, owner });
            }
        }
    }

    fn add_caps(&mut self, mantle: &Mantle, caps: bool, owner: Owner) {
        let ends = [(mantle.base, -mantle.axis), (mantle.base + mantle.axis * mantle.height, mantle.axis)];
        for ((center, normal), radius) in ends.into_iter().zip(mantle.radii) {
            if caps && radius > 0.0 {
                self.disks.push(DiskPart { center, normal, radius, inner: 0.0, owner });
            }
        }
    }
}

/// What cylinders and cones have in common.
struct Mantle {
    base: DVec3,
    axis: DVec3,
    height: f64,
    radii: [f64; 2],
}

impl Mantle {
    fn new(base: DVec3, along: DVec3, radii: [f64; 2]) -> Self {
        let height = along.length();
        Mantle { base, axis: along / height, height, radii }
    }
}

fn polygon_part<const N: usize>(
    piece: &[DVec3],
    normal: DVec3,
    (uv_origin, uv_edge): (DVec3, DVec3),
    owner: Owner,
) -> PolygonPart<N> {
    let corners = std::array::from_fn(|k| piece[k.min(piece.len() - 1)]);
    PolygonPart { corners, normal, uv_origin, uv_edge, owner }
}
