//! A hash of all that a scene is, by value: whatever its files say, wherever they lie.
//!
//! It is the SHA-256 of every part of a [`Scene`] in turn. Small parts are hashed as their debug form, which tells f64
//! apart to the last bit; arrays that come from files (rows of clouds, texels) as their bytes. What changes no
//! pixel of colour has no part in it: names of texture files, layers, warnings, values at other frames.

use std::fmt::{Debug, Write};

use sha2::{Digest, Sha256};

use super::{
    Backdrop, Background, Cloud, CloudMaterial, CloudShapes, ImageTexture, Object, Rows, Scene, Texture, TextureKind,
};

/// Bytes that are gathered before they are hashed.
const PART: usize = 1 << 16;

impl Scene {
    /// The hash of the scene at its frame and of `settings`, in 64 hexadecimal digits. `settings` are any words that say
    /// what else decides about the pixels.
    pub fn hash(&self, settings: &str) -> String {
        self.sum().hash(settings)
    }

    /// All of the hash but for the settings.
    pub fn sum(&self) -> SceneSum {
        let mut sum = Sum(Sha256::new(), Vec::new());
        sum.scene(self);
        SceneSum(sum)
    }
}

/// A scene that was hashed, for the hashes of pictures with different settings.
#[derive(Debug)]
pub struct SceneSum(Sum);

impl SceneSum {
    /// [`Scene::hash`].
    pub fn hash(&self, settings: &str) -> String {
        let mut sum = self.0.clone();
        sum.small(&settings);
        sum.finish()
    }
}

#[derive(Debug, Clone)]
struct Sum(Sha256, Vec<u8>);

/// Text goes in as its bytes.
impl Write for Sum {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.bytes(text.as_bytes());
        Ok(())
    }
}

impl Sum {
    fn scene(&mut self, scene: &Scene) {
        let Scene { image, render, cameras, background, ambient, textures, materials, lights, .. } = scene;
        let Background { backdrop, transparent, light } = background;
        let Scene { objects, clouds, groups, .. } = scene;
        self.small(&("octray scene 1", image, render, cameras, transparent, ambient, materials, lights, groups));
        self.backdrop(backdrop);
        if !light {
            self.small(&"no light");
        }
        textures.iter().for_each(|texture| self.texture(texture));
        self.small(&objects.len());
        objects.iter().for_each(|object| self.object(object));
        clouds.iter().for_each(|cloud| self.cloud(cloud));
    }

    fn object(&mut self, Object { shape, material, name, group }: &Object) {
        self.small(&(shape, material, name, group));
    }

    fn backdrop(&mut self, backdrop: &Backdrop) {
        match backdrop {
            Backdrop::Color(_) | Backdrop::Gradient { .. } => self.small(backdrop),
            Backdrop::Image { image, scale, rotation } => {
                self.small(&("image", scale, rotation));
                self.picture(image);
            }
        }
    }

    fn texture(&mut self, Texture { name, kind }: &Texture) {
        self.small(name);
        match kind {
            TextureKind::Checker(checker) => self.small(checker),
            TextureKind::Image(image) => self.picture(image),
        }
    }

    fn picture(&mut self, image: &ImageTexture) {
        let ImageTexture { file: _, wrap, filter, color_space, width, height, texels } = image;
        self.small(&(wrap, filter, color_space, width, height));
        self.numbers(texels.as_flattened());
    }

    fn cloud(&mut self, Cloud { shapes, material, colors, name, group }: &Cloud) {
        self.small(&(name, group, shapes.len(), colors.is_some()));
        match material {
            CloudMaterial::One(material) => self.small(material),
            CloudMaterial::Each(materials) => self.numbers(materials),
        }
        if let Some(colors) = colors {
            self.numbers(colors.as_flattened());
        }
        match shapes {
            CloudShapes::Spheres(rows) => self.rows("spheres", rows),
            CloudShapes::Disks(rows) => self.rows("disks", rows),
            CloudShapes::Boxes(rows, rotation) => {
                self.small(rotation);
                self.rows("boxes", rows);
            }
            CloudShapes::Cylinders(rows, caps) => {
                self.small(caps);
                self.rows("cylinders", rows);
            }
            CloudShapes::Polygons { corners, starts } => {
                self.rows("polygons", corners);
                self.numbers(starts);
            }
        }
    }

