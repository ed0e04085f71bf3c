// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_compare.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"
#include "export/triangle_tree.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kSamplesPerTask = 1024;

/// Normal of a triangle, as long as twice its area.
Vec3d crossOf(const Mesh& mesh, std::size_t triangle) {
    const Triangle& t = mesh.triangles[triangle];
    const Vec3d a = mesh.positions[t[0]].cast<double>();
    return (mesh.positions[t[1]].cast<double>() - a).cross(mesh.positions[t[2]].cast<double>() - a);
}

/// Area of each triangle and of those before it.
std::vector<double> areaUpTo(const Mesh& mesh, const char* name) {
    checkTriangles(mesh);
    std::vector<double> area(mesh.triangles.size());
    double sum = 0;
    for (std::size_t i = 0; i < area.size(); ++i) area[i] = sum += 0.5 * crossOf(mesh, i).norm();
    if (!(sum > 0) || !std::isfinite(sum))
        throw DataError(std::string("compare: ") + name, "an area of " + std::to_string(sum), "a surface");
    return area;
}

double unitDouble(std::uint64_t bits) { return static_cast<double>(bits >> 11) * 0x1p-53; }

struct SurfaceSample {
    Vec3d position;
    std::size_t triangle;
};

SurfaceSample sampleOf(const Mesh& mesh, const std::vector<double>& area, std::size_t index, std::size_t n_samples) {
    enum Stream : std::uint64_t { kWhere, kAlong, kAcross };
    const auto random = [&](Stream stream) { return unitDouble(randomBits(/*seed=*/1, stream, index)); };
    const double at = (static_cast<double>(index) + random(kWhere)) / static_cast<double>(n_samples) * area.back();
    // The first that reaches beyond: never one without area.
    const auto found = std::upper_bound(area.begin(), area.end() - 1, at);
    const auto triangle = static_cast<std::size_t>(found - area.begin());
    // A square's point becomes an even one of the triangle (Osada et al. 2002, "Shape distributions").
    const double root = std::sqrt(random(kAlong)), v = random(kAcross);
    const Triangle& t = mesh.triangles[triangle];
    return {(1 - root) * mesh.positions[t[0]].cast<double>() + root * (1 - v) * mesh.positions[t[1]].cast<double>() +
                root * v * mesh.positions[t[2]].cast<double>(),
            triangle};
}

SurfaceDistances distancesTo(const Mesh& other, const TriangleTree& tree, const Mesh& mesh,
                             const std::vector<double>& area, const CompareOptions& options) {
    std::vector<double> distance(options.samples), cosine(options.samples);
    parallelRanges(options.samples, kSamplesPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const SurfaceSample sample = sampleOf(mesh, area, i, options.samples);
            const NearestPoint nearest = tree.nearest(sample.position);
            distance[i] = std::sqrt(nearest.squared_distance);
            cosine[i] = std::abs(
                crossOf(mesh, sample.triangle).normalized().dot(crossOf(other, nearest.triangle).normalized()));
        }
    });
    SurfaceDistances result;
    for (std::size_t i = 0; i < options.samples; ++i) {
        result.mean += distance[i];
        result.normal_dot += cosine[i];
        result.within += distance[i] <= options.threshold;
        result.largest = std::max(result.largest, distance[i]);
    }
    const auto n = static_cast<double>(options.samples);
    result.mean /= n;
    result.normal_dot /= n;
    result.within /= n;
    const auto percentile = distance.begin() + static_cast<std::ptrdiff_t>(std::ceil(0.95 * n)) - 1;
    std::nth_element(distance.begin(), percentile, distance.end());
    result.percentile_95 = *percentile;
    return result;
}

}  // namespace

MeshComparison compareMeshes(const Mesh& mesh, const Mesh& truth, const CompareOptions& options) {
    if (!(options.threshold > 0))
        throw UsageError("compare: threshold", std::to_string(options.threshold), "a positive distance");
    if (options.samples == 0) throw UsageError("compare: samples", "0", "at least 1");
    const std::vector<double> mesh_area = areaUpTo(mesh, "the mesh"), truth_area = areaUpTo(truth, "the truth");
    MeshComparison comparison;
    comparison.accuracy = distancesTo(truth, TriangleTree(truth), mesh, mesh_area, options);
    comparison.completeness = distancesTo(mesh, TriangleTree(mesh), truth, truth_area, options);
    return comparison;
}

}  // namespace nerfvdb
