//! A scene with its spheres cut into triangles, as renderers without spheres have them.

use glam::DVec3;

use crate::scene::{CloudShapes, Object, Polygon, Scene, Shape, Sphere};

/// Most triangles of a scene.
const MOST: usize = 2_000_000;

/// Triangles of a sphere for `side` cuts along each edge of an octahedron.
pub fn triangles(side: u32) -> usize {
    8 * (side * side) as usize
}

/// The scene with each sphere as so many triangles ([`triangles`]), with the sphere's normals at their corners; `None` where
/// there is no sphere, a texture that would have to be laid out, or too many triangles would come of it.
pub fn tessellated(scene: &Scene, side: u32) -> Option<Scene> {
    let is_sphere = |object: &&Object| matches!(object.shape, Shape::Sphere(_));
    let rows =
        scene.clouds.iter().filter(|cloud| matches!(cloud.shapes, CloudShapes::Spheres(_))).map(|cloud| cloud.len());
    let count = scene.objects.iter().filter(is_sphere).count() + rows.sum::<usize>();
    if count == 0 || count * triangles(side) > MOST || !scene.textures.is_empty() {
        return None;
    }
    let mut cut = Scene { objects: Vec::new(), clouds: Vec::new(), ..scene.clone() };
    for object in &scene.objects {
        match &object.shape {
            Shape::Sphere(sphere) => add(&mut cut, sphere, side, object.material),
            Shape::Plane(_)
            | Shape::Disk(_)
            | Shape::Polygon(_)
            | Shape::Box(_)
            | Shape::Cylinder(_)
            | Shape::Cone(_) => {
                cut.objects.push(object.clone());
            }
        }
    }
    for cloud in &scene.clouds {
        if !matches!(cloud.shapes, CloudShapes::Spheres(_)) {
            cut.clouds.push(cloud.clone());
            continue;
        }
        // Colours of rows belong to clouds, which triangles of their own do not have.
        if cloud.colors.is_some() {
            return None;
        }
        for primitive in (0..cloud.len()).map(|row| cloud.primitive(row)) {
            if let Shape::Sphere(sphere) = primitive.shape.as_ref() {
                add(&mut cut, sphere, side, primitive.material);
            }
        }
    }
    Some(cut)
}

fn add(scene: &mut Scene, sphere: &Sphere, side: u32, material: usize) {
    for normals in faces(side) {
        let corners = normals.iter().map(|normal| sphere.center + sphere.radius * *normal).collect();
        let shape = Shape::Polygon(Polygon { corners, uvs: Vec::new(), normals: normals.to_vec() });
        scene.objects.push(Object { shape, material, name: None, group: None });
    }
}

/// The unit sphere: the faces of an octahedron, each cut into `n^2` triangles whose corners are put on the sphere, seen
/// counter-clockwise from outside.
pub fn faces(n: u32) -> impl Iterator<Item = [DVec3; 3]> {
    (0..8u32).flat_map(move |octant| {
        let sign = |bit: u32| if octant >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let signs = DVec3::new(sign(0), sign(1), sign(2));
        let corner = move |i: u32, j: u32| (signs * DVec3::new(i.into(), j.into(), (n - i - j).into())).normalize();
        let turn = move |[a, b, c]: [DVec3; 3]| if signs.element_product() > 0.0 { [a, b, c] } else { [a, c, b] };
        (0..n).flat_map(move |i| {
            (0..n - i).flat_map(move |j| {
                let up = [corner(i, j), corner(i + 1, j), corner(i, j + 1)];
                let down = (i + j + 1 < n).then(|| [corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]);
                std::iter::once(up).chain(down).map(turn)
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_close_around_the_sphere_and_look_outward() {
        let all: Vec<_> = faces(11).collect();
        assert_eq!((all.len(), triangles(11)), (968, 968));
        let volume: f64 = all.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum();
        let ball = 4.0 / 3.0 * std::f64::consts::PI;
        assert!(volume < ball && volume > 0.98 * ball, "{volume}");
        assert!(all.iter().all(|[a, b, c]| (*b - *a).cross(*c - *a).dot(*a) > 0.0));
    }

    #[test]
    fn scenes_keep_what_is_no_sphere() {
        let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fig5.toml")).unwrap();
        let spheres = scene.objects.iter().filter(|object| matches!(object.shape, Shape::Sphere(_))).count();
        let cut = tessellated(&scene, 2).unwrap();
        assert_eq!(cut.objects.len(), scene.objects.len() - spheres + spheres * 32);
        assert!(crate::plan::validate(&cut).is_ok());
        assert!(tessellated(&Scene::default(), 2).is_none() && tessellated(&scene, 1000).is_none());
    }
}
