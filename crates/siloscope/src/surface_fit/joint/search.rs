//! Which fits are run: from the tile stage's answer where that is certain, else from every proposal anew.

use crate::geometry::surface::{Part, SiloSurface, SurfaceTolerance};
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::model::Model;
use crate::surface_fit::joint::parameters::{
    BIAS, INTERCEPT, JointState, OBLIQUITY, OFFSET, OVAL_COLUMN, RADIUS, SIZE, SLOPE,
};
use crate::surface_fit::joint::select::{Weighed, weigh};
use crate::surface_fit::joint::solve::{JointFit, Schedule};
use crate::surface_fit::solver::Fit;
use crate::surface_fit::warm_start::LEAST_SHARE;

/// From a wall that is known to a millimetre.
const NEAR: Schedule = Schedule { annealed: 0, sketched: 0, pixels: 3 };
/// From a proposal: model error falls from a fraction of the radius.
const ANNEALED: Schedule = Schedule { annealed: 9, sketched: 0, pixels: 0 };
/// The rest of it.
const FINISH: Schedule = Schedule { annealed: 0, sketched: 4, pixels: 2 };
/// Another model from there.
const AGAIN: Schedule = Schedule { annealed: 0, sketched: 2, pixels: 2 };
/// First model error of a proposal, as a fraction of the radius.
const FIRST_TAU: f64 = 0.04;
/// Most proposals that are run.
const PROPOSALS: usize = 3;

/// Log-likelihood of a ninth of the tiles by which a cylinder with a cone leaves one without no chance.
const DECISIVE: f64 = 150.0;
/// A cone that is off by more may be feed of any shape: its tiles agree without being independent, metres.
const ROUGH_CONE: f64 = 3e-3;
/// A model that is more probable than this leaves no other a say.
const CERTAIN: f64 = 0.999;
/// Least arc of the cylinder, as a fraction of the circle, and least fraction of the tiles.
pub const LEAST_ARC: f64 = 0.25;
const LEAST_CYLINDER: f64 = 0.08;
/// Most that a wall's tiles are off by without another model being asked, metres and as a fraction of the radius.
const PLAIN_TAU: f64 = 1.5e-3;
/// Most correlation of its residuals.
const PLAIN_CORRELATION: f64 = 8.0;
/// Most smooth tiles too steep for feed that no model explains, as a fraction of the wall's.
const PLAIN_STEEP: f64 = 0.03;
/// The same for a known wall: over the model error that it has shown before.
const RELEARNED: f64 = 2.0;
/// Fewest tiles of each part that show it again.
const LEAST_AGAIN: f64 = 2.0;
/// Feed lies less steep: the steepest drained angles of repose are 45°. Cosine of 48°.
const STEEP_COSINE: f64 = 0.669;

/// The fits of a frame and their weights, best first.
#[derive(Debug, Clone)]
pub struct Search {
    /// The fits.
    pub fits: Vec<JointFit>,
    /// The models.
    pub weighed: Vec<Weighed>,
}

/// The state of a tile fit.
pub fn state_of(fit: &Fit) -> JointState {
    let SiloSurface { pose, radius, cone, ovality } = fit.surface;
    let mut x = [0.0; SIZE];
    x[..4].copy_from_slice(&[pose.r_x, pose.r_y, pose.t_x, pose.t_y]);
    x[BIAS..BIAS + 3].copy_from_slice(&[fit.bias.offset, fit.bias.scale, fit.bias.quadratic]);
    if let Some(radius) = radius {
        x[RADIUS] = radius;
        x[OVAL_COLUMN] = radius * ovality[0];
        x[OVAL_COLUMN + 1] = radius * ovality[1];
    }
    if let Some(cone) = cone {
        (x[SLOPE], x[INTERCEPT]) = (cone.slope, cone.intercept());
    }
    let mut state = JointState { x, has_cylinder: radius.is_some(), has_cone: cone.is_some(), reference: 1.0 };
    state.reference = if state.has_cylinder && state.has_cone { state.joint().clamp(0.2, 60.0) } else { 1.0 };
    state
}

