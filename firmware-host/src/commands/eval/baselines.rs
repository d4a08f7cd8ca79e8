//! What whole plants are compared with: SimpleProc, loose surfaces, a dense mesh.

use std::path::Path;
use std::process::Command;

use demeter_recon::baseline::{PARAMETERS, bezier, quadratic, simple_proc};
use demeter_recon::cloud::PointCloud;
use demeter_recon::metrics::chamfer;
use demeter_recon::model::{Habit, OrganKind, PlantMesh, Species};
use demeter_recon::organs::OrganTree;
use glam::DVec3;

use super::fit::Scored;
use crate::error::CommandError;
use crate::files;

/// Numbers that place an organ: attachment, three of its turn, size.
const PLACE: usize = 5;
/// Bytes of a number of a baseline, kept as f32.
const NUMBER_BYTES: usize = 4;
/// Numbers of a quadratic patch: six of its height, six of its plane's place and turn; its outline comes free.
const QUADRATIC: usize = 12;

/// How many free numbers our model has for an organ of this kind.
pub(super) fn numbers(kind: OrganKind, species: &Species) -> usize {
    PLACE
        + match kind {
            OrganKind::Leaf => {
                species.leaf.shape.rank() + species.leaf.deform.rank() + usize::from(species.habit == Habit::Grass)
            }
            OrganKind::MainStem | OrganKind::Stem => species.stem.deform.rank() + 1,
        }
}

/// SimpleProc on the whole cloud.
pub(super) fn procedural(cloud: &PointCloud, species: &Species, up: DVec3) -> Option<Scored> {
    let mesh = simple_proc(&cloud.points, species.habit, up);
    let cd = chamfer(&cloud.points, &mesh)?.cd;
    Some(Scored { cd, bytes: PARAMETERS * NUMBER_BYTES, organs: None })
}

/// A Bézier surface an organ, with as many numbers as our model has for it.
pub(super) fn beziers(cloud: &PointCloud, tree: &OrganTree, species: &Species) -> Option<Scored> {
    let of = |kind| numbers(kind, species);
    patches(cloud, tree, of, bezier)
}

/// A quadratic patch an organ.
pub(super) fn quadratics(cloud: &PointCloud, tree: &OrganTree) -> Option<Scored> {
    patches(cloud, tree, |_| QUADRATIC, |points, _| quadratic(points))
}

fn patches(
    cloud: &PointCloud,
    tree: &OrganTree,
    numbers: impl Fn(OrganKind) -> usize,
    patch: impl Fn(&[DVec3], usize) -> PlantMesh,
) -> Option<Scored> {
    let mut whole = PlantMesh::default();
    let mut bytes = 0;
    for organ in &tree.organs {
        let mesh = patch(&organ.points, numbers(organ.kind));
        bytes += numbers(organ.kind) * NUMBER_BYTES;
        let first = whole.positions.len() as u32;
        whole.faces.extend(mesh.faces.iter().map(|face| face.map(|vertex| vertex + first)));
        whole.positions.extend(mesh.positions);
    }
    Some(Scored { cd: chamfer(&cloud.points, &whole)?.cd, bytes, organs: Some(tree.organs.len()) })
}

/// tools/poisson.py run by the given Python; `path` is the cloud's file, in units of `metres`.
///
/// # Errors
/// [`CommandError`] `poisson` naming what is missing or what the script says.
pub(super) fn poisson(python: &Path, path: &Path, metres: f64, cloud: &PointCloud) -> Result<Scored, CommandError> {
    let wrong = |message: String| CommandError::usage("poisson", message);
    let made = std::env::temp_dir().join(format!("demeter-poisson-{}.obj", std::process::id()));
    let ran = Command::new(python).arg(SCRIPT).arg(path).arg(&made).output();
    let ran = ran.map_err(|error| wrong(format!("{}: {error}", python.display())))?;
    if !ran.status.success() {
        let said = String::from_utf8_lossy(&ran.stderr);
        return Err(wrong(format!("{SCRIPT}: {}", said.lines().last().unwrap_or("failed without a word"))));
    }
    let text = String::from_utf8_lossy(&files::read(&made)?).into_owned();
    std::fs::remove_file(&made).map_err(|error| files::file_error(&made, &error))?;
    let mesh = obj(&text, metres).ok_or_else(|| wrong(format!("{SCRIPT}: expected triangles in an OBJ file")))?;
    let cd = chamfer(&cloud.points, &mesh).ok_or_else(|| wrong("a surface without area".into()))?.cd;
    Ok(Scored { cd, bytes: (3 * mesh.positions.len() + 3 * mesh.faces.len()) * NUMBER_BYTES, organs: None })
}

/// Where the script stands in a checkout.
const SCRIPT: &str = "tools/poisson.py";

/// Vertices and triangles of an OBJ file; `None` when it is something else.
fn obj(text: &str, metres: f64) -> Option<PlantMesh> {
    let mut mesh = PlantMesh::default();
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        let kind = words.next();
        let first_part = |word: &str| word.split('/').next()?.parse::<f64>().ok();
        let numbers = words.map(first_part).collect::<Option<Vec<f64>>>();
        match (kind, numbers.as_deref()) {
            (Some("v"), Some([x, y, z, ..])) => mesh.positions.push(DVec3::new(*x, *y, *z) * metres),
            (Some("f"), Some([a, b, c])) => mesh.faces.push([*a, *b, *c].map(|v| (v as u32).wrapping_sub(1))),
            (Some("v" | "f"), _) => return None,
            _ => {}
        }
    }
    let known = |face: &[u32; 3]| face.iter().all(|vertex| (*vertex as usize) < mesh.positions.len());
    mesh.faces.iter().all(known).then_some(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_come_out_of_an_obj_and_nothing_else_does() {
        let mesh = obj("# x\nv 0 0 0\nv 1000 0 0 0.5 0.5 0.5\nv 0 1000 0\nf 1//1 2//2 3//3\n", 1e-3).unwrap();
        assert_eq!((mesh.positions[1], mesh.faces.as_slice()), (DVec3::X, [[0, 1, 2]].as_slice()));
        for wrong in ["v 0 0\n", "v 0 0 0\nf 1 2 3\n", "f 1 2 3 4\n", "f 0 0 0\n"] {
            assert!(obj(wrong, 1.0).is_none(), "{wrong}");
        }
    }
}
