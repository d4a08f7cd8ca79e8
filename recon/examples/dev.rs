#![allow(clippy::all, clippy::unwrap_used, clippy::print_stdout, missing_docs)]
use demeter_recon::{cloud::PointCloud, fit, metrics, model::*, segment, species, tree};
use glam::DVec3;
fn read(path: &str, unit: f64) -> PointCloud {
    let b = std::fs::read(path).unwrap();
    let e = b.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let h = std::str::from_utf8(&b[..e]).unwrap();
    let mut n = 0;
    let mut props = vec![];
    for l in h.lines() {
        let t: Vec<_> = l.split(' ').collect();
        if t[0] == "element" && t[1] == "vertex" {
            n = t[2].parse().unwrap();
        }
        if t[0] == "property" && t[1] != "list" {
            props.push((
                t[2].to_string(),
                match t[1] {
                    "float" => 4,
                    "double" => 8,
                    "uchar" => 1,
                    _ => 4,
                },
            ));
        }
    }
    let rs: usize = props.iter().map(|p| p.1).sum();
    let mut c = PointCloud::default();
    let mut lab = vec![];
    for i in 0..n {
        let r = &b[e + i * rs..];
        let mut o = 0;
        let mut x = [0.; 3];
        let mut l = None;
        for (name, sz) in &props {
            let v = match sz {
                8 => f64::from_le_bytes(r[o..o + 8].try_into().unwrap()),
                4 => f32::from_le_bytes(r[o..o + 4].try_into().unwrap()) as f64,
                _ => r[o] as f64,
            };
            match name.as_str() {
                "x" => x[0] = v,
                "y" => x[1] = v,
                "z" => x[2] = v,
                "label" => l = Some(v as i32),
                _ => {}
            }
            o += sz;
        }
        c.points.push(DVec3::from(x) * unit);
        if let Some(l) = l {
            lab.push(l)
        }
    }
    if !lab.is_empty() {
        c.labels = Some(lab)
    }
    c
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let labels = if a[1] == "none" { segment::Labels::None } else { segment::Labels::Auto };
    let dump = std::env::var("DUMP").ok();
    for arg in &a[2..] {
        let (sp, path) = arg.split_once(':').unwrap();
        let mm = !path.contains("27_o");
        let cloud = read(path, if mm { 1e-3 } else { 1.0 });
        let species = species::shipped(sp).unwrap().unwrap();
        let t = std::time::Instant::now();
        let seg = segment::segment(
            &cloud,
            species.habit,
            labels,
            if mm { segment::Up::Auto } else { segment::Up::Axis(DVec3::Z) },
        )
        .unwrap();
        let t1 = t.elapsed();
        let n = seg.organs.len();
        let tr = tree::build(seg.organs.clone()).unwrap();
        let t2 = t.elapsed();
        let f = fit::plant(&tr, &species, seg.up).unwrap();
        let t3 = t.elapsed();
        let posed = forward(&f.plant, &species).unwrap();
        let mesh = PlantMesh::of(&posed, Detail::Control, Knots::Uniform);
        let cd = metrics::chamfer(&cloud.points, &mesh).unwrap();
        let blades = f.plant.organs.iter().filter(|o| o.kind() == OrganKind::Leaf).count();
        println!(
            "{:60} up {} organs {n} -> {} blades {blades} cd {:.4} ({:.4} {:.4}) seg {:.0} tree {:.0} fit {:.0} ms",
            path.rsplit('/').next().unwrap(),
            seg.up,
            f.plant.organs.len(),
            cd.cd,
            cd.cloud_to_surface,
            cd.surface_to_cloud,
            t1.as_secs_f64() * 1e3,
            (t2 - t1).as_secs_f64() * 1e3,
            (t3 - t2).as_secs_f64() * 1e3
        );
        if std::env::var("V").is_ok() {
            for (o, r) in f.plant.organs.iter().zip(&f.organs) {
                println!(
                    "   {:?} parent {:?} d {:.2} s {:.3} pts {} res {:?} vis {:?} conv {}",
                    o.kind(),
                    o.parent,
                    o.joint.d,
                    o.joint.scale,
                    r.points,
                    r.residual,
                    r.visible_fraction,
                    r.converged
                )
            }
        }
        if let Some(d) = &dump {
            use std::io::Write;
            let mut w = std::fs::File::create(format!("{d}/{}.txt", path.rsplit('/').next().unwrap())).unwrap();
            for (k, o) in seg.organs.iter().enumerate() {
                for p in &o.points {
                    writeln!(w, "p {} {} {} {}", p.x, p.y, p.z, k).unwrap();
                }
            }
            for (p, fc) in metrics::sample_surface(&mesh, 20000, 1) {
                writeln!(w, "m {} {} {} {}", p.x, p.y, p.z, mesh.organ_of_face[fc]).unwrap();
            }
            writeln!(w, "u {} {} {} 0", seg.up.x, seg.up.y, seg.up.z).unwrap();
        }
    }
}
