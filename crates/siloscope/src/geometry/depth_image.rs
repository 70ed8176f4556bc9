//! A depth image with the rays of its pixels, and its points (step 1, Eqs. 1 and 2).

use crate::stats::voxel_grid::PointSource;
use crate::{Camera, Distortion, Error, Result, Vec3};
use std::ops::Range;

/// A stored depth: metres as floating-point numbers, raw units as integers.
pub trait Depth: Copy + Sync {
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

/// Rays `(x/z, y/z)` of a depth image's pixels.
#[derive(Debug, Clone, Copy)]
enum Rays<'a> {
    /// Those of a camera without distortion.
    Pinhole(&'a Camera),
    /// One ray a pixel, row by row.
    Each(&'a [[f64; 2]]),
}

/// A depth image with the rays of its pixels; depths that are not positive or not finite are missing.
#[derive(Debug, Clone, Copy)]
pub struct DepthImage<'a, T = f32> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Depths row by row, in metres but for `with_unit`.
    pub depth: &'a [T],
    rays: Rays<'a>,
    unit: f64,
    mask: Option<&'a [bool]>,
}

impl<'a, T> DepthImage<'a, T> {
    /// The image of a camera, depths in metres.
    ///
    /// `rays` are `camera.rays()`, needed where the lens distorts: they are the camera's and not the frame's, so the
    /// caller keeps them.
    pub fn new(depth: &'a [T], camera: &'a Camera, rays: Option<&'a [[f64; 2]]>) -> Result<Self> {
        camera.validate()?;
        let (width, height) = (camera.width, camera.height);
        let rays = match rays {
            Some(rays) => return Self::with_rays(depth, rays, width, height),
            None if camera.distortion == Distortion::None => Rays::Pinhole(camera),
            None => return Err(Error::Shape { what: "rays", got: 0, expected: width * height }),
        };
        same_size("depth", depth.len(), width * height)?;
        Ok(Self { width, height, depth, rays, unit: 1.0, mask: None })
    }

    /// The image of a camera of which only the rays are known.
    pub fn with_rays(depth: &'a [T], rays: &'a [[f64; 2]], width: usize, height: usize) -> Result<Self> {
        same_size("depth", depth.len(), width * height)?;
        same_size("rays", rays.len(), width * height)?;
        Ok(Self { width, height, depth, rays: Rays::Each(rays), unit: 1.0, mask: None })
    }

    /// The same with depths in units of `unit` metres.
    pub fn with_unit(self, unit: f64) -> Result<Self> {
        match unit.is_finite() && unit > 0.0 {
            true => Ok(Self { unit, ..self }),
            false => Err(Error::Setting { name: "depth_unit", bounds: "a positive number of metres", value: unit }),
        }
    }

    /// The same without the pixels whose `mask` is false.
    pub fn with_mask(self, mask: &'a [bool]) -> Result<Self> {
        same_size("mask", mask.len(), self.depth.len())?;
        Ok(Self { mask: Some(mask), ..self })
    }

    /// Ray `(x/z, y/z)` of a pixel.
    #[inline(always)]
    pub fn ray(&self, pixel: usize) -> [f64; 2] {
        match self.rays {
            Rays::Each(rays) => rays[pixel],
            Rays::Pinhole(camera) => camera.ray((pixel % self.width) as f64, (pixel / self.width) as f64),
        }
    }

    /// Rays of a row's pixels, where each pixel has one of its own; None where `axes` describe them.
    pub fn rays_of_row(&self, row: usize) -> Option<&'a [[f64; 2]]> {
        let Rays::Each(rays) = self.rays else { return None };
        rays.get(row * self.width..(row + 1) * self.width)
    }

    /// One x/z a column and one y/z a row, where that describes all rays: no lens distortion.
    pub fn axes(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let Rays::Pinhole(camera) = self.rays else { return None };
        let columns = (0..self.width).map(|u| (u as f64 - camera.cx) / camera.fx).collect();
        Some((columns, (0..self.height).map(|v| (v as f64 - camera.cy) / camera.fy).collect()))
    }

    /// Width of a pixel at depth 1, averaged over the first row.
    pub fn pixel_size(&self) -> f64 {
        let (first, last) = (self.ray(0), self.ray(self.width - 1));
        (last[0] - first[0]).abs() / (self.width - 1).max(1) as f64
    }
}

impl<T: Depth> DepthImage<'_, T> {
    /// Points of a range of rows, pixel by pixel (Eqs. 1 and 2).
    pub fn for_each_point(&self, rows: Range<usize>, mut use_point: impl FnMut(usize, Vec3)) {
        let axes = self.axes();
        for v in rows {
            let pixels = v * self.width..(v + 1) * self.width;
            let measured = self.depth[pixels.clone()].iter().zip(pixels).enumerate().filter_map(|(u, (depth, i))| {
                let z = depth.metres(self.unit).filter(|_| self.mask.is_none_or(|mask| mask[i]))?;
                Some((u, i, z))
            });
            match &axes {
                Some((columns, rows)) => {
                    let (columns, y) = (&columns[..self.width], rows[v]);
                    measured.for_each(|(u, i, z)| use_point(i, Vec3::new(columns[u] * z, y * z, z)));
                }
                None => measured.for_each(|(_, i, z)| {
                    let [x, y] = self.ray(i);
                    use_point(i, Vec3::new(x * z, y * z, z));
                }),
            }
        }
    }
}

