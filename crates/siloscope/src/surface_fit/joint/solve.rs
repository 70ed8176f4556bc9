//! The joint fit of one model: relinearise, label, solve, and learn the widths, until it stands.

use crate::geometry::surface::Part;
use crate::surface_fit::joint::blocks::Blocks;
use crate::surface_fit::joint::correlation::correlation_factor;
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::labels::{LabelModel, Labels, label};
use crate::surface_fit::joint::model::{Amplitudes, Model, prior};
use crate::surface_fit::joint::parameters::{COMMON, INTERCEPT, JointState, RADIUS, SIZE, SLOPE};
use crate::surface_fit::joint::pixels::pixel_means;
use crate::surface_fit::joint::predict::{Predictor, Sight, own_columns};
use crate::surface_fit::joint::readings::Readings;
use crate::surface_fit::joint::system::{Accumulator, Posterior, Quadratic, dot};

/// Smallest model error, metres: what the tiles' own means resolve.
pub const TAU_FLOOR: f64 = 1e-5;
/// Most by which a model error falls in one step, as a factor.
const TAU_FALL: f64 = 0.55;
/// Most by which it grows.
const TAU_GROWTH: f64 = 1.3;
/// A step of the pose this small is the last, rad and radii.
const SMALL_STEP: f64 = 3e-4;
/// Below this model error a tile's curvature matters, metres.
const CURVED_BELOW: f64 = 3e-3;
/// After a step of the pose this small the wall bends over a tile as before, rad and radii.
const SAME_BEND: f64 = 3e-3;

/// A model's fit.
#[derive(Debug, Clone)]
pub struct JointFit {
    /// The model whose prior was used.
    pub model: Model,
    /// The state.
    pub state: JointState,
    /// Model error of cylinder and cone, metres across the wall.
    pub tau: [f64; 2],
    /// Correlation factors of cylinder and cone.
    pub correlation: [f64; 2],
    /// Learned widths.
    pub amplitudes: Amplitudes,
    /// Labels of the tiles.
    pub labels: Labels,
    /// The tiles against the wall.
    pub sights: Vec<Option<Sight>>,
    /// The frame's sum of squares about the state, without priors.
    pub quadratic: Quadratic,
    pub(super) fractions: [f64; 3],
    /// By how much the pose moved since the tiles were last held against the wall, rad and radii.
    pub(super) moved: f64,
}

/// How a fit runs.
#[derive(Debug, Clone, Copy)]
pub struct Schedule {
    /// Steps on a ninth of the tiles, without form, with a falling model error.
    pub annealed: usize,
    /// Steps on a quarter of the tiles with form and intrinsics.
    pub sketched: usize,
    /// Last steps on all tiles and the pixels where tiles are uneven.
    pub pixels: usize,
}

/// Rows of the tiles that may be wall, at a linearisation point.
struct Rows {
    tiles: Vec<usize>,
    widths: Vec<usize>,
    values: Vec<f64>,
}

impl JointFit {
    /// A start for a model.
    pub fn start(model: Model, state: JointState, tau: f64) -> Self {
        let size = state.size();
        Self {
            model,
            tau: [tau; 2],
            correlation: [1.0; 2],
            amplitudes: Amplitudes::first(size),
            labels: Labels::default(),
            sights: Vec::new(),
            quadratic: Accumulator::default().quadratic(),
            fractions: [0.5, 0.45, 0.05],
            moved: f64::INFINITY,
            state,
        }
    }

    /// Runs a schedule; `None` where the equations break down.
    pub fn run(mut self, frame: &Frame, schedule: &Schedule) -> Option<Self> {
        for step in 0..schedule.annealed {
            let pass = Pass { every: 3, annealed: true, learn: false, inner: 1 };
            let moved = self.pass(frame, &pass)?;
            if step > 3 && moved < 1e-3 && self.tau[0].max(self.tau[1]) < CURVED_BELOW {
                break;
            }
        }
        for step in 0..schedule.sketched {
            let pass = Pass { every: 2, annealed: false, learn: step > 0, inner: 2 };
            let moved = self.pass(frame, &pass)?;
            if step > 1 && moved < SMALL_STEP {
                break;
            }
        }
        // with the bias free, weakly determined directions leave more to the last step
        let small = if frame.inputs.bias_std[2] > 0.0 { 0.03 * SMALL_STEP } else { SMALL_STEP };
        for step in 0..schedule.pixels {
            let pass = Pass { every: 1, annealed: false, learn: true, inner: if step == 0 { 2 } else { 1 } };
            let moved = self.pass(frame, &pass)?;
            self.correlate(frame);
            if moved < small {
                break;
            }
        }
        Some(self)
    }

