//! From the weighed models to an answer in the twelve parameters that frames share.

use crate::Vec3;
use crate::fusion::frame_factor::FrameFactor;
use crate::geometry::convex_vessel::ConvexVessel;
use crate::geometry::parameters::{Information, PARAMETERS, Parameters};
use crate::geometry::surface::{Cone, Part, SiloSurface};
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::model::Model;
use crate::surface_fit::joint::parameters::{BIAS, CAMERA, INTERCEPT, RADIUS, SIZE, SLOPE};
use crate::surface_fit::joint::search::{OVAL_COLUMN, Search};
use crate::surface_fit::joint::select::{Average, averaged};
use crate::surface_fit::joint::solve::JointFit;
use crate::surface_fit::joint::system::Prior;
use nalgebra::{DMatrix, SMatrix};

/// The answer of the joint fit.
#[derive(Debug, Clone)]
pub struct JointAnswer {
    /// Wall as cylinder and coaxial cone; the cone is missing where it is no hopper's, or not coaxial.
    pub surface: SiloSurface,
    /// The most probable vessel.
    pub vessel: ConvexVessel,
    /// Mean of the twelve parameters; NaN where a part is missing.
    pub parameters: Parameters,
    /// Their covariance.
    pub covariance: Information,
    /// The same if the intrinsics were exact: what frames of one camera don't have in common.
    pub relative: Information,
    /// What the frame alone says.
    pub share: FrameFactor,
    /// Which parameters are estimated.
    pub free: [bool; PARAMETERS],
    /// The models with their probabilities, most probable first.
    pub models: Vec<(Model, f64)>,
    /// Which fit is the most probable model's.
    pub best: usize,
    /// Errors of the intrinsics: focal lengths (relative), principal point (rays), k1.
    pub camera: [f64; 5],
}

/// The answer of weighed models; `hopper` tells whether the cone is known to be the silo's own, `scale` is the standard
/// deviation of a depth scale that nothing tells.
pub fn answer(frame: &Frame, search: &Search, hopper: bool, scale: f64) -> Option<JointAnswer> {
    let best = search.weighed.first()?;
    let fit = search.fits.get(best.fit)?;
    let average = averaged(frame, &search.fits, &search.weighed, false)?;
    let exact = frame.inputs.camera_std == [0.0; 5];
    let relative = if exact { average.clone() } else { averaged(frame, &search.fits, &search.weighed, true)? };
    let coaxial = hopper && best.model == Model::CoaxialCone;
    let map = projection(fit.state.x[RADIUS], fit.state.has_cylinder, coaxial);
    let parameters = projected_mean(&map, &average, fit.state.has_cylinder, coaxial);
    let mut free: [bool; PARAMETERS] = std::array::from_fn(|k| map.row(k).iter().any(|v| *v != 0.0));
    (7..10).for_each(|k| free[k] = frame.inputs.bias_std[k - 7] > 0.0);
    let with_scale = |of: &Average| project(&map, &of.covariance) + scale_share(&parameters, scale);
    let (covariance, relative) = (project(&map, &average.covariance), with_scale(&relative));
    let share = share(frame, fit, best.model, (&map, &covariance, &parameters))?;
    let mut state = fit.state.clone();
    state.x = best.mean;
    let cone = coaxial.then(|| Cone::with_intercept(parameters[5], parameters[6]));
    let radius = fit.state.has_cylinder.then_some(parameters[4]);
    let mut pose = state.pose();
    (pose.r_x, pose.r_y, pose.t_x, pose.t_y) = (parameters[0], parameters[1], parameters[2], parameters[3]);
    let surface = SiloSurface { pose, radius, cone, ovality: [parameters[10], parameters[11]] };
    Some(JointAnswer {
        surface,
        vessel: state.vessel(),
        parameters,
        covariance: with_scale(&average),
        relative,
        share,
        free,
        models: search.weighed.iter().map(|w| (w.model, w.probability)).collect(),
        best: best.fit,
        camera: std::array::from_fn(|k| average.mean[CAMERA + k]),
    })
}

type Projection = SMatrix<f64, PARAMETERS, SIZE>;

