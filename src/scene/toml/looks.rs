//! `[textures.NAME]` and `[materials.NAME]`.

use std::convert::Infallible;

use glam::DVec3;

use super::Reader;
use super::keyed::is_keyed;
use super::table::{Item, Named, Table};
use super::values::{NamedFile, choice, color, file, list, number, pair};
use crate::scene::picture_file::{self, Picture};
use crate::scene::rules::{Broken, Rule};
use crate::scene::{
    Checker, ColorSpace, ImageTexture, Material, Model, Paint, Part, Texture, TextureFilter, TextureKind, Visible, Wrap,
};

#[derive(Clone, Copy)]
enum Pattern {
    Checker,
    Image,
}

#[derive(Clone, Copy)]
enum Look {
    Diffuse,
    Mirror,
    Dielectric,
    Phong,
}

const PATTERNS: &[(&str, Pattern)] = &[("checker", Pattern::Checker), ("image", Pattern::Image)];
const LOOKS: &[(&str, Look)] =
    &[("diffuse", Look::Diffuse), ("mirror", Look::Mirror), ("dielectric", Look::Dielectric), ("phong", Look::Phong)];
const WRAPS: &[(&str, Wrap)] = &[("repeat", Wrap::Repeat), ("clamp", Wrap::Clamp)];
const FILTERS: &[(&str, TextureFilter)] = &[("bilinear", TextureFilter::Bilinear), ("nearest", TextureFilter::Nearest)];
const COLOR_SPACES: &[(&str, ColorSpace)] = &[("srgb", ColorSpace::Srgb), ("linear", ColorSpace::Linear)];

