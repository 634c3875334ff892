//! What surfaces, lights and the background make of light, eight lanes at a time. The meaning of each
//! is said beside its data in [`scene`](crate::scene).

pub mod attributes;
mod background;
mod lamp;
mod light;
mod material;
mod onward;
mod texture;

pub use self::background::Backdrop8;
pub use self::lamp::{AreaLight, Drawn, SkyLight, scattered};
pub use self::light::{Illumination, LightTable, Toward};
pub use self::material::{Bsdf8, MaterialTable};
pub use self::onward::{Facing, Onward, Way};
