//! Eight of everything: floats, masks, vectors, columns, rays and hits.
//!
//! This room is the only one that names the SIMD crate. A lane is one of eight slots; what it stands
//! for (a ray, a primitive, a packet) is the business of whoever filled it.

mod column;
mod float;
mod mask;
mod packet;
mod ray;
mod vec3;

pub use column::Columns;
pub use float::{Float8, difference_of_products, first_least, float8, greatest, least};
pub use mask::{Mask8, bits};
pub use packet::{DVec3x8, ExactPacket, Hit8, RayPacket, dot8};
pub use ray::Ray;
pub use vec3::Vec3x8;

/// Slots of a packet.
pub const LANES: usize = 8;

/// Half the distance from 1 to the next f32: the relative error of one rounding.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON / 2.0;