/// The twelve parameters by those of the joint fit.
fn projection(radius: f64, cylinder: bool, cone: bool) -> Projection {
    let mut map = Projection::zeros();
    (0..4).for_each(|k| map[(k, k)] = 1.0);
    (0..3).for_each(|k| map[(7 + k, BIAS + k)] = 1.0);
    if cylinder {
        map[(4, RADIUS)] = 1.0;
        (0..2).for_each(|k| map[(10 + k, OVAL_COLUMN + k)] = 1.0 / radius);
    }
    if cone {
        (map[(5, SLOPE)], map[(6, INTERCEPT)]) = (1.0, 1.0);
    }
    map
}

fn projected_mean(map: &Projection, average: &Average, cylinder: bool, cone: bool) -> Parameters {
    let mut mean = Parameters::from_fn(|k, _| (0..SIZE).map(|c| map[(k, c)] * average.mean[c]).sum());
    if !cylinder {
        mean[4] = f64::NAN;
    }
    if !cone {
        (mean[5], mean[6]) = (f64::NAN, f64::NAN);
    }
    mean
}

fn project(map: &Projection, covariance: &DMatrix<f64>) -> Information {
    let half = DMatrix::from_fn(PARAMETERS, SIZE, |r, c| map[(r, c)]);
    let full = &half * covariance * half.transpose();
    Information::from_fn(|r, c| 0.5 * (full[(r, c)] + full[(c, r)]))
}

/// The share of an unknown depth scale: every length goes with it.
fn scale_share(parameters: &Parameters, std: f64) -> Information {
    let length =
        |k: usize| if [2, 3, 4, 6].contains(&k) && parameters[k].is_finite() { parameters[k] * std } else { 0.0 };
    let lengths = Parameters::from_fn(|k, _| length(k));
    lengths * lengths.transpose()
}

/// What the frame says about the twelve parameters: all others marginalised with their priors.
fn share(
    frame: &Frame,
    fit: &JointFit,
    model: Model,
    (map, covariance, mean): (&Projection, &Information, &Parameters),
) -> Option<FrameFactor> {
    let prior = fit.prior(frame, model);
    let kept: Vec<usize> = (0..PARAMETERS).filter(|&k| map.row(k).iter().any(|v| *v != 0.0)).collect();
    let column = |k: usize| (0..SIZE).find(|&c| map[(k, c)] != 0.0);
    let columns: Vec<usize> = kept.iter().filter_map(|&k| column(k)).collect();
    let scales: Vec<f64> = kept.iter().zip(&columns).map(|(&k, &c)| 1.0 / map[(k, c)]).collect();
    let (lambda, pull, noise) = marginal(fit, &prior, &columns, frame)?;
    let (mut information, mut gradient, mut sensor) = (Information::zeros(), Parameters::zeros(), Information::zeros());
    let mut held = Parameters::zeros();
    for (r, &k) in kept.iter().enumerate() {
        gradient[k] = pull[r] * scales[r];
        for (c, &l) in kept.iter().enumerate() {
            information[(k, l)] = lambda[(r, c)] * scales[r] * scales[c];
            sensor[(k, l)] = noise[(r, c)] * scales[r] * scales[c];
        }
        let known = match k {
            4 => frame.inputs.radius.is_some(),
            0 | 1 => frame.inputs.gravity.is_some(),
            7..12 => true,
            _ => false,
        };
        if known && prior.std[columns[r]] > 0.0 {
            held[k] = (scales[r] / prior.std[columns[r]]).powi(2);
        }
    }
    let held_matrix = Information::from_diagonal(&held);
    let free: Vec<bool> = (0..PARAMETERS).map(|k| covariance[(k, k)] > 0.0).collect();
    let both = |m: Information| m.map_with_location(|r, c, v| if free[r] && free[c] { v } else { 0.0 });
    let joint = both(information + held_matrix);
    let scatter = joint * covariance * joint - both(held_matrix);
    // the answer is the mean over models; the frame's own equations are about the fit's state
    let base = Parameters::from_fn(|k, _| if mean[k].is_finite() { mean[k] } else { f64::NAN });
    let at = Parameters::from_fn(|k, _| column(k).map_or(0.0, |c| fit.state.x[c] * map[(k, c)]));
    let off = Parameters::from_fn(|k, _| if mean[k].is_finite() && free[k] { mean[k] - at[k] } else { 0.0 });
    gradient += information * off;
    Some(FrameFactor {
        step: Parameters::zeros(),
        information,
        gradient,
        scatter: 0.5 * (scatter + scatter.transpose()),
        noise: sensor,
        prior: held,
        base,
        rays: rays(frame, fit, mean[5].is_finite()),
    })
}

