//! The species that ship.

mod generic;

use crate::model::Species;
use crate::model::species::SpeciesError;

pub use generic::generic;

/// Names of the species that ship.
pub const NAMES: [&str; 8] = ["soybean", "maize", "sorghum", "tobacco", "tomato", "bean", "cowpea", "pepper"];

/// A shipped species by name, `None` when there is none of that name.
///
/// # Errors
/// [`SpeciesError`] when a basis is refused, which the tests rule out.
pub fn shipped(name: &str) -> Option<Result<Species, SpeciesError>> {
    generic(name)
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
