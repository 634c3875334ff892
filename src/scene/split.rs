//! Polygons, concave ones too, into triangles whose corners are theirs.

use earcut::Earcut;
use glam::DVec3;

/// Triangles in the polygon's own sense of rotation. `normal` is the polygon's, of unit length.
pub(crate) fn triangles(corners: &[DVec3], normal: DVec3) -> Vec<Vec<DVec3>> {
    let (x, y) = super::basis(normal);
    let origin = corners[0];
    let flat: Vec<[f64; 2]> = corners.iter().map(|c| [(*c - origin).dot(x), (*c - origin).dot(y)]).collect();
    let mut indices: Vec<u32> = Vec::new();
    Earcut::new().earcut_slice(&flat, &[], &mut indices);
    let triangle = |abc: &[u32]| {
        let mut t: Vec<DVec3> = abc.iter().map(|i| corners[*i as usize]).collect();
        let turn = (t[1] - t[0]).cross(t[2] - t[0]).dot(normal);
        if turn < 0.0 {
            t.swap(1, 2);
        }
        (turn != 0.0).then_some(t)
    };
    indices.chunks_exact(3).filter_map(triangle).collect()
}
