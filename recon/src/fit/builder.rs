//! The growing plant of stage 1: each organ fitted alone and hung on the stem it grows from.

use glam::DVec3;

use super::hanger::{Hanger, relative};
use super::hidden::{self, Outline};
use super::leaf::crowd::Crowd;
use super::leaf::smeared::{self, Cloud};
use super::leaf::{self, LeafFit};
use super::stem::StemFit;
use super::whole::Evidence;
use super::{FitError, OrganFit, stem, uncertainty};
use crate::cloud::diagonal;
use crate::model::kinematics::Similarity;
use crate::model::{Form, Habit, Joint, Organ, OrganKind, PlantError, Species};
use crate::traits::Sigmas;

/// A blade of a species with petioles that starts farther than this share of its own extent from its parent gets a
/// petiole of its own (a guess: nearer, the gap is the stem's thickness and a scan's raggedness).
const BRIDGE_SHARE: f64 = 0.08;

/// The growing plant.
pub(super) struct Builder<'a> {
    species: &'a Species,
    up: DVec3,
    pub organs: Vec<Organ>,
    pub fits: Vec<OrganFit>,
    /// What each organ was fitted to.
    pub evidence: Vec<Evidence<'a>>,
    /// The stem that each organ is, `None` for blades.
    hangers: Vec<Option<Hanger>>,
    /// Petioles that were put in: their organ and their far end.
    petioles: Vec<(usize, DVec3)>,
    blades: Vec<HungBlade>,
}

/// A blade of the plant.
struct HungBlade {
    /// Its organ.
    organ: usize,
    /// What it hangs on.
    joint: Similarity,
    fit: LeafFit,
}

/// The data of one organ.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    /// Index in the organ tree.
    pub organ: usize,
    pub kind: OrganKind,
    /// Metres; at least three with an extent.
    pub points: &'a [DVec3],
}

impl<'a> Builder<'a> {
    /// A plant of its main stem alone, which starts at `ground`.
    pub(super) fn new(main: Source<'a>, ground: Similarity, species: &'a Species, up: DVec3) -> Self {
        let mut builder = Self {
            species,
            up,
            organs: Vec::new(),
            fits: Vec::new(),
            evidence: Vec::new(),
            hangers: Vec::new(),
            petioles: Vec::new(),
            blades: Vec::new(),
        };
        let fit = stem::fit(main.points, ground.translation, species);
        builder.add_stem(None, 0.0, ground, &fit, Some(main));
        builder
    }

    /// Hangs an organ on a stem of the plant, over a petiole where one must have been; gives its index.
    pub(super) fn hang(&mut self, parent: usize, source: Source<'a>) -> Result<usize, FitError> {
        let hanger = self.hanger(parent, source)?;
        let d = hanger.root(source.points);
        let joint = hanger.joint(d);
        if source.kind != OrganKind::Leaf {
            let fit = stem::fit(source.points, joint.translation, self.species);
            return Ok(self.add_stem(Some(parent), d, joint, &fit, Some(source)));
        }
        let foot = hanger.foot(source.points);
        let size = diagonal(source.points).unwrap_or(0.0);
        let radius = hanger.radius;
        let apart = |joint: Similarity, radius: f64| foot.distance(joint.translation) - radius > BRIDGE_SHARE * size;
        let nearest = hanger.nearest(foot);
        let beside = hanger.joint(nearest);
        if self.species.habit == Habit::Grass || !apart(beside, radius) {
            return Ok(self.add_leaf(parent, d, joint, source));
        }
        let Some(petiole) = self.shared_petiole(foot, size) else {
            let petiole = self.bridge(parent, nearest, beside, foot, radius);
            self.petioles.push((petiole, foot));
            return self.add_leaf_at_end(petiole, source);
        };
        let hanger = self.hanger(petiole, source)?;
        let (end, radius) = (hanger.joint(1.0), hanger.radius);
        if !apart(end, radius) {
            return Ok(self.add_leaf(petiole, 1.0, end, source));
        }
        let petiolule = self.bridge(petiole, 1.0, end, foot, radius);
        self.add_leaf_at_end(petiolule, source)
    }

    fn hanger(&self, parent: usize, source: Source<'_>) -> Result<&Hanger, FitError> {
        let missing = PlantError::LeafParent { organ: source.organ, parent };
        Ok(self.hangers[parent].as_ref().ok_or(missing)?)
    }

    /// Puts a straight stem, half as thick as its parent, from a joint to the foot of what hangs there.
    fn bridge(&mut self, parent: usize, d: f64, joint: Similarity, foot: DVec3, radius: f64) -> usize {
        let mut bridge = stem::fit_path(&[joint.translation, foot], self.species);
        bridge.radius = self.species.ranges.stem_radius.clamp(radius / 2.0);
        self.add_stem(Some(parent), d, joint, &bridge, None)
    }

