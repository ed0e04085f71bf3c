// SPDX-License-Identifier: Apache-2.0
#include "cli/mesh_comparison.h"

#include "cli/text.h"

namespace nerfvdb {
namespace {

Json distancesJson(const SurfaceDistances& d, double unit) {
    return {{"mean", d.mean / unit}, {"percentile_95", d.percentile_95 / unit}, {"largest", d.largest / unit}};
}

Json lengthsJson(const MeshComparison& comparison, double unit) {
    return {{"accuracy", distancesJson(comparison.accuracy, unit)},
            {"completeness", distancesJson(comparison.completeness, unit)},
            {"chamfer", comparison.chamfer() / unit}};
}

std::string distancesText(const char* name, const SurfaceDistances& d, double voxel_size) {
    return formatted("%s: mean %.4g (%.3g voxels), 95 %% within %.4g (%.3g voxels)\n", name, d.mean,
                     d.mean / voxel_size, d.percentile_95, d.percentile_95 / voxel_size);
}

}  // namespace

Json comparisonJson(const MeshComparison& comparison, double voxel_size) {
    return {{"world", lengthsJson(comparison, 1)},
            {"voxels", lengthsJson(comparison, voxel_size)},
            {"voxel_size", voxel_size},
            {"precision", comparison.accuracy.within},
            {"recall", comparison.completeness.within},
            {"f_score", comparison.fScore()},
            {"normal_consistency", comparison.normalConsistency()}};
}

std::string comparisonText(const MeshComparison& comparison, double voxel_size) {
    return distancesText("accuracy (mesh to truth)", comparison.accuracy, voxel_size) +
           distancesText("completeness (truth to mesh)", comparison.completeness, voxel_size) +
           formatted(
               "Chamfer distance (mean of both means): %.4g (%.3g voxels)\n"
               "F-score at one voxel: %.4f; normal consistency: %.4f\n",
               comparison.chamfer(), comparison.chamfer() / voxel_size, comparison.fScore(),
               comparison.normalConsistency());
}

}  // namespace nerfvdb
