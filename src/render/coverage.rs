//! Which parts of the picture can see anything but the background: the boxes of the tree and of what is in its leaves, on
//! the screen.

use glam::DVec3;

use crate::accel::Tree;
use crate::scene::{Camera, Lens};

/// Pixels along an edge of a cell.
const CELL: i32 = 4;
/// Boxes to look at before the rest is taken as it is.
const MOST_BOXES: usize = 1 << 16;
/// Boxes of at most so many cells along an edge are not looked into.
const SMALL: usize = 2;

/// Cells of the picture, and which of them may see a primitive.
#[derive(Debug)]
pub struct Coverage {
    width: usize,
    cells: Vec<bool>,
}

impl Coverage {
    /// For camera rays through points at most `reach` pixels from the centre of their pixel. `None` where anything
    /// may be seen anywhere: something has no bounds, or the rays are not those of a pinhole or of a parallel
    /// projection.
    pub fn new(tree: &Tree, camera: &Camera, origin: DVec3, display: (u32, u32), reach: f64) -> Option<Self> {
        let screen = Screen::new(camera, origin, display, reach)?;
        let size = [display.0, display.1].map(|pixels| (pixels as usize).div_ceil(CELL as usize));
        let mut coverage = Coverage { width: size[0], cells: vec![false; size[0] * size[1]] };
        let mut looked = 0;
        let is_bounded = tree.outline(|min, max, is_last| {
            looked += 1;
            let Some(cells) = screen.cells(min.as_dvec3(), max.as_dvec3(), size) else { return false };
            let [x0, y0, x1, y1] = cells;
            let is_small = x1 - x0 <= SMALL && y1 - y0 <= SMALL;
            if is_last || is_small || looked > MOST_BOXES {
                coverage.rows(cells).for_each(|row| row.fill(true));
                return false;
            }
            !coverage.rows(cells).all(|row| row.iter().all(|covered| *covered))
        });
        is_bounded.then_some(coverage)
    }

    /// Whether rays of a pixel may meet anything; those beyond the picture may.
    #[inline(always)]
    pub fn sees(&self, x: i32, y: i32) -> bool {
        let (column, row) = (x.div_euclid(CELL) as usize, y.div_euclid(CELL) as usize);
        column >= self.width
            || self.cells.get(row.wrapping_mul(self.width).wrapping_add(column)).is_none_or(|cell| *cell)
    }

    /// Whether rays of each of the 4 x 2 pixels from one on may meet anything.
    #[inline(always)]
    pub fn sees_packet(&self, x: i32, y: i32) -> bool {
        [(0, 0), (3, 0), (0, 1), (3, 1)].into_iter().all(|(right, down)| self.sees(x + right, y + down))
    }

    fn rows(&mut self, [x0, y0, x1, y1]: [usize; 4]) -> impl Iterator<Item = &mut [bool]> {
        self.cells.chunks_mut(self.width).take(y1).skip(y0).map(move |row| &mut row[x0..x1])
    }
}

/// From points to pixels.
struct Screen {
    eye: DVec3,
    /// Right, down and forward, so long that their products with a point are pixels, at depth 1 for a pinhole.
    axes: [DVec3; 3],
    center: [f64; 2],
    parallel: bool,
    /// Pixels that a box is larger by: how far rays are from the centres of their pixels, and roundings.
    margin: f64,
}

impl Screen {
    fn new(camera: &Camera, origin: DVec3, (width, height): (u32, u32), reach: f64) -> Option<Self> {
        let (right, up, forward) = camera.axes();
        let half = f64::from(height) / 2.0;
        let (pixels, parallel) = match camera.lens {
            Lens::Pinhole { vfov } => (half / (vfov.to_radians() / 2.0).tan(), false),
            Lens::Orthographic { height } => (half / (height / 2.0), true),
            Lens::ThinLens { .. } | Lens::Panoramic => return None,
        };
        let center = [f64::from(width) / 2.0, half];
        // Beyond that what is beside the eye can hardly be told from what is behind it.
        if !parallel && center[0].max(center[1]) > 1e4 * pixels {
            return None;
        }
        let eye = camera.eye - origin;
        // Directions and origins are rounded to f32, relative to their own size.
        let rounding = f64::from(f32::EPSILON);
        let off = match parallel {
            false => (pixels.powi(2) + center[0].powi(2) + center[1].powi(2)).sqrt() * rounding,
            true => (eye.length() * pixels + center[0] + center[1]) * rounding,
        };
        let margin = reach + 0.01 + 4.0 * off;
        Some(Screen { eye, axes: [right * pixels, up * -pixels, forward], center, parallel, margin })
    }

