//! Laws of plant records: what comes back, how small they are, and that no bytes do harm.

use crate::common::{random_plant, species};
use demeter_recon::cloud::diagonal;
use demeter_recon::model::{Detail, Form, Knots, Organ, Plant, PlantMesh, Species, forward};
use demeter_recon::organs::ScaleSource;
use demeter_recon::record::{RecordError, SpeciesRef, decode, encode_compact, encode_exact, peek};
use demeter_recon::species::NAMES;
use demeter_recon::world::{grow, seeded};
use proptest::prelude::*;

/// spec/demeter-model.md "A plant's record".
const VERTEX_ERROR: f64 = 0.0005;
const BYTES_PER_ORGAN: usize = 32;
/// The same of plants that chance makes: six in ten organs are blades, of all sizes on each other, and each is as little
/// likely as the last; those that grow have petioles and are held to the specification below.
const BYTES_BY_CHANCE: usize = 40;

fn vertex_error(exact: &Plant, decoded: &Plant, species: &Species, detail: Detail) -> f64 {
    let mesh = |plant| PlantMesh::of(&forward(plant, species).unwrap(), detail, Knots::Uniform).positions;
    let (exact, decoded) = (mesh(exact), mesh(decoded));
    assert_eq!(exact.len(), decoded.len());
    let total: f64 = exact.iter().zip(&decoded).map(|(a, b)| a.distance(*b)).sum();
    total / exact.len() as f64 / diagonal(&exact).unwrap()
}

/// Coefficients of an organ, then radius or width.
fn numbers(organ: &Organ) -> (Vec<f64>, f64, Option<u16>) {
    match &organ.form {
        Form::Stem { gamma, radius } => (gamma.clone(), *radius, None),
        Form::Leaf { blade, leaf } => ([blade.beta.clone(), blade.gamma.clone()].concat(), blade.width, Some(*leaf)),
    }
}

/// The plant with coefficients that spread as a species says, by 1 σ: chance draws them evenly within 2.5 σ.
fn typical(mut plant: Plant) -> Plant {
    for organ in &mut plant.organs {
        match &mut organ.form {
            Form::Stem { gamma, .. } => gamma.iter_mut().for_each(|c| *c *= 0.69),
            Form::Leaf { blade, .. } => blade.beta.iter_mut().chain(&mut blade.gamma).for_each(|c| *c *= 0.69),
        }
    }
    plant
}

/// Whether a record keeps to its bytes. Its fixed part, what the main stem alone takes, stands apart.
fn is_small(bytes: &[u8], plant: &Plant, species: &Species) -> bool {
    let alone = Plant { organs: plant.organs[..1].to_vec(), ..plant.clone() };
    let fixed = encode_compact(&alone, species, ScaleSource::None).unwrap().len();
    bytes.len() <= fixed + BYTES_BY_CHANCE * (plant.organs.len() - 1)
}

fn plants() -> impl Strategy<Value = (&'static str, usize, u64)> {
    (prop::sample::select(NAMES.to_vec()), 1..40_usize, any::<u64>())
}

