//! Whether organs hang where they should.

use std::collections::{BTreeMap, BTreeSet};

/// Each organ's parent by the organs' ids, `None` for the main stem.
pub type Parents = BTreeMap<i32, Option<i32>>;

/// How many organs have the right parent, and of how many. Only `seen` organs count, the main stem apart; one that is
/// not `found` hangs wrongly. Where the true parent was not seen (a scan may have no point of it), the parent's own
/// parent stands in for it.
#[must_use]
pub fn right_parents(found: &Parents, truth: &Parents, seen: &BTreeSet<i32>) -> (usize, usize) {
    let (mut right, mut count) = (0, 0);
    for organ in seen {
        let Some(Some(mut parent)) = truth.get(organ).copied() else { continue };
        // At most as many steps as organs, so a cycle in the truth ends the walk.
        for _ in truth {
            match truth.get(&parent) {
                Some(Some(next)) if !seen.contains(&parent) => parent = *next,
                _ => break,
            }
        }
        count += 1;
        right += usize::from(found.get(organ) == Some(&Some(parent)));
    }
    (right, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(parents: &[(i32, Option<i32>)]) -> Parents {
        parents.iter().copied().collect()
    }

    #[test]
    fn every_seen_organ_but_the_main_stem_counts() {
        let truth = tree(&[(0, None), (1, Some(0)), (2, Some(1)), (3, Some(1))]);
        let all = BTreeSet::from([0, 1, 2, 3]);
        assert_eq!(right_parents(&truth, &truth, &all), (3, 3));
        assert_eq!(right_parents(&tree(&[(0, None), (1, Some(0)), (2, Some(0))]), &truth, &all), (1, 3));
        assert_eq!(right_parents(&Parents::new(), &truth, &all), (0, 3));
        // The petiole was not seen: its blades belong on the main stem.
        let blades = tree(&[(0, None), (2, Some(0)), (3, Some(0))]);
        assert_eq!(right_parents(&blades, &truth, &BTreeSet::from([0, 2, 3])), (2, 2));
        assert_eq!(right_parents(&blades, &truth, &all), (0, 3));
        let cycle = tree(&[(1, Some(2)), (2, Some(1))]);
        assert_eq!(right_parents(&Parents::new(), &cycle, &BTreeSet::from([1])), (0, 1));
    }
}