    /// The cells that a box may be seen in, the last ones excluded; `None` where it cannot be seen.
    fn cells(&self, min: DVec3, max: DVec3, size: [usize; 2]) -> Option<[usize; 4]> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut behind = 0;
        for corner in 0..8 {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { min[axis] } else { max[axis] };
            let point = DVec3::new(pick(0), pick(1), pick(2)) - self.eye;
            let depth = if self.parallel { 1.0 } else { point.dot(self.axes[2]) };
            // Nearer than this a box is as good as at the eye: it may be anywhere.
            if depth <= 1e-6 * point.length() {
                behind += 1;
            }
            for k in 0..2 {
                let at = self.center[k] + point.dot(self.axes[k]) / depth;
                (low[k], high[k]) = (low[k].min(at), high[k].max(at));
            }
        }
        match behind {
            0 => {}
            8 => return None,
            _ => return Some([0, 0, size[0], size[1]]),
        }
        let cell = |at: f64, least: f64| ((at / f64::from(CELL)).floor() + least).max(0.0) as usize;
        let from = [0, 1].map(|k| cell(low[k] - self.margin, 0.0).min(size[k]));
        let to = [0, 1].map(|k| cell(high[k] + self.margin, 1.0).min(size[k]));
        (from[0] < to[0] && from[1] < to[1]).then_some([from[0], from[1], to[0], to[1]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Plan;
    use crate::scene::{Object, Scene, Shape, Sphere};

    fn coverage(lens: Lens, spheres: &[([f64; 3], f64)]) -> Option<Coverage> {
        let mut scene = Scene::default();
        let model = crate::scene::Model::Diffuse { albedo: crate::scene::Paint::Color(DVec3::ONE) };
        let visible = crate::scene::Visible::Both;
        scene.materials.push(crate::scene::Material { name: "m".into(), model, back: None, visible });
        scene.objects = spheres
            .iter()
            .map(|(center, radius)| {
                let shape = Shape::Sphere(Sphere { center: (*center).into(), radius: *radius });
                Object { shape, material: 0, name: None, group: None }
            })
            .collect();
        let eye = DVec3::new(0.0, 0.0, 10.0);
        let camera = Camera { name: None, eye, target: DVec3::ZERO, up: DVec3::Y, lens };
        let plan = Plan::new(&scene, eye);
        let tree = Tree::new(plan.parts(), &plan.visible);
        Coverage::new(&tree, &camera, eye, (100, 80), 1.5)
    }

    #[test]
    fn a_ball_covers_its_pixels_and_few_others() {
        // Radius 1 in the middle, seen 10 away with 80 pixels for 90 degrees: 4 pixels around (50, 40).
        for (lens, radius) in [(Lens::Pinhole { vfov: 90.0 }, 4.1), (Lens::Orthographic { height: 20.0 }, 4.0)] {
            let coverage = coverage(lens, &[([0.0; 3], 1.0)]).expect("bounded");
            for y in 0..80 {
                for x in 0..100 {
                    let off = ((f64::from(x) - 49.5).powi(2) + (f64::from(y) - 39.5).powi(2)).sqrt();
                    let sees = coverage.sees(x, y);
                    assert!(if off < radius + 1.5 { sees } else { !sees || off < 17.0 }, "{x} {y} {off} {sees}");
                }
            }
        }
    }

    /// Both stand in one leaf.
    #[test]
    fn between_balls_there_is_nothing() {
        let lens = Lens::Pinhole { vfov: 90.0 };
        let coverage = coverage(lens, &[([-8.0, 0.0, 0.0], 1.0), ([8.0, 0.0, 0.0], 1.0)]).expect("bounded");
        assert!([18, 82].iter().all(|x| coverage.sees(*x, 40)));
        assert!((35..65).all(|x| !coverage.sees(x, 40)));
    }

    #[test]
    fn what_is_behind_covers_nothing_and_what_is_around_covers_all() {
        let lens = Lens::Pinhole { vfov: 40.0 };
        let behind = coverage(lens, &[([0.0, 0.0, 15.0], 1.0)]).expect("bounded");
        assert!(behind.cells.iter().all(|covered| !covered));
        let around = coverage(lens, &[([0.0, 0.0, 10.5], 1.0)]).expect("bounded");
        assert!(around.cells.iter().all(|covered| *covered));
    }
}
