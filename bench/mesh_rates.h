// SPDX-License-Identifier: Apache-2.0
// How fast the scene leaves: surfaces extracted and volumes written, beside what others need for the same.
#pragma once

#include <filesystem>

#include "bench/plot.h"
#include "bench/result.h"
#include "core/report.h"

namespace nerfvdb {

struct MeshRateOptions {
    int repeats = 5;
    int resolution = 512;                // voxels along the edge of each scene's box
    std::filesystem::path scratch = {};  // folder for volumes; empty: they are not measured
};

/// A series for each scene of surface_scene.h and number of threads (one, and all that are allowed), a row for
/// each way: nerfvdb's extractSurface with normals, and its peers (mesh_peers.h). Columns: seconds,
/// cpu_seconds, triangles, triangles_per_s by the wall, triangles_per_cpu_s (a core's rate on a machine that
/// others use, too), and memory_over_output: the peak beyond what was in use before, over the bytes of the
/// mesh. With a scratch folder series "making a .vdb" more, of a shell in half the box: exportVdb from the model,
/// writeVolume from the voxels, and OpenVDB with the grids made; their column is voxels_per_s, active voxels of the density.
BenchResult benchMesh(const MeshRateOptions& options, Report& report);

/// Triangles a second.
Plot meshPlot(const BenchResult& result);

}  // namespace nerfvdb