impl<T: Depth> PointSource for DepthImage<'_, T> {
    /// Rows.
    fn parts(&self) -> usize {
        self.height
    }

    fn visit(&self, rows: Range<usize>, mut use_point: impl FnMut(&Vec3)) {
        self.for_each_point(rows, |_, point| use_point(&point));
    }
}

impl DepthImage<'_> {
    /// Depths of up to N pixels from `start` on, 0 beyond `side`.
    #[inline(always)]
    pub(crate) fn row<const N: usize>(&self, start: usize, side: usize) -> [f32; N] {
        let depths = &self.depth[start..start + side];
        let mut row = [0.0; N];
        if let Some(whole) = depths.first_chunk::<N>() {
            row = *whole;
        } else {
            row.iter_mut().zip(depths).for_each(|(to, &from)| *to = from);
        }
        row
    }
}

fn same_size(what: &'static str, got: usize, expected: usize) -> Result<()> {
    if got == expected { Ok(()) } else { Err(Error::Shape { what, got, expected }) }
}

/// Points of all pixels with a measurement, and the pixels' indices, row by row (Eqs. 1 and 2).
pub fn back_project<T: Depth>(image: &DepthImage<T>) -> (Vec<usize>, Vec<Vec3>) {
    let (mut pixels, mut points) = (Vec::new(), Vec::new());
    image.for_each_point(0..image.height, |pixel, point| {
        pixels.push(pixel);
        points.push(point);
    });
    (pixels, points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::workers::Workers;
    use crate::stats::voxel_grid::voxel_grid;

    fn camera() -> Camera {
        Camera { width: 4, height: 3, fx: 2.0, fy: 4.0, cx: 1.5, cy: 1.0, distortion: Distortion::None }
    }

    #[test]
    fn points_follow_equations_1_and_2() -> Result<()> {
        let depth: Vec<u16> = vec![0, 1000, 65535, 0, 0, 0, 0, 2000, 0, 0, 0, 0];
        let (pixels, points) = back_project(&DepthImage::new(&depth, &camera(), None)?.with_unit(1e-3)?);
        assert_eq!(pixels, [1, 7]);
        assert_eq!(points, [Vec3::new(-0.25, -0.25, 1.0), Vec3::new(1.5, 0.0, 2.0)]);
        Ok(())
    }

    #[test]
    fn rays_and_the_pinhole_agree_where_nothing_distorts() -> Result<()> {
        let depth: Vec<f32> = (0..12).map(|i| i as f32).collect();
        let (camera, rays) = (camera(), camera().rays());
        let direct = back_project(&DepthImage::new(&depth, &camera, None)?);
        assert_eq!(back_project(&DepthImage::new(&depth, &camera, Some(&rays))?), direct);
        Ok(())
    }

    #[test]
    fn no_measurement_gives_no_point() -> Result<()> {
        let depth = [0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, -0.0];
        let mask: Vec<bool> = (0..12).map(|i| i != 6).collect();
        let (pixels, _) = back_project(&DepthImage::new(&depth, &camera(), None)?.with_mask(&mask)?);
        assert_eq!(pixels, [5, 7]);
        Ok(())
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        let camera = camera();
        assert!(matches!(
            DepthImage::new(&[1.0; 11], &camera, None),
            Err(Error::Shape { what: "depth", got: 11, expected: 12 })
        ));
        assert!(DepthImage::new(&[1.0; 12], &camera, Some(&[[0.0; 2]])).is_err());
        let distorted = Camera { distortion: Distortion::Rational([0.0; 8]), ..camera.clone() };
        assert!(matches!(DepthImage::new(&[1.0; 12], &distorted, None), Err(Error::Shape { what: "rays", .. })));
        let image = DepthImage::new(&[1.0; 12], &camera, None);
        assert!(image.clone().and_then(|image| image.with_unit(0.0)).is_err());
        assert!(image.and_then(|image| image.with_mask(&[true])).is_err());
    }

    #[test]
    fn an_image_and_its_points_give_the_same_cloud() -> Result<()> {
        let camera =
            Camera { width: 40, height: 30, fx: 30.0, fy: 30.0, cx: 20.0, cy: 15.0, distortion: Distortion::None };
        let depth: Vec<f64> = (0..1200).map(|i| 1.0 + f64::from(i % 7) * 0.1).collect();
        let image = DepthImage::new(&depth, &camera, None)?;
        let (_, points) = back_project(&image);
        let workers = Workers::new(2);
        assert_eq!(voxel_grid(&image, 0.05, &workers)?, voxel_grid(points.as_slice(), 0.05, &workers)?);
        Ok(())
    }
}
