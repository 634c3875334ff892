//! A frame ready to be traced: the plan, its tree and its camera rays.

use std::time::Instant;

use glam::DVec3;

use super::adaptive::Noise;
use super::block::{Block, Rooms, View};
use super::coverage::Coverage;
use super::{Engine, Renderer, Stats};
use crate::accel::Tree;
use crate::film::Window;
use crate::integrate::{CameraRays, Direct, Lamps, RayCounts, Record};
use crate::lanes::LANES;
use crate::plan::{Kind, Plan, Skip};
use crate::reference::Reference;
use crate::scene::{Aov, Integrator, RenderSettings};
use crate::shapes::{Ray64, RowRef};

/// One frame with its tree built: for those who want to look on while parts of it are traced.
pub struct Frame<'s> {
    pub(super) plan: Plan<'s>,
    pub(super) tree: Tree,
    pub(super) lamps: Lamps<'s>,
    pub(super) coverage: Option<Coverage>,
    pub(super) rooms: Rooms,
    /// Tells margins, where those are asked for.
    pub(super) judge: Option<Reference>,
    pub(super) rays: CameraRays,
    pub(super) noise: Option<Noise>,
    pub(super) spp: u32,
    pub(super) settings: RenderSettings,
    /// What depth is counted along; `None`: along each ray.
    pub(super) axis: Option<DVec3>,
    pub(super) plan_seconds: f64,
    pub(super) build_seconds: f64,
}

impl<'s> Frame<'s> {
    /// Plans and builds.
    pub fn prepare(renderer: &Renderer<'s>) -> Self {
        let start = Instant::now();
        let plan = renderer.plan();
        let plan_seconds = start.elapsed().as_secs_f64();
        let single = renderer.engine == Engine::Single;
        let tree = Tree::planned(&plan).certify(renderer.certify).one_by_one(single);
        let lamps = Lamps::new(&plan, renderer.settings.integrator);
        let image = &renderer.image;
        let (display, camera) = ((image.width, image.height), renderer.camera);
        let coverage = match plan.skips.leaves_out(Skip::Background) {
            true => Coverage::new(&tree, camera, plan.origin, display, renderer.reach()),
            false => None,
        };
        let asks =
            renderer.layers.has(Aov::Margin) || (renderer.layers.is_empty() && !renderer.skips.has(Skip::Layers));
        let judge = asks.then(|| Reference::relative_to(renderer.scene, plan.origin));
        let build_seconds = start.elapsed().as_secs_f64() - plan_seconds;
        let seed = renderer.settings.seed;
        let noise = renderer.noise_level();
        // A single sample would sit at the centre.
        let spp = if noise.is_some() { image.spp.max(2) } else { image.spp };
        let rays = CameraRays::new(camera, plan.origin, display, image.filter, spp, seed);
        let (settings, axis) = (renderer.settings.clone(), camera.view_axis());
        Frame {
            plan,
            tree,
            lamps,
            coverage,
            rooms: Rooms::default(),
            judge,
            rays,
            noise,
            spp: image.spp,
            settings,
            axis,
            plan_seconds,
            build_seconds,
        }
    }

    /// What the coordinates of its rays are relative to.
    pub fn origin(&self) -> DVec3 {
        self.plan.origin
    }

    /// Where a ray, given in f64 relative to the origin, meets a primitive near `t`: found again in f64 as for a [`Hit`].
    ///
    /// [`Hit`]: crate::Hit
    pub fn found_again(&self, primitive: u32, (origin, dir): (DVec3, DVec3), t: f64) -> Option<f64> {
        let stores = self.tree.stores();
        let ray = Ray64 { origin, dir, t_min: 0.0, t_max: f64::INFINITY };
        let found = |kind: Kind, row: usize| {
            let found = stores.refine(RowRef::new(kind, row), &ray, t)?;
            (stores.owner(kind, row).primitive == primitive).then_some(found.t)
        };
        let rows = |kind: Kind| (0..stores.blocks(kind) * LANES).filter_map(move |row| found(kind, row));
        let off = |place: &f64| (place - t).abs();
        Kind::ALL.into_iter().flat_map(rows).min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// Whether rays go on from some material in use.
    pub fn scatters(&self) -> bool {
        self.plan.scatters || self.settings.integrator == Integrator::Path
    }

    /// Its blocks: windows that are traced as one, of some hundred pixels.
    pub fn blocks(&self, window: Window) -> Vec<Window> {
        Block::cover(window).into_iter().map(|block| block.window).collect()
    }

    /// Traces one block on this thread, as a render does, while a record looks on: its pixels row by row.
    pub fn trace_block<R: Record>(&self, block: Window, record: &mut R) -> (Vec<[f32; 4]>, RayCounts) {
        let work = Block::new(block).trace(&self.view(), &self.direct(), 0..self.spp, record, || false);
        work.map_or_else(Default::default, |work| (work.pixels, work.rays))
    }

    pub(super) fn view(&self) -> View<'_> {
        View { rays: &self.rays, coverage: self.coverage.as_ref(), rooms: &self.rooms }
    }

    pub(super) fn direct(&self) -> Direct<'_> {
        Direct::new(&self.plan, &self.tree, &self.lamps, self.settings.clone())
    }

    pub(super) fn stats(&self) -> Stats {
        Stats {
            plan_seconds: self.plan_seconds,
            build_seconds: self.build_seconds,
            column_bytes: self.tree.stores().column_bytes(),
            tree_bytes: self.tree.bytes(),
            ..Stats::default()
        }
    }
}
