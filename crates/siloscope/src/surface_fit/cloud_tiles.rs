//! Patches of a point cloud: the means of a voxel grid, with normals from their neighbours.

use crate::Result;
use crate::base::workers::Workers;
use crate::geometry::normals::normals;
use crate::stats::neighbours::nearest_neighbours;
use crate::stats::voxel_grid::Cloud;
use crate::surface_fit::tiles::{NONE, Patch, Patches};

/// Neighbours of a patch for its normal.
const NEIGHBOURS: usize = 24;

/// Patches of a cloud, one for each occupied voxel; fewer than `NEIGHBOURS` give none.
///
/// The normal is the direction in which the neighbourhood is thinnest. The eight neighbours that stand beside a patch
/// are the farthest of its neighbourhood, far enough for their normals to tell a turn.
pub fn cloud_patches(cloud: &Cloud, workers: &Workers) -> Result<Patches> {
    let mut patches = Patches { side: 1, cloud: true, ..Patches::default() };
    if cloud.points.len() <= NEIGHBOURS {
        return Ok(patches);
    }
    let near = nearest_neighbours(&cloud.points, NEIGHBOURS, workers)?;
    let normals = normals(&cloud.points, &near, workers);
    for (i, (&p, &normal)) in cloud.points.iter().zip(&normals).enumerate() {
        let around = near.of(i);
        let offsets = around.iter().map(|&j| cloud.points[j as usize] - p);
        let (mut off, mut spread) = (0.0, 0.0);
        for offset in offsets {
            let across = offset.dot(&normal);
            off += across * across;
            spread += offset.norm_squared() - across * across;
        }
        let n = around.len() as f64;
        let (scatter, reach) = ((off / n).sqrt(), (spread / n).sqrt());
        patches.list.push(Patch {
            q: normal,
            measured: 0.0,
            origin: p,
            normal,
            sigma_normal: 1.5 * scatter / (reach * n.sqrt()).max(1e-12),
            scatter,
            count: 1.0,
            smooth: scatter < 0.5 * reach,
            tile: (0, 0),
        });
        let mut far = [NONE; 8];
        for (slot, &j) in far.iter_mut().zip(around.iter().rev()) {
            *slot = j;
        }
        patches.neighbours.push(far);
    }
    Ok(patches)
}
