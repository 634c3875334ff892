//! Cylinders: frusta that do not narrow.

use glam::DVec3;

use super::cone::Cone;
use crate::scene;

/// The frustum of two equal radii: its radius does not depend on the place, and all else is a cone's.
pub fn cylinder(cylinder: &scene::Cylinder, origin: DVec3) -> Cone {
    let scene::Cylinder { base, apex, radius, caps } = *cylinder;
    Cone::new(&scene::Cone { base, apex, radius, apex_radius: radius, caps }, origin)
}
