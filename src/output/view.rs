//! The camera as the matrices that an EXR header holds.
//!
//! Source: "Standard Attributes", OpenEXR documentation: row vectors, so that translations stand in the last
//! row; `worldToCamera` is left-handed with x right, y up, z into the scene; `worldToNDC` takes the display
//! window to (0, 0) upper left .. (1, 1) lower right, and its z is for the reader to discard.

use crate::scene::{Camera, Lens};

/// What a header says of a camera.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct View {
    /// Sixteen numbers, row by row.
    pub world_to_camera: [f32; 16],
    /// Sixteen numbers, row by row; none for a panorama, which no matrix makes.
    pub world_to_ndc: Option<[f32; 16]>,
    /// Width of the picture at distance 1 from the eye; 1 for other than central projections, where it means nothing.
    pub screen_window_width: f32,
}

/// Nearer than this there is no z in 0..1. Infinity has z = 1, and the matrix can be inverted.
const NEAR: f64 = 0.01;

impl View {
    /// Both matrices of a camera that fills a display window of this size.
    pub fn new(camera: &Camera, display: (u32, u32)) -> Self {
        let (right, up, forward) = camera.axes();
        let axis = |i: usize| [right[i], up[i], forward[i], 0.0];
        let eye = camera.eye;
        let moved = [-eye.dot(right), -eye.dot(up), -eye.dot(forward), 1.0];
        let world_to_camera = [axis(0), axis(1), axis(2), moved];
        // A picture of no height is refused when it is written.
        let aspect = f64::from(display.0) / f64::from(display.1.max(1));
        let projection = project(camera.lens, aspect.max(f64::MIN_POSITIVE));
        View {
            world_to_camera: single(world_to_camera),
            world_to_ndc: projection.map(|(camera_to_ndc, _)| single(times(world_to_camera, camera_to_ndc))),
            screen_window_width: projection.map_or(1.0, |(_, width)| width as f32),
        }
    }
}

type Matrix = [[f64; 4]; 4];

/// Camera space to NDC, and the width of the screen window. The scene's definition of a lens, solved for the
/// picture: x/W = 1/2 + sx H/(2W), y/H = 1/2 - sy/2.
fn project(lens: Lens, aspect: f64) -> Option<(Matrix, f64)> {
    Some(match lens {
        Lens::Pinhole { vfov } | Lens::ThinLens { vfov, .. } => {
            let tan = (vfov.to_radians() / 2.0).tan();
            let (x, y) = (0.5 / (aspect * tan), -0.5 / tan);
            let last = [0.0, 0.0, -NEAR, 0.0];
            ([[x, 0.0, 0.0, 0.0], [0.0, y, 0.0, 0.0], [0.5, 0.5, 1.0, 1.0], last], 2.0 * tan * aspect)
        }
        Lens::Orthographic { height } => {
            let (x, y) = (1.0 / (aspect * height), -1.0 / height);
            let last = [0.5, 0.5, 0.0, 1.0];
            ([[x, 0.0, 0.0, 0.0], [0.0, y, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], last], 1.0)
        }
        Lens::Panoramic => return None,
    })
}

fn times(a: Matrix, b: Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| (0..4).map(|k| a[row][k] * b[k][column]).sum()))
}

fn single(m: Matrix) -> [f32; 16] {
    std::array::from_fn(|i| m[i / 4][i % 4] as f32 + 0.0) // which makes -0 a plain 0
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// A row vector times a matrix, divided by its last coordinate.
    fn apply(p: DVec3, m: &[f32; 16]) -> DVec3 {
        let p = [p.x, p.y, p.z, 1.0];
        let q: [f64; 4] = std::array::from_fn(|j| (0..4).map(|i| p[i] * f64::from(m[4 * i + j])).sum());
        DVec3::new(q[0], q[1], q[2]) / q[3]
    }

    fn camera(lens: Lens) -> Camera {
        let (eye, target) = (DVec3::new(3.0, -2.0, 5.0), DVec3::new(-1.0, 0.5, 0.25));
        Camera { name: None, eye, target, up: DVec3::new(0.1, 1.0, -0.2), lens }
    }

    /// The ray of a pixel by the words of [`Lens`], followed for some distance, lands on that pixel again.
    #[test]
    fn a_point_seen_at_a_pixel_projects_to_it() {
        let (w, h) = (640.0, 360.0);
        let thin = Lens::ThinLens { vfov: 37.0, aperture: 0.1, focus: 2.0 };
        for lens in [Lens::Pinhole { vfov: 37.0 }, thin, Lens::Orthographic { height: 4.5 }] {
            let camera = camera(lens);
            let view = View::new(&camera, (640, 360));
            let (right, up, forward) = camera.axes();
            for (x, y, t) in [(0.0, 0.0, 1.0), (640.0, 360.0, 3.0), (17.5, 201.25, 9.0), (320.0, 180.0, 2.0)] {
                let (sx, sy): (f64, f64) = ((2.0 * x - w) / h, (h - 2.0 * y) / h);
                let (origin, dir) = match lens {
                    Lens::Panoramic => unreachable!("not among them"),
                    Lens::Pinhole { vfov } | Lens::ThinLens { vfov, .. } => {
                        (camera.eye, forward + (vfov.to_radians() / 2.0).tan() * (sx * right + sy * up))
                    }
                    Lens::Orthographic { height } => (camera.eye + height / 2.0 * (sx * right + sy * up), forward),
                };
                let point = origin + t * dir;
                let ndc = apply(point, &view.world_to_ndc.unwrap());
                // Sums of a few terms near 10 in f32.
                assert!((ndc.x - x / w).abs() < 1e-5 && (ndc.y - y / h).abs() < 1e-5, "{lens:?} {x} {y}: {ndc}");
                let seen = apply(point, &view.world_to_camera);
                let want = DVec3::new((point - camera.eye).dot(right), (point - camera.eye).dot(up), t);
                assert!((seen - want).length() < 1e-5, "{lens:?}: {seen} {want}");
            }
        }
    }

    /// x right, y up, z into the scene: the determinant of the rotation is -1, the eye is the origin, and what is
    /// above the axis has a smaller y in the picture.
    #[test]
    fn camera_space_is_left_handed() {
        let camera = camera(Lens::Pinhole { vfov: 60.0 });
        let view = View::new(&camera, (200, 100));
        let m = view.world_to_camera.map(f64::from);
        let row = |i: usize| DVec3::new(m[4 * i], m[4 * i + 1], m[4 * i + 2]);
        assert!((row(0).dot(row(1).cross(row(2))) + 1.0).abs() < 1e-6);
        assert!(apply(camera.eye, &view.world_to_camera).length() < 1e-5);
        let (right, up, forward) = camera.axes();
        let above = apply(camera.eye + 2.0 * forward + 0.3 * up + 0.1 * right, &view.world_to_ndc.unwrap());
        assert!(above.x > 0.5 && above.y < 0.5 && above.z > 0.0 && above.z < 1.0, "{above}");
        assert!((f64::from(view.screen_window_width) - 4.0 * (30f64).to_radians().tan()).abs() < 1e-6);
    }
}
