//! From start values to a fit on patches that stands up to the evidence.

use crate::base::refusal::Refusal;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::sensor::{DepthBias, NoiseLaw};
use crate::geometry::surface::{FEED_SLOPE, Part, SurfaceTolerance};
use crate::geometry::view::View;
use crate::surface_fit::diagnostics::{WallEvidence, wall_evidence};
use crate::surface_fit::likelihood::{likelihood, may_be_feed};
use crate::surface_fit::outermost::outermost;
use crate::surface_fit::profile_parts::{Oriented, other_part, steeper_cone};
use crate::surface_fit::proposals::{Start, starts};
use crate::surface_fit::solver::{Fit, Prior, Problem};
use crate::surface_fit::taper::cone_instead;
use crate::surface_fit::tiles::{NONE, Patches};

/// A fit on patches that stands up to the evidence.
#[derive(Debug, Clone)]
pub struct Settled {
    /// The fit.
    pub fit: Fit,
    /// Which patches are wall.
    pub wall: Vec<bool>,
    /// What they look like.
    pub evidence: WallEvidence,
    /// The part of which there are hardly any: it is left out once it has told what it can.
    pub bare: Option<Part>,
}

/// Refines every start value on a few patches; the likeliest that stands up to the evidence is refined on more.
///
/// The depth scale stays fixed here: it trades against the silo's size along a curve on which Gauss–Newton steps crawl.
/// A known radius then moves the answer along that curve exactly.
pub fn coarse_fit(
    patches: &mut Patches,
    noise: NoiseLaw,
    prior: &Prior,
    pixel: f64,
) -> (Result<Settled, Refusal>, Vec<Fit>) {
    let free_size = with_free_size(prior);
    if patches.cloud {
        let found = candidates(&Problem { patches, noise, prior: &free_size, pixel }, View::Either);
        return (best_settled(patches, noise, (&free_size, pixel), found), Vec::new());
    }
    let mut from_inside = candidates(&Problem { patches, noise, prior: &free_size, pixel }, View::Inside);
    from_inside.sort_by(|a, b| b.0.total_cmp(&a.0));
    let proposals = from_inside.iter().map(|(_, fit)| fit.clone()).collect();
    let found = best_settled(patches, noise, (&free_size, pixel), from_inside).or_else(|refusal| {
        let from_outside = candidates(&Problem { patches, noise, prior: &free_size, pixel }, View::Outside);
        best_settled(patches, noise, (&free_size, pixel), from_outside).map_err(|_| refusal)
    });
    (found, proposals)
}

/// The prior without a known radius, where the depth scale is not known either.
pub(crate) fn with_free_size(prior: &Prior) -> Prior {
    Prior { radius: prior.radius.filter(|_| prior.bias_std[1] == 0.0), ..prior.clone() }
}

/// Least share of the patches that must be wall where something likelier was refused: less is found in almost anything.
const LEAST_AFTER_ALL: f64 = 0.05;

/// The likeliest candidate that stands up to the evidence, or why the likeliest does not.
fn best_settled(
    patches: &mut Patches,
    noise: NoiseLaw,
    (prior, pixel): (&Prior, f64),
    mut candidates: Vec<(f64, Fit)>,
) -> Result<Settled, Refusal> {
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut refusal = Refusal::NoWall;
    for (rank, (_, mut fit)) in candidates.into_iter().take(4).enumerate() {
        Problem { patches, noise, prior, pixel }.refine(&mut fit, 3, 4, 0.2);
        if prior.bias_std[2] > 0.0 {
            patches.unbias_normals(&fit.bias);
        }
        match settled(&Problem { patches, noise, prior, pixel }, fit) {
            Ok(found) if rank == 0 || found.evidence.share > LEAST_AFTER_ALL => return Ok(found),
            Err(why) if rank == 0 => refusal = why,
            _ => {}
        }
    }
    Err(refusal)
}

/// Start values after a few steps, each with its likelihood.
fn candidates(problem: &Problem, view: View) -> Vec<(f64, Fit)> {
    let found = starts(&oriented(problem, &problem.prior.bias), view);
    let bar = 0.4 * found.first().map_or(0.0, |best| best.score);
    let mut refined: Vec<(f64, Fit)> = Vec::new();
    for start in found.iter().take_while(|start| start.score >= bar) {
        if refined.len() == 4 {
            break;
        }
        if refined.iter().any(|(_, fit)| is_near(start, fit)) {
            continue;
        }
        let mut fit = Fit {
            surface: start.surface,
            bias: problem.prior.bias,
            inside: start.inside,
            misfit: 0.03 * start.surface.size(),
            weights: vec![0.0; problem.patches.list.len()],
        };
        problem.refine(&mut fit, 4, 8, 0.25);
        refined.push((likelihood(problem, &fit, 1), fit));
    }
    refined
}

/// Whether a start value differs from a refined one by less than start values err: it would lead to the same answer.
fn is_near(start: &Start, fit: &Fit) -> bool {
    const ERROR: SurfaceTolerance = SurfaceTolerance { tilt: 0.06, shift: 0.15, radius: 0.1, slope: 0.15, apex: 0.3 };
    start.inside == fit.inside && start.surface.is_near(&fit.surface, &ERROR)
}

