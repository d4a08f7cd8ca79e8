//! Organs of one view to plants.

use glam::{DVec2, DVec3};

use super::gap::Near;
use super::{LiftedOrgan, View};
use crate::axes::PrincipalAxes;
use crate::model::OrganKind;
use crate::organs::OrganCloud;

/// Two pieces of main stem are one when the shorter lies this near to the longer's axis and this near to its end, in
/// lengths of the longer (guesses: stems of neighbours stand farther apart, pieces of one are cut by a blade).
const COLLINEAR: f64 = 0.12;
const CUT: f64 = 0.8;
/// An organ hangs on a plant over a gap of at most its own size or this share of the main stem's, whichever is larger:
/// a hidden petiole leaves such a gap (a guess).
const REACH: f64 = 0.5;
/// Organs that reach no main stem belong together over gaps of at most this share of the smaller one's size (a guess).
const LOOSE: f64 = 0.5;
/// A main stem that is put where none was seen has this many points.
const STAND_IN_POINTS: usize = 48;
/// And is at least this long, in sizes of its plant.
const STAND_IN_LENGTH: f64 = 0.1;
/// A base is taken to be on the ground when it is seen no higher than this share of its distance: depth is about that
/// uncertain (a guess).
const NEAR_GROUND: f64 = 0.06;
/// A stem stands upright when the vertical component of its axis is over this (45 degrees); only such a one is drawn on.
const UPRIGHT: f64 = 0.7;
/// A piece of main stem with less than this share of the largest one's pixels, and no continuation of another, is a scrap:
/// the tip of a hanging blade, a dark edge. It roots no plant (a guess; plants in one picture are of a size).
const SCRAP: f64 = 0.2;
/// A leaf with less than this share of the pixels of its plant's largest is a speck: an edge, a petiole's end. Set after
/// looking at one soybean, whose specks have up to 0.020 and whose smallest leaflet 0.25.
const SPECK: f64 = 1.0 / 40.0;
/// A leaf alone is a seedling, whose other leaves are hidden behind it or too small to see, when it has at least this share
/// of the pixels of the picture's largest plant (a guess; in fields the lower it is, the more weeds are plants) and at most
/// this share of the picture's: what is larger is a leaf held before the camera (a guess, too).
const SEEDLING: f64 = 0.02;
const LEAF_BEFORE_CAMERA: f64 = 0.1;
/// Share of points at either end of an organ that make its end.
const END: f64 = 0.03;

/// One plant of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantView {
    /// Its organs in the frame they were lifted into; organ 0 is the main stem.
    pub organs: Vec<OrganCloud>,
    /// Instances of the raster that belong to it, ascending.
    pub instances: Vec<u16>,
    /// Whether no main stem was seen and organ 0 is a stand-in.
    pub stand_in: bool,
    /// The main stem's lowest point.
    pub base: DVec3,
    /// The pixel it was seen in, row major; `None` for a stand-in.
    pub base_pixel: Option<u32>,
    /// Pixels of all its instances.
    pub pixels: usize,
    /// Whether one of them touches the picture's border.
    pub touches_border: bool,
    /// First and last column and row: `[x0, y0, x1, y1]`, inclusive.
    pub bounds: [u32; 4],
}

/// Why organs make no plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum GroupError {
    /// A main stem without a leaf.
    #[error("expected a leaf on the main stem, found none")]
    NoLeaf,
    /// A scrap of main stem.
    #[error("expected a main stem of about the size of the others in the picture, found a scrap")]
    Scrap,
    /// A speck of leaf.
    #[error("expected leaves of about the size of the plant's largest, found a speck")]
    Speck,
    /// No main stem, and too little to say where it would be: one organ in a row, or in a photo one that is no seedling.
    #[error("expected a main stem or at least two organs, found one organ")]
    NoMainStem,
}

/// Organs that make no plant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused {
    /// Their instances, ascending.
    pub instances: Vec<u16>,
    /// Why.
    pub reason: GroupError,
}