proptest! {
    #![proptest_config(crate::common::cases(24))]

    #[test]
    fn exact_records_keep_every_parameter_to_f32((name, organs, seed) in plants()) {
        let species = species(name);
        let plant = random_plant(&species, organs, seed);
        let bytes = encode_exact(&plant, &species, ScaleSource::Stereo).unwrap();
        let record = decode(&bytes, |_| Some(&species)).unwrap();
        prop_assert_eq!(record.scale_source, ScaleSource::Stereo);
        prop_assert_eq!(&record.species, &SpeciesRef::of(&species));
        let rounded = |x: f64| f64::from(x as f32);
        for (a, b) in plant.organs.iter().zip(&record.plant.organs) {
            prop_assert_eq!(a.parent, b.parent);
            prop_assert_eq!((rounded(a.joint.d), rounded(a.joint.scale)), (b.joint.d, b.joint.scale));
            prop_assert!(a.joint.rotation.dot(b.joint.rotation) > 1.0 - 1e-12);
            let ((a, size, leaf), (b, other_size, other_leaf)) = (numbers(a), numbers(b));
            prop_assert_eq!((rounded(size), leaf), (other_size, other_leaf));
            prop_assert!(a.iter().map(|c| rounded(*c)).eq(b));
        }
        prop_assert_eq!(plant.world_from_plant, record.plant.world_from_plant);
    }

    #[test]
    fn compact_records_keep_vertices_and_quanta_and_are_small((name, organs, seed) in plants()) {
        let species = species(name);
        let plant = typical(random_plant(&species, organs, seed));
        let bytes = encode_compact(&plant, &species, ScaleSource::None).unwrap();
        prop_assert_eq!(&encode_compact(&plant, &species, ScaleSource::None).unwrap(), &bytes);
        let record = decode(&bytes, |_| Some(&species)).unwrap();
        prop_assert_eq!(record.scale_source, ScaleSource::None);
        for detail in [Detail::Control, Detail::Coarse] {
            let error = vertex_error(&plant, &record.plant, &species, detail);
            prop_assert!(error <= VERTEX_ERROR, "{detail:?}: {error}");
        }
        if organs >= 10 {
            prop_assert!(is_small(&bytes, &plant, &species), "{} bytes for {organs} organs", bytes.len());
        }
        let posed = [&plant, &record.plant].map(|p| forward(p, &species).unwrap());
        for (i, (a, b)) in plant.organs.iter().zip(&record.plant.organs).enumerate() {
            prop_assert_eq!(a.parent, b.parent);
            prop_assert!(i == 0 || (a.joint.d - b.joint.d).abs() <= 1.0 / 128.0 + 1e-9);
            let ((coefficients, size, leaf), (others, other_size, other_leaf)) = (numbers(a), numbers(b));
            prop_assert_eq!(leaf, other_leaf);
            prop_assert!(coefficients.iter().zip(&others).all(|(a, b)| (a - b).abs() <= 0.5 + 1e-9));
            // Half a step of 1/64 octave each of radius and size.
            prop_assert!((size / other_size).log2().abs() <= 1.0 / 64.0 + 1e-9);
            let scale = posed[0].world_from_organ[i].scale / posed[1].world_from_organ[i].scale;
            prop_assert!(scale.log2().abs() <= 1.0 / 128.0 + 1e-9);
        }
    }

    #[test]
    fn cut_or_flipped_bytes_are_refused(
        (name, organs, seed) in plants(),
        compact in any::<bool>(),
        at in any::<prop::sample::Index>(),
        bit in 0..8_u8,
    ) {
        let species = species(name);
        let plant = random_plant(&species, organs.min(6), seed);
        let encode = if compact { encode_compact } else { encode_exact };
        let bytes = encode(&plant, &species, ScaleSource::Input).unwrap();
        let read = |bytes: &[u8]| decode(bytes, |_| Some(&species));
        prop_assert!(read(&bytes[..at.index(bytes.len())]).is_err());
        let mut longer = bytes.clone();
        longer.push(0);
        prop_assert!(read(&longer).is_err());
        let mut flipped = bytes.clone();
        let i = at.index(bytes.len());
        flipped[i] ^= 1 << bit;
        prop_assert!(read(&flipped).is_err());
        // The same damage with a checksum that fits gives an error or a plant that can be drawn.
        let end = flipped.len() - 4;
        let sum = *blake3::hash(&flipped[..end]).as_bytes();
        flipped[end..].copy_from_slice(&sum[..4]);
        if let Ok(record) = read(&flipped) {
            let posed = forward(&record.plant, &species).unwrap();
            prop_assert!(posed.control.iter().flatten().all(|p| p.is_finite()));
        }
    }

    #[test]
    fn any_body_ends(body in prop::collection::vec(any::<u8>(), 0..60), encoding in 0..3_u8, organs in any::<u8>()) {
        let species = species("maize");
        let mut bytes = b"DMPL\x01".to_vec();
        bytes.extend([encoding, 5]);
        bytes.extend(b"maize");
        bytes.extend(SpeciesRef::of(&species).hash);
        bytes.extend([organs | 0x80, 31]);
        bytes.extend(body);
        bytes.extend(&blake3::hash(&bytes).as_bytes()[..4]);
        if let Ok(record) = decode(&bytes, |_| Some(&species)) {
            record.plant.validate().unwrap();
        }
    }
}

