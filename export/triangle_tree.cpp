// SPDX-License-Identifier: Apache-2.0
#include "export/triangle_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kLeafTriangles = 4;  // at most
constexpr int kMostDepth = 32;             // triangles are numbered by 32 bits

std::size_t firstNode(int depth) { return (std::size_t{1} << depth) - 1; }

double squaredDistance(const Vec3d& point, const Vec3f& low, const Vec3f& high) {
    const Vec3d outside = (low.cast<double>() - point).cwiseMax(point - high.cast<double>()).cwiseMax(0.0);
    return outside.squaredNorm();
}

}  // namespace

Vec3d nearestOnTriangle(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const Vec3d ab = b - a, ac = c - a, ap = p - a;
    const double d1 = ab.dot(ap), d2 = ac.dot(ap);
    if (d1 <= 0 && d2 <= 0) return a;
    const Vec3d bp = p - b;
    const double d3 = ab.dot(bp), d4 = ac.dot(bp);
    if (d3 >= 0 && d4 <= d3) return b;
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) return a + d1 / (d1 - d3) * ab;
    const Vec3d cp = p - c;
    const double d5 = ab.dot(cp), d6 = ac.dot(cp);
    if (d6 >= 0 && d5 <= d6) return c;
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6) return a + d2 / (d2 - d6) * ac;
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 >= d3 && d5 >= d6 && d4 - d3 + d5 - d6 > 0) return b + (d4 - d3) / (d4 - d3 + d5 - d6) * (c - b);
    const double sum = va + vb + vc;
    return a + vb / sum * ab + vc / sum * ac;
}

TriangleTree::TriangleTree(const Mesh& mesh) : mesh_(mesh), order_(mesh.triangles.size()) {
    checkTriangles(mesh);
    const std::size_t n = mesh.triangles.size();
    std::iota(order_.begin(), order_.end(), 0u);
    std::vector<Vec3f> centres(n);
    parallelRanges(n, 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const Triangle& t = mesh.triangles[i];
            centres[i] = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
        }
    });
    while ((n + (std::size_t{1} << depth_) - 1) >> depth_ > kLeafTriangles) ++depth_;
    for (int depth = 0; depth < depth_; ++depth)
        parallelFor(std::size_t{1} << depth, [&](std::size_t i) { sortNode(depth, i, centres); });

    bounds_.resize(firstNode(depth_ + 1));
    const std::size_t n_leaves = std::size_t{1} << depth_;
    parallelRanges(n_leaves, 1024, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) bounds_[firstNode(depth_) + i] = boundsOfLeaf(rangeOf(depth_, i));
    });
    for (std::size_t node = firstNode(depth_); node-- > 0;) {
        const Bounds &left = bounds_[2 * node + 1], &right = bounds_[2 * node + 2];
        bounds_[node] = {left.low.cwiseMin(right.low), left.high.cwiseMax(right.high)};
    }
}

TriangleTree::Range TriangleTree::rangeOf(int depth, std::size_t index) const {
    const std::size_t n = order_.size();
    return {(n * index) >> depth, (n * (index + 1)) >> depth};
}

void TriangleTree::sortNode(int depth, std::size_t index, const std::vector<Vec3f>& centres) {
    const Range range = rangeOf(depth, index);
    Vec3f low = Vec3f::Constant(std::numeric_limits<float>::max()), high = -low;
    for (std::size_t i = range.begin; i < range.end; ++i) {
        low = low.cwiseMin(centres[order_[i]]);
        high = high.cwiseMax(centres[order_[i]]);
    }
    int axis = 0;
    (high - low).maxCoeff(&axis);
    const std::size_t middle = rangeOf(depth + 1, 2 * index).end;
    if (middle == range.end) return;
    std::nth_element(order_.begin() + range.begin, order_.begin() + middle, order_.begin() + range.end,
                     [&](std::uint32_t a, std::uint32_t b) { return centres[a][axis] < centres[b][axis]; });
}

TriangleTree::Bounds TriangleTree::boundsOfLeaf(Range range) const {
    Bounds bounds{Vec3f::Constant(std::numeric_limits<float>::max()),
                  Vec3f::Constant(std::numeric_limits<float>::lowest())};
    for (std::size_t i = range.begin; i < range.end; ++i)
        for (int k = 0; k < 3; ++k) {
            const Vec3f& p = mesh_.positions[mesh_.triangles[order_[i]][k]];
            bounds.low = bounds.low.cwiseMin(p);
            bounds.high = bounds.high.cwiseMax(p);
        }
    return bounds;
}

NearestPoint TriangleTree::nearest(const Vec3d& point) const {
    struct Waiting {
        std::size_t node;
        double squared_distance;
    };
    std::array<Waiting, kMostDepth + 1> waiting;  // the farther children on the way down
    std::size_t n_waiting = 0;
    NearestPoint best{std::numeric_limits<double>::infinity(), order_[0]};
    const std::size_t first_leaf = firstNode(depth_);
    waiting[n_waiting++] = {0, 0};
    while (n_waiting > 0) {
        auto [node, squared_distance] = waiting[--n_waiting];
        if (squared_distance >= best.squared_distance) continue;
        while (node < first_leaf) {
            const auto distance = [&](std::size_t child) {
                return squaredDistance(point, bounds_[child].low, bounds_[child].high);
            };
            Waiting near{2 * node + 1, distance(2 * node + 1)}, far{2 * node + 2, distance(2 * node + 2)};
            if (far.squared_distance < near.squared_distance) std::swap(near, far);
            if (far.squared_distance < best.squared_distance) waiting[n_waiting++] = far;
            node = near.node;
            squared_distance = near.squared_distance;
            if (squared_distance >= best.squared_distance) break;
        }
        if (squared_distance >= best.squared_distance) continue;
        const Range range = rangeOf(depth_, node - first_leaf);
        for (std::size_t i = range.begin; i < range.end; ++i) {
            const Triangle& t = mesh_.triangles[order_[i]];
            const Vec3d q =
                nearestOnTriangle(point, mesh_.positions[t[0]].cast<double>(), mesh_.positions[t[1]].cast<double>(),
                                  mesh_.positions[t[2]].cast<double>());
            const double found = (q - point).squaredNorm();
            if (found < best.squared_distance) best = {found, order_[i]};
        }
    }
    return best;
}

}  // namespace nerfvdb
