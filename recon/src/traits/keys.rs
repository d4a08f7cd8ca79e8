//! The traits: one definition each. All are computed from the plant's parameters and their surface, never from points.
//!
//! Directions are the world's: z up, azimuths counter-clockwise from +x seen from above. "Along" a stem or vein is
//! along its control points. Angles are in radians. docs/traits.md is the same as a table, with ontology ids.

/// Plant: vertical distance from the main stem's base to the highest point of the surface, m. By hand: a ruler held
/// upright beside the plant, nothing stretched.
pub const HEIGHT: &str = "height";

/// Plant: number of leaves, a compound leaf counted once, 1. By hand: count petioles with blades; cotyledons count if
/// they are blades of the plant.
pub const LEAF_COUNT: &str = "leaf_count";

/// Plant: number of blades, each leaflet of a compound leaf counted, 1. By hand: count blades.
pub const BLADE_COUNT: &str = "blade_count";

/// Plant: number of blades of whose surface at least half has data beside it, 1; known after a fit alone, for a record
/// does not hold what was seen. By hand: count the blades in sight.
pub const BLADE_COUNT_VISIBLE: &str = "blade_count_visible";

/// Blade: area of one side of the bent surface, m2. Plant: sum over its blades. By hand: a leaf area meter, blades
/// without petioles.
pub const LEAF_AREA: &str = "leaf_area";

/// Blade: length of the main vein from its base to its tip along the bends, m. Plant: mean over its blades. By hand: a
/// tape laid along the midrib; from the collar it reads less by the way from the stem's axis to its surface.
pub const LEAF_LENGTH: &str = "leaf_length";

/// Blade: longest row from edge to edge across the main vein, along the bends, m. Plant: mean over its blades. By
/// hand: a ruler across the flattened blade at its widest.
pub const LEAF_WIDTH: &str = "leaf_width";

/// Blade: angle in 0..=π/2 between the vertical and the area-weighted mean normal of the blade, whichever side is up:
/// 0 lies flat, π/2 stands upright, rad. Plant: area-weighted mean over its blades. By hand: a clinometer laid on the
/// blade.
pub const LEAF_INCLINATION: &str = "leaf_inclination";

/// Blade: azimuth in (-π, π] of the line from the blade's base to its tip; absent for a plumb blade, rad. By hand: a
/// compass over the midrib.
pub const LEAF_AZIMUTH: &str = "leaf_azimuth";

/// Blade: angle in 0..=π between the stem that carries it, upwards at the attachment, and the first quarter of the
/// main vein, rad. By hand: a protractor between stem and midrib.
pub const LEAF_INSERTION_ANGLE: &str = "leaf_insertion_angle";

/// Blade: sum of the angles between successive pieces of the main vein, over its length, 1/m. By hand: rarely taken; a
/// tape pressed to the midrib in profile.
pub const LEAF_CURVATURE: &str = "leaf_curvature";

/// Petiole (the first stem of a leaf, where it leaves a stem that carries more than that leaf): length from there to
/// its first blade or further stem, m; a rachis beyond is not counted. By hand: a ruler from the axil to the first
/// leaflet.
pub const PETIOLE_LENGTH: &str = "petiole_length";

/// Petiole: angle in 0..=π between the stem that carries it, upwards at the attachment, and the petiole's chord, rad.
/// By hand: a protractor in the axil.
pub const PETIOLE_ANGLE: &str = "petiole_angle";

/// What hangs on a stem that carries more than one leaf (blade, petiole or branch): length along that stem from the
/// node below, or from the stem's base, m. Things within 1/200 of the stem's length share a node (a guess). Plant:
/// mean over the main stem's nodes. By hand: a ruler from node to node.
pub const INTERNODE_LENGTH: &str = "internode_length";

/// Stem: its diameter, which the model keeps constant, m. Plant: the main stem's. By hand: callipers half way up.
pub const STEM_DIAMETER: &str = "stem_diameter";

/// Stem: its length along the bends, m. Plant: the main stem's. By hand: a tape along the stem to its tip.
pub const STEM_LENGTH: &str = "stem_length";

/// Main stem: angle in 0..=π between the vertical and its chord from base to tip, rad. By hand: a plumb line and a
/// protractor.
pub const STEM_LEAN: &str = "stem_lean";

/// Organ: number of joints between it and the main stem, which has 0, 1. By hand: count along the branches.
pub const BRANCH_ORDER: &str = "branch_order";

/// Plant: area of the shadow that the surface throws on level ground under a sun at the zenith, m2. By hand: a photo
/// from straight above with a scale beside the plant.
pub const PROJECTED_AREA: &str = "projected_area";

/// Plant: volume of the convex hull of the surface, m3. By hand: hardly; scanners report it.
pub const HULL_VOLUME: &str = "hull_volume";
