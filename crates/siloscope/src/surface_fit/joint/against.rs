//! A frame's tiles against a wall that other frames have told: what a held-out frame is judged by.

use crate::geometry::depth_image::DepthImage;
use crate::surface_fit::joint::form::Form;
use crate::surface_fit::joint::parameters::{COMMON, JointState, SIZE};
use crate::surface_fit::joint::predict::{Predictor, Sight, own_columns};
use crate::surface_fit::joint::readings::Readings;
use crate::surface_fit::outcome::Knowledge;
use crate::surface_fit::{noise, tiles::tile_patches};

/// A smooth tile whose ray meets the wall.
#[derive(Debug, Clone)]
pub struct TileAgainstWall {
    /// Its number among the frame's tiles.
    pub number: usize,
    /// Its column and row in the grid of tiles.
    pub place: (u32, u32),
    /// The wall there, and the residual.
    pub sight: Sight,
    /// Variance of the tile's mean by the sensor's noise, m².
    pub variance: f64,
    /// Derivative of the residual by all parameters.
    pub row: [f64; SIZE],
}

/// The tiles of an image against the wall of a state; nothing is fitted, and no tile is judged to be wall.
///
/// Left out are tiles that are not smooth, or over which the wall is no quadratic.
pub fn tiles_against(image: &DepthImage, know: &Knowledge, state: &JointState) -> Vec<TileAgainstWall> {
    let mut patches = tile_patches(image, know.error.noise.as_ref());
    patches.unbias_normals(&know.error.bias);
    let law = noise(&patches, know);
    let readings = Readings::new(&patches, &law, &know.error.bias, image.pixel_size());
    let form = Form::default();
    let predictor = Predictor::new(state, &form);
    let against = |number: usize| {
        let sight = predictor.sight(&readings, number, true, None)?;
        let (patch, variance) = (patches.list.get(number)?, readings.variance.get(number)?);
        let row = full_row(&predictor, &sight);
        let even = sight.bend.is_none_or(|bend| bend.even);
        (patch.smooth && even).then_some(TileAgainstWall { number, place: patch.tile, sight, variance: *variance, row })
    };
    (0..patches.list.len()).filter_map(against).collect()
}

/// What the pixels of an image would read of the wall of a state, row by row, metres; NaN where no ray meets it.
pub fn readings_of(image: &DepthImage, state: &JointState) -> Vec<f64> {
    let form = Form::default();
    let predictor = Predictor::new(state, &form);
    (0..image.width * image.height).map(|i| predictor.reading(image.ray(i)).unwrap_or(f64::NAN)).collect()
}

/// The derivative of a tile's residual in the order of all parameters.
fn full_row(predictor: &Predictor, sight: &Sight) -> [f64; SIZE] {
    let (mut compact, mut row) = ([0.0; SIZE], [0.0; SIZE]);
    let width = predictor.derivative(sight, true, &mut compact);
    let own = own_columns(sight.at.part);
    row[..COMMON].copy_from_slice(&compact[..COMMON]);
    row[own..own + width - COMMON].copy_from_slice(&compact[COMMON..width]);
    row
}
