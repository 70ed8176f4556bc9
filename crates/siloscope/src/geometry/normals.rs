//! Step 2, first half: normals after Hoppe et al. (1992).

use crate::Vec3;
use crate::base::workers::Workers;
use crate::stats::eigen;
use crate::stats::neighbours::Neighbours;
use nalgebra::Matrix3;

/// Unit normal of every point, turned towards the camera at the origin.
///
/// The smallest eigenvector of M = 1/k Σ (p_i − p)(p_i − p)ᵀ over the k neighbours, about the point itself as the
/// paper prints it.
pub fn normals(points: &[Vec3], neighbours: &Neighbours, workers: &Workers) -> Vec<Vec3> {
    workers.map(points.len(), |i| {
        let p = points[i];
        let normal = eigen::smallest(&scatter(points, &p, neighbours.of(i)));
        if normal.dot(&p) > 0.0 { -normal } else { normal }
    })
}

/// The sum of M; its factor 1/k changes no eigenvector.
fn scatter(points: &[Vec3], p: &Vec3, neighbours: &[u32]) -> Matrix3<f64> {
    let mut m = [0.0; 6];
    for j in neighbours {
        let d = points[*j as usize] - p;
        let products = [d.x * d.x, d.x * d.y, d.x * d.z, d.y * d.y, d.y * d.z, d.z * d.z];
        m.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
    }
    let [xx, xy, xz, yy, yz, zz] = m;
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}