/// Divides a view's organs into plants, the largest (in pixels) first.
///
/// A minimum spanning forest rooted at the main stems: again and again the organ with the smallest gap to a plant's
/// stems joins it (leaves carry nothing). What reaches no main stem forms plants of its own, whose stem is its lowest
/// stem or a stand-in through the leaves' bases.
#[must_use]
pub fn group(view: &View<'_>, organs: &[LiftedOrgan]) -> (Vec<PlantView>, Vec<Refused>) {
    let up = super::scale::up(view);
    let near: Vec<Near> = organs.iter().map(|organ| Near::new(&organ.cloud.points)).collect();
    let pixels = |members: &Vec<usize>| members.iter().map(|&i| organs[i].region.pixels).sum::<usize>() as f64;
    let stems = main_stems(organs, &near);
    let least = SCRAP * stems.iter().map(pixels).fold(0.0, f64::max);
    let (mut plants, scraps): (Vec<_>, Vec<_>) = stems.into_iter().partition(|stem| pixels(stem) >= least);
    let loose = spread(organs, &near, &mut plants);
    let rooted = plants.len();
    plants.extend(loose_plants(&near, &loose));

    let ids = |members: &[usize]| {
        let mut ids: Vec<u16> = members.iter().map(|&m| organs[m].region.id).collect();
        ids.sort_unstable();
        ids
    };
    // In a row every plant is seen again and again, and a leaf alone is a neighbour's.
    let in_row = view.world_from_camera.is_some();
    let largest = plants.iter().map(pixels).fold(0.0, f64::max);
    let is_seedling = |members: &Vec<usize>| {
        !in_row && (SEEDLING * largest..LEAF_BEFORE_CAMERA * view.semantic.len() as f64).contains(&pixels(members))
    };
    let mut views = Vec::new();
    let scrap = |stem: &Vec<usize>| Refused { instances: ids(stem), reason: GroupError::Scrap };
    let mut refused: Vec<Refused> = scraps.iter().map(scrap).collect();
    for (i, members) in plants.into_iter().enumerate() {
        let (specks, members): (Vec<_>, Vec<_>) = members.iter().partition(|&&m| is_speck(organs, m, &members));
        if !specks.is_empty() {
            refused.push(Refused { instances: ids(&specks), reason: GroupError::Speck });
        }
        let leaves = members.iter().filter(|&&m| organs[m].cloud.kind == OrganKind::Leaf).count();
        let instances = ids(&members);
        if leaves == 0 {
            refused.push(Refused { instances, reason: GroupError::NoLeaf });
        } else if i >= rooted && members.len() < 2 && !is_seedling(&members) {
            refused.push(Refused { instances, reason: GroupError::NoMainStem });
        } else {
            views.push(plant(view, organs, &members, instances, up));
        }
    }
    views.sort_by_key(|plant| (std::cmp::Reverse(plant.pixels), plant.instances[0]));
    (views, refused)
}

fn is_speck(organs: &[LiftedOrgan], organ: usize, plant: &[usize]) -> bool {
    let leaves = plant.iter().map(|&m| &organs[m]).filter(|organ| organ.cloud.kind == OrganKind::Leaf);
    let largest = leaves.map(|leaf| leaf.region.pixels).max().unwrap_or(0) as f64;
    organs[organ].cloud.kind == OrganKind::Leaf && (organs[organ].region.pixels as f64) < SPECK * largest
}

/// Main stems as lists of their pieces.
fn main_stems(organs: &[LiftedOrgan], near: &[Near]) -> Vec<Vec<usize>> {
    let mut pieces: Vec<usize> = (0..organs.len()).filter(|&i| organs[i].cloud.kind == OrganKind::MainStem).collect();
    pieces.sort_by(|&a, &b| near[b].size().total_cmp(&near[a].size()).then(a.cmp(&b)));
    let mut stems: Vec<Vec<usize>> = Vec::new();
    for piece in pieces {
        let continues = |stem: &&mut Vec<usize>| {
            let longest = stem[0];
            let length = near[longest].size();
            let PrincipalAxes { centre, axes, .. } = PrincipalAxes::of(organs[longest].cloud.points.iter().copied());
            let points = &organs[piece].cloud.points;
            let off = |p: &DVec3| (*p - centre).reject_from(axes.x_axis).length();
            let aside = points.iter().map(off).sum::<f64>() / points.len() as f64;
            let gap = stem.iter().map(|&s| near[s].gap(&near[piece])).fold(f64::INFINITY, f64::min);
            aside <= COLLINEAR * length && gap <= CUT * length
        };
        match stems.iter_mut().find(continues) {
            Some(stem) => stem.push(piece),
            None => stems.push(vec![piece]),
        }
    }
    stems
}

