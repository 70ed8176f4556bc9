//! Step 1, first half: pixels to points (Eqs. 1 and 2).

use crate::{Camera, Distortion, Error, Result, Vec3};
use std::ops::Range;

/// Depths as they are stored: floating point in metres, integers in raw units.
#[derive(Debug, Clone, Copy)]
pub enum Depths<'a> {
    /// Metres.
    Single(&'a [f32]),
    /// Metres.
    Double(&'a [f64]),
    /// Raw units.
    Raw(&'a [u16]),
}

impl Depths<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Single(depth) => depth.len(),
            Self::Double(depth) => depth.len(),
            Self::Raw(depth) => depth.len(),
        }
    }
}

/// A stored depth.
trait Depth: Copy {
    /// Depth in metres, or None where nothing was measured: 0, NaN, infinite, negative, and 65535 in raw units.
    fn metres(self, unit: f64) -> Option<f64>;
}

impl Depth for f64 {
    fn metres(self, unit: f64) -> Option<f64> {
        let z = self * unit;
        (z > 0.0 && z < f64::INFINITY).then_some(z)
    }
}

impl Depth for f32 {
    fn metres(self, unit: f64) -> Option<f64> {
        f64::from(self).metres(unit)
    }
}

impl Depth for u16 {
    fn metres(self, unit: f64) -> Option<f64> {
        (self != 0 && self != u16::MAX).then_some(f64::from(self) * unit)
    }
}

/// A depth image with everything that is needed to place its pixels in space.
#[derive(Debug, Clone, Copy)]
pub struct DepthImage<'a> {
    depth: Depths<'a>,
    camera: &'a Camera,
    rays: Option<&'a [[f64; 2]]>,
    unit: f64,
    mask: Option<&'a [bool]>,
}

impl<'a> DepthImage<'a> {
    /// Depth row by row, in units of `unit` metres.
    ///
    /// Only pixels whose `mask` is true are used. `rays` are `camera.rays()`, needed where the lens distorts: they
    /// are the camera's and not the frame's, so the caller keeps them.
    pub fn new(
        depth: Depths<'a>,
        camera: &'a Camera,
        rays: Option<&'a [[f64; 2]]>,
        unit: f64,
        mask: Option<&'a [bool]>,
    ) -> Result<Self> {
        camera.validate()?;
        if !(unit.is_finite() && unit > 0.0) {
            return Err(Error::Setting { name: "depth_unit", bounds: "a positive number of metres", value: unit });
        }
        let expected = camera.width * camera.height;
        for (what, got) in
            [("depth", Some(depth.len())), ("rays", rays.map(<[_]>::len)), ("mask", mask.map(<[_]>::len))]
        {
            match got {
                Some(got) if got != expected => return Err(Error::Shape { what, got, expected }),
                _ => (),
            }
        }
        if rays.is_none() && camera.distortion != Distortion::None {
            return Err(Error::Shape { what: "rays", got: 0, expected });
        }
        Ok(Self { depth, camera, rays, unit, mask })
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.camera.height
    }

    /// Points of a range of rows, pixel by pixel (Eqs. 1 and 2).
    pub fn for_each_point(&self, rows: Range<usize>, use_point: impl FnMut(usize, Vec3)) {
        match self.depth {
            Depths::Single(depth) => self.points_of(depth, rows, use_point),
            Depths::Double(depth) => self.points_of(depth, rows, use_point),
            Depths::Raw(depth) => self.points_of(depth, rows, use_point),
        }
    }

    fn points_of<T: Depth>(&self, depth: &[T], rows: Range<usize>, mut use_point: impl FnMut(usize, Vec3)) {
        let (camera, width) = (self.camera, self.camera.width);
        let columns: Vec<f64> = (0..width).map(|u| (u as f64 - camera.cx) / camera.fx).collect();
        for v in rows {
            let y = (v as f64 - camera.cy) / camera.fy;
            let pixels = v * width..(v + 1) * width;
            for ((i, depth), x) in pixels.clone().zip(&depth[pixels]).zip(&columns) {
                let Some(z) = depth.metres(self.unit).filter(|_| self.mask.is_none_or(|mask| mask[i])) else {
                    continue;
                };
                let [x, y] = self.rays.map_or([*x, y], |rays| rays[i]);
                use_point(i, Vec3::new(x * z, y * z, z));
            }
        }
    }
}

/// Points of all pixels with a measurement, and the pixels' indices, row by row (Eqs. 1 and 2).
pub fn back_project(image: &DepthImage) -> (Vec<usize>, Vec<Vec3>) {
    let (mut pixels, mut points) = (Vec::new(), Vec::new());
    image.for_each_point(0..image.rows(), |pixel, point| {
        pixels.push(pixel);
        points.push(point);
    });
    (pixels, points)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera { width: 4, height: 3, fx: 2.0, fy: 4.0, cx: 1.5, cy: 1.0, distortion: Distortion::None }
    }

    #[test]
    fn points_follow_equations_1_and_2() -> Result<()> {
        let depth: Vec<u16> = vec![0, 1000, 65535, 0, 0, 0, 0, 2000, 0, 0, 0, 0];
        let (pixels, points) = back_project(&DepthImage::new(Depths::Raw(&depth), &camera(), None, 1e-3, None)?);
        assert_eq!(pixels, [1, 7]);
        assert_eq!(points, [Vec3::new(-0.25, -0.25, 1.0), Vec3::new(1.5, 0.0, 2.0)]);
        Ok(())
    }

    #[test]
    fn rays_and_the_pinhole_agree_where_nothing_distorts() -> Result<()> {
        let depth: Vec<f32> = (0..12).map(|i| i as f32).collect();
        let (camera, rays) = (camera(), camera().rays());
        let direct = back_project(&DepthImage::new(Depths::Single(&depth), &camera, None, 1.0, None)?);
        assert_eq!(back_project(&DepthImage::new(Depths::Single(&depth), &camera, Some(&rays), 1.0, None)?), direct);
        Ok(())
    }

    #[test]
    fn no_measurement_gives_no_point() -> Result<()> {
        let depth = [0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, -0.0];
        let mask: Vec<bool> = (0..12).map(|i| i != 6).collect();
        let (pixels, _) = back_project(&DepthImage::new(Depths::Double(&depth), &camera(), None, 1.0, Some(&mask))?);
        assert_eq!(pixels, [5, 7]);
        Ok(())
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        let camera = camera();
        assert!(matches!(
            DepthImage::new(Depths::Double(&[1.0; 11]), &camera, None, 1.0, None),
            Err(Error::Shape { what: "depth", got: 11, expected: 12 })
        ));
        assert!(DepthImage::new(Depths::Double(&[1.0; 12]), &camera, None, 0.0, None).is_err());
        assert!(DepthImage::new(Depths::Double(&[1.0; 12]), &camera, None, 1.0, Some(&[true])).is_err());
    }
}