impl<'a> Reader<'a, '_> {
    /// Reads textures and materials; all names are known before any is looked up.
    pub fn read_looks(&mut self) {
        let textures = self.named("textures", "texture");
        let materials = self.named("materials", "material");
        for texture in &textures {
            self.textures.give(texture.name, texture.table.context, &texture.span);
        }
        for material in &materials {
            self.materials.give(material.name, material.table.context, &material.span);
        }
        for texture in textures {
            let name = texture.name.to_owned();
            let kind = self.texture(texture.table);
            let part = Part::Texture(self.scene.textures.len());
            self.scene.textures.extend(kind.map(|kind| Texture { name, kind }));
            self.claim(Some(part));
        }
        for material in materials {
            let name = material.name.to_owned();
            let material = self.material(material.table, name);
            let part = Part::Material(self.scene.materials.len());
            self.scene.materials.extend(material);
            self.claim(Some(part));
        }
    }

    fn named(&self, key: &'static str, what: &'static str) -> Vec<Named<'a>> {
        self.roots.iter().flat_map(|root| root.named(key, what)).collect()
    }

    fn texture(&mut self, mut table: Table<'a>) -> Option<TextureKind> {
        let kind = match table.kind(PATTERNS, &[])? {
            Pattern::Checker => {
                let colors = table.need("colors", two_colors);
                let scale = table.or("scale", [1.0, 1.0], pair(Rule::POSITIVE));
                (|| Some(TextureKind::Checker(Checker { colors: colors?, scale: scale? })))()
            }
            Pattern::Image => {
                let named = table.need("file", |item| Some((file(item)?, item.clone())));
                let wrap = table.or("wrap", Wrap::default(), choice(WRAPS));
                let filter = table.or("filter", TextureFilter::default(), choice(FILTERS));
                let color_space = table.maybe("color_space", choice(COLOR_SPACES));
                (|| {
                    let (named, item) = named?;
                    let picture = item.fine(&named, picture_file::look(&named.path, color_space?))?;
                    self.pictures.push((self.scene.textures.len(), item, named.clone()));
                    Some(TextureKind::Image(ImageTexture {
                        file: named.path,
                        wrap: wrap?,
                        filter: filter?,
                        color_space: picture.color_space,
                        width: picture.width,
                        height: picture.height,
                        texels: picture.texels,
                    }))
                })()
            }
        };
        table.finish();
        kind
    }

    /// Decodes the pictures that some primitive shows; all of them where something is wrong anyway.
    pub fn read_pictures(&mut self) {
        let is_sound = self.roots.first().is_none_or(|root| root.context.log.count() == 0);
        let used = if is_sound { self.scene.used_textures() } else { vec![true; self.scene.textures.len()] };
        for (index, item, named) in std::mem::take(&mut self.pictures) {
            let Some(TextureKind::Image(image)) = self.scene.textures.get(index).map(|texture| &texture.kind) else {
                continue;
            };
            let space = Some(image.color_space);
            let picture = if used[index] { self.picture(&item, &named, space) } else { None };
            if let (Some(picture), TextureKind::Image(image)) = (picture, &mut self.scene.textures[index].kind) {
                image.texels = picture.texels;
            }
        }
    }

    /// The picture of a file, read once: textures of the same file share their texels.
    pub fn picture(&mut self, item: &Item<'a>, named: &NamedFile, space: Option<ColorSpace>) -> Option<Picture> {
        let read = || -> Result<_, Infallible> {
            let picture = item.fine(named, picture_file::read(&named.path, space));
            if let Some(negative) = picture.as_ref().map(|picture| picture.negative).filter(|negative| *negative > 0) {
                item.context.warn(&item.span, format!("{} has {negative} negative values, taken for 0", named.shown));
            }
            Ok(picture)
        };
        let Ok(picture) = self.store.pictures.get((named.path.clone(), space), read);
        picture.clone()
    }

    fn material(&mut self, mut table: Table<'a>, name: String) -> Option<Material> {
        let look = table.kind(LOOKS, &[])?;
        let model = match look {
            Look::Diffuse => {
                let albedo = table.or("albedo", Paint::Color(DVec3::splat(0.8)), |item| self.paint(item));
                albedo.map(|albedo| Model::Diffuse { albedo })
            }
            Look::Mirror => {
                let reflectance = table.or("reflectance", Paint::Color(DVec3::ONE), |item| self.paint(item));
                reflectance.map(|reflectance| Model::Mirror { reflectance })
            }
            Look::Dielectric => {
                let ior = table.or("ior", 1.5, number(Rule::POSITIVE));
                let tint = table.or("tint", Paint::Color(DVec3::ONE), |item| self.paint(item));
                ior.zip(tint).map(|(ior, tint)| Model::Dielectric { ior, tint })
            }
            Look::Phong => self.phong(&table),
        };
        let back = table.maybe("back", |item| self.materials.find(item));
        let visible = table.or("one_sided", Visible::Both, one_sided);
        table.finish();
        Some(Material { name, model: model?, back: back?, visible: visible? })
    }

    fn phong(&self, table: &Table<'a>) -> Option<Model> {
        let color = table.need("color", |item| self.paint(item));
        let kd = table.need("kd", number(Rule::COLOR));
        let ks = table.need("ks", number(Rule::COLOR));
        let shine = table.need("shine", number(Rule::COLOR));
        let transmittance = table.or("transmittance", 0.0, number(Rule::COLOR));
        let ior = table.or("ior", 1.0, number(Rule::COLOR));
        Some(Model::Phong { color: color?, kd: kd?, ks: ks?, shine: shine?, transmittance: transmittance?, ior: ior? })
    }

    /// A colour, or `{ texture = "NAME" }`.
    fn paint(&self, item: &Item<'a>) -> Option<Paint> {
        if item.value.is_array() || is_keyed(item) {
            return color(item).map(Paint::Color);
        }
        if !item.value.is_table() {
            return item.wrong("must be three numbers in brackets or { texture = \"NAME\" }");
        }
        let table = item.table()?;
        let texture = table.need("texture", |item| self.textures.find(item));
        table.finish();
        texture.map(Paint::Texture)
    }
}

impl Item<'_> {
    /// A picture of a file that it names, if nothing is wrong with that.
    fn fine(&self, named: &NamedFile, picture: Result<Picture, Broken>) -> Option<Picture> {
        picture
            .map_err(|broken| {
                self.context.fail(&self.span, format!("{} {}", named.shown, broken.rule), broken.found);
            })
            .ok()
    }
}

fn one_sided(item: &Item<'_>) -> Option<Visible> {
    match (item.value.as_bool(), item.value.as_str()) {
        (Some(false), _) => Some(Visible::Both),
        (Some(true), _) => Some(Visible::Front),
        (_, Some("back")) => Some(Visible::Back),
        _ => item.wrong("must be true, false or \"back\""),
    }
}

fn two_colors(item: &Item<'_>) -> Option<[DVec3; 2]> {
    if item.elements().is_none_or(|elements| elements.len() != 2) {
        return item.wrong("must be a list of two colours");
    }
    list(item, "two colours", color)?.try_into().ok()
}
