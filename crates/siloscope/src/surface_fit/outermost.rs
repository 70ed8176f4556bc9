//! The wall is the outermost surface: nothing lies behind it, and feed that sticks to it lies before it.
//!
//! Bands of stuck feed run along the wall and may be more of what is seen than the wall itself. A fit that takes them for
//! wall leaves the wall proper behind itself. From there it is led outwards by an asymmetric loss, as a baseline is led
//! under the peaks of a spectrum: what lies behind pulls twenty times as much as what lies before.

use crate::geometry::evaluator::SurfaceEvaluator;
use crate::surface_fit::solver::{Contact, Equation, Fit, Problem, System, tukey};

/// Thicker than any film, as a share of the silo's size.
const FILM: f64 = 0.1;
/// How far dents and seams put a tile off the ideal wall, metres.
const FORM: f64 = 1.5e-3;
/// What is off by more than so many standard deviations of noise and form is not on the surface.
const SURE: f64 = 3.5;
/// From fewer patches than this, which are no wall, it is led only once.
const FEW: usize = 20;
/// Least share of the wall's patches that lie behind a surface that is not the wall.
const SHARE: f64 = 0.01;
/// Share of them that may be left behind the wall.
const LEFT: f64 = 0.3;
/// How often it is led further from where it came.
const TRIES: usize = 3;
/// What is left of them after a try from which another is not worth it.
const SLOW: f64 = 0.95;
/// Weight of what lies before the surface over that of what lies behind.
const BEFORE: f64 = 0.05;
/// Tolerated angle between normals, radians.
const ANGLE: f64 = 0.15;
/// Misfit of a wall with nothing behind it, metres: only with a larger one may patches of the wall itself lie behind it.
const SMOOTH: f64 = 1e-3;

/// One patch in so many is asked.
const SKETCH: usize = 3;

/// A surface further out, oval where the silo is, if patches lie behind this one and hardly any behind that.
pub fn outermost(problem: &Problem, fit: &Fit, wall: &[bool]) -> Option<Fit> {
    if !sides_tell(problem, fit) {
        return None;
    }
    let on = wall.iter().filter(|wall| **wall).count();
    let now = behind(problem, fit, |i| fit.misfit > SMOOTH || !wall[i]);
    if now < SHARE * on as f64 {
        return None;
    }
    let prior = problem.prior.with_ovality();
    let oval = Problem { prior: &prior, ..*problem };
    let tries = if on < FEW { 1 } else { TRIES };
    let (mut outer, mut before) = (led_outwards(&oval, fit)?, now);
    for _ in 1..tries {
        let left = behind(problem, &outer, |_| true);
        if left < LEFT * now || left > SLOW * before {
            break;
        }
        (outer, before) = (led_outwards(&oval, &outer)?, left);
    }
    (behind(problem, &outer, |_| true) < LEFT * now).then_some(outer)
}

/// Whether it means anything on which side of the surface a patch lies: not of a cloud, nor where neighbouring pixels
/// share their noise, which puts patches behind a wall, too.
fn sides_tell(problem: &Problem, fit: &Fit) -> bool {
    problem.patches.common_noise == 1.0 && fit.inside
}

/// How many patches run along the surface behind it.
fn behind(problem: &Problem, fit: &Fit, asked: impl Fn(usize) -> bool) -> f64 {
    count(problem, fit, asked, |off| off > SURE)
}

/// How many patches run along the surface where their distance behind it, in standard deviations, is as asked for.
fn count(problem: &Problem, fit: &Fit, asked: impl Fn(usize) -> bool, is_there: impl Fn(f64) -> bool) -> f64 {
    let off = |c: &Contact| c.residual / variance(c, fit, FORM).sqrt();
    let some = alongside(problem, fit, |i| i.is_multiple_of(SKETCH) && asked(i));
    (SKETCH * some.filter(|(_, contact)| is_there(off(contact))).count()) as f64
}

/// Variance of a residual by the noise and by a wall's form.
fn variance(contact: &Contact, fit: &Fit, form: f64) -> f64 {
    let form = form / contact.cosine;
    contact.noise(fit) + form * form
}

/// The patches within a film's reach of the surface that are parallel to it.
fn alongside<'a>(
    problem: &'a Problem,
    fit: &'a Fit,
    asked: impl Fn(usize) -> bool + 'a,
) -> impl Iterator<Item = (usize, Contact)> + 'a {
    const PARALLEL: f64 = 0.2;
    let (placed, reach) = (SurfaceEvaluator::new(fit.surface), FILM * fit.surface.size());
    let list = &problem.patches.list;
    (0..list.len()).filter(move |&i| list[i].smooth && asked(i)).filter_map(move |i| {
        let contact = problem.contact(fit, &placed, i)?;
        let near = (contact.residual * contact.cosine).abs() < reach;
        (near && problem.agreement(fit, &placed, &contact, i, ANGLE) > PARALLEL).then_some((i, contact))
    })
}

/// Steps outwards; how far before the surface a patch still counts falls from step to step.
fn led_outwards(problem: &Problem, fit: &Fit) -> Option<Fit> {
    const ROUNDS: usize = 16;
    const START: f64 = 0.01; // as a share of the silo's size
    const NARROWER: f64 = 0.8;
    let mut outer = fit.clone();
    let mut form = (START * fit.surface.size()).max(FORM);
    for _ in 0..ROUNDS {
        let placed = SurfaceEvaluator::new(outer.surface);
        let mut system = System::with_prior(problem.prior, &outer);
        for (i, contact) in alongside(problem, &outer, |i| i.is_multiple_of(SKETCH)) {
            let variance = variance(&contact, &outer, form);
            let off = contact.residual / variance.sqrt();
            let weight = if off > 0.0 { 1.0 / off.max(1.0) } else { BEFORE * tukey(off * off) };
            if weight > 0.0 {
                let equation = problem.stable_equation(&outer, &placed, &contact, i);
                system.add(&Equation { variance, ..equation }, weight);
            }
        }
        outer.apply(&system.solve(&outer)?);
        form = (NARROWER * form).max(FORM);
    }
    outer.misfit = outer.misfit.clamp(FORM, 3.0 * FORM);
    problem.refine(&mut outer, 3, 2, ANGLE);
    Some(outer)
}