    /// The petiole put in for another leaflet of the same leaf, the one that ends nearest to `foot`, where a blade of
    /// this `size` starts.
    fn shared_petiole(&self, foot: DVec3, size: f64) -> Option<usize> {
        let near = self.petioles.iter().map(|(petiole, end)| (end.distance(foot), *petiole));
        let near = near.filter(|(away, _)| self.species.habit.is_petiolule(*away, size));
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, petiole)| petiole)
    }

    fn add_stem(
        &mut self,
        parent: Option<usize>,
        d: f64,
        joint: Similarity,
        fit: &StemFit,
        source: Option<Source<'a>>,
    ) -> usize {
        self.hangers.push(Some(Hanger::of(fit, joint.translation, self.species)));
        self.organs.push(Organ {
            parent,
            joint: Joint { d, rotation: relative(joint.rotation, fit.rotation), scale: fit.length / joint.scale },
            form: Form::Stem { gamma: fit.gamma.clone(), radius: fit.radius / fit.length },
        });
        self.evidence.push(Evidence { points: source.map_or(&[], |s| s.points), radius_known: fit.radius_known });
        self.fits.push(OrganFit {
            source: source.map(|s| s.organ),
            points: source.map_or(0, |s| s.points.len()),
            residual: source.map(|_| fit.residual),
            visible_fraction: None,
            converged: fit.converged,
            sigmas: Sigmas::new(),
        });
        self.organs.len() - 1
    }

    fn add_leaf_at_end(&mut self, parent: usize, source: Source<'a>) -> Result<usize, FitError> {
        let joint = self.hanger(parent, source)?.joint(1.0);
        Ok(self.add_leaf(parent, 1.0, joint, source))
    }

    fn add_leaf(&mut self, parent: usize, d: f64, joint: Similarity, source: Source<'a>) -> usize {
        let fit = leaf::fit(source.points, joint.translation, self.up, self.species);
        self.add_fitted(parent, d, joint, source, fit)
    }

    /// Where an organ whose points are `points` hangs on a stem of the plant.
    pub(super) fn joint(&self, parent: usize, source: Source<'_>) -> Result<(f64, Similarity), FitError> {
        let hanger = self.hanger(parent, source)?;
        let d = hanger.root(source.points);
        Ok((d, hanger.joint(d)))
    }

    /// Adds a blade that was fitted where it hangs; gives its index.
    pub(super) fn add_fitted(
        &mut self,
        parent: usize,
        d: f64,
        joint: Similarity,
        source: Source<'a>,
        fit: LeafFit,
    ) -> usize {
        let organ = self.organs.len();
        self.hangers.push(None);
        self.evidence.push(Evidence { points: source.points, radius_known: false });
        self.organs.push(Organ { parent: Some(parent), ..blade(d, joint, &fit) });
        self.fits.push(OrganFit { source: Some(source.organ), points: source.points.len(), ..outcome(&fit) });
        self.blades.push(HungBlade { organ, joint, fit });
        organ
    }

    /// Fits blades again that are hardly larger than the noise; `count` tells the points of an organ of the tree.
    pub(super) fn sharpen(&mut self, count: impl Fn(usize) -> usize) {
        let count = |fits: &[OrganFit], organ: usize| fits[organ].source.map_or(0, &count);
        let each = |hung: &HungBlade| {
            count(&self.fits, hung.organ) as f64 / self.evidence[hung.organ].points.len().max(1) as f64
        };
        let fits: Vec<_> = self.blades.iter().map(|hung| (&hung.fit, each(hung))).collect();
        let Some(crowd) = Crowd::of(&fits) else { return };
        for HungBlade { organ, joint, fit } in &mut self.blades {
            let points = self.evidence[*organ].points;
            let cloud = Cloud { points, count: count(&self.fits, *organ), base: joint.translation, up: self.up };
            let Some(sharper) = smeared::again(fit, cloud, self.species, crowd) else { continue };
            let (old, said) = (&mut self.organs[*organ], &mut self.fits[*organ]);
            *old = Organ { parent: old.parent, ..blade(old.joint.d, *joint, &sharper) };
            *said = OrganFit { source: said.source, points: said.points, ..outcome(&sharper) };
            *fit = sharper;
        }
    }

    /// Widens the uncertainties of blades that may be partly hidden, leaves being numbered; `count` as above.
    pub(super) fn doubt(&mut self, count: impl Fn(usize) -> usize) {
        let outline = |hung: &HungBlade| Outline {
            points: self.fits[hung.organ].source.map_or(0, &count) as f64,
            area: hung.fit.area,
            leaf: match self.organs[hung.organ].form {
                Form::Leaf { leaf, .. } => leaf,
                Form::Stem { .. } => unreachable!("a blade is a leaf"),
            },
        };
        let outlines: Vec<Outline> = self.blades.iter().map(outline).collect();
        for (hung, share) in self.blades.iter().zip(hidden::shares(&outlines)) {
            uncertainty::doubt(&mut self.fits[hung.organ].sigmas, share);
        }
    }
}

/// A blade that hangs on a joint at `d` of a parent yet to be said.
fn blade(d: f64, joint: Similarity, fit: &LeafFit) -> Organ {
    Organ {
        parent: None,
        joint: Joint { d, rotation: relative(joint.rotation, fit.rotation), scale: fit.length / joint.scale },
        form: Form::Leaf { blade: fit.blade.clone(), leaf: 0 },
    }
}

/// What is said of a blade but for its points.
fn outcome(fit: &LeafFit) -> OrganFit {
    OrganFit {
        source: None,
        points: 0,
        residual: Some(fit.residual),
        visible_fraction: Some(fit.visible),
        converged: fit.converged,
        sigmas: fit.sigmas.clone(),
    }
}
