// The axis by PCL: SACSegmentationFromNormals, cylinder and cone tried, the one with more inliers kept.
//
//   pcl_axis FRAME REPEATS PRIOR DISTANCE WEIGHT
//
// PRIOR: largest angle between axis and optical axis in rad, 0 for none; DISTANCE: threshold in m; WEIGHT: of the normals.
// PCL draws its samples with one fixed seed, so every repeat shuffles the points.

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <memory>
#include <numbers>
#include <random>

#include <pcl/console/print.h>
#include <pcl/features/normal_3d.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/sac_segmentation.h>

#include "depth_file.hpp"

namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using Normals = pcl::PointCloud<pcl::Normal>;

constexpr double degree = std::numbers::pi / 180.0;

struct Settings {
    double prior, distance, weight;
};

struct Fit {
    std::size_t inliers = 0;
    pcl::ModelCoefficients model;
};

Cloud::Ptr cloud_of(const peers::Frame& frame) {
    auto cloud = std::make_shared<Cloud>();
    for (const auto& p : peers::points_of(frame)) cloud->emplace_back(float(p[0]), float(p[1]), float(p[2]));
    return cloud;
}

Cloud::Ptr voxels_of(const Cloud::Ptr& cloud, std::mt19937& random) {
    auto voxels = std::make_shared<Cloud>();
    pcl::VoxelGrid<pcl::PointXYZ> grid;
    grid.setInputCloud(cloud);
    grid.setLeafSize(0.05F, 0.05F, 0.05F);
    grid.filter(*voxels);
    std::shuffle(voxels->begin(), voxels->end(), random);
    return voxels;
}

Normals::Ptr normals_of(const Cloud::Ptr& cloud) {
    auto normals = std::make_shared<Normals>();
    pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> estimation;
    estimation.setInputCloud(cloud);
    estimation.setSearchMethod(std::make_shared<pcl::search::KdTree<pcl::PointXYZ>>());
    estimation.setKSearch(30);
    estimation.compute(*normals);
    return normals;
}

Fit fitted(const Cloud::Ptr& cloud, const Normals::Ptr& normals, int model, const Settings& settings,
           bool optimise) {
    pcl::SACSegmentationFromNormals<pcl::PointXYZ, pcl::Normal> segmentation;
    segmentation.setInputCloud(cloud);
    segmentation.setInputNormals(normals);
    segmentation.setModelType(model);
    segmentation.setMethodType(pcl::SAC_RANSAC);  // MSAC with an axis limit often answers nothing (PCL issue 5847)
    segmentation.setOptimizeCoefficients(optimise);
    segmentation.setNormalDistanceWeight(settings.weight);
    segmentation.setDistanceThreshold(settings.distance);
    segmentation.setMaxIterations(2000);
    segmentation.setRadiusLimits(0.3, 4.0);
    segmentation.setMinMaxOpeningAngle(5.0 * degree, 80.0 * degree);
    if (settings.prior > 0.0) {
        segmentation.setAxis(Eigen::Vector3f::UnitZ());
        segmentation.setEpsAngle(settings.prior);
    }
    Fit fit;
    pcl::PointIndices inliers;
    segmentation.segment(inliers, fit.model);
    fit.inliers = inliers.indices.size();
    return fit;
}

// Optimising can leave an invalid cone without inliers; then the sampled one is taken.
Fit robustly_fitted(const Cloud::Ptr& cloud, const Normals::Ptr& normals, int model, const Settings& settings) {
    Fit fit = fitted(cloud, normals, model, settings, true);
    return fit.inliers > 0 ? fit : fitted(cloud, normals, model, settings, false);
}

void run(const peers::Frame& frame, const Settings& settings, std::mt19937& random) {
    peers::Clock clock;
    const Cloud::Ptr cloud = cloud_of(frame);
    const double deprojected = clock.lap();
    const Cloud::Ptr voxels = voxels_of(cloud, random);
    const double gridded = clock.lap();
    const Normals::Ptr normals = normals_of(voxels);
    const double oriented = clock.lap();
    const Fit cylinder = robustly_fitted(voxels, normals, pcl::SACMODEL_CYLINDER, settings);
    const Fit cone = robustly_fitted(voxels, normals, pcl::SACMODEL_CONE, settings);
    const std::vector<double> laps{deprojected, gridded, oriented, clock.lap()};
    const bool conical = cone.inliers > cylinder.inliers;
    const Fit& best = conical ? cone : cylinder;
    const auto& c = best.model.values;
    if (best.inliers == 0 || c.size() < 7) {
        peers::print(false, "none", 0, {0, 0, 0}, {0, 0, 1}, laps);
        return;
    }
    peers::print(true, conical ? "cone" : "cylinder", best.inliers, {c[0], c[1], c[2]}, {c[3], c[4], c[5]}, laps);
}

}  // namespace

int main(int count, char** arguments) {
    if (count != 6) {
        std::fprintf(stderr, "usage: pcl_axis FRAME REPEATS PRIOR DISTANCE WEIGHT\n");
        return 2;
    }
    try {
        pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
        const peers::Frame frame = peers::read_frame(arguments[1]);
        const Settings settings{std::atof(arguments[3]), std::atof(arguments[4]), std::atof(arguments[5])};
        for (int repeat = 0; repeat < std::atoi(arguments[2]); ++repeat) {
            std::mt19937 random{std::uint32_t(repeat)};
            run(frame, settings, random);
        }
    } catch (const std::exception& error) {
        std::fprintf(stderr, "pcl_axis: %s\n", error.what());
        return 1;
    }
    return 0;
}
