//! Plants and clouds as files that other programs read. Equal input gives equal bytes.

mod glb;
mod obj;
mod ply;

pub use glb::mesh_to_glb;
pub use obj::mesh_to_obj;
pub use ply::{cloud_to_ply, mesh_to_ply};

use crate::model::OrganKind;

/// The word for an organ's kind in names of nodes and groups, and in JSON (spec/plant.schema.json).
#[must_use]
pub const fn kind_name(kind: OrganKind) -> &'static str {
    match kind {
        OrganKind::MainStem => "main_stem",
        OrganKind::Stem => "stem",
        OrganKind::Leaf => "leaf",
    }
}