/// Refines a candidate on more patches and holds it against the evidence.
pub(crate) fn settled(problem: &Problem, mut fit: Fit) -> Result<Settled, Refusal> {
    if fit.surface.cone.is_none() != fit.surface.radius.is_none() && fit.inside {
        fit = with_other_part(problem, fit);
    }
    problem.refine(&mut fit, 3, 3, 0.15);
    if may_be_feed(problem, &fit) {
        fit = without_feed(problem, fit)?;
    }
    let mut wall = wall_patches(problem, &fit);
    if let Some(outer) = outermost(problem, &fit, &wall) {
        wall = wall_patches(problem, &outer);
        fit = outer;
    }
    if let Some(cone) = cone_instead(problem, &fit, &wall) {
        wall = wall_patches(problem, &cone);
        fit = cone;
    }
    let evidence = wall_evidence(problem.patches, &fit, &SurfaceEvaluator::new(fit.surface), &wall);
    judge(&evidence, fit.inside, problem.patches.cloud)?;
    let bare = bare_part(problem, &fit, &wall);
    Ok(Settled { fit, wall, evidence, bare })
}

/// The fit with a steeper cone about the same axis in place of one that may be feed, or else without a cone.
fn without_feed(problem: &Problem, fit: Fit) -> Result<Fit, Refusal> {
    if let Some(surface) = steeper_cone(&fit.surface, FEED_SLOPE, &oriented(problem, &fit.bias)) {
        let mut steeper = Fit { surface, misfit: 0.01 * surface.size(), ..fit.clone() };
        problem.refine(&mut steeper, 6, 3, 0.2);
        problem.refine(&mut steeper, 3, 2, 0.15);
        if steeper.surface.cone.is_some() && !may_be_feed(problem, &steeper) {
            return Ok(steeper);
        }
    }
    if fit.surface.radius.is_none() {
        return Err(Refusal::ConeMayBeFeed);
    }
    let mut alone = fit;
    alone.surface.cone = None;
    problem.refine(&mut alone, 3, 2, 0.15);
    Ok(alone)
}

/// Least share of an image that a body fills that is looked at from outside.
const BODY_SHARE: f64 = 0.2;

/// What has to hold on a wall of revolution.
///
/// Tiles of an image measure it to a hundredth; the normals of a cloud come from few points, and both bend and turn less
/// than their surface.
pub(crate) fn judge(e: &WallEvidence, inside: bool, cloud: bool) -> Result<(), Refusal> {
    let too_small = !inside && !cloud && e.share < BODY_SHARE; // a pipe or an auger in view, not what one looks at
    if e.patches < 20 || e.arc < 0.5 || too_small {
        return Err(Refusal::NoWall);
    }
    let [turn, bend] = match (cloud, inside) {
        (true, true) => [0.2, 0.12],
        (true, false) => [0.2, 0.08],
        (false, _) => [0.06, 0.05],
    };
    let turns = (e.turn - 1.0).abs() < turn + 3.0 * e.turn_std.min(0.03);
    if !turns {
        return Err(Refusal::Flat);
    }
    let straight = e.bend.abs() < bend + 3.0 * e.bend_std.min(0.02);
    if !straight {
        return Err(Refusal::Bent);
    }
    if e.behind + e.behind_cone > 0.05 {
        return Err(Refusal::BehindWall);
    }
    Ok(())
}

/// Looks again for the part that is missing, now that the axis and the depth bias are known better.
fn with_other_part(problem: &Problem, fit: Fit) -> Fit {
    let before = likelihood(problem, &fit, 1);
    let Some(surface) = other_part(&fit.surface, &oriented(problem, &fit.bias)) else { return fit };
    let mut both = Fit { surface, misfit: 0.01 * surface.size(), ..fit.clone() };
    problem.refine(&mut both, 4, 3, 0.2);
    if likelihood(problem, &both, 1) > before { both } else { fit }
}

pub(crate) fn oriented(problem: &Problem, bias: &DepthBias) -> Vec<Oriented> {
    let usable = problem.patches.list.iter().filter(|p| p.smooth && p.sigma_normal < 0.3);
    usable
        .map(|p| {
            let d = if problem.patches.cloud { 0.0 } else { bias.true_depth(p.measured) };
            Oriented {
                p: p.at(d),
                n: p.normal,
                signed: !problem.patches.cloud,
                angle: 0.2 + 3.0 * p.sigma_normal,
                slack: 2.0 * p.scatter / p.count.sqrt(),
            }
        })
        .filter(|o| o.p.x.is_finite() && o.p.z.is_finite())
        .collect()
}

/// The part of which hardly any wall patch is left, so that its parameters would be undetermined.
fn bare_part(problem: &Problem, fit: &Fit, wall: &[bool]) -> Option<Part> {
    const ENOUGH: usize = 12;
    let placed = SurfaceEvaluator::new(fit.surface);
    let (mut cylinder, mut cone) = (0, 0);
    for contact in (0..wall.len()).filter(|&i| wall[i]).filter_map(|i| problem.contact(fit, &placed, i)) {
        *(if contact.part == Part::Cylinder { &mut cylinder } else { &mut cone }) += 1;
        if cylinder.min(cone) >= ENOUGH {
            return None;
        }
    }
    match (cylinder >= ENOUGH, cone >= ENOUGH) {
        (true, false) => Some(Part::Cone),
        (false, true) => Some(Part::Cylinder),
        _ => None,
    }
}

/// Patches that agree with the wall and whose neighbours do too: the seam with feed or clutter is left out.
fn wall_patches(problem: &Problem, fit: &Fit) -> Vec<bool> {
    let placed = SurfaceEvaluator::new(fit.surface);
    let agrees: Vec<bool> = (0..problem.patches.list.len())
        .map(|i| problem.contact(fit, &placed, i).is_some_and(|c| problem.weight(fit, &placed, &c, i, 0.15) > 0.2))
        .collect();
    if problem.patches.cloud {
        return agrees;
    }
    let seam = |i: usize| {
        let near = &problem.patches.neighbours[i];
        let foreign = near.iter().filter(|&&n| n != NONE && !agrees[n as usize]);
        foreign.count() > 1
    };
    (0..agrees.len()).map(|i| agrees[i] && !seam(i)).collect()
}
