//! What a scene must keep so that tracing cannot fail: scenes made by hand have no reader to check them.

use crate::scene::{Cloud, CloudMaterial, CloudShapes, Model, Paint, Primitive, Scene, Shape, TextureKind, rules};

/// A rule that a scene breaks.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("not a valid scene: {0}")]
pub struct InvalidScene(String);

/// Checks indices, counts and the numbers of all shapes.
///
/// # Errors
/// The first rule that is broken, and where.
pub fn validate(scene: &Scene) -> Result<(), InvalidScene> {
    scene.materials.iter().enumerate().try_for_each(|(index, material)| {
        let known = |material: usize| material < scene.materials.len();
        require(material.back.is_none_or(known), || format!("the back of material {index} does not exist"))?;
        let paint: &Model = &material.model;
        let texture = |texture: usize| texture < scene.textures.len();
        let exists = !matches!(paint.paint(), Paint::Texture(index) if !texture(index));
        require(exists, || format!("the texture of material {index} does not exist"))
    })?;
    scene.clouds.iter().enumerate().try_for_each(|(index, cloud)| columns(index, cloud))?;
    let all_sound = scene.clouds.iter().all(|cloud| is_sound(scene, cloud));
    let doubtful = if all_sound { scene.objects.len() } else { usize::MAX };
    let mut primitives = scene.primitives().enumerate().take(doubtful);
    primitives.try_for_each(|(index, primitive)| shape(scene, index, &primitive))?;
    let used = scene.used_textures();
    scene.textures.iter().enumerate().try_for_each(|(index, texture)| match &texture.kind {
        TextureKind::Checker(_) => Ok(()),
        TextureKind::Image(image) => {
            let whole = image.width > 0 && image.width.checked_mul(image.height) == Some(image.texels.len());
            let is_open = image.texels.is_empty() && !used[index];
            require(is_open || whole && image.height > 0, || {
                format!("texture {index} has not as many texels as its size says")
            })
        }
    })
}

fn columns(index: usize, cloud: &Cloud) -> Result<(), InvalidScene> {
    let rows = cloud.len();
    let materials = match &cloud.material {
        CloudMaterial::One(_) => true,
        CloudMaterial::Each(materials) => materials.len() == rows,
    };
    let colors = cloud.colors.as_ref().is_none_or(|colors| colors.len() == rows);
    let starts = match &cloud.shapes {
        CloudShapes::Polygons { corners, starts } => {
            starts.is_sorted() && starts.last().is_none_or(|last| *last as usize <= corners.len())
        }
        CloudShapes::Spheres(_) | CloudShapes::Disks(_) | CloudShapes::Boxes(..) | CloudShapes::Cylinders(..) => true,
    };
    require(materials && colors && starts, || format!("the columns of cloud {index} do not fit each other"))
}

/// Whether a cloud is one whose primitives are known to break no rule without a look at each.
fn is_sound(scene: &Scene, cloud: &Cloud) -> bool {
    let is_known = matches!(cloud.material, CloudMaterial::One(material) if material < scene.materials.len());
    is_known && matches!(&cloud.shapes, CloudShapes::Spheres(rows) if rules::are_spheres(rows))
}

fn shape(scene: &Scene, index: usize, primitive: &Primitive) -> Result<(), InvalidScene> {
    require(primitive.material < scene.materials.len(), || {
        format!("the material of primitive {index} does not exist")
    })?;
    let broken = |rule: &dyn std::fmt::Display| InvalidScene(format!("primitive {index}: {rule}"));
    if let Shape::Polygon(polygon) = &*primitive.shape {
        // What readers check beyond this (planar, simple) makes no tracer fail.
        let corners = polygon.corners.len();
        let fits = |count: usize| count == 0 || count == corners;
        let finite =
            polygon.corners.iter().all(|corner| corner.is_finite() && corner.abs().max_element() <= rules::LARGEST);
        let sound = corners >= 3 && finite && fits(polygon.uvs.len()) && fits(polygon.normals.len());
        return require(sound && polygon.normal().is_normalized(), || {
            format!(
                "primitive {index}: polygon must have 3 corners or more, an area, and none or one uv and normal a corner"
            )
        });
    }
    rules::shape(&primitive.shape)
        .map_err(|rule| broken(&format!("{} {}, found {}", primitive.shape.kind(), rule.rule, rule.found)))
}

fn require(holds: bool, text: impl FnOnce() -> String) -> Result<(), InvalidScene> {
    if holds { Ok(()) } else { Err(InvalidScene(text())) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Object, Polygon, Sphere, Visible};

    fn scene(shape: Shape, material: usize) -> Scene {
        let model = Model::Diffuse { albedo: Paint::Color([0.5; 3].into()) };
        let clay = Material { name: "clay".into(), model, back: None, visible: Visible::Both };
        let objects = vec![Object { shape, material, name: None, group: None }];
        Scene { materials: vec![clay], objects, ..Scene::default() }
    }

    #[test]
    fn scenes_made_by_hand_are_checked() {
        let sphere = |radius| Shape::Sphere(Sphere { center: [0.0; 3].into(), radius });
        assert_eq!(validate(&scene(sphere(1.0), 0)), Ok(()));
        let broken = [
            scene(sphere(1.0), 1),
            scene(sphere(-1.0), 0),
            scene(sphere(f64::NAN), 0),
            scene(Shape::Polygon(Polygon::default()), 0),
            scene(Shape::Polygon(Polygon { corners: vec![[1.0; 3].into(); 4], ..Polygon::default() }), 0),
        ];
        assert!(broken.iter().all(|scene| validate(scene).is_err()));
    }
}
