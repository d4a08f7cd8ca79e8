//! Plants fitted to one picture: known points of each blade are known pixels, depth is a weak guess.

use demeter_frame::Pose;
use glam::{DQuat, DVec3};
use nalgebra::DVector;

use super::builder::{Builder, Source};
use super::leaf;
use super::leaf::state::State;
use super::solver::{Normal, minimise};
use super::{FitError, Fitted, hanger};
use crate::model::leaf::{Lattice, gauge};
use crate::model::{Form, OrganKind, Plant, PlantError, Similarity, Species, forward};

/// The nodes of a blade that are looked for in a picture.
pub const NODES: Lattice = Lattice::every(4, 7);
/// Steps from each start, and of the best.
const TRIAL: usize = 3;
const STEPS: usize = 15;
/// Standard deviation of a node in the picture, pixels: edges wave (tried: 1 to 2.5, docs/training.md).
const PIXELS: f64 = 2.0;
/// What the species' width counts beside a picture: what is seen across a turned blade is less than its width (a guess).
const WIDTH_WEIGHT: f64 = 0.2;

/// Where a picture shows a blade, in the frame of its camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Pictured {
    /// Its [`NODES`], row-major, metres; depth above 0.
    pub nodes: Vec<DVec3>,
    /// Metres that a pixel spans there.
    pub pixel: f64,
    /// Standard deviation of a node's depth, in lengths of the blade.
    pub depth: f64,
}

/// Fits a plant to its picture, in the camera's frame: a main stem by its points, and blades whose nodes are known. `up`
/// is the unit vertical of that frame.
///
/// # Errors
/// [`FitError`] when the main stem cannot be fitted.
pub fn pictured(stem: &[DVec3], blades: &[Pictured], species: &Species, up: DVec3) -> Result<Fitted, FitError> {
    super::error::check(0, stem)?;
    let base = hanger::ground(stem, up);
    let world_from_plant = Pose::new(DQuat::from_rotation_arc(DVec3::Z, up), base);
    let ground = Similarity { rotation: world_from_plant.rotation, translation: base, scale: 1.0 };
    let main = Source { organ: 0, kind: OrganKind::MainStem, points: stem };
    let mut builder = Builder::new(main, ground, species, up);
    for (k, blade) in blades.iter().enumerate() {
        let source = Source { organ: k + 1, kind: OrganKind::Leaf, points: &blade.nodes };
        let (d, joint) = builder.joint(0, source)?;
        let (state, converged) = blade.fitted(joint.translation, up, species);
        let mut fit = leaf::ended(state, &blade.nodes, species);
        fit.converged = converged;
        builder.add_fitted(0, d, joint, source, fit);
    }
    super::leaflets::group(&mut builder.organs, species.habit);
    let plant = Plant { world_from_plant, organs: builder.organs };
    plant.validate()?;
    Ok(Fitted { plant, organs: builder.fits, dropped: Vec::new() })
}

/// Moves blades of a plant fitted in the camera's frame to where its picture shows them: see [`super::in_picture`]. Where
/// they hang stands.
pub(super) fn to_picture(
    fitted: &mut Fitted,
    shown: impl Fn(usize, DVec3) -> Option<Pictured>,
    species: &Species,
    up: DVec3,
) -> Result<(), PlantError> {
    let posed = forward(&fitted.plant, species)?;
    for (organ, fit) in fitted.organs.iter_mut().enumerate() {
        let Some(parent) = fitted.plant.organs[organ].parent else { continue };
        let (Form::Leaf { leaf, .. }, Form::Stem { gamma, .. }) =
            (&fitted.plant.organs[organ].form, &fitted.plant.organs[parent].form)
        else {
            continue;
        };
        let Some(blade) = fit.source.and_then(|source| shown(source, posed.world_from_organ[organ].translation)) else {
            continue;
        };
        let joint = posed.world_from_organ[parent].at(&species.stem.curve(gamma), fitted.plant.organs[organ].joint.d);
        let (state, converged) = blade.fitted(joint.translation, up, species);
        let turn = state.rotation * gauge(&species.leaf.points(&state.blade(), Lattice::WHOLE)).inverse();
        let form = Form::Leaf { blade: state.blade(), leaf: *leaf };
        fit.converged = converged;
        let organ = &mut fitted.plant.organs[organ];
        organ.joint.rotation = hanger::relative(joint.rotation, turn.normalize());
        organ.joint.scale = state.metres() / joint.scale;
        organ.form = form;
    }
    fitted.plant.validate()
}

