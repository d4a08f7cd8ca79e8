//! From an organ tree to a plant of the Demeter model: stems first, each hung exactly on its parent, then blades
//! (spec/reconstruction.md "Fitting").
//!
//! The result is always inside the model: one connected tree, every base on its parent's curve, |β|, |γ| <= 3 σ.

mod centreline;
mod leaf;
mod orient;
mod solver;
mod stem;

use demeter_frame::Pose;
use glam::{DQuat, DVec3};

use crate::model::kinematics::{Similarity, attachment};
use crate::model::stem::{BONES, StemCurve};
use crate::model::{Form, Habit, Joint, Organ, OrganKind, Plant, PlantError, Species};
use crate::organs::OrganTree;
pub(crate) use stem::median as median_of;
use stem::{StemFit, mean, nearest_on};

/// Share of an organ's points, nearest to its parent, that say where it is attached.
const FOOT_SHARE: f64 = 0.03;
/// A blade of a species with petioles that starts farther than this share of its own extent from its parent gets a
/// petiole of its own (a guess: nearer, the gap is the stem's thickness and a scan's raggedness).
const BRIDGE_SHARE: f64 = 0.08;
/// A leaflet that starts within this share of its own extent from the end of a petiole that was put in for another
/// hangs on that petiole too (a guess: petiolules of soybean and tomato are shorter than half their leaflet).
const PETIOLULE_SHARE: f64 = 0.5;
/// Most leaflets that one leaf is taken to have when they hang on one petiole (soybean 3, tomato up to 9).
const MAX_LEAFLETS: usize = 9;

/// How well one organ fits.
#[derive(Clone, Debug, PartialEq)]
pub struct OrganFit {
    /// Index of the organ in the tree it was fitted to, `None` for a petiole that was put in to bridge a gap.
    pub source: Option<usize>,
    /// Points it was fitted to.
    pub points: usize,
    /// Mean distance of its points to its surface, metres; `None` without points.
    pub residual: Option<f64>,
    /// Share of its surface that has data beside it; `None` for stems.
    pub visible_fraction: Option<f64>,
    /// The solver stopped because the cost no longer fell.
    pub converged: bool,
}

/// A fitted plant.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// The plant, valid by construction.
    pub plant: Plant,
    /// One entry an organ of the plant.
    pub organs: Vec<OrganFit>,
}

/// Why an organ tree gives no plant.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum FitError {
    /// Too few points to say anything.
    #[error("organ {organ}: expected at least {expected} points, found {found}")]
    Points {
        /// Index in the tree.
        organ: usize,
        /// The least number.
        expected: usize,
        /// Its points.
        found: usize,
    },
    /// A cloud with no extent or with numbers that are not finite.
    #[error("organ {organ}: expected finite points that span more than {expected_metres} m, found {found_metres} m")]
    Extent {
        /// Index in the tree.
        organ: usize,
        /// Least extent.
        expected_metres: f64,
        /// Its extent.
        found_metres: f64,
    },
    /// The tree is none.
    #[error("organ tree: {0}")]
    Plant(#[from] PlantError),
}

/// Fewest points of an organ.
pub(crate) const MIN_POINTS: usize = 3;
/// Least extent of an organ, metres.
pub(crate) const MIN_EXTENT: f64 = 1e-4;

/// A parent on which organs can be hung.
struct Hanger {
    similarity: Similarity,
    curve: StemCurve,
    radius: f64,
}

impl Hanger {
    fn of(similarity: Similarity, gamma: &[f64], radius: f64, species: &Species) -> Self {
        Self { similarity, curve: species.stem.curve(gamma), radius }
    }

    /// The fraction d of the place on the stem nearest to a point of the world.
    fn nearest(&self, p: DVec3) -> f64 {
        let world: Vec<DVec3> = self.curve.points.iter().map(|x| self.similarity.point(*x)).collect();
        let (mut best, mut d) = (f64::INFINITY, 0.0);
        for (i, pair) in world.windows(2).enumerate() {
            let (t, at) = nearest_on(p, pair[0], pair[1]);
            if at.distance_squared(p) < best {
                best = at.distance_squared(p);
                d = (i as f64 + t) / BONES as f64;
            }
        }
        d
    }

    fn at(&self, d: f64) -> (DVec3, DQuat) {
        let (p, frame) = attachment(&self.curve, d);
        (self.similarity.point(p), self.similarity.rotation * frame)
    }
}

/// The growing plant.
struct Builder<'a> {
    species: &'a Species,
    up: DVec3,
    organs: Vec<Organ>,
    fits: Vec<OrganFit>,
    hangers: Vec<Option<Hanger>>,
    /// Petioles that were put in: their organ and their far end.
    petioles: Vec<(usize, DVec3)>,
}

