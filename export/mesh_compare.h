// SPDX-License-Identifier: Apache-2.0
// How far a mesh is from the truth, and the truth from the mesh.
#pragma once

#include <cstddef>

#include "export/mesh.h"

namespace nerfvdb {

struct CompareOptions {
    double threshold = 0;            // distance that still counts as right, world units; one voxel, say; positive
    std::size_t samples = 1u << 18;  // points on each surface; means of as many are good to some 0.2 % of the spread
};

/// Of points on one surface to the nearest point of another, world units.
struct SurfaceDistances {
    double mean = 0;
    double percentile_95 = 0;  // of 100 points 95 are no farther
    double largest = 0;
    double within = 0;      // share of the points that are no farther than the threshold
    double normal_dot = 0;  // mean |cosine| between the normal at the point and that at the nearest one
};

struct MeshComparison {
    SurfaceDistances accuracy;      // from the mesh to the truth: what should not be there
    SurfaceDistances completeness;  // from the truth to the mesh: what is missing
    /// Half the sum of both mean distances (not squared).
    double chamfer() const { return 0.5 * (accuracy.mean + completeness.mean); }
    /// Half the sum of both mean cosines.
    double normalConsistency() const { return 0.5 * (accuracy.normal_dot + completeness.normal_dot); }
    /// 2 P R / (P + R) of precision P = accuracy.within and recall R = completeness.within; 0 if both are.
    double fScore() const {
        const double sum = accuracy.within + completeness.within;
        return sum > 0 ? 2 * accuracy.within * completeness.within / sum : 0;
    }
};

/// Points are spread evenly by area (the area is cut into as many equal parts, each gives one point at random inside),
/// the same in every run; distances are exact from each point to the triangles of the other mesh. Normals are those of
/// triangles; their sign is left out, since an inner wall of a thin sheet is nearest to its outer one as often as not.
/// Measures follow Knapitsch et al. 2017, "Tanks and temples" (F-score), and Mescheder et al. 2019, "Occupancy
/// networks" (normal consistency).
///
/// Threads: parallel; the same for any number of threads.
/// Errors: DataError for a mesh without area, and as checkTriangles; UsageError for a threshold that is not positive or
///         without samples.
MeshComparison compareMeshes(const Mesh& mesh, const Mesh& truth, const CompareOptions& options);

}  // namespace nerfvdb