impl Pictured {
    /// The blade that hangs at `base` and is seen here; and whether the solver came to its end.
    fn fitted(&self, base: DVec3, up: DVec3, species: &Species) -> (State, bool) {
        let middle = self.nodes.chunks_exact(NODES.columns()).map(|row| row[NODES.columns() / 2]);
        let course: Vec<DVec3> = std::iter::once(base).chain(middle).collect();
        let tried = leaf::starts(&course, &self.nodes, up, species).map(|start| {
            let pins = Pins::of(self, &start, species);
            let (state, _) = pins.minimised(start, TRIAL, species);
            (pins.normal(&state, species).cost, pins, state)
        });
        let best = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, pins, state)) = best else { unreachable!("three were tried") };
        pins.minimised(state, STEPS, species)
    }
}

/// A blade's nodes with their weights.
struct Pins {
    nodes: Vec<DVec3>,
    in_picture: f64,
    in_depth: f64,
}

impl Pins {
    /// The blade's two faces look alike in a picture: its nodes are taken in the order that turns it less.
    fn of(blade: &Pictured, state: &State, species: &Species) -> Self {
        let now: Vec<DVec3> =
            species.leaf.points(&state.blade(), NODES).into_iter().map(|p| state.rotation * p).collect();
        let columns = NODES.columns();
        let across = |row: &[DVec3]| row[columns - 1] - row[0];
        let rows = now.chunks_exact(columns).zip(blade.nodes.chunks_exact(columns));
        let agree: f64 = rows.map(|(now, shown)| across(now).dot(across(shown))).sum();
        let mut nodes = blade.nodes.clone();
        if agree < 0.0 {
            nodes.chunks_exact_mut(columns).for_each(<[DVec3]>::reverse);
        }
        let length = state.metres();
        Self { nodes, in_picture: (PIXELS * blade.pixel).powi(-2), in_depth: (blade.depth * length).powi(-2) }
    }

    fn minimised(&self, mut state: State, steps: usize, species: &Species) -> (State, bool) {
        let apply = |state: &State, step: &DVector<f64>| state.stepped(step, species);
        let converged = minimise(&mut state, steps, |state| self.normal(state, species), apply);
        (state, converged)
    }

