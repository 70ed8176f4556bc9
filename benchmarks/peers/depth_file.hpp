// A frame in memory, and what both programs do to it before they fit: points, voxels, JSON.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

namespace peers {

using Point = std::array<double, 3>;

// Layout of the file: int32 width, height; double fx, fy, cx, cy; float depth in metres, row by row, 0 for none.
struct Frame {
    std::int32_t width = 0, height = 0;
    double fx = 0, fy = 0, cx = 0, cy = 0;
    std::vector<float> depth;
};

inline Frame read_frame(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    Frame frame;
    auto get = [&](void* place, std::size_t size) { file.read(static_cast<char*>(place), std::streamsize(size)); };
    get(&frame.width, sizeof frame.width);
    get(&frame.height, sizeof frame.height);
    for (double* value : {&frame.fx, &frame.fy, &frame.cx, &frame.cy}) get(value, sizeof *value);
    if (!file || frame.width < 1 || frame.height < 1) throw std::runtime_error(path + ": no frame");
    frame.depth.resize(std::size_t(frame.width) * std::size_t(frame.height));
    get(frame.depth.data(), frame.depth.size() * sizeof(float));
    if (!file) throw std::runtime_error(path + ": too short");
    return frame;
}

inline std::vector<Point> points_of(const Frame& frame) {
    std::vector<Point> points;
    points.reserve(frame.depth.size());
    for (int v = 0; v < frame.height; ++v)
        for (int u = 0; u < frame.width; ++u) {
            const double z = frame.depth[std::size_t(v) * std::size_t(frame.width) + std::size_t(u)];
            if (z > 0) points.push_back({z * (u - frame.cx) / frame.fx, z * (v - frame.cy) / frame.fy, z});
        }
    return points;
}

// Mean point of each cell of a grid.
inline std::vector<Point> voxels_of(const std::vector<Point>& points, double size) {
    struct Sum {
        Point total{0, 0, 0};
        int count = 0;
    };
    std::unordered_map<std::int64_t, Sum> cells;
    cells.reserve(points.size() / 8 + 16);
    for (const Point& p : points) {
        std::int64_t name = 0;
        for (double x : p) name = (name << 21) ^ (std::int64_t(std::floor(x / size)) & 0x1fffff);
        Sum& sum = cells[name];
        for (int i = 0; i < 3; ++i) sum.total[i] += p[i];
        ++sum.count;
    }
    std::vector<Point> means;
    means.reserve(cells.size());
    for (const auto& [name, sum] : cells)
        means.push_back({sum.total[0] / sum.count, sum.total[1] / sum.count, sum.total[2] / sum.count});
    return means;
}

// Processor time, which other work on the machine does not lengthen.
class Clock {
  public:
    // Milliseconds since the last call.
    double lap() {
        const std::clock_t now = std::clock();
        const double ms = 1e3 * double(now - last_) / CLOCKS_PER_SEC;
        last_ = now;
        return ms;
    }

  private:
    std::clock_t last_ = std::clock();
};

// One answer as a line of JSON; `found` false means that there is none.
inline void print(bool found, const std::string& shape, std::size_t inliers, const Point& point, const Point& axis,
                  const std::vector<double>& laps) {
    std::printf("{\"found\": %s, \"shape\": \"%s\", \"inliers\": %zu, \"point\": [%.17g, %.17g, %.17g], ",
                found ? "true" : "false", shape.c_str(), inliers, point[0], point[1], point[2]);
    std::printf("\"axis\": [%.17g, %.17g, %.17g], \"ms\": [", axis[0], axis[1], axis[2]);
    for (std::size_t i = 0; i < laps.size(); ++i) std::printf("%s%.6g", i ? ", " : "", laps[i]);
    std::printf("]}\n");
}

}  // namespace peers