/// Runs the fits: `near` is a wall found on tiles, `proposals` are rougher ones.
pub fn search(
    frame: &Frame,
    near: Option<&Fit>,
    proposals: &[Fit],
    other_part: impl Fn(&SiloSurface) -> Option<SiloSurface>,
) -> Search {
    let mut fits = Vec::new();
    if let Some(fit) = near {
        let state = state_of(fit);
        let start = Model::of(&state).first().map(|model| JointFit::start(*model, state, fit.misfit.max(2e-4)));
        fits.extend(start.and_then(|start| start.run(frame, &NEAR)));
        let weighed = weigh(frame, &fits);
        if fits.first().is_some_and(|fit| is_certain(frame, fit, &weighed)) {
            return Search { fits, weighed };
        }
        // beside others it is weighed with its own widths, not with those on the way to them
        fits = fits.into_iter().map(|fit| fit.clone().run(frame, &AGAIN).unwrap_or(fit)).collect();
    }
    fits.extend(near.and_then(|fit| beside(frame, fit, &other_part)));
    let starts = distinct(near, proposals);
    let mut both = Vec::new();
    let mut alone = Vec::new();
    let mut cones = Vec::new();
    for start in starts {
        let state = state_of(start);
        let with_cone =
            if state.has_cylinder && !state.has_cone { other_part(&start.surface) } else { Some(start.surface) };
        if let Some(surface) = with_cone.filter(|s| s.cone.is_some() && s.radius.is_some()) {
            both.extend(anneal(frame, Model::FreeCone, state_of(&Fit { surface, ..start.clone() })));
        }
        if state.has_cylinder {
            alone.extend(anneal(frame, Model::Cylinder, without(&state, Part::Cone)));
        }
        if state.has_cone {
            cones.push(without(&state, Part::Cylinder));
        }
    }
    let weak = both.iter().all(is_cylinder_weak);
    let (score, other) = (best_score(&both), best_score(&alone));
    let rough = both.iter().any(|fit| fit.tau[1] > ROUGH_CONE);
    if weak {
        let cone_alone = cones.into_iter().filter_map(|state| anneal(frame, Model::ConeAlone, state));
        let cone_alone = cone_alone.filter(|fit| !Model::of(&fit.state).is_empty()).collect();
        fits.extend(finished(frame, cone_alone));
    }
    fits.extend(finished(frame, both));
    if weak || rough || other > score - DECISIVE {
        fits.extend(finished(frame, alone));
    }
    let mut weighed = weigh(frame, &fits);
    // a model's own widths are learned under its own prior
    let again = weighed.first().filter(|best| fits[best.fit].model != best.model).and_then(|best| {
        let mut again = JointFit { model: best.model, moved: f64::INFINITY, ..fits[best.fit].clone() };
        again.state.x = best.mean;
        again.run(frame, &AGAIN)
    });
    if let Some(again) = again {
        fits.push(again);
        weighed = weigh(frame, &fits);
    }
    Search { weighed, fits }
}

/// The fit from the wall of another frame; `None` where this one does not plainly show it again.
pub fn search_again(frame: &Frame, known: &Fit) -> Option<Search> {
    let state = state_of(known);
    let model = *Model::of(&state).first()?;
    let fit = JointFit::start(model, state, known.misfit.max(2e-4)).run(frame, &NEAR)?;
    let [cylinder, cone] = wall_tiles(&fit);
    let most = (RELEARNED * known.misfit).max(PLAIN_TAU.min(1e-3 * fit.state.size()).max(3e-4));
    let plain = fit.tau.iter().all(|tau| *tau < most) && fit.amplitudes.at_cap(fit.state.size()).is_none();
    let shown = (cylinder >= LEAST_AGAIN || !fit.state.has_cylinder)
        && (cone >= LEAST_AGAIN || !fit.state.has_cone)
        && cylinder + cone > LEAST_SHARE * tiles_met(&fit);
    let mut weighed = weigh(frame, std::slice::from_ref(&fit));
    // of what model the vessel is the other frame has told
    let agrees = weighed.first().is_some_and(|best| best.model == model);
    weighed.truncate(1);
    weighed.iter_mut().for_each(|best| best.probability = 1.0);
    let again = plain && shown && agrees && steep_unexplained(frame, &fit) < PLAIN_STEEP;
    again.then(|| Search { fits: vec![fit], weighed })
}

/// A cylinder that is known to a millimetre with the conical surface beside it: annealed, it would be taken for what
/// sticks to it.
fn beside(frame: &Frame, near: &Fit, other_part: impl Fn(&SiloSurface) -> Option<SiloSurface>) -> Option<JointFit> {
    let surface = Some(&near.surface).filter(|s| s.radius.is_some() && s.cone.is_none()).and_then(other_part)?;
    let state = state_of(&Fit { surface, ..near.clone() });
    JointFit::start(Model::FreeCone, state, near.misfit.max(2e-4)).run(frame, &NEAR)
}

/// Proposals that would lead to the same answer are run once.
fn distinct<'a>(near: Option<&'a Fit>, proposals: &'a [Fit]) -> Vec<&'a Fit> {
    const SAME: SurfaceTolerance = SurfaceTolerance { tilt: 0.06, shift: 0.15, radius: 0.1, slope: 0.15, apex: 0.3 };
    let mut starts: Vec<&Fit> = Vec::new();
    for fit in near.into_iter().chain(proposals) {
        if starts.len() < PROPOSALS && !starts.iter().any(|other| fit.surface.is_near(&other.surface, &SAME)) {
            starts.push(fit);
        }
    }
    starts
}