    fn normal(&self, state: &State, species: &Species) -> Normal {
        let jacobian = species.leaf.jacobian_on(&state.blade(), NODES);
        let metres = state.metres();
        let coefficients = jacobian.coefficients;
        let mut normal = Normal::new(State::COEFFICIENTS + coefficients);
        let mut row = vec![0.0; State::COEFFICIENTS + coefficients];
        for (n, shown) in self.nodes.iter().enumerate().skip(NODES.columns()) {
            let at = state.place(jacobian.points[n]);
            // A camera's plane where the node is shown: a change in depth moves what is off its axis.
            let scale = shown.z / at.z;
            let pulls = [
                (DVec3::new(1.0, 0.0, -at.x / at.z) * scale, at.x * scale - shown.x, self.in_picture),
                (DVec3::new(0.0, 1.0, -at.y / at.z) * scale, at.y * scale - shown.y, self.in_picture),
                (DVec3::Z, at.z - shown.z, self.in_depth),
            ];
            let from_base = at - state.base;
            for (direction, miss, weight) in pulls {
                let turn = from_base.cross(direction);
                row[..4].copy_from_slice(&[turn.x, turn.y, turn.z, from_base.dot(direction)]);
                let in_blade = state.rotation.inverse() * direction * metres;
                for (k, cell) in row[4..].iter_mut().enumerate() {
                    *cell = jacobian.derivative(n, k).dot(in_blade);
                }
                normal.add(miss, &row, weight);
            }
        }
        for (k, value) in state.beta.iter().chain(&state.gamma).enumerate() {
            normal.prior(State::COEFFICIENTS + k, *value, 1.0);
        }
        let width = species.priors.ln_width;
        normal.prior(
            State::COEFFICIENTS + coefficients - 1,
            state.log_width - width.mean,
            WIDTH_WEIGHT * width.sd.powi(-2),
        );
        normal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::leaf::Blade;
    use crate::species::shipped;

    const METRES: f64 = 0.4;
    const DEPTH: f64 = 0.15;

    /// A bent blade of maize a metre and a half before the camera, and its nodes.
    fn blade(species: &Species) -> (State, Vec<DVec3>) {
        let wave = |k: usize| (k as f64 * 1.7).sin();
        let state = State {
            base: DVec3::new(0.05, 0.1, 1.5),
            // The picture's y points down: tips rise.
            rotation: DQuat::from_rotation_z(2.3) * DQuat::from_rotation_y(1.3),
            log_length: METRES.ln(),
            log_width: species.priors.ln_width.mean,
            beta: (0..species.leaf.shape.rank()).map(|k| 0.5 * wave(k)).collect(),
            gamma: (0..species.leaf.deform.rank()).map(wave).collect(),
        };
        let nodes = species.leaf.points(&state.blade(), NODES).into_iter().map(|p| state.place(p)).collect();
        (state, nodes)
    }

    fn stem(base: DVec3) -> Vec<DVec3> {
        let around = |k: usize| DVec3::new((k as f64).cos(), 0.0, -(k as f64).sin().abs()) * 0.008;
        (0..300).map(|k| base + DVec3::Y * (0.2 - 0.4 * k as f64 / 300.0) + around(k)).collect()
    }

    #[test]
    fn gradients_agree_with_finite_differences() {
        let species = shipped("maize").expect("listed").expect("valid");
        let (state, mut nodes) = blade(&species);
        nodes.iter_mut().enumerate().for_each(|(k, p)| *p += DVec3::new(0.01, -0.007, 0.02) * (k as f64).cos());
        let pins = Pins::of(&Pictured { nodes, pixel: 0.002, depth: DEPTH }, &state, &species);
        let at = pins.normal(&state, &species);
        for k in 0..at.g.len() {
            let cost = |by: f64| {
                let mut step = DVector::zeros(at.g.len());
                step[k] = by;
                pins.normal(&state.stepped(&step, &species), &species).cost
            };
            let h = 1e-5;
            let finite = (cost(h) - cost(-h)) / (4.0 * h);
            assert!((finite - at.g[k]).abs() <= 1e-4 * (1.0 + at.g.amax()), "parameter {k}: {finite} {}", at.g[k]);
        }
    }

    #[test]
    fn a_pictured_blade_comes_back() {
        let species = shipped("maize").expect("listed").expect("valid");
        let (state, nodes) = blade(&species);
        let pixel = 0.002;
        for mirrored in [false, true] {
            let mut shown = nodes.clone();
            if mirrored {
                shown.chunks_exact_mut(NODES.columns()).for_each(<[DVec3]>::reverse);
            }
            let blades = [Pictured { nodes: shown, pixel, depth: DEPTH }];
            let fitted = pictured(&stem(state.base), &blades, &species, DVec3::NEG_Y).unwrap();
            assert_eq!(fitted.plant.organs[1].kind(), OrganKind::Leaf);
            let posed = crate::model::forward(&fitted.plant, &species).unwrap();
            let tip = |p: DVec3| (p / p.z).truncate() * 1.5;
            let found = posed.control[1][posed.control[1].len() - 1];
            let away = tip(found).distance(tip(nodes[nodes.len() - 1]));
            assert!(away < 4.0 * pixel, "the tip is {away} m off");
            let length = posed.world_from_organ[1].scale;
            assert!((length / METRES - 1.0).abs() < 0.1, "{length}");
            let Form::Leaf { blade: Blade { beta, gamma, .. }, .. } = &fitted.plant.organs[1].form else {
                panic!("a leaf")
            };
            assert!(beta.iter().chain(gamma).all(|c| c.abs() <= 3.0));
        }
    }

    #[test]
    fn no_stem_is_a_typed_error() {
        let species = shipped("maize").expect("listed").expect("valid");
        let (_, nodes) = blade(&species);
        for stem in [vec![], vec![DVec3::Z; 9], vec![DVec3::NAN; 9]] {
            assert!(
                pictured(
                    &stem,
                    &[Pictured { nodes: nodes.clone(), pixel: 0.002, depth: DEPTH }],
                    &species,
                    DVec3::NEG_Y
                )
                .is_err()
            );
        }
    }
}
