//! From rays to radiance, a tile at a time.

mod ao;
mod branches;
mod camera;
mod direct;
mod hits;
mod lamps;
mod lights;
mod path;
mod record;
mod shadows;
mod wave;

pub use self::camera::{CameraRays, PixelPattern, Samples8};
pub use self::direct::{Direct, Room, Samples};
pub use self::lamps::Lamps;
pub use self::record::{Lit, RayCounts, RayKind, Record, Seen, Silent, Spent, Summed, Taken};
pub use self::wave::{WAVE, Wave};