    fn rows<const N: usize>(&mut self, kind: &str, rows: &Rows<N>) {
        self.small(&kind);
        match rows {
            Rows::F32(rows) => self.numbers(rows.as_flattened()),
            Rows::F64(rows) => self.numbers(rows.as_flattened()),
        }
    }

    /// A value by its debug form, and a mark behind it.
    fn small(&mut self, value: &impl Debug) {
        // Writing here cannot fail.
        let _ = writeln!(self, "{value:?}");
    }

    /// Numbers by their bytes, the lowest first.
    fn numbers<T: bytemuck::NoUninit>(&mut self, numbers: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(numbers);
        if cfg!(target_endian = "little") {
            self.bytes(bytes);
        } else {
            bytes.chunks(size_of::<T>()).for_each(|number| number.iter().rev().for_each(|byte| self.bytes(&[*byte])));
        }
    }

    #[inline]
    fn bytes(&mut self, bytes: &[u8]) {
        if self.1.len() + bytes.len() >= PART {
            self.0.update(&self.1);
            self.1.clear();
        }
        match bytes.len() < PART {
            true => self.1.extend_from_slice(bytes),
            false => self.0.update(bytes),
        }
    }

    fn finish(mut self) -> String {
        self.0.update(&self.1);
        self.0.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;

    const SCENE: &str = r#"format = 1
[image]
width = 4
height = 4
[camera]
type = "pinhole"
eye = [0, 0, 8]
target = [0, 0, 0]
vfov = 45
[materials.clay]
type = "diffuse"
[[clouds]]
type = "spheres"
file = "a.csv"
material = "clay"
"#;

    fn room(scene: &str, rows: &str) -> tempfile::TempDir {
        let room = tempfile::tempdir().unwrap();
        fs::write(room.path().join("scene.toml"), scene).unwrap();
        fs::write(room.path().join("a.csv"), format!("x,y,z,r\n{rows}\n")).unwrap();
        room
    }

    fn hash(room: &Path) -> String {
        Scene::load(room.join("scene.toml")).unwrap().hash("spp 4")
    }

    #[test]
    fn what_files_say_counts_and_where_they_lie_does_not() {
        let (first, same) = (room(SCENE, "0,0,0,1"), room(&format!("# a remark\n{SCENE}"), "0,0,0,1.0"));
        assert_eq!(hash(first.path()), hash(same.path()));
        assert_eq!(hash(first.path()).len(), 64);
        let all = [
            (SCENE, "0,0,0,1.0000000000000002"),
            (SCENE, "0,0,0,1\n0,0,0,1"),
            (&SCENE.replace("vfov = 45", "vfov = 45.000000000000007"), "0,0,0,1"),
            (&SCENE.replace("\"diffuse\"", "\"mirror\""), "0,0,0,1"),
        ];
        let mut seen = vec![hash(first.path())];
        for (scene, rows) in all {
            let found = hash(room(scene, rows).path());
            assert!(!seen.contains(&found), "{scene} {rows}");
            seen.push(found);
        }
        let scene = Scene::load(first.path().join("scene.toml")).unwrap();
        assert_ne!(scene.hash("spp 4"), scene.hash("spp 5"));
    }

    #[test]
    fn order_counts() {
        let (one, two) = (room(SCENE, "0,0,0,1\n1,0,0,2"), room(SCENE, "1,0,0,2\n0,0,0,1"));
        assert_ne!(hash(one.path()), hash(two.path()));
    }
}
