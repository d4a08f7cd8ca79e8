//! The species that ship.

mod generic;

use std::io::Read;

use flate2::read::GzDecoder;

use crate::model::Species;
use crate::model::species::SpeciesError;

pub use generic::generic;

/// Names of the species that ship.
pub const NAMES: [&str; 8] = ["soybean", "maize", "sorghum", "tobacco", "tomato", "bean", "cowpea", "pepper"];

/// A shipped species by name, `None` when there is none of that name. docs/species.md says what each was learned from,
/// `make species` learns them.
///
/// # Errors
/// [`SpeciesError`] when a file is refused, which the tests rule out.
pub fn shipped(name: &str) -> Option<Result<Species, SpeciesError>> {
    let packed: &[u8] = match name {
        "soybean" => include_bytes!("../../species/soybean.safetensors.gz"),
        "maize" => include_bytes!("../../species/maize.safetensors.gz"),
        "sorghum" => include_bytes!("../../species/sorghum.safetensors.gz"),
        "tobacco" => include_bytes!("../../species/tobacco.safetensors.gz"),
        "tomato" => include_bytes!("../../species/tomato.safetensors.gz"),
        "bean" => include_bytes!("../../species/bean.safetensors.gz"),
        "cowpea" => include_bytes!("../../species/cowpea.safetensors.gz"),
        "pepper" => include_bytes!("../../species/pepper.safetensors.gz"),
        _ => return None,
    };
    Some(unpacked(packed))
}

fn unpacked(packed: &[u8]) -> Result<Species, SpeciesError> {
    let mut bytes = Vec::new();
    GzDecoder::new(packed).read_to_end(&mut bytes)?;
    Species::from_bytes(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::leaf::{ROWS, node};

    #[test]
    fn every_shipped_species_reads_back_equal_and_keeps_base_and_tip() {
        for name in NAMES {
            let species = shipped(name).expect("listed").expect("valid");
            let again = Species::from_bytes(&species.to_bytes().expect("serialises")).expect("reads");
            assert_eq!(species, again);
            for beta in [vec![], vec![3.0; 6], vec![-2.5, 1.0, 2.0]] {
                let flat = species.leaf.flat(&beta, 1.0);
                assert!(flat[node(0, 5)].length() < 1e-6, "{name}: base {}", flat[node(0, 5)]);
                assert!((flat[node(ROWS - 1, 5)] - glam::DVec2::Y).length() < 1e-6);
            }
        }
        assert!(shipped("triffid").is_none());
    }
}
