//! Pieces of one strap leaf, cut where it twists or is crossed, back into one.

use glam::DVec3;

use super::gap::Near;
use super::{LiftedOrgan, View};
use crate::axes::PrincipalAxes;
use crate::model::OrganKind;

/// A leaf reaches the stem when the gap in the picture is at most this share of its size there (a guess).
const REACHES: f64 = 0.15;
/// A piece goes on where another ends within this share of the picture's diagonal: some widths of a blade (a guess).
const JOINT: f64 = 0.025;
/// And in about its direction: cosine of the angle between the two, about 70 degrees for blades that hang over (a guess).
const ONWARD: f64 = 0.3;
/// Only straps are cut so: at least this much longer than wide, as standard deviations of their pixels; leaflets, which
/// are not, touch each other without being one (a guess).
const STRAP: f64 = 2.2;
/// Share of a piece's pixels that make its far end.
const END: f64 = 0.03;

/// A leaf of a plant, in the picture.
struct Piece {
    organ: usize,
    near: Near,
    middle: DVec3,
    /// The end that is farther from the stems.
    tip: DVec3,
    gap: f64,
    is_strap: bool,
}

/// The leaves among `members` as lists of pieces, the piece next to the stem first. Depth plays no part: it is what
/// the network knows least of thin leaves.
pub(super) fn leaves(view: &View<'_>, organs: &[LiftedOrgan], members: &[usize]) -> Vec<Vec<usize>> {
    let width = view.intrinsics.width;
    let diagonal = f64::from(width).hypot(f64::from(view.intrinsics.height));
    let picture = |organ: usize| {
        let at = |&p: &u32| DVec3::new(f64::from(p % width), f64::from(p / width), 0.0);
        organs[organ].cloud.source.iter().map(at)
    };
    let (leaves, stems): (Vec<usize>, Vec<usize>) =
        members.iter().partition(|&&m| organs[m].cloud.kind == OrganKind::Leaf);
    let stem = Near::new(&stems.iter().flat_map(|&s| picture(s)).collect::<Vec<_>>());
    let mut pieces: Vec<Piece> =
        leaves.into_iter().map(|organ| Piece::of(organ, &picture(organ).collect::<Vec<_>>(), &stem)).collect();
    pieces.sort_by(|a, b| a.gap.total_cmp(&b.gap).then(a.organ.cmp(&b.organ)));

    // The last piece of each leaf is the one that may go on.
    let mut joined: Vec<Vec<Piece>> = Vec::new();
    for piece in pieces {
        let goes_on = |leaf: &&mut Vec<Piece>| leaf.last().is_some_and(|last| last.goes_on(&piece, JOINT * diagonal));
        let free = piece.gap.is_finite() && piece.gap > REACHES * piece.near.size();
        match joined.iter_mut().filter(|_| free).find(goes_on) {
            Some(leaf) => leaf.push(piece),
            None => joined.push(vec![piece]),
        }
    }
    joined.into_iter().map(|leaf| leaf.into_iter().map(|piece| piece.organ).collect()).collect()
}

impl Piece {
    fn of(organ: usize, pixels: &[DVec3], stem: &Near) -> Self {
        let near = Near::new(pixels);
        let PrincipalAxes { centre: middle, deviation, .. } = PrincipalAxes::of(pixels.iter().copied());
        let mut far: Vec<(f64, DVec3)> = pixels.iter().map(|p| (stem.distance(*p), *p)).collect();
        far.sort_by(|a, b| b.0.total_cmp(&a.0));
        far.truncate(((pixels.len() as f64 * END) as usize).max(1));
        let tip = far.iter().map(|(_, p)| *p).sum::<DVec3>() / far.len().max(1) as f64;
        let is_strap = deviation[0] > STRAP * deviation[1];
        Self { organ, gap: stem.gap(&near), near, middle, tip, is_strap }
    }

    /// Whether `next` begins where this piece ends.
    fn goes_on(&self, next: &Self, joint: f64) -> bool {
        let (here, there) = (self.tip - self.middle, next.middle - self.tip);
        self.is_strap
            && next.near.distance(self.tip) <= joint
            && here.normalize_or_zero().dot(there.normalize_or_zero()) > ONWARD
    }
}
