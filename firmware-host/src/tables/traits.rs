use demeter_recon::traits::{Unit, keys};

/// A trait as a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraitColumn {
    /// Its key, which names the column.
    pub key: &'static str,
    /// Its unit.
    pub unit: Unit,
    /// Ids with spaces between: Crop Ontology of soybean (CO_336) and maize (CO_322), Plant Trait Ontology (TO). Those
    /// of a crop hold for that crop alone. Empty where no ontology has the trait.
    pub ontology: &'static str,
    /// Plants have it.
    pub plant: bool,
    /// Organs have it.
    pub organ: bool,
}

const fn column(key: &'static str, unit: Unit, (plant, organ): (bool, bool), ontology: &'static str) -> TraitColumn {
    TraitColumn { key, unit, ontology, plant, organ }
}

const PLANT: (bool, bool) = (true, false);
const ORGAN: (bool, bool) = (false, true);
const BOTH: (bool, bool) = (true, true);

/// Every trait of docs/traits.md with the ids of spec/standards.md.
pub const TRAITS: [TraitColumn; 20] = [
    column(keys::HEIGHT, Unit::Metre, PLANT, "CO_336:0000258 CO_322:0000996 TO:0000207"),
    column(keys::LEAF_COUNT, Unit::One, PLANT, "CO_336:0000315 TO:0000241"),
    column(keys::BLADE_COUNT, Unit::One, PLANT, ""),
    column(keys::BLADE_COUNT_VISIBLE, Unit::One, PLANT, ""),
    column(keys::LEAF_AREA, Unit::SquareMetre, BOTH, "TO:0000827 TO:0001114"),
    column(keys::LEAF_LENGTH, Unit::Metre, BOTH, "CO_322:0000780 TO:0000135"),
    column(keys::LEAF_WIDTH, Unit::Metre, BOTH, "CO_322:0000782 TO:0000370"),
    column(keys::LEAF_INCLINATION, Unit::Radian, BOTH, ""),
    column(keys::LEAF_AZIMUTH, Unit::Radian, ORGAN, ""),
    column(keys::LEAF_INSERTION_ANGLE, Unit::Radian, ORGAN, "TO:0000206"),
    column(keys::LEAF_CURVATURE, Unit::PerMetre, ORGAN, ""),
    column(keys::PETIOLE_LENGTH, Unit::Metre, ORGAN, "TO:0000766"),
    column(keys::PETIOLE_ANGLE, Unit::Radian, ORGAN, ""),
    column(keys::INTERNODE_LENGTH, Unit::Metre, BOTH, "TO:0000145"),
    column(keys::STEM_DIAMETER, Unit::Metre, BOTH, "CO_336:0000316 TO:0020083"),
    column(keys::STEM_LENGTH, Unit::Metre, BOTH, ""),
    column(keys::STEM_LEAN, Unit::Radian, BOTH, ""),
    column(keys::BRANCH_ORDER, Unit::One, ORGAN, ""),
    column(keys::PROJECTED_AREA, Unit::SquareMetre, PLANT, ""),
    column(keys::HULL_VOLUME, Unit::CubicMetre, PLANT, ""),
];
