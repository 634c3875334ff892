//! How rays go on from a surface: mirrors and glass, one ray at a time, in f64, because every bounce off
//! something curved multiplies what an earlier one has rounded.

use glam::DVec3;

/// What a material does to rays beyond its own light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Onward {
    /// They end.
    Nothing,
    /// They are mirrored, times the colour.
    Mirror,
    /// Fresnel's share is mirrored, the rest refracted, times the colour.
    Glass {
        /// Refractive index, inside over outside.
        ior: f64,
    },
    /// Fixed shares are mirrored and refracted.
    Phong {
        /// Mirrored share.
        ks: f64,
        /// Refracted share.
        transmittance: f64,
        /// Refractive index.
        ior: f64,
    },
}

/// A hit as rays go on from it.
#[derive(Debug, Clone, Copy)]
pub struct Facing {
    /// Unit, of the ray that came.
    pub dir: DVec3,
    /// Shading normal, unit, on the viewer's side of the surface.
    pub n_s: DVec3,
    /// Geometric normal, unit, on the viewer's side.
    pub n_g: DVec3,
    /// Whether the front was met.
    pub front: bool,
}

/// A direction, unit, and the share of its radiance that counts.
pub type Way = Option<(DVec3, DVec3)>;

impl Onward {
    /// The mirrored and the refracted way.
    pub fn ways(self, color: DVec3, facing: &Facing) -> (Way, Way) {
        match self {
            Onward::Nothing => (None, None),
            Onward::Mirror => (Some((facing.mirrored(), color)), None),
            Onward::Glass { ior } => match facing.refracted(ior) {
                None => (Some((facing.mirrored(), DVec3::ONE)), None),
                Some((way, fresnel)) => {
                    (Some((facing.mirrored(), DVec3::splat(fresnel))), Some((way, color * (1.0 - fresnel))))
                }
            },
            Onward::Phong { ks, transmittance, ior } if transmittance > 0.0 => match facing.refracted(ior) {
                None => (Some((facing.mirrored(), DVec3::splat(ks + transmittance))), None),
                Some((way, _)) => {
                    (Some((facing.mirrored(), DVec3::splat(ks))), Some((way, DVec3::splat(transmittance))))
                }
            },
            Onward::Phong { ks, .. } if ks > 0.0 => (Some((facing.mirrored(), DVec3::splat(ks))), None),
            Onward::Phong { .. } => (None, None),
        }
    }
}

impl Facing {
    /// The mirror direction, bent back where an interpolated normal sends it below the surface.
    fn mirrored(&self) -> DVec3 {
        let mirrored = self.dir - 2.0 * self.dir.dot(self.n_s) * self.n_s;
        let height = mirrored.dot(self.n_g);
        if height > 0.0 || self.n_s == self.n_g {
            return mirrored;
        }
        (mirrored + (1e-3 - height) * self.n_g).normalize()
    }

    /// The refracted direction and Fresnel's unpolarised reflectance; `None` where reflection is total.
    ///
    /// Source: Born and Wolf, Principles of Optics, 7th edition, 1999, section 1.5.
    fn refracted(&self, ior: f64) -> Option<(DVec3, f64)> {
        let ratio = if self.front { 1.0 / ior } else { ior };
        let n = if self.dir.dot(self.n_s) <= 0.0 { self.n_s } else { -self.n_s };
        let cos_i = -self.dir.dot(n);
        let along = ratio * (self.dir + cos_i * n);
        let sin2_t = along.length_squared();
        if sin2_t >= 1.0 {
            return None;
        }
        let cos_t = (1.0 - sin2_t).sqrt();
        let parallel = (cos_i - ratio * cos_t) / (cos_i + ratio * cos_t);
        let perpendicular = (ratio * cos_i - cos_t) / (ratio * cos_i + cos_t);
        let fresnel = (parallel * parallel + perpendicular * perpendicular) / 2.0;
        Some((along - cos_t * n, fresnel))
    }
}
