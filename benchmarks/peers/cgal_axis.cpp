// The axis by CGAL: Efficient RANSAC (Schnabel et al. 2007) for cylinders and cones; the largest shape is kept.
//
//   cgal_axis FRAME REPEATS PRIOR EPSILON NORMAL
//
// PRIOR: largest angle between axis and optical axis in rad, 0 for none; EPSILON: distance in m; NORMAL: least cosine.

#include <cstdlib>
#include <exception>
#include <utility>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Random.h>
#include <CGAL/Shape_detection/Efficient_RANSAC.h>
#include <CGAL/pca_estimate_normals.h>
#include <CGAL/property_map.h>

#include "depth_file.hpp"

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Oriented = std::pair<Kernel::Point_3, Kernel::Vector_3>;
using Places = CGAL::First_of_pair_property_map<Oriented>;
using Directions = CGAL::Second_of_pair_property_map<Oriented>;
using Traits = CGAL::Shape_detection::Efficient_RANSAC_traits<Kernel, std::vector<Oriented>, Places, Directions>;
using Ransac = CGAL::Shape_detection::Efficient_RANSAC<Traits>;
using Cylinder = CGAL::Shape_detection::Cylinder<Traits>;
using Cone = CGAL::Shape_detection::Cone<Traits>;

struct Settings {
    double prior, epsilon, normal;
};

struct Axis {
    Kernel::Point_3 point;
    Kernel::Vector_3 direction;
    const char* shape;
};

Axis axis_of(const Ransac::Shape& shape) {
    if (const auto* cylinder = dynamic_cast<const Cylinder*>(&shape))
        return {cylinder->axis().point(), cylinder->axis().to_vector(), "cylinder"};
    const auto& cone = dynamic_cast<const Cone&>(shape);
    return {cone.apex(), cone.axis(), "cone"};
}

bool within(const Kernel::Vector_3& axis, double prior) {
    if (prior <= 0.0) return true;
    return std::abs(axis.z()) / std::sqrt(axis.squared_length()) >= std::cos(prior);
}

Ransac::Parameters parameters_of(const Settings& settings, std::size_t points) {
    Ransac::Parameters parameters;
    parameters.probability = 0.001;
    parameters.min_points = points / 20;
    parameters.epsilon = settings.epsilon;
    parameters.cluster_epsilon = 0.1;
    parameters.normal_threshold = settings.normal;
    return parameters;
}

std::vector<Oriented> oriented(const std::vector<peers::Point>& voxels) {
    std::vector<Oriented> points;
    for (const auto& p : voxels) points.emplace_back(Kernel::Point_3(p[0], p[1], p[2]), Kernel::Vector_3(0, 0, 0));
    CGAL::pca_estimate_normals<CGAL::Sequential_tag>(
        points, 30, CGAL::parameters::point_map(Places()).normal_map(Directions()));
    return points;
}

void run(const peers::Frame& frame, const Settings& settings) {
    peers::Clock clock;
    const auto cloud = peers::points_of(frame);
    const double deprojected = clock.lap();
    const auto voxels = peers::voxels_of(cloud, 0.05);
    const double gridded = clock.lap();
    auto points = oriented(voxels);
    const double normals = clock.lap();
    Ransac ransac;
    ransac.set_input(points);
    ransac.add_shape_factory<Cylinder>();
    ransac.add_shape_factory<Cone>();
    ransac.detect(parameters_of(settings, points.size()));
    const std::vector<double> laps{deprojected, gridded, normals, clock.lap()};
    const Ransac::Shape* best = nullptr;
    for (const auto& shape : ransac.shapes()) {
        const bool larger = !best || shape->indices_of_assigned_points().size() > best->indices_of_assigned_points().size();
        if (larger && within(axis_of(*shape).direction, settings.prior)) best = shape.get();
    }
    if (!best) {
        peers::print(false, "none", 0, {0, 0, 0}, {0, 0, 1}, laps);
        return;
    }
    const Axis axis = axis_of(*best);
    peers::print(true, axis.shape, best->indices_of_assigned_points().size(),
                 {axis.point.x(), axis.point.y(), axis.point.z()},
                 {axis.direction.x(), axis.direction.y(), axis.direction.z()}, laps);
}

}  // namespace

int main(int count, char** arguments) {
    if (count != 6) {
        std::fprintf(stderr, "usage: cgal_axis FRAME REPEATS PRIOR EPSILON NORMAL\n");
        return 2;
    }
    try {
        const peers::Frame frame = peers::read_frame(arguments[1]);
        const Settings settings{std::atof(arguments[3]), std::atof(arguments[4]), std::atof(arguments[5])};
        for (int repeat = 0; repeat < std::atoi(arguments[2]); ++repeat) {
            CGAL::get_default_random() = CGAL::Random(unsigned(repeat));
            run(frame, settings);
        }
    } catch (const std::exception& error) {
        std::fprintf(stderr, "cgal_axis: %s\n", error.what());
        return 1;
    }
    return 0;
}