#[test]
fn nearly_straight_stems_do_not_swing_what_they_carry() {
    let species = species("soybean");
    for seed in 0..20 {
        let mut plant = typical(random_plant(&species, 12, seed));
        for organ in &mut plant.organs {
            if let Form::Stem { gamma, .. } = &mut organ.form {
                gamma.iter_mut().for_each(|c| *c *= 0.002);
            }
        }
        let bytes = encode_compact(&plant, &species, ScaleSource::None).unwrap();
        let record = decode(&bytes, |_| Some(&species)).unwrap();
        let error = vertex_error(&plant, &record.plant, &species, Detail::Control);
        assert!(error <= VERTEX_ERROR && is_small(&bytes, &plant, &species), "{seed}: {error} {}", bytes.len());
    }
}

/// Plants as they grow, not as chance makes them: small from ten organs on, everything included.
#[test]
fn grown_plants_fit_their_bytes() {
    for (name, seed) in NAMES.into_iter().flat_map(|name| (0..6).map(move |seed| (name, seed))) {
        let species = species(name);
        let plant = grow(&species, 0.2 * seed as f64, &mut seeded(seed));
        let bytes = encode_compact(&plant, &species, ScaleSource::Stereo).unwrap();
        let error =
            vertex_error(&plant, &decode(&bytes, |_| Some(&species)).unwrap().plant, &species, Detail::Refined(2));
        let organs = plant.organs.len();
        let small = organs < 10 || bytes.len() <= BYTES_PER_ORGAN * organs;
        assert!(small, "{name} {seed}: {} bytes, {organs} organs", bytes.len());
        assert!(error <= VERTEX_ERROR, "{name} {seed}: {error}");
    }
}

#[test]
fn other_versions_other_species_and_other_files_are_refused_by_name() {
    let species = species("soybean");
    let plant = random_plant(&species, 3, 1);
    let bytes = encode_exact(&plant, &species, ScaleSource::None).unwrap();
    assert_eq!(peek(&bytes), Ok(SpeciesRef::of(&species)));
    let read = |bytes: &[u8]| decode(bytes, |_| Some(&species)).unwrap_err();
    assert!(matches!(read(b""), RecordError::NoRecord { .. }));
    assert!(matches!(read(b"ply\nformat ascii 1.0"), RecordError::NoRecord { .. }));
    let mut newer = bytes.clone();
    newer[4] = 2;
    assert_eq!(read(&newer), RecordError::Version { expected: 1, found: 2 });
    let unknown = decode(&bytes, |_| None::<&Species>).unwrap_err();
    assert!(matches!(unknown, RecordError::Species { .. }), "{unknown}");
    let other = crate::common::species("maize");
    assert!(matches!(decode(&bytes, |_| Some(&other)), Err(RecordError::Species { .. })));
}

#[test]
fn what_no_record_can_hold_is_refused() {
    let species = species("soybean");
    let plant = random_plant(&species, 3, 1);
    let refused = |change: &dyn Fn(&mut Plant)| {
        let mut plant = plant.clone();
        change(&mut plant);
        for encode in [encode_compact, encode_exact] {
            assert!(encode(&plant, &species, ScaleSource::None).is_err());
        }
    };
    refused(&|p| p.organs.clear());
    refused(&|p| p.world_from_plant.translation.x = f64::NAN);
    refused(&|p| p.organs[0].joint.scale = f64::MIN_POSITIVE);
    refused(&|p| p.organs[1].parent = Some(7));
    refused(&|p| match &mut p.organs[0].form {
        Form::Stem { gamma, .. } => gamma.extend([0.0; 50]),
        Form::Leaf { .. } => {}
    });
}