/// Information, gradient and the sensor's share of the scatter for some columns, all other free ones marginalised.
fn marginal(
    fit: &JointFit,
    prior: &Prior,
    columns: &[usize],
    frame: &Frame,
) -> Option<(DMatrix<f64>, Vec<f64>, DMatrix<f64>)> {
    let rest: Vec<usize> = (0..SIZE).filter(|k| !columns.contains(k) && prior.std[*k] > 0.0).collect();
    let h = &fit.quadratic.information;
    let pick = |r: &[usize], c: &[usize]| DMatrix::from_fn(r.len(), c.len(), |i, j| h[(r[i], c[j])]);
    let (uu, uv, vv) = (pick(columns, columns), pick(columns, &rest), pick(&rest, &rest));
    let scale: Vec<f64> = rest.iter().map(|&k| prior.std[k]).collect();
    let scaled = DMatrix::from_fn(rest.len(), rest.len(), |i, j| {
        vv[(i, j)] * scale[i] * scale[j] + if i == j { 1.0 } else { 0.0 }
    });
    let factor = nalgebra::Cholesky::new(scaled)?;
    let right = DMatrix::from_fn(rest.len(), columns.len(), |i, j| uv[(j, i)] * scale[i]);
    let solved = factor.solve(&right); // (S^½ V S^½ + I)⁻¹ S^½ VU
    let gain = DMatrix::from_fn(columns.len(), rest.len(), |i, j| solved[(j, i)] * scale[j]);
    let information = &uu - &gain * uv.transpose();
    let g = &fit.quadratic.gradient;
    let pull_of_rest: Vec<f64> =
        rest.iter().map(|&k| g[k] + (fit.state.x[k] - prior.mean[k]) / (prior.std[k] * prior.std[k])).collect();
    let pull = (0..columns.len())
        .map(|i| g[columns[i]] - (0..rest.len()).map(|j| gain[(i, j)] * pull_of_rest[j]).sum::<f64>())
        .collect();
    let cross = &gain * uv.transpose();
    let score = &uu - &cross - cross.transpose() + &gain * vv * gain.transpose();
    Some((information, pull, score * sensor_fraction(frame, fit)))
}

/// Fraction of the residuals' stated scatter that is the sensor's noise, over the wall's tiles.
pub(super) fn sensor_fraction(frame: &Frame, fit: &JointFit) -> f64 {
    let (mut noise, mut all) = (0.0, 0.0);
    for (i, sight) in fit.sights.iter().enumerate() {
        let Some(sight) = sight else { continue };
        let f = fit.correlation[usize::from(sight.at.part == Part::Cone)];
        let weight = fit.labels.wall[i] / (fit.labels.variance[i] * f);
        noise += weight * frame.readings.variance[i] / (fit.labels.variance[i] * f);
        all += weight;
    }
    if all > 0.0 { (noise / all).min(1.0) } else { 0.0 }
}

/// Some of the wall's rays with their information, where the depth bias is free.
fn rays(frame: &Frame, fit: &JointFit, cone: bool) -> Vec<[f64; 3]> {
    const RAYS: usize = 32;
    if frame.inputs.bias_std == [0.0; 3] {
        return Vec::new();
    }
    let wall =
        |&i: &usize| fit.labels.wall[i] > 0.5 && fit.sights[i].is_some_and(|s| cone || s.at.part == Part::Cylinder);
    let tiles: Vec<usize> = (0..fit.sights.len()).filter(wall).collect();
    let n = RAYS.min(tiles.len());
    let stands_for = tiles.len() as f64 / n.max(1) as f64;
    let ray = |k: usize| {
        let i = tiles[(2 * k + 1) * tiles.len() / (2 * n)];
        let q: Vec3 = frame.readings.patches.list[i].q;
        [q.x, q.y, stands_for * fit.labels.wall[i] / fit.labels.variance[i]]
    };
    (0..n).map(ray).collect()
}
