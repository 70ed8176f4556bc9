//! One height scale for the forms of all frames.
//!
//! A frame scales its wall's form to the height that it has in view. The same wall in another scale is P_k of an affine
//! argument: a linear map of the coefficients. What it has of the orders that are no form goes where these belong:
//! rings of degree 0 are the radius, bends of degree 0 and 1 the axis.

use crate::geometry::surface::Part;
use crate::surface_fit::joint::form::terms;
use crate::surface_fit::joint::parameters::{CYLINDER_FORM, JointState, OBLIQUITY, OFFSET, RADIUS, SIZE};
use nalgebra::DMatrix;

/// Heights to which the common answer's form and cone are told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heights {
    /// Where the cylinder's form ends, metres.
    pub form: f64,
    /// Where the cone's offset is its centre, metres.
    pub cone: f64,
}

impl Heights {
    /// Those of a frame.
    pub fn of(state: &JointState) -> Self {
        Self { form: state.reference, cone: state.reference }
    }
}

/// Heights that differ by less than this are the same, relative.
const SAME: f64 = 1e-9;

/// The parameters of a state told to its `own` heights by those told to the `common` ones: x_own = M x_common. `None`
/// where M is the identity.
pub fn by_common(state: &JointState, own: &Heights, common: &Heights) -> Option<DMatrix<f64>> {
    let form = state.has_cylinder && (own.form / common.form - 1.0).abs() > SAME;
    let cone = state.has_cone && (own.cone / common.cone - 1.0).abs() > SAME;
    if !form && !cone {
        return None;
    }
    let mut map = DMatrix::identity(SIZE, SIZE);
    if cone {
        (0..2).for_each(|k| map[(OFFSET + k, OBLIQUITY + k)] = own.cone - common.cone);
    }
    if form {
        rescale(&mut map, state, (own.form, common.form));
    }
    Some(map)
}

fn rescale(map: &mut DMatrix<f64>, state: &JointState, (own, common): (f64, f64)) {
    let list = terms(Part::Cylinder);
    let by_degree = polynomials(own / common);
    for (from, term) in list.iter().enumerate() {
        let column = CYLINDER_FORM + from;
        map[(column, column)] = 0.0;
        for (degree, value) in by_degree[term.degree].iter().enumerate() {
            let same = |t: &crate::surface_fit::joint::form::Term| {
                (t.order, t.sine, t.degree) == (term.order, term.sine, degree)
            };
            match list.iter().position(same) {
                Some(to) => map[(CYLINDER_FORM + to, column)] = *value,
                None => lowest(map, (term.order, term.sine, degree), column, *value, (state.x[1], own)),
            }
        }
    }
}

/// Radius and axis by a term that is no form: a bend of degree 1 is a·(2z/z_b − 1).
fn lowest(
    map: &mut DMatrix<f64>,
    (order, sine, degree): (usize, bool, usize),
    column: usize,
    value: f64,
    (r_y, height): (f64, f64),
) {
    let shift = if sine { 3 } else { 2 };
    match (order, degree) {
        (0, 0) => map[(RADIUS, column)] += value,
        (1, 0) => map[(shift, column)] -= value,
        (1, 1) => {
            map[(shift, column)] += value;
            let per_height = 2.0 * value / height;
            if sine {
                map[(0, column)] += per_height / r_y.cos();
            } else {
                map[(1, column)] -= per_height;
            }
        }
        _ => {}
    }
}

const DEGREES: usize = 9;

/// P_k(ρ t + ρ − 1) as sums of P_j(t), for k up to 8.
fn polynomials(ratio: f64) -> [[f64; DEGREES]; DEGREES] {
    let mut p = [[0.0; DEGREES]; DEGREES];
    p[0][0] = 1.0;
    for k in 0..DEGREES - 1 {
        let times = times_argument(&p[k], ratio);
        let n = k as f64;
        let before = if k > 0 { p[k - 1] } else { [0.0; DEGREES] };
        for j in 0..DEGREES {
            p[k + 1][j] = ((2.0 * n + 1.0) * times[j] - n * before[j]) / (n + 1.0);
        }
    }
    p
}

/// (ρ t + ρ − 1) times a sum of P_j(t).
fn times_argument(sum: &[f64; DEGREES], ratio: f64) -> [f64; DEGREES] {
    let mut product = sum.map(|v| v * (ratio - 1.0));
    for (j, value) in sum.iter().enumerate() {
        let n = j as f64;
        if j + 1 < DEGREES {
            product[j + 1] += ratio * value * (n + 1.0) / (2.0 * n + 1.0);
        }
        if j > 0 {
            product[j - 1] += ratio * value * n / (2.0 * n + 1.0);
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface_fit::joint::form::Form;
    use crate::surface_fit::joint::parameters::{CYLINDER_END, INTERCEPT, SLOPE};
    use crate::surface_fit::joint::predict::Predictor;
    use nalgebra::DVector;

    /// A wall with a form of some tenths of a millimetre, told to the height of the whole cylinder.
    fn common() -> JointState {
        let mut x = [0.0; SIZE];
        x[..4].copy_from_slice(&[0.05, -0.04, 0.3, -0.2]);
        (x[RADIUS], x[SLOPE], x[INTERCEPT]) = (1.25, 0.8, 4.0);
        x[OFFSET..OFFSET + 4].copy_from_slice(&[0.01, -0.02, 0.1, 0.07]);
        (CYLINDER_FORM..CYLINDER_END).for_each(|k| x[k] = 2e-4 * (k as f64).sin());
        JointState { x, has_cylinder: true, has_cone: true, reference: 3.4 }
    }

    #[test]
    fn a_form_told_to_another_height_is_the_same_wall() {
        let common = common();
        let mut frame = JointState { reference: 2.3, ..common.clone() };
        let [own, all] = [2.3, 3.4].map(|height| Heights { form: height, cone: height });
        let map = by_common(&frame, &own, &all).expect("the heights differ");
        let told = map * DVector::from_row_slice(&common.x);
        frame.x.copy_from_slice(told.as_slice());
        let form = Form::default();
        let depth = |state: &JointState, ray: [f64; 2]| {
            let predictor = Predictor::new(state, &form);
            let at = predictor.caster.turn(ray);
            let (d, part) = predictor.caster.depth(&at, [0.0; 2]);
            if part == Part::Cone {
                return 0.0;
            }
            let place = predictor.caster.incidence(&at, d, part);
            let basis_height = 2.0 * place.z / state.reference - 1.0;
            let mut basis = [0.0; CYLINDER_END - CYLINDER_FORM];
            form.evaluate(Part::Cylinder, basis_height, place.radial, &mut basis);
            let bulge = basis.iter().zip(&state.x[CYLINDER_FORM..]).map(|(b, c)| b * c).sum();
            predictor.caster.part_depth(&at, Part::Cylinder, bulge)
        };
        for k in 0..40 {
            let ray = [(k as f64).cos(), (k as f64 * 1.7).sin()];
            let (one, other) = (depth(&common, ray), depth(&frame, ray));
            assert!((one - other).abs() < 4e-6, "{ray:?}: {one} {other}");
        }
    }

    #[test]
    fn the_same_heights_change_nothing() {
        let heights = Heights { form: 3.4, cone: 3.4 };
        assert!(by_common(&common(), &heights, &heights).is_none());
    }
}