/// Fits a plant. `up` is the unit vertical of the points' frame.
///
/// # Errors
/// [`FitError`] naming the organ that cannot be fitted, or when the tree is none.
pub fn plant(tree: &OrganTree, species: &Species, up: DVec3) -> Result<Fitted, FitError> {
    check(tree)?;
    let main = &tree.organs[0].points;
    let base = lowest(main, up);
    let world_from_plant = Pose::new(DQuat::from_rotation_arc(DVec3::Z, up), base);
    let mut builder =
        Builder { species, up, organs: Vec::new(), fits: Vec::new(), hangers: Vec::new(), petioles: Vec::new() };
    let fitted = stem::fit(main, base, species);
    let ground = Similarity { rotation: world_from_plant.rotation, translation: base, scale: 1.0 };
    builder.add_stem(None, 0.0, ground, &fitted, Some(0), main.len());
    // Index of each tree organ's plant organ: bridges shift the numbering.
    let mut placed = vec![0];
    for (i, organ) in tree.organs.iter().enumerate().skip(1) {
        let parent = placed[tree.parent[i].unwrap_or(0)];
        placed.push(builder.hang(parent, i, organ.kind, &organ.points)?);
    }
    group_leaflets(&mut builder.organs, species.habit);
    let plant = Plant { world_from_plant, organs: builder.organs };
    plant.validate()?;
    Ok(Fitted { plant, organs: builder.fits })
}

impl Builder<'_> {
    fn hang(&mut self, parent: usize, source: usize, kind: OrganKind, points: &[DVec3]) -> Result<usize, FitError> {
        let Some(hanger) = &self.hangers[parent] else {
            return Err(PlantError::LeafParent { organ: source, parent }.into());
        };
        let foot = foot(points, hanger);
        let d = hanger.nearest(foot);
        let (base, frame) = hanger.at(d);
        let joint = Similarity { rotation: frame, translation: base, scale: hanger.similarity.scale };
        if kind != OrganKind::Leaf {
            let fitted = stem::fit(points, base, self.species);
            return Ok(self.add_stem(Some(parent), d, joint, &fitted, Some(source), points.len()));
        }
        let apart = |base: DVec3, radius: f64| foot.distance(base) - radius > BRIDGE_SHARE * extent(points);
        if self.species.habit == Habit::Grass || !apart(base, hanger.radius) {
            return Ok(self.add_leaf(parent, d, source, points));
        }
        let Some(petiole) = self.shared_petiole(foot, extent(points)) else {
            let petiole = self.bridge(parent, d, joint, foot, hanger.radius);
            self.petioles.push((petiole, foot));
            return Ok(self.add_leaf(petiole, 1.0, source, points));
        };
        let Some(hanger) = &self.hangers[petiole] else {
            return Err(PlantError::LeafParent { organ: source, parent: petiole }.into());
        };
        let (base, frame) = hanger.at(1.0);
        if !apart(base, hanger.radius) {
            return Ok(self.add_leaf(petiole, 1.0, source, points));
        }
        let joint = Similarity { rotation: frame, translation: base, scale: hanger.similarity.scale };
        let petiolule = self.bridge(petiole, 1.0, joint, foot, hanger.radius);
        Ok(self.add_leaf(petiolule, 1.0, source, points))
    }

    /// Puts a straight stem, half as thick as its parent, from a joint to the foot of what hangs there.
    fn bridge(&mut self, parent: usize, d: f64, joint: Similarity, foot: DVec3, radius: f64) -> usize {
        let mut bridge = stem::fit_path(&[joint.translation, foot], &[], self.species);
        bridge.radius = self.species.ranges.stem_radius.clamp(radius / 2.0);
        self.add_stem(Some(parent), d, joint, &bridge, None, 0)
    }

    /// The petiole put in for another leaflet of the same leaf, the one that ends nearest to `foot`.
    fn shared_petiole(&self, foot: DVec3, extent: f64) -> Option<usize> {
        let near = self.petioles.iter().map(|(petiole, end)| (end.distance(foot), *petiole));
        let near = near.filter(|(away, _)| self.species.habit == Habit::Compound && *away < PETIOLULE_SHARE * extent);
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, petiole)| petiole)
    }

    fn add_stem(
        &mut self,
        parent: Option<usize>,
        d: f64,
        joint: Similarity,
        fit: &StemFit,
        source: Option<usize>,
        points: usize,
    ) -> usize {
        let world = Similarity { rotation: fit.rotation, translation: joint.translation, scale: fit.length };
        self.hangers.push(Some(Hanger::of(world, &fit.gamma, fit.radius, self.species)));
        self.organs.push(Organ {
            parent,
            joint: Joint { d, rotation: relative(joint.rotation, fit.rotation), scale: fit.length / joint.scale },
            form: Form::Stem { gamma: fit.gamma.clone(), radius: fit.radius / fit.length },
        });
        let residual = source.map(|_| fit.residual);
        self.fits.push(OrganFit { source, points, residual, visible_fraction: None, converged: fit.converged });
        self.organs.len() - 1
    }

    fn add_leaf(&mut self, parent: usize, d: f64, source: usize, points: &[DVec3]) -> usize {
        let (base, frame, scale) = match &self.hangers[parent] {
            Some(hanger) => {
                let (base, frame) = hanger.at(d);
                (base, frame, hanger.similarity.scale)
            }
            None => unreachable!("only stems are given as parents"),
        };
        let fit = leaf::fit(points, base, self.up, self.species);
        self.hangers.push(None);
        self.organs.push(Organ {
            parent: Some(parent),
            joint: Joint { d, rotation: relative(frame, fit.rotation), scale: fit.length / scale },
            form: Form::Leaf { blade: fit.blade, leaf: 0 },
        });
        self.fits.push(OrganFit {
            source: Some(source),
            points: points.len(),
            residual: Some(fit.residual),
            visible_fraction: Some(fit.visible),
            converged: fit.converged,
        });
        self.organs.len() - 1
    }
}