/// The best of annealed fits, finished on all tiles and on pixels.
fn finished(frame: &Frame, runs: Vec<JointFit>) -> Option<JointFit> {
    runs.into_iter().max_by(|a, b| rough_score(a).total_cmp(&rough_score(b)))?.run(frame, &FINISH)
}

fn anneal(frame: &Frame, model: Model, state: JointState) -> Option<JointFit> {
    let tau = FIRST_TAU * state.size();
    JointFit::start(model, state, tau).run(frame, &ANNEALED)
}

fn best_score(fits: &[JointFit]) -> f64 {
    fits.iter().map(rough_score).fold(f64::NEG_INFINITY, f64::max)
}

fn rough_score(fit: &JointFit) -> f64 {
    fit.labels.log_likelihood.iter().sum()
}

fn without(state: &JointState, part: Part) -> JointState {
    let mut rest = state.clone();
    match part {
        Part::Cone => {
            rest.has_cone = false;
            rest.x[SLOPE..].fill(0.0);
        }
        Part::Cylinder => {
            rest.has_cylinder = false;
            rest.x[RADIUS..SLOPE].fill(0.0);
            rest.x[OFFSET..OBLIQUITY + 2].fill(0.0);
        }
    }
    rest
}

/// Whether no other model can matter: both the wall and what is beside it look as one vessel's do.
fn is_certain(frame: &Frame, fit: &JointFit, weighed: &[Weighed]) -> bool {
    let sure = weighed.first().is_some_and(|w| w.probability > CERTAIN);
    let size = fit.state.size();
    let plain = fit.tau.iter().all(|tau| *tau < PLAIN_TAU.min(1e-3 * size).max(3e-4))
        && fit.correlation.iter().all(|f| *f < PLAIN_CORRELATION)
        && fit.amplitudes.at_cap(size).is_none();
    sure && plain && fit.state.has_cylinder && !is_cylinder_weak(fit) && steep_unexplained(frame, fit) < PLAIN_STEEP
}

/// Number of tiles that were held against the wall.
pub fn tiles_met(fit: &JointFit) -> f64 {
    fit.sights.iter().flatten().count() as f64
}

/// Numbers of wall tiles on cylinder and cone.
pub fn wall_tiles(fit: &JointFit) -> [f64; 2] {
    let mut count = [0.0; 2];
    for (sight, p) in fit.sights.iter().zip(&fit.labels.wall) {
        if let Some(sight) = sight {
            count[usize::from(sight.at.part == Part::Cone)] += p;
        }
    }
    count
}

/// Whether so little of the cylinder is seen that the cone may be all there is.
fn is_cylinder_weak(fit: &JointFit) -> bool {
    wall_tiles(fit)[0] < LEAST_CYLINDER * tiles_met(fit) || arc(fit, Part::Cylinder) < LEAST_ARC
}

/// Arc of a part's wall tiles, as a fraction of the circle: 36 sectors with three tiles each, or one of a sketch.
pub fn arc(fit: &JointFit, part: Part) -> f64 {
    let mut sectors = [0u32; 36];
    for (sight, p) in fit.sights.iter().zip(&fit.labels.wall) {
        if let Some(sight) = sight.filter(|s| s.at.part == part && *p > 0.5) {
            let turn = sight.at.radial[1].atan2(sight.at.radial[0]) / std::f64::consts::TAU + 0.5;
            sectors[((turn * 36.0) as usize).min(35)] += 1;
        }
    }
    let enough = if tiles_met(fit) > 0.5 * fit.sights.len() as f64 { 3 } else { 1 };
    sectors.iter().filter(|n| **n >= enough).count() as f64 / 36.0
}

/// Smooth tiles before the wall that are too steep for feed and no deposit, over the wall's tiles.
fn steep_unexplained(frame: &Frame, fit: &JointFit) -> f64 {
    let axis = fit.state.pose().axis_direction();
    let patches = frame.readings.patches;
    let steep = patches.list.iter().enumerate().filter(|(i, p)| {
        let wall = fit.labels.wall.get(*i).is_some_and(|w| *w > 0.5) || fit.labels.deposit.get(*i).is_some_and(|d| *d);
        let seam = patches.neighbours[*i].iter().any(|&n| fit.labels.wall.get(n as usize).is_some_and(|w| *w > 0.5));
        p.smooth && !wall && !seam && p.normal.dot(&axis).abs() < STEEP_COSINE
    });
    let [cylinder, cone] = wall_tiles(fit);
    steep.count() as f64 / (cylinder + cone).max(1.0)
}