/// Hangs organs on plants, nearest first; returns those that reach none.
fn spread(organs: &[LiftedOrgan], near: &[Near], plants: &mut [Vec<usize>]) -> Vec<usize> {
    let mut free: Vec<usize> = (0..organs.len()).filter(|&i| organs[i].cloud.kind != OrganKind::MainStem).collect();
    let mut best: Vec<(f64, usize)> = vec![(f64::INFINITY, 0); organs.len()];
    let reach: Vec<f64> = plants.iter().map(|stem| REACH * near[stem[0]].size()).collect();
    let improve = |best: &mut [(f64, usize)], free: &[usize], from: usize, plant: usize| {
        for &i in free {
            if near[from].at_least(&near[i]) < best[i].0 {
                let gap = near[from].gap(&near[i]);
                if gap < best[i].0 && gap <= reach[plant].max(near[i].size()) {
                    best[i] = (gap, plant);
                }
            }
        }
    };
    for (plant, stem) in plants.iter().enumerate() {
        for &piece in stem {
            improve(&mut best, &free, piece, plant);
        }
    }
    while let Some(k) = (0..free.len()).min_by(|&a, &b| best[free[a]].0.total_cmp(&best[free[b]].0)) {
        let (gap, plant) = best[free[k]];
        if gap == f64::INFINITY {
            break;
        }
        let organ = free.remove(k);
        plants[plant].push(organ);
        if organs[organ].cloud.kind != OrganKind::Leaf {
            improve(&mut best, &free, organ, plant);
        }
    }
    free
}

/// Clusters organs without a main stem by their gaps (single linkage).
fn loose_plants(near: &[Near], loose: &[usize]) -> Vec<Vec<usize>> {
    let mut left: Vec<usize> = loose.to_vec();
    let mut clusters = Vec::new();
    while !left.is_empty() {
        let mut cluster = vec![left.remove(0)];
        let mut next = 0;
        while next < cluster.len() {
            let from = cluster[next];
            let (joined, apart) = left.into_iter().partition(|&i: &usize| {
                let limit = LOOSE * near[from].size().min(near[i].size());
                near[from].at_least(&near[i]) <= limit && near[from].gap(&near[i]) <= limit
            });
            cluster.extend::<Vec<usize>>(joined);
            left = apart;
            next += 1;
        }
        clusters.push(cluster);
    }
    clusters
}

fn plant(view: &View<'_>, organs: &[LiftedOrgan], members: &[usize], instances: Vec<u16>, up: DVec3) -> PlantView {
    let height = |p: &DVec3| p.dot(up);
    let main: Vec<usize> = of_kind(organs, members, OrganKind::MainStem);
    // Without a main stem the stem that reaches lowest is taken for it.
    let foot = |&i: &usize| organs[i].cloud.points.iter().map(height).fold(f64::INFINITY, f64::min);
    let lowest =
        of_kind(organs, members, OrganKind::Stem).into_iter().min_by(|a, b| foot(a).total_cmp(&foot(b)).then(a.cmp(b)));
    let pieces: Vec<usize> = if main.is_empty() { lowest.into_iter().collect() } else { main };
    let stand_in = pieces.is_empty();
    let mut stem = OrganCloud { kind: OrganKind::MainStem, points: Vec::new(), source: Vec::new() };
    for &piece in &pieces {
        stem.points.extend(&organs[piece].cloud.points);
        stem.source.extend(&organs[piece].cloud.source);
    }
    if stand_in {
        stem.points = stand_in_stem(organs, members, up);
    }
    let low = (0..stem.points.len()).min_by(|&a, &b| height(&stem.points[a]).total_cmp(&height(&stem.points[b])));
    let base = low.map_or(DVec3::ZERO, |i| stem.points[i]);
    let base_pixel = low.and_then(|i| stem.source.get(i).copied());
    let stems = of_kind(organs, members, OrganKind::Stem).into_iter().filter(|m| !pieces.contains(m));
    let mut rest: Vec<Vec<usize>> =
        stems.map(|stem| vec![stem]).chain(super::join::leaves(view, organs, members)).collect();
    rest.sort_unstable();
    let cloud = |pieces: &Vec<usize>| {
        let clouds = pieces.iter().map(|&piece| &organs[piece].cloud);
        OrganCloud {
            kind: organs[pieces[0]].cloud.kind,
            points: clouds.clone().flat_map(|c| c.points.iter().copied()).collect(),
            source: clouds.flat_map(|c| c.source.iter().copied()).collect(),
        }
    };
    let regions = members.iter().map(|&m| &organs[m].region);
    PlantView {
        organs: std::iter::once(stem).chain(rest.iter().map(cloud)).collect(),
        instances,
        stand_in,
        base,
        base_pixel,
        pixels: regions.clone().map(|r| r.pixels).sum(),
        touches_border: regions.clone().any(|r| r.touches_border),
        bounds: regions.fold([u32::MAX, u32::MAX, 0, 0], |[x0, y0, x1, y1], r| {
            [x0.min(r.bounds[0]), y0.min(r.bounds[1]), x1.max(r.bounds[2]), y1.max(r.bounds[3])]
        }),
    }
}