fn check(tree: &OrganTree) -> Result<(), FitError> {
    if tree.organs.is_empty() {
        return Err(PlantError::Empty.into());
    }
    for (organ, cloud) in tree.organs.iter().enumerate() {
        if cloud.points.len() < MIN_POINTS {
            return Err(FitError::Points { organ, expected: MIN_POINTS, found: cloud.points.len() });
        }
        let found_metres = extent(&cloud.points);
        if !(found_metres.is_finite() && found_metres > MIN_EXTENT) {
            return Err(FitError::Extent { organ, expected_metres: MIN_EXTENT, found_metres });
        }
    }
    Ok(())
}

/// Diagonal of the axis-aligned bounding box; NaN when a point is not finite.
fn extent(points: &[DVec3]) -> f64 {
    if !points.iter().all(|p| p.is_finite()) {
        return f64::NAN;
    }
    crate::cloud::diagonal(points).unwrap_or(0.0)
}

fn relative(parent: DQuat, child: DQuat) -> DQuat {
    let q = (parent.inverse() * child).normalize();
    if q.w < 0.0 { -q } else { q }
}

/// Mean of the lowest points.
fn lowest(points: &[DVec3], up: DVec3) -> DVec3 {
    mean_of_first(points, |p| p.dot(up))
}

/// Where an organ starts: the mean of its points nearest to the parent's curve.
fn foot(points: &[DVec3], parent: &Hanger) -> DVec3 {
    let world: Vec<DVec3> = parent.curve.points.iter().map(|x| parent.similarity.point(*x)).collect();
    mean_of_first(points, |p| stem::distance_to_path(p, &world))
}

fn mean_of_first(points: &[DVec3], key: impl Fn(DVec3) -> f64) -> DVec3 {
    let mut order: Vec<(f64, DVec3)> = points.iter().map(|p| (key(*p), *p)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order.truncate(((points.len() as f64 * FOOT_SHARE) as usize).clamp(1, 30));
    DVec3::from_array([0, 1, 2].map(|axis| mean(order.iter().map(|(_, p)| p[axis]))))
}

/// Numbers the leaves: leaflets on one petiole make one leaf.
fn group_leaflets(organs: &mut [Organ], habit: Habit) {
    // The stem next to the main stem that carries each organ: its petiole, or its branch.
    let mut petiole: Vec<Option<usize>> = Vec::with_capacity(organs.len());
    for (i, organ) in organs.iter().enumerate() {
        petiole.push(match organ.parent {
            Some(parent) if parent > 0 => petiole[parent],
            Some(_) if organ.kind() == OrganKind::Stem => Some(i),
            _ => None,
        });
    }
    let blades = |of: usize| {
        let carried = petiole.iter().zip(&*organs);
        carried.filter(|(p, organ)| **p == Some(of) && organ.kind() == OrganKind::Leaf).count()
    };
    let shared: Vec<Option<usize>> =
        petiole.iter().map(|p| p.filter(|p| habit == Habit::Compound && blades(*p) <= MAX_LEAFLETS)).collect();
    let mut number_of = std::collections::BTreeMap::new();
    let mut next = 0;
    for (i, organ) in organs.iter_mut().enumerate() {
        if let Form::Leaf { leaf, .. } = &mut organ.form {
            *leaf = *number_of.entry(shared[i].map_or((1, i), |p| (0, p))).or_insert_with(|| {
                next += 1;
                next - 1
            });
        }
    }
}