    fn correlate(&mut self, frame: &Frame) {
        self.correlation = [Part::Cylinder, Part::Cone]
            .map(|part| correlation_factor(frame.readings, &self.sights, &self.labels, part));
    }

    /// The prior of a model with the learned widths.
    pub fn prior(&self, frame: &Frame, model: Model) -> crate::surface_fit::joint::system::Prior {
        prior(model, &self.state, frame.inputs, frame.form, Some(&self.amplitudes))
    }

    /// Posterior by another model's prior.
    pub fn posterior(&self, frame: &Frame, model: Model) -> Option<Posterior> {
        self.quadratic.posterior(&self.state.x, &self.prior(frame, model))
    }

    /// One linearisation with some reweighted solutions; returns by how much the pose moved, in rad and radii.
    fn pass(&mut self, frame: &Frame, pass: &Pass) -> Option<f64> {
        self.state.reference = reference(&self.state, frame.readings);
        let curved = !pass.annealed && self.tau[0].max(self.tau[1]) < CURVED_BELOW;
        let linearised = self.state.clone();
        let predictor = Predictor::new(&linearised, frame.form);
        let patches = frame.readings.patches;
        let asked = |i: usize| {
            patches.list[i].tile.0.is_multiple_of(pass.every) && patches.list[i].tile.1.is_multiple_of(pass.every)
        };
        let n = frame.readings.patches.list.len();
        let before = std::mem::take(&mut self.sights);
        let bend = |i: usize| before.get(i)?.filter(|_| self.moved < SAME_BEND)?.bend;
        self.sights = (0..n).map(|i| asked(i).then(|| predictor.sight(frame.readings, i, curved, bend(i)))?).collect();
        if pass.every == 1 {
            self.relabel(frame, pass);
            pixel_means(frame, &predictor, &self.labels, self.tau, &mut self.sights);
        }
        let mut rows = Rows { tiles: Vec::new(), widths: Vec::new(), values: Vec::new() };
        let mut moved = 0.0;
        for inner in 0..pass.inner {
            if inner > 0 || pass.every > 1 {
                self.relabel(frame, pass);
            }
            if inner == 0 {
                rows = self.rows(&predictor, !pass.annealed);
            }
            self.quadratic = self.accumulate(frame, &rows);
            let amplitudes = (!pass.annealed).then_some(&self.amplitudes);
            let prior = prior(self.model, &self.state, frame.inputs, frame.form, amplitudes);
            let posterior = self.quadratic.posterior(&self.state.x, &prior)?;
            let factor = shortened(&posterior.step, self.state.size());
            self.state.add(&posterior.step, factor);
            self.quadratic.shift(&posterior.step, factor);
            self.bound();
            self.move_residuals(&rows, &posterior.step, factor);
            moved += pose_step(&posterior.step, self.state.size()) * factor;
            if pass.learn {
                let shrinkage = posterior.shrinkage();
                self.amplitudes = self.amplitudes.learned(&self.state, frame.form, &shrinkage, frame.inputs);
            }
            self.settle_tau(frame.readings, pass);
        }
        self.moved = moved;
        Some(moved)
    }

    fn relabel(&mut self, frame: &Frame, pass: &Pass) {
        let model = LabelModel {
            tau: self.tau,
            fractions: self.fractions,
            annealed: pass.annealed,
            deposits: pass.every == 1,
            size: self.state.size(),
        };
        self.labels = label(frame.readings, &self.sights, &model);
        if !pass.annealed {
            self.fractions = self.labels.fractions;
        }
    }

    fn rows(&self, predictor: &Predictor, form: bool) -> Rows {
        const LIKELY: f64 = 1e-4;
        let (mut rows, mut row) = (Rows { tiles: Vec::new(), widths: Vec::new(), values: Vec::new() }, [0.0; SIZE]);
        for (i, sight) in self.sights.iter().enumerate() {
            if let Some(sight) = sight.filter(|_| self.labels.wall[i] > LIKELY) {
                let width = predictor.derivative(&sight, form, &mut row);
                rows.tiles.push(i);
                rows.widths.push(width);
                rows.values.extend_from_slice(&row[..width]);
            }
        }
        rows
    }

    /// The frame's sum of squares; tiles of a part in the same 2 × 2 block count as one, with their mean row.
    fn accumulate(&self, frame: &Frame, rows: &Rows) -> Quadratic {
        let patches = frame.readings.patches;
        let mut blocks = Blocks::new(patches.columns);
        let mut start = 0;
        for (&i, &width) in rows.tiles.iter().zip(&rows.widths) {
            let values = &rows.values[start..start + width];
            start += width;
            let Some(sight) = self.sights[i] else { continue };
            let part = usize::from(sight.at.part == Part::Cone);
            let weight = self.labels.wall[i] / (self.labels.variance[i] * self.correlation[part]);
            if weight > 0.0 {
                blocks.add(patches.list[i].tile, sight.at.part, values, (sight.residual, weight));
            }
        }
        blocks.quadratic()
    }