fn of_kind(organs: &[LiftedOrgan], members: &[usize], kind: OrganKind) -> Vec<usize> {
    let mut found: Vec<usize> = members.iter().copied().filter(|&m| organs[m].cloud.kind == kind).collect();
    found.sort_unstable();
    found
}

/// An upright line through the middle of the leaves' bases, from the plant's lowest point to its highest leaf base.
fn stand_in_stem(organs: &[LiftedOrgan], members: &[usize], up: DVec3) -> Vec<DVec3> {
    let points = || members.iter().flat_map(|&m| organs[m].cloud.points.iter());
    let count = points().count() as f64;
    let middle = points().sum::<DVec3>() / count;
    let size = 2.0 * (points().map(|p| (*p - middle).length_squared()).sum::<f64>() / count).sqrt();
    let bases: Vec<DVec3> = members.iter().map(|&m| nearer_end(&organs[m].cloud.points, middle)).collect();
    let foot = bases.iter().sum::<DVec3>() / bases.len() as f64;
    let lowest = points().map(|p| p.dot(up)).fold(f64::INFINITY, f64::min);
    let highest = bases.iter().map(|p| p.dot(up)).fold(f64::NEG_INFINITY, f64::max);
    let length = (highest - lowest).max(STAND_IN_LENGTH * size);
    let bottom = foot + up * (lowest - foot.dot(up));
    (0..STAND_IN_POINTS).map(|i| bottom + up * (length * i as f64 / (STAND_IN_POINTS - 1) as f64)).collect()
}

/// The middle of the end, along the longest axis, that is nearer to `target`.
fn nearer_end(points: &[DVec3], target: DVec3) -> DVec3 {
    let PrincipalAxes { centre, axes, .. } = PrincipalAxes::of(points.iter().copied());
    let mut sorted: Vec<DVec3> = points.to_vec();
    sorted.sort_by(|a, b| (*a - centre).dot(axes.x_axis).total_cmp(&(*b - centre).dot(axes.x_axis)));
    let few = ((points.len() as f64 * END) as usize).max(1);
    let mean = |some: &[DVec3]| some.iter().sum::<DVec3>() / some.len() as f64;
    let (first, last) = (mean(&sorted[..few]), mean(&sorted[points.len() - few..]));
    if first.distance(target) <= last.distance(target) { first } else { last }
}

impl PlantView {
    /// Where it stands on the ground z = 0, metres, in a view with a pose: under the ray to its base when that was seen
    /// near the ground, which a wrong depth cannot move; else where its stem, drawn on downwards, would end.
    #[must_use]
    pub fn ground_position(&self, view: &View<'_>) -> DVec2 {
        let hit = self.base_pixel.zip(view.world_from_camera).and_then(|(p, pose)| {
            let (x, y) = (p % view.intrinsics.width, p / view.intrinsics.width);
            let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let ray = pose.rotation * view.intrinsics.unproject(at, 1.0);
            let depth = -pose.translation.z / ray.z;
            let near_ground = self.base.z <= NEAR_GROUND * self.base.distance(pose.translation);
            (depth > 0.0 && near_ground).then(|| (pose.translation + ray * depth).truncate())
        });
        hit.unwrap_or_else(|| {
            let axis = PrincipalAxes::of(self.organs[0].points.iter().copied()).axes.x_axis;
            let upright = axis.z.abs() > UPRIGHT;
            (self.base - if upright { axis * (self.base.z / axis.z) } else { DVec3::ZERO }).truncate()
        })
    }

    /// How far its middle is from the picture's, 0 at the middle to 1 at a corner.
    #[must_use]
    pub fn off_centre(&self, view: &View<'_>) -> f64 {
        let (w, h) = (f64::from(view.intrinsics.width), f64::from(view.intrinsics.height));
        let [x0, y0, x1, y1] = self.bounds.map(f64::from);
        DVec2::new((x0 + x1 + 1.0) / w - 1.0, (y0 + y1 + 1.0) / h - 1.0).length() / 2f64.sqrt()
    }
}
