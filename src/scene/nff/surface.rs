//! From NFF's surfaces to materials: one material for each surface and each side that is seen.

use std::collections::HashMap;

use glam::DVec3;

use crate::scene::{Material, Model, Paint, Visible};

/// What an object asks of its surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Seen {
    /// From its front, or from both sides where the surface transmits.
    Usual,
    /// From both sides (`pp`).
    BothSides,
    /// From inside alone (a negative radius).
    Inside,
}

/// All surfaces of a file and the materials made of them.
///
/// Surface `i` (from 1, in file order, equal ones counted once) gives the material `fi`; the same
/// surface on an object that is seen otherwise than usual gives `fi_two_sided` or `fi_inside`.
/// A material is made when its first object appears, so unused surfaces give none.
#[derive(Debug, Default)]
pub(super) struct Surfaces {
    models: Vec<Model>,
    by_bits: HashMap<[u64; 8], usize>,
    current: Option<usize>,
    made: HashMap<(usize, &'static str), usize>,
    materials: Vec<Material>,
}

impl Surfaces {
    /// An `f` statement: red green blue, kd, ks, shine, transmittance, ior.
    pub fn set(&mut self, numbers: [f64; 8]) {
        let [r, g, b, kd, ks, shine, transmittance, ior] = numbers;
        let color = Paint::Color(DVec3::new(r, g, b));
        let surface = *self.by_bits.entry(numbers.map(f64::to_bits)).or_insert_with(|| {
            self.models.push(Model::Phong { color, kd, ks, shine, transmittance, ior });
            self.models.len() - 1
        });
        self.current = Some(surface);
    }

    /// Index of the material for the next object, or `None` before the first `f`.
    pub fn material(&mut self, seen: Seen) -> Option<usize> {
        let surface = self.current?;
        let model = self.models[surface];
        let (visible, suffix) = sides(seen, transmits(&model));
        let index = *self.made.entry((surface, suffix)).or_insert_with(|| {
            let name = format!("f{}{suffix}", surface + 1);
            self.materials.push(Material { name, model, back: None, visible });
            self.materials.len() - 1
        });
        Some(index)
    }

    pub fn into_materials(self) -> Vec<Material> {
        self.materials
    }
}

fn transmits(model: &Model) -> bool {
    matches!(model, Model::Phong { transmittance, .. } if *transmittance > 0.0)
}

fn sides(seen: Seen, transmits: bool) -> (Visible, &'static str) {
    match seen {
        Seen::Inside => (Visible::Back, "_inside"),
        Seen::Usual | Seen::BothSides if transmits => (Visible::Both, ""),
        Seen::Usual => (Visible::Front, ""),
        Seen::BothSides => (Visible::Both, "_two_sided"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLAY: [f64; 8] = [1.0, 0.5, 0.2, 0.8, 0.0, 3.0, 0.0, 0.0];
    const GLASS: [f64; 8] = [1.0, 1.0, 1.0, 0.1, 0.1, 100.0, 0.9, 1.5];

    #[test]
    fn a_surface_and_its_visible_side_make_one_material() {
        let mut surfaces = Surfaces::default();
        assert_eq!(surfaces.material(Seen::Usual), None);
        surfaces.set(GLASS);
        surfaces.set(CLAY);
        let clay = [Seen::Usual, Seen::BothSides, Seen::Inside, Seen::Usual].map(|seen| surfaces.material(seen));
        assert_eq!(clay, [Some(0), Some(1), Some(2), Some(0)]);
        surfaces.set(GLASS);
        let glass = [Seen::BothSides, Seen::Usual].map(|seen| surfaces.material(seen));
        assert_eq!(glass, [Some(3), Some(3)]);
        surfaces.set(CLAY);
        assert_eq!(surfaces.material(Seen::Usual), Some(0));
        let made: Vec<_> = surfaces.into_materials().into_iter().map(|made| (made.name, made.visible)).collect();
        let expected = [
            ("f2", Visible::Front),
            ("f2_two_sided", Visible::Both),
            ("f2_inside", Visible::Back),
            ("f1", Visible::Both),
        ];
        assert_eq!(made, expected.map(|(name, visible)| (name.to_owned(), visible)));
    }
}
