//! The shapes a scene may hold, as plain f64 data.

use glam::{DQuat, DVec2, DVec3};

/// The geometry of one primitive. Normals point outward; the front is the side they point to.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A sphere.
    Sphere(Sphere),
    /// An infinite plane.
    Plane(Plane),
    /// A flat disk or ring.
    Disk(Disk),
    /// A planar polygon, convex or concave.
    Polygon(Polygon),
    /// A box, axis-aligned or turned.
    Box(Cuboid),
    /// A cylinder, open or with caps.
    Cylinder(Cylinder),
    /// A cone or a frustum, open or with caps.
    Cone(Cone),
}

/// `|x - center| = radius`; u = azimuth/2pi = atan2(z, x)/2pi in 0..1, v = angle from +y / pi.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Scene units.
    pub center: DVec3,
    /// Scene units, > 0.
    pub radius: f64,
}

/// `normal . (x - point) = 0`; u, v in scene units from `point` along [`basis`] of the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A point of the plane, the origin of its uv.
    pub point: DVec3,
    /// Not zero; of any length.
    pub normal: DVec3,
}

/// The points of a plane between `inner_radius` and `radius` from `center` (both included);
/// u = azimuth/2pi in the [`basis`] of the normal, v = distance/radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disk {
    /// Scene units.
    pub center: DVec3,
    /// Not zero; of any length.
    pub normal: DVec3,
    /// Scene units, > 0.
    pub radius: f64,
    /// Scene units, 0 <= inner < radius; 0 is a full disk.
    pub inner_radius: f64,
}

/// A simple planar polygon; its front is the side from which the corners run counter-clockwise.
///
/// `uvs` and `normals` are interpolated by mean value coordinates (Hormann and Floater, "Mean value
/// coordinates for arbitrary planar polygons", ACM Transactions on Graphics 25(4), 2006), which are
/// the barycentric ones in a triangle and do not depend on how a polygon is split. Without `uvs`,
/// u runs in scene units along the first edge and v across it (normal x edge), from the first corner.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Polygon {
    /// 3 to 65,535 corners in scene units, none repeated, no three neighbours in line.
    pub corners: Vec<DVec3>,
    /// Texture coordinates, none or one a corner.
    pub uvs: Vec<DVec2>,
    /// Shading normals, none or one a corner.
    pub normals: Vec<DVec3>,
}

/// A box; per face uv 0 to 1 along the next two axes in cyclic order (an x face: u = y, v = z).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cuboid {
    /// Lower corner before the rotation, scene units.
    pub min: DVec3,
    /// Upper corner before the rotation, greater than `min` in each coordinate.
    pub max: DVec3,
    /// Turns the box about its centre; `None`: axis-aligned.
    pub rotation: Option<DQuat>,
}

/// u = azimuth/2pi about the axis (in the [`basis`] of apex - base), v = height/length; caps as disks
/// of normal +-axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cylinder {
    /// Centre of the lower rim, scene units.
    pub base: DVec3,
    /// Centre of the upper rim, differs from `base`.
    pub apex: DVec3,
    /// Scene units, > 0.
    pub radius: f64,
    /// Whether both ends are closed.
    pub caps: bool,
}

/// As [`Cylinder`], with a radius that falls or grows linearly from base to apex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Centre of the lower rim, scene units.
    pub base: DVec3,
    /// Centre of the upper rim or the tip, differs from `base`.
    pub apex: DVec3,
    /// Radius at the base, scene units, >= 0.
    pub radius: f64,
    /// Radius at the apex, scene units, >= 0, not the same as `radius`; 0 is a full cone.
    pub apex_radius: f64,
    /// Whether both ends are closed.
    pub caps: bool,
}

impl Shape {
    /// The word for this kind in scene files, messages and default names.
    pub fn kind(&self) -> &'static str {
        match self {
            Shape::Sphere(_) => "sphere",
            Shape::Plane(_) => "plane",
            Shape::Disk(_) => "disk",
            Shape::Polygon(_) => "polygon",
            Shape::Box(_) => "box",
            Shape::Cylinder(_) => "cylinder",
            Shape::Cone(_) => "cone",
        }
    }
}

impl Polygon {
    /// The unit normal of the polygon's plane: Newell's sum over the corners, taken relative to the
    /// first one. Zero for a polygon without area.
    ///
    /// Source: Sutherland, Sproull and Schumacker, "A characterization of ten hidden-surface
    /// algorithms", ACM Computing Surveys 6(1), 1974 (Newell's method).
    pub fn normal(&self) -> DVec3 {
        let origin = self.corners[0];
        let pairs = self.corners.iter().zip(self.corners.iter().cycle().skip(1));
        let sum: DVec3 = pairs.map(|(a, b)| (*a - origin).cross(*b - origin)).sum();
        sum.normalize_or_zero()
    }
}

/// The two axes of a plane or disk of unit normal `n`: with `n` a right-handed orthonormal basis.
///
/// Source: Duff et al., "Building an orthonormal basis, revisited", Journal of Computer Graphics
/// Techniques 6(1), 2017.
pub fn basis(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y))
}
