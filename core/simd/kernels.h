// SPDX-License-Identifier: Apache-2.0
// The inner loops, on plain pointers and counts. Each exists twice with the same signature: in `simd`, portable
// vectors through Highway, dispatched at run time to what the machine has; and in `reference`, scalar, obvious,
// the documentation and the judge of the other. Nothing here allocates, throws, or knows of trees or files.
//
// Arrays: every array must be readable and writable 16 elements past its count (padding, contents undefined).
// Accuracy: `simd` agrees with `reference` within 1e-5 relative to the sum of the magnitudes of the terms of a
// sum (its order differs between targets); integers agree exactly, but for points within rounding of a cell's face.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace nerfvdb {

inline constexpr int kPadding = 16;  // elements; one 512-bit vector of floats

/// Sparse bricks of 8^3 values as plain arrays; see vdb/topology.h for the words.
struct Bricks {
    // What a ray meets, in two steps (vdb/leaf_table.h). [x][y][z] by node of 8^3 leaves: where its leaves stand below,
    // or -d: every node nearer than d in each axis is empty too (d >= 1). [node][512] by leaf: its number if it has
    // occupied cells, or -d: every leaf nearer than d is empty.
    const std::int32_t* skip_nodes = nullptr;
    const std::int32_t* skip_leaves = nullptr;
    std::int32_t node_dims[3] = {0, 0, 0};     // nodes per axis
    std::int32_t leaf_dims[3] = {0, 0, 0};     // leaves per axis
    const std::int32_t* upper_neighbours = nullptr;  // [leaf][8]
    const std::uint64_t* occupied = nullptr;         // [leaf][8] bits of occupied cells
    const float* density = nullptr;                  // [leaf][512] raw density; for sigmaForward, sigma
    const float* features = nullptr;                 // [leaf][512][channels]
    int channels = 0;                                // 4, 8 or 16
};

/// Value number of a cell's corner (0..7: bits x, y, z) in a pool of bricks. For what is not in a hurry.
inline std::size_t cornerIndex(const Bricks& bricks, std::int32_t leaf, std::int32_t cell, int corner) {
    const int x = (cell >> 6) + (corner >> 2 & 1);
    const int y = (cell >> 3 & 7) + (corner >> 1 & 1);
    const int z = (cell & 7) + (corner & 1);
    const int crossed = (x >> 3) * 4 + (y >> 3) * 2 + (z >> 3);
    const std::size_t owner = static_cast<std::size_t>(bricks.upper_neighbours[leaf * std::size_t{8} + crossed]);
    return owner * 512 + static_cast<std::size_t>((x & 7) * 64 + (y & 7) * 8 + (z & 7));
}

/// Rays in index space, [n] each; sample k of a ray lies at distance offset + k * step from its origin.
struct RayTile {
    int n = 0;
    float *ox = nullptr, *oy = nullptr, *oz = nullptr;  // origin: where the ray enters the box
    float *dx = nullptr, *dy = nullptr, *dz = nullptr;  // unit direction
    float* length = nullptr;                            // distance from origin to where it leaves the box
    float* offset = nullptr;                            // of the first sample, in [0, step)
    std::int32_t* next = nullptr;                       // next sample to look at; -1: the ray is finished
};

/// Points on rays, structure of arrays, [n] each.
struct SampleArrays {
    std::int32_t* leaf = nullptr;    // leaf number
    std::int32_t* cell = nullptr;    // offset of the cell in its leaf, x * 64 + y * 8 + z
    float *x = nullptr, *y = nullptr, *z = nullptr;  // position inside the cell, [0, 1]
    float* t = nullptr;              // distance from the ray's origin, voxels
};

/// What the leaves that a kept sample's cell reaches into need to know of it: half a cache line.
struct alignas(32) SampleGradient {
    std::int32_t cell;               // offset in its leaf, as SampleArrays::cell
    float x, y, z;                   // position inside the cell
    float weight;                    // of the sample along its ray
    float dl_draw;                   // gradient of the interpolated raw density
    const float* dl_dfeatures;       // [channels] of the sample's ray
};

/// One sample in one leaf. `corner` (bits x, y, z) says by which faces the sample's cell reaches into it.
struct LeafContribution {
    const SampleGradient* sample;
    std::int32_t leaf;               // for whoever sorts; kernels do not read it
    std::uint32_t corner;
};

/// Gradients of one leaf, gathered before its voxels are updated.
struct LeafGradient {
    float* density;                  // [512]
    float* features;                 // [512][channels]
    std::uint64_t* touched;          // [8] bits of voxels that received something
};

struct RmsPropRates {
    float density_rate, feature_rate;
    float decay;                     // of the second moments
    float epsilon;
    float sparsity;                  // pull of a density towards empty, in full steps
    float density_smoothing;         // pull of a density towards its neighbours' mean, in full steps per unit of raw
                                     // density by which it differs, or for 1 if it differs by more
    float feature_smoothing;         // pull of features towards their neighbours' mean, per unit of feature_rate
};

struct AdamRates {
    float beta1, beta2, epsilon, rate;
    float scale1, scale2;            // bias corrections, 1 / (1 - beta^count)
};

namespace simd {
#include "core/simd/kernel_declarations.inl"
/// Name of the instruction set in use, such as "AVX3".
const char* activeTarget();
/// Names of the instruction sets that this program holds and this machine runs, the best first.
std::vector<std::string> supportedTargets();
/// Runs every kernel on one of supportedTargets(), on the best again for an empty name. False, and nothing changes,
/// for a name that is not among them. For tests and measurements; not while kernels run.
bool forceTarget(const std::string& name);

/// Whatever is forced while it lives, the instruction set that was in use before is in use again after it.
class KeepTarget {
public:
    KeepTarget() : before_(activeTarget()) {}
    ~KeepTarget() { forceTarget(before_); }
    KeepTarget(const KeepTarget&) = delete;
    KeepTarget& operator=(const KeepTarget&) = delete;

private:
    std::string before_;
};
}  // namespace simd

namespace reference {
#include "core/simd/kernel_declarations.inl"
}  // namespace reference

}  // namespace nerfvdb