    fn move_residuals(&mut self, rows: &Rows, step: &[f64; SIZE], factor: f64) {
        let mut start = 0;
        for (&i, &width) in rows.tiles.iter().zip(&rows.widths) {
            let values = &rows.values[start..start + width];
            start += width;
            if let Some(sight) = &mut self.sights[i] {
                let own = own_columns(sight.at.part);
                let common = dot(&values[..COMMON], &step[..COMMON]);
                sight.residual += factor * (common + dot(&values[COMMON..], &step[own..own + width - COMMON]));
            }
        }
    }

    /// Keeps the state where a vessel is.
    fn bound(&mut self) {
        if self.state.has_cone {
            self.state.x[SLOPE] = self.state.x[SLOPE].clamp(0.15, 3.0);
        }
        if self.state.has_cylinder {
            self.state.x[RADIUS] = self.state.x[RADIUS].max(0.01);
        }
    }

    /// Model errors from the residuals that the noise does not explain.
    fn settle_tau(&mut self, readings: &Readings, pass: &Pass) {
        for (p, part) in [Part::Cylinder, Part::Cone].into_iter().enumerate() {
            let (mut sum, mut weights, mut count) = (0.0, 0.0, 0);
            for (i, sight) in self.sights.iter().enumerate() {
                let Some(sight) = sight.filter(|s| s.at.part == part && self.labels.wall[i] > 0.0) else { continue };
                let rate2 = sight.rate * sight.rate;
                let weight = self.labels.wall[i] / (self.labels.variance[i] * rate2).powi(2);
                sum += weight * rate2 * (sight.residual * sight.residual - readings.variance[i]);
                weights += weight;
                count += 1;
            }
            if count < 30 || weights <= 0.0 {
                continue;
            }
            let found = (sum / weights).max(0.0).sqrt().max(TAU_FLOOR);
            let growth = if pass.annealed { 1.0 } else { TAU_GROWTH };
            self.tau[p] = found.clamp(TAU_FALL * self.tau[p], growth * self.tau[p]);
        }
        match (self.state.has_cylinder, self.state.has_cone) {
            (true, true) if pass.annealed => {
                let most = self.tau[0].max(self.tau[1]);
                self.tau = self.tau.map(|tau| tau.max(0.5 * most));
            }
            (true, false) => self.tau[1] = self.tau[0],
            (false, _) => self.tau[0] = self.tau[1],
            _ => {}
        }
    }
}

/// One linearisation.
#[derive(Debug, Clone, Copy)]
struct Pass {
    /// Step between the tiles' columns and rows.
    every: u32,
    annealed: bool,
    learn: bool,
    /// Reweighted solutions.
    inner: usize,
}

/// Factor that keeps a step within what the equations are good for.
fn shortened(step: &[f64; SIZE], size: f64) -> f64 {
    let within = |limit: f64, of: f64| if of.abs() > limit { limit / of.abs() } else { 1.0 };
    let turn = within(0.1, step[0].abs().max(step[1].abs()));
    let shift = within(0.2 * size, step[2].abs().max(step[3].abs()).max(step[RADIUS].abs()));
    turn.min(shift).min(within(0.3, step[SLOPE])).min(within(size, step[INTERCEPT]))
}

/// Size of a step of the pose, rad and radii.
fn pose_step(step: &[f64; SIZE], size: f64) -> f64 {
    step[0].abs().max(step[1].abs()).max(step[2].abs() / size).max(step[3].abs() / size)
}

/// Height at which the cone's offset is its centre, held during a step: the joint, or for a cylinder the lowest tiles.
fn reference(state: &JointState, readings: &Readings) -> f64 {
    match (state.has_cylinder, state.has_cone) {
        (true, true) => state.joint().clamp(0.2, 60.0),
        (false, _) => 0.5 * state.x[INTERCEPT] / state.x[SLOPE].max(0.05),
        (true, false) => {
            let down = state.pose().rotation().row(2).transpose();
            let mut heights: Vec<f64> =
                readings.patches.list.iter().map(|p| state.bias().true_depth(p.measured) * down.dot(&p.q)).collect();
            let at = (0.98 * heights.len() as f64) as usize;
            if at >= heights.len() {
                return 1.0;
            }
            heights.select_nth_unstable_by(at, f64::total_cmp).1.max(0.2)
        }
    }
}
